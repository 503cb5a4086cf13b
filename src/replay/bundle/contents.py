"""What of a run goes into its bundle, with the class of each file, and what is left out and why."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from replay.errors import InputError
from replay.files import read_json
from replay.manifest import NAME, Artifact, StageManifest, check_manifest
from replay.tables import Column, TableFormat

ARTIFACTS = TableFormat(
    "list of artifacts",
    (
        Column("path", "file, relative to the payload", "text"),
        Column("bytes", "size; empty for a volatile file", "text", may_be_empty=True),
        Column("sha256", "hash; empty for a volatile file", "text", may_be_empty=True),
        Column("class", "exact, tolerance or volatile", "text"),
        Column("rtol", "relative tolerance, class tolerance alone", "text", may_be_empty=True),
        Column("atol", "absolute tolerance in the unit, class tolerance alone", "text", may_be_empty=True),
        Column("stage", "stage that made it; empty for what the bundle adds", "text", may_be_empty=True),
        Column("unit", "unit, where the file holds one kind of value", "text", may_be_empty=True),
        Column("meaning", "what it holds", "text", may_be_empty=True),
    ),
)


def results_hash(listing: bytes) -> str:
    """Hash of what a run gave, without its times, its source and the machine: two equal runs share it.

    Parameters
    ----------
    listing
        ``artifacts.csv``.

    Returns
    -------
    str
        Hex SHA-256 of the lines that list files of ``results/``, as ``grep '^results/' artifacts.csv | sha256sum``
        says it.
    """
    lines = (line for line in listing.split(b"\n") if line.startswith(b"results/"))
    return hashlib.sha256(b"".join(line + b"\n" for line in lines)).hexdigest()


# Folders and files that serve one running process alone.
_NEVER = {"checkpoint": "serves an interrupted run alone", "states.partial": "serves an interrupted run alone"}


@dataclass(frozen=True)
class Item:
    """A file of the payload.

    Parameters
    ----------
    path
        Relative to the payload.
    source
        File on the disk, or the bytes themselves.
    class_, rtol, atol, unit, meaning
        As in `replay.manifest.Artifact`.
    stage
        Stage that made it, or "".
    promised
        Hash by the stage's manifest; sealing refuses another.
    """

    path: str
    source: Path | bytes
    class_: str = "exact"
    rtol: float | None = None
    atol: float | None = None
    unit: str = ""
    meaning: str = ""
    stage: str = ""
    promised: str | None = None

    def open(self) -> BinaryIO:
        """Open the content."""
        return io.BytesIO(self.source) if isinstance(self.source, bytes) else self.source.open("rb")


@dataclass(frozen=True)
class LeftOut:
    """A file that is not in the bundle, and why; with its hash when it was withheld on purpose."""

    path: str
    reason: str
    sha256: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``bundle.json``."""
        return {"path": self.path, "reason": self.reason, "sha256": self.sha256}


@dataclass(frozen=True)
class Run:
    """A results folder as its manifests describe it.

    Parameters
    ----------
    play
        Name of the play.
    manifests
        Stage to manifest, in the order of the workflow.
    items, left_out
        What goes into the bundle, and what does not.
    verdict
        ``ACCEPTED``, ``ACCEPTED WITH WARNINGS``, ``REJECTED``, ``INTERRUPTED`` for a run that did not come to
        its end, or ``NOT JUDGED`` for one without a verdict.
    line
        The verdict in one line.
    failures
        Stage to the reason it failed or was stopped.
    """

    play: str
    manifests: dict[str, StageManifest]
    items: tuple[Item, ...]
    left_out: tuple[LeftOut, ...]
    verdict: str
    line: str
    failures: dict[str, str]


