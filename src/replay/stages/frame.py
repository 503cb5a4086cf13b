"""What every stage does the same way: read what came before, refuse what changed, write its manifest last."""

from __future__ import annotations

import platform
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from replay import __version__
from replay.errors import InputError
from replay.files import LOCK, hold_folder, read_json
from replay.manifest import NAME, Artifact, StageManifest, check_manifest, write_manifest
from replay.play import ADDRESS

if TYPE_CHECKING:
    from replay.gates import Gate

MEMBER = "member.json"
"""File of a member's settings stage: what it overrides, and whose stages it shares."""


@dataclass(frozen=True)
class Workspace:
    """Where one play's files are.

    Parameters
    ----------
    play
        Name of the play, or address of a member of an ensemble of it: ``demo.friction/003``.
    plays
        Folder of the plays; ``plays/<play>/play.yaml`` describes this one.
    results
        Folder of the results; everything of this play goes to ``results/<play>``.
    """

    play: str
    plays: Path = Path("config/plays")
    results: Path = Path("results")

    @property
    def description(self) -> Path:
        """The play's own description."""
        return self.plays / self.play / "play.yaml"

    def folder(self, stage: str) -> Path:
        """Folder of a stage; a member shares some of them with its play or with other members."""
        return self.results / self._owners.get(stage, self.play) / stage

    @cached_property
    def _owners(self) -> dict[str, str]:
        member = self.results / self.play / "settings" / MEMBER
        return read_json(member)["shared"] if ADDRESS.fullmatch(self.play) and member.is_file() else {}


class Finished:
    """Finished stages of a play, for one that reads their files.

    Parameters
    ----------
    workspace
        Where the play's files are.
    stages
        The stages, as far as the play's mode has them; their files must not have changed since.

    Raises
    ------
    InputError
        When a stage has not finished or one of its files changed.
    """

    def __init__(self, workspace: Workspace, stages: Sequence[str]) -> None:
        self.workspace = workspace
        here = stages_of(workspace)
        self._before: dict[str, StageManifest] = {
            stage: check_stage(workspace, stage) for stage in stages if stage in here
        }
        self._inputs: dict[str, Path] = {}

    def follow(self, stage: str) -> None:
        """Let this stage read one more stage's files, which only an earlier one's show to be needed."""
        self._before.setdefault(stage, check_stage(self.workspace, stage))

    @property
    def stopped_by(self) -> str | None:
        """Why an earlier stage ended the play, or None."""
        return next((m.stopped_by for m in self._before.values() if m.stopped_by), None)

    def manifest_of(self, stage: str) -> StageManifest:
        """Manifest of an earlier stage."""
        return self._before[stage]

    def read(self, stage: str, path: str) -> Path:
        """Path of an earlier stage's file, which becomes an input of this one.

        Raises
        ------
        InputError
            When that stage did not make the file.
        """
        if self._before[stage].artifact(path) is None:
            raise InputError(
                self.workspace.folder(stage) / path,
                f"stage {stage} made no such file",
                mend=f"run `replay {COMMANDS[stage]}` again",
            )
        return self.read_file(f"{stage}/{path}", self.workspace.folder(stage) / path)

    def read_file(self, name: str, path: Path) -> Path:
        """Record any other file as an input under `name`."""
        self._inputs[name] = path
        return path

    def made(self, stage: str, path: str) -> bool:
        """Whether an earlier stage made a file; a play that was stopped has fewer, one of another mode other stages."""
        return stage in self._before and self._before[stage].artifact(path) is not None


