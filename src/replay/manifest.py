"""What a stage made: the file it writes last, naming each of its files with hash and class.

A stage whose folder holds a ``manifest.json`` is finished: the manifest is written after
everything it lists is on the disk, so a killed run never leaves one. It carries no clock,
no host and no absolute path; two equal runs write equal manifests.

Classes of artifacts
    ``exact``      the same bytes from the same inputs, environment and machine type
    ``tolerance``  equal numbers within ``rtol`` and ``atol`` (in the artifact's unit)
    ``volatile``   logs, timings and the like: never compared, listed without size or hash
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal, get_args

from replay.errors import InputError
from replay.files import read_json, sha256, write_json

NAME = "manifest.json"
FORMAT = "replay stage manifest 1"

Class = Literal["exact", "tolerance", "volatile"]
Status = Literal["done", "stopped"]

_AGAIN = "run the stage again"


@dataclass(frozen=True)
class Artifact:
    """One file of a stage.

    Parameters
    ----------
    path
        Relative to the stage's folder, with forward slashes.
    class_
        ``exact``, ``tolerance`` or ``volatile``.
    rtol, atol
        For ``tolerance``: relative and absolute tolerance, the latter in `unit`.
    unit
        Unit of the values, where the file holds one kind of value; columns name their own.
    meaning
        One clause on what the file holds.
    bytes, sha256
        Filled in by `write_manifest`; None for a volatile file.
    """

    path: str
    class_: Class = "exact"
    rtol: float | None = None
    atol: float | None = None
    unit: str = ""
    meaning: str = ""
    bytes: int | None = None
    sha256: str | None = None

    def __post_init__(self) -> None:
        if self.class_ not in get_args(Class):
            message = f"{self.path}: {self.class_!r} is not one of the classes {get_args(Class)}"
            raise ValueError(message)
        if (self.class_ == "tolerance") != (self.rtol is not None and self.atol is not None):
            message = f"{self.path}: rtol and atol belong to class tolerance, and both to it"
            raise ValueError(message)
        if not is_plain_path(self.path):
            message = f"{self.path}: not a plain relative path inside the stage's folder"
            raise ValueError(message)

    @classmethod
    def exact(cls, path: str, meaning: str, unit: str = "") -> Artifact:
        """A file whose bytes two equal runs share."""
        return cls(path, "exact", unit=unit, meaning=meaning)

    @classmethod
    def tolerance(cls, path: str, meaning: str, *, rtol: float, atol: float, unit: str = "") -> Artifact:
        """A file whose numbers agree within `rtol` and `atol` [`unit`]."""
        return cls(path, "tolerance", rtol, atol, unit, meaning)

    @classmethod
    def volatile(cls, path: str, meaning: str) -> Artifact:
        """A file that says something about one run only: a log, a timing."""
        return cls(path, "volatile", meaning=meaning)


@dataclass(frozen=True)
class Input:
    """A file the stage read: its name within the play (never an absolute path) and its hash."""

    path: str
    sha256: str


@dataclass(frozen=True)
class StageManifest:
    """What a stage read, made and was told.

    Parameters
    ----------
    stage, play
        Names.
    status
        ``done``, or ``stopped`` when a gate or an upstream refusal ended the stage early.
    stopped_by
        The reason, when stopped.
    inputs, artifacts
        Sorted by path.
    parameters
        Settings the result depends on; never thread counts or folders.
    versions
        Program to version.
    """

    stage: str
    play: str
    status: Status = "done"
    stopped_by: str | None = None
    inputs: tuple[Input, ...] = ()
    artifacts: tuple[Artifact, ...] = ()
    parameters: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.status not in get_args(Status) or (self.status == "stopped") != bool(self.stopped_by):
            message = f"stage {self.stage}: status {self.status!r} with stopped_by {self.stopped_by!r}"
            raise ValueError(message)

    def artifact(self, path: str) -> Artifact | None:
        """Return the artifact at `path`, or None."""
        return next((a for a in self.artifacts if a.path == path), None)


def is_plain_path(path: str) -> bool:
    """Whether `path` is relative, in normal form, with forward slashes, and stays in its folder."""
    pure = PurePosixPath(path)
    return (
        bool(pure.parts)
        and not pure.is_absolute()
        and ".." not in pure.parts
        and "\\" not in path
        and str(pure) == path
    )


def write_manifest(
    folder: str | Path,
    *,
    stage: str,
    play: str,
    artifacts: Iterable[Artifact],
    inputs: Mapping[str, str | Path] | None = None,
    status: Status = "done",
    stopped_by: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    versions: Mapping[str, str] | None = None,
) -> StageManifest:
    """Hash what the stage read and made, and write ``manifest.json``; the last act of a stage.

    Parameters
    ----------
    folder
        The stage's folder.
    stage, play, status, stopped_by, parameters, versions
        See `StageManifest`.
    artifacts
        Files in `folder`; sizes and hashes are taken here.
    inputs
        Name within the play (``driver/driver_6dof.csv``) to the file that was read.

    Returns
    -------
    StageManifest
        As written.

    Raises
    ------
    ValueError
        When a listed file is missing, listed twice, or badly named (our own mistake).
    """
    folder = Path(folder)
    listed = sorted(artifacts, key=lambda a: a.path)
    twice = {path for path, times in Counter(a.path for a in listed).items() if times > 1}
    missing = [a.path for a in listed if not (folder / a.path).is_file()]
    foreign = [name for name in inputs or {} if not is_plain_path(name)]
    if twice or missing or foreign or NAME in {a.path for a in listed}:
        message = f"stage {stage}: missing {missing}, listed twice {sorted(twice)}, not plain {foreign}, or itself"
        raise ValueError(message)
    manifest = StageManifest(
        stage=stage,
        play=play,
        status=status,
        stopped_by=stopped_by,
        inputs=tuple(Input(name, sha256(path)) for name, path in sorted((inputs or {}).items())),
        artifacts=tuple(_hashed(folder, a) for a in listed),
        parameters=dict(parameters or {}),
        versions=dict(sorted((versions or {}).items())),
    )
    write_json(folder / NAME, _to_json(manifest))
    return manifest


def _hashed(folder: Path, artifact: Artifact) -> Artifact:
    if artifact.class_ == "volatile":
        return artifact
    path = folder / artifact.path
    return replace(artifact, bytes=path.stat().st_size, sha256=sha256(path))


def _to_json(manifest: StageManifest) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "stage": manifest.stage,
        "play": manifest.play,
        "status": manifest.status,
        "stopped_by": manifest.stopped_by,
        "inputs": [{"path": i.path, "sha256": i.sha256} for i in manifest.inputs],
        "artifacts": [
            {
                "path": a.path,
                "bytes": a.bytes,
                "sha256": a.sha256,
                "class": a.class_,
                "rtol": a.rtol,
                "atol": a.atol,
                "unit": a.unit,
                "meaning": a.meaning,
            }
            for a in manifest.artifacts
        ],
        "parameters": manifest.parameters,
        "versions": manifest.versions,
    }


def read_manifest(folder: str | Path) -> StageManifest:
    """Read ``manifest.json`` of a stage's folder.

    Raises
    ------
    InputError
        When there is none (the stage has not finished) or it is not a stage manifest.
    """
    path = Path(folder) / NAME
    if not path.is_file():
        raise InputError(path, "the stage has not finished: its manifest is missing", mend=_AGAIN)
    return parse_manifest(read_json(path), path)


def parse_manifest(value: Any, path: str | Path) -> StageManifest:
    """Turn the JSON value of a manifest into a `StageManifest`; `path` is for the message.

    Raises
    ------
    InputError
        When the value is not a stage manifest.
    """
    try:
        if value["format"] != FORMAT:
            raise InputError(path, f"format {value['format']!r}", expected=FORMAT, mend=_AGAIN)
        return StageManifest(
            stage=value["stage"],
            play=value["play"],
            status=value["status"],
            stopped_by=value["stopped_by"],
            inputs=tuple(Input(i["path"], i["sha256"]) for i in value["inputs"]),
            artifacts=tuple(
                Artifact(a["path"], a["class"], a["rtol"], a["atol"], a["unit"], a["meaning"], a["bytes"], a["sha256"])
                for a in value["artifacts"]
            ),
            parameters=value["parameters"],
            versions=value["versions"],
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(path, f"is not a stage manifest ({error})", expected=FORMAT, mend=_AGAIN) from None


def check_manifest(folder: str | Path) -> StageManifest:
    """Read a stage's manifest and check that every file it lists is there and unchanged.

    Returns
    -------
    StageManifest
        As read.

    Raises
    ------
    InputError
        Naming the first file that is missing or changed.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    for artifact in manifest.artifacts:
        path = folder / artifact.path
        if not path.is_file():
            raise InputError(path, f"listed by {folder.name}/{NAME} but missing", mend=_AGAIN)
        if artifact.sha256 is None:
            continue
        size = path.stat().st_size
        if size != artifact.bytes:
            raise InputError(path, f"changed: {size} bytes", expected=f"{artifact.bytes} bytes", mend=_AGAIN)
        if sha256(path) != artifact.sha256:
            raise InputError(
                path, "changed since the stage wrote it", expected=f"sha256 {artifact.sha256}", mend=_AGAIN
            )
    return manifest
