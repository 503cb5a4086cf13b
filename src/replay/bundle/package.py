"""The article's minimum reproducibility package: which of its items are there, and hashed.

Facts alone; whether they suffice is for the package gate.
"""

from __future__ import annotations

from fnmatch import fnmatchcase
from pathlib import Path

from replay.bundle.contents import Item, Run, gather
from replay.bundle.source import read_source
from replay.errors import InputError
from replay.files import read_json

# Item of the gate to the payload path that holds it (patterns, first match counts).
_ITEMS: dict[str, tuple[str, ...]] = {
    "poses_per_frame.csv": ("results/reconstruction/poses_per_frame.csv",),
    "kinematics.csv": ("results/reconstruction/kinematics.csv",),
    "initial_conditions_t0.csv": ("results/reconstruction/initial_conditions_t0.csv",),
    "qc_summary.txt": ("results/reconstruction/qc_summary.txt",),
    "qc_per_frame.csv": ("results/reconstruction/qc_per_frame.csv",),
    "resolved configuration": ("results/settings/*.json",),
    "applied driver": ("results/driver/driver_6dof.csv",),
    "run-deck entry point": (
        "results/decks/velodyne/*.card",
        "results/decks/*.card",
        "results/decks/lsdyna/*.k",
        "results/decks/*.k",
        "results/decks/*",
    ),
    "gate results": ("results/*/gate*.json",),
}
# Item of the gate to the key of the play's source that names the file.
_TRACKS = {
    "kinovea_clicks.csv": "clicks",
    "helmet_landmarks.csv": "landmarks",
    "Config.json": "camera",
    "wearable kinematics": "kinematics",
}


def package_facts(results: str | Path, source_root: str | Path) -> dict[str, tuple[bool, bool]]:
    """Look for the items of the minimum package in what would be sealed.

    Parameters
    ----------
    results
        ``results/<play>``.
    source_root
        Root of the project's source.

    Returns
    -------
    dict
        Item (as `replay.gates.package` names it) to (present, hash recorded).

    Raises
    ------
    InputError
        When no stage has finished, or a file changed since its stage wrote it.
    """
    run = gather(results)
    facts = facts_of(run, tracks=read_tracks(Path(results)))
    try:
        facts["source code"] = (bool(read_source(source_root).files), True)
    except InputError:
        facts["source code"] = (False, False)
    return facts


def facts_of(run: Run, *, tracks: dict[str, str]) -> dict[str, tuple[bool, bool]]:
    """Look for the items in a gathered run; the source code is not among them.

    Parameters
    ----------
    run
        From `gather`.
    tracks
        From `read_tracks`.
    """
    withheld = {left.path: left.sha256 for left in run.left_out if left.sha256}
    patterns = dict(_ITEMS)
    for item, key in _TRACKS.items():
        if key in tracks:
            patterns[item] = (f"results/inputs/{tracks[key]}",)
    facts: dict[str, tuple[bool, bool]] = {}
    for item, candidates in patterns.items():
        found = _first(run.items, candidates)
        # A file that may not be shared stands in the bundle by its hash.
        kept_back = any(fnmatchcase(path, pattern) for pattern in candidates for path in withheld)
        facts[item] = (found is not None or kept_back, kept_back or bool(found and found.promised))
    versions = bool(run.manifests.get("replay") and run.manifests["replay"].versions)
    facts["solver version"] = (versions, versions)
    return facts


def _first(items: tuple[Item, ...], patterns: tuple[str, ...]) -> Item | None:
    listed = (i for pattern in patterns for i in items if i.promised and fnmatchcase(i.path, pattern))
    return next(listed, None)


def read_tracks(results: Path) -> dict[str, str]:
    """Names of the play's raw tracks by their key in the play's source, from the resolved settings."""
    path = results / "settings" / "play.json"
    source = read_json(path).get("source", {}) if path.is_file() else {}
    return {key: Path(source[key]).name for key in _TRACKS.values() if isinstance(source.get(key), str)}