class Stage(Finished):
    """One run of one stage.

    Parameters
    ----------
    workspace
        Where the play's files are.
    name
        Name of the stage: its folder.
    after
        The stages whose files this one may read; they must have finished, and their files must not have
        changed since.
    keep
        Names in the folder that survive from an unfinished run (a checkpoint).

    Raises
    ------
    InputError
        When an earlier stage has not finished or one of its files changed.
    """

    def __init__(self, workspace: Workspace, name: str, *, after: Sequence[str] = (), keep: Sequence[str] = ()) -> None:
        super().__init__(workspace, after)
        self.name = name
        self.folder = workspace.folder(name)
        self._artifacts: list[Artifact] = []
        self._keep = (*keep, LOCK)
        self._begun = False
        self._lock()

    def _begin(self) -> None:
        """Clear the folder, manifest first; only now, so that an input that cannot be used costs no old result."""
        if self._begun:
            return
        self._begun = True
        (self.folder / NAME).unlink(missing_ok=True)
        for path in self.folder.iterdir():
            if path.name not in self._keep:
                shutil.rmtree(path) if path.is_dir() else path.unlink()

    def _lock(self) -> None:
        """Refuse a second writer."""
        self._held = hold_folder(self.folder, "this stage")

    def write(self, path: str, meaning: str, *, unit: str = "", volatile: bool = False) -> Path:
        """Path for a file of this stage, listed in its manifest."""
        self._begin()
        self._artifacts.append(
            Artifact.volatile(path, meaning) if volatile else Artifact.exact(path, meaning, unit=unit)
        )
        full = self.folder / path
        full.parent.mkdir(parents=True, exist_ok=True)
        return full

    def folder_for_many(self) -> Path:
        """The stage's folder, cleared, for a writer that names its own files; list them with `write` afterwards."""
        self._begin()
        return self.folder

    def write_all(self, meanings: dict[str, str]) -> Path:
        """List several files of this stage at once; return its folder."""
        for path, meaning in meanings.items():
            self.write(path, meaning)
        return self.folder

    def skip(self) -> str:
        """Write the manifest of a stage that an earlier gate made needless; return why."""
        reason = self.stopped_by or ""
        self._begin()
        self._seal(reason, {})
        return f"{self.name}: not run, {reason}"

    def give_up(self, reason: str) -> str:
        """Write the manifest of a stage that could not go on, with the files it did write; return `reason`."""
        self._artifacts = [a for a in self._artifacts if (self.folder / a.path).is_file()]
        self._seal(reason, {})
        return reason

    def finish(self, gates: Iterable[Gate] = (), *, parameters: dict[str, Any] | None = None) -> str | None:
        """Write the manifest.

        Parameters
        ----------
        gates
            Judged in this stage; each is printed, and one that stops the play is recorded.
        parameters
            Settings that the result depends on.

        Returns
        -------
        str or None
            Why the play ends here, or None.
        """
        refusal: str | None = None
        for gate in gates:
            print(f"gate {gate.name}: {gate.verdict}")
            for line in gate.cause_lines():
                print(f"    {line}")
            if gate.stops and refusal is None:
                worst = next(check for check in gate.causes() if check.verdict == "fail")
                refusal = f"stopped by gate {gate.name}: {worst.sentence()}"
        self._seal(refusal, parameters or {})
        print(f"{self.name}: wrote {len(self._artifacts)} files to {self.folder}")
        return refusal

    def _seal(self, stopped_by: str | None, parameters: dict[str, Any]) -> None:
        write_manifest(
            self.folder,
            stage=self.name,
            play=self.workspace.play,
            artifacts=self._artifacts,
            inputs=self._inputs,
            status="stopped" if stopped_by else "done",
            stopped_by=stopped_by,
            parameters=parameters,
            versions={"replay": __version__, "python": platform.python_version()},
        )


def check_stage(workspace: Workspace, stage: str) -> StageManifest:
    """Manifest of a finished stage whose files are all there and unchanged.

    Raises
    ------
    InputError
        Naming the file, and the command that makes it again.
    """
    try:
        return check_manifest(workspace.folder(stage))
    except InputError as error:
        raise InputError(
            error.file, error.found, expected=error.expected, mend=f"run `replay {COMMANDS[stage]}` again"
        ) from None


COMMANDS = {
    "settings": "settings",
    "inputs": "inputs",
    "reconstruction": "reconstruct",
    "driver": "drive",
    "assembly": "assemble",
    "placement": "place",
    "decks": "decks",
    "shake": "shake",
    "replay": "impact",
    "sensitivity": "sensitivity",
    "fidelity": "fidelity",
    "measures": "measure",
    "verdict": "judge",
    "report": "report",
}
STAGES = tuple(COMMANDS)
"""Every stage with a manifest, in the order of the protocol."""
_OF_COLLISIONS = ("placement",)
_OF_RECORDS = ("reconstruction", "fidelity")


def stages_of(workspace: Workspace) -> tuple[str, ...]:
    """The stages that a play of this mode has, by its resolved settings."""
    settings = workspace.folder("settings") / "play.json"
    play = read_json(settings) if settings.is_file() else {}
    absent = set() if play.get("collision") else set(_OF_COLLISIONS)
    if play.get("source", {}).get("kind") == "none":
        absent |= set(_OF_RECORDS)
    return tuple(stage for stage in STAGES if stage not in absent)
