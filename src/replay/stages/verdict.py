"""Stage ``verdict``: every gate of the play in one verdict."""

from __future__ import annotations

from pathlib import Path

from replay.bundle import package_facts
from replay.files import write_json
from replay.gates import Gate, PlayVerdict, package_gate, play_verdict, read_gate
from replay.gates.package import UNRECORDED_PACKAGE, VIDEO_PACKAGE, WEARABLE_PACKAGE
from replay.stages.frame import STAGES, Stage, Workspace
from replay.stages.limits import limits_of
from replay.stages.resolved import read_settings

GATE_FILES = {
    "reconstruction": ("gate.json",),
    "assembly": ("gate_helmet.json", "gate.json"),
    "placement": ("gate.json",),
    "shake": ("gate.json",),
    "replay": ("gate.json",),
    "sensitivity": ("gate.json",),
    "fidelity": ("gate.json",),
}
ALL_GATE_FILES = {**GATE_FILES, "verdict": ("gate.json",)}
"""With the package gate, which the verdict stage judges itself."""


def collect(stage: Stage) -> list[Gate]:
    """Gates that earlier stages judged."""
    limits = limits_of(stage)
    return [
        read_gate(stage.read(name, file), limits)
        for name, files in GATE_FILES.items()
        for file in files
        if stage.made(name, file)
    ]


def package(stage: Stage) -> Gate:
    """Gate on the minimum reproducibility package, as it lies in the results."""
    root = Path(__file__).resolve().parents[3]
    facts = package_facts(stage.workspace.results / stage.workspace.play, root)
    kind = read_settings(stage).source.kind
    required = {"clicks": VIDEO_PACKAGE, "wearable": WEARABLE_PACKAGE, "none": UNRECORDED_PACKAGE}[kind]
    return package_gate(facts, limits_of(stage), required=required)


def run(workspace: Workspace) -> str | None:
    """Collect the gates, judge the package of a play that ran to its end, and write ``verdict.json``."""
    stage = Stage(workspace, "verdict", after=STAGES[: STAGES.index("verdict")])
    gates = collect(stage)
    if not stage.stopped_by:
        gates.append(package(stage))
        gates[-1].write(stage.write("gate.json", "gate: reproducibility package"))
    verdict: PlayVerdict = play_verdict(
        workspace.play, gates, limits_of(stage), awaited=("package",) if stage.stopped_by else ()
    )
    write_json(stage.write("verdict.json", "every gate of the play in one verdict"), verdict.to_json())
    stage.finish()
    print(verdict.line())
    return None