def gather(results: str | Path, *, withhold: Mapping[str, str] | None = None, unfinished: Sequence[str] = ()) -> Run:
    """Read a results folder, checking every file against its stage's manifest.

    Parameters
    ----------
    results
        ``results/<play>``: one folder a stage, each with its manifest.
    withhold
        Payload path to the reason why its bytes may not be shared; hash and reason go in instead.
    unfinished
        Stages that the run did not come to: the verdict is then ``INTERRUPTED``, whatever an older one said.

    Raises
    ------
    InputError
        When no stage has finished, or a file changed since its stage wrote it.
    """
    results = Path(results)
    withhold = dict(withhold or {})
    if not results.is_dir():
        raise InputError(results, "the results folder does not exist", mend="run the play first")
    items: list[Item] = []
    left: list[LeftOut] = []
    manifests: dict[str, StageManifest] = {}
    for folder in sorted(p for p in results.iterdir() if p.is_dir() and p.name != "bundle" and p.name[0] != "."):
        if not (folder / NAME).is_file():
            reason = "speaks of one machine" if folder.name == "logs" else "the stage did not finish"
            left.append(LeftOut(f"results/{folder.name}/", reason))
            continue
        manifest = manifests[folder.name] = check_manifest(folder)
        prefix = f"results/{folder.name}"
        for artifact in manifest.artifacts:
            path = f"{prefix}/{artifact.path}"
            if path in withhold:
                left.append(LeftOut(path, withhold.pop(path), artifact.sha256))
            else:
                items.append(_item(path, folder, artifact))
        items.append(Item(f"{prefix}/{NAME}", folder / NAME, meaning="what the stage read and made", stage=folder.name))
        left += _unlisted(folder, prefix, manifest)
    if not manifests:
        raise InputError(results, "no stage has finished here", mend="run the play first")
    if withhold:
        raise InputError(
            results / next(iter(withhold)), "is to be withheld but is no artifact", mend="correct the path"
        )
    plays = {manifest.play for manifest in manifests.values()}
    if plays != {results.name}:
        raise InputError(
            results,
            f"holds stages of {', '.join(sorted(plays))}",
            expected=f"stages of {results.name} alone",
            mend="remove the folder and run the play again",
        )
    verdict, line = _verdict(results, unfinished)
    order = workflow_order({name: [i.path for i in manifest.inputs] for name, manifest in manifests.items()})
    manifests = {name: manifests[name] for name in order}
    return Run(results.name, manifests, tuple(items), tuple(left), verdict, line, _failures(results, manifests))


def workflow_order(read: Mapping[str, Sequence[str]]) -> list[str]:
    """Order stages so that each comes after those it read from; stages that read nothing were never run and come last.

    Parameters
    ----------
    read
        Stage to the names of its inputs (``driver/driver_6dof.csv``).
    """
    order: list[str] = []
    waiting = {name: {path.partition("/")[0] for path in paths} & set(read) - {name} for name, paths in read.items()}
    while waiting:
        ready = [name for name, before in waiting.items() if before <= set(order)]
        first = min(ready or waiting, key=lambda name: (not read[name], name))
        order.append(first)
        del waiting[first]
    return order


def _item(path: str, folder: Path, artifact: Artifact) -> Item:
    return Item(
        path,
        folder / artifact.path,
        artifact.class_,
        artifact.rtol,
        artifact.atol,
        artifact.unit,
        artifact.meaning,
        folder.name,
        artifact.sha256,
    )


def _unlisted(folder: Path, prefix: str, manifest: StageManifest) -> list[LeftOut]:
    """Files beside the manifest that it does not list: named, so that nothing is dropped in silence."""
    listed = {a.path for a in manifest.artifacts} | {NAME}
    left: dict[str, str] = {}
    for path in sorted(folder.rglob("*")):
        inner = path.relative_to(folder)
        if not path.is_file() or inner.as_posix() in listed or any(part[0] == "." for part in inner.parts):
            continue
        rule = next((part for part in inner.parts if part in _NEVER), None)
        if rule is None:
            left[f"{prefix}/{inner.as_posix()}"] = "not listed by its stage's manifest"
        else:
            upto = "/".join(inner.parts[: inner.parts.index(rule) + 1])
            left[f"{prefix}/{upto}" + ("/" if (folder / upto).is_dir() else "")] = _NEVER[rule]
    return [LeftOut(path, reason) for path, reason in left.items()]


def _verdict(results: Path, unfinished: Sequence[str]) -> tuple[str, str]:
    if unfinished:
        return "INTERRUPTED", f"{results.name}: the run ended before {', '.join(unfinished)}; nothing was judged"
    path = results / "verdict" / "verdict.json"
    if not path.is_file():
        return "NOT JUDGED", "the run ended before its verdict"
    value = read_json(path)
    status = str(value.get("status", "not judged")).upper() if isinstance(value, dict) else "NOT JUDGED"
    return status, str(value.get("line", "")) if isinstance(value, dict) else ""


def _failures(results: Path, manifests: Mapping[str, StageManifest]) -> dict[str, str]:
    """Stage to reason: a gate's failed checks, or what stopped the stage."""
    failures = {}
    for stage, manifest in manifests.items():
        reasons = [manifest.stopped_by] if manifest.stopped_by else []
        for artifact in manifest.artifacts:
            name = artifact.path.rpartition("/")[2]
            if name.startswith("gate") and name.endswith(".json"):
                reasons += _failed_checks(read_json(results / stage / artifact.path))
        if reasons:
            failures[stage] = "; ".join(dict.fromkeys(reasons))
    return failures


def _failed_checks(gate: Any) -> list[str]:
    if not isinstance(gate, dict) or gate.get("verdict") != "fail":
        return []
    failed = [c for c in gate.get("checks", []) if isinstance(c, dict) and c.get("verdict") == "fail"]
    words = [f"{c.get('name')} = {c.get('value')} {c.get('unit') or ''}".strip() for c in failed]
    return [f"gate {gate.get('gate')} failed: {', '.join(words)}"]
