"""Stage ``verdict``: every gate of the play in one verdict."""

from __future__ import annotations

from replay.files import write_json
from replay.gates import Limits, PlayVerdict, play_verdict, read_gate
from replay.stages.frame import Stage, Workspace
from replay.stages.settings import read_settings

GATE_FILES = {
    "reconstruction": ("gate.json",),
    "assembly": ("gate_helmet.json", "gate.json"),
    "shake": ("gate.json",),
    "replay": ("gate.json",),
    "sensitivity": ("gate.json",),
    "fidelity": ("gate.json",),
}
_AFTER = ("settings", "reconstruction", "assembly", "decks", "shake", "replay", "sensitivity", "fidelity", "measures")


def limits_of(stage: Stage) -> Limits:
    """Limits in force for the play: the shipped ones, with the play's own where it sets some."""
    return Limits.load(read_settings(stage).gates)


def collect(stage: Stage) -> PlayVerdict:
    """Verdict from the gates that earlier stages judged."""
    limits = limits_of(stage)
    gates = [
        read_gate(stage.read(name, file), limits)
        for name, files in GATE_FILES.items()
        for file in files
        if stage.manifest_of(name).artifact(file)
    ]
    return play_verdict(stage.workspace.play, gates, limits)


def run(workspace: Workspace) -> str | None:
    """Collect the gates and write ``verdict.json``."""
    stage = Stage(workspace, "verdict", after=_AFTER)
    verdict = collect(stage)
    write_json(stage.write("verdict.json", "every gate of the play in one verdict"), verdict.to_json())
    stage.finish()
    print(verdict.line())
    return None
