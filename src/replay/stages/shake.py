"""Stage ``shake``: a millisecond of free flight of the helmet alone (protocol 1.6, 1.7)."""

from __future__ import annotations

import pandas as pd

from replay.files import read_json
from replay.gates import contact_blow_up, ledger_values, shake_gate
from replay.measures import ShakeRecorder, shake_measures
from replay.models import read_model
from replay.stages.frame import Stage, Workspace
from replay.stages.impact import RUN_FILES, UNFINISHED, run_solver
from replay.stages.limits import limits_of
from replay.stages.problem import controls_of, helmet_problem
from replay.stages.resolved import read_settings


def run(workspace: Workspace, *, threads: int | None = None, checkpoint_every_s: float = 10.0) -> str | None:
    """Fly the helmet with the controls of the replay and judge whether it flies undisturbed."""
    stage = Stage(workspace, "shake", after=["settings", "assembly"], keep=UNFINISHED)
    if stage.stopped_by:
        return stage.skip()
    play = read_settings(stage)
    model = read_model(stage.read("assembly", "model.h5"))
    controls = controls_of(play, play.shake.duration_s, checkpoint_every_s=checkpoint_every_s)
    problem = helmet_problem(model, play.shake.speed_m_per_s, controls, play.solver.contact)
    recorder = ShakeRecorder(
        problem.hexes,
        problem.nodes,
        problem.element_part,
        [part.name for part in problem.parts],
        [part.material.density_kg_per_m3 for part in problem.parts],
        [part.material.wave_speed_m_per_s() for part in problem.parts],
        [play.shake.speed_m_per_s, 0.0, 0.0],
    )
    files = {**RUN_FILES, "shake.csv": "edge stretch, part velocities and stress of the flying helmet"}
    refusal = run_solver(stage, problem, [recorder], files, threads=threads)
    if refusal:
        return refusal
    steps = pd.read_csv(stage.folder / "timestep.csv")["time_step_s"]
    energy, summary = pd.read_csv(stage.folder / "energy.csv"), read_json(stage.folder / "run.json")
    limits = limits_of(stage)
    gate = shake_gate(
        {
            **shake_measures(pd.read_csv(stage.folder / "shake.csv")),
            **ledger_values(energy, steps),
            "ran_to_end": summary["ran_to_end"],
        },
        limits,
        contact_blow_up=contact_blow_up(energy["contact_normal_J"], energy["kinetic_J"], summary["contact"], limits),
    )
    gate.write(stage.write("gate.json", "gate: helmet shake"))
    return stage.finish([gate])
