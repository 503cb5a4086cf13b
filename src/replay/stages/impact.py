"""Stage ``replay``: the explicit run, its brain recorder, and the numerics gate."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replay.errors import InstabilityError, ResumeError
from replay.files import read_json
from replay.gates import Gate, numerics_gate, part_energies
from replay.measures import BrainRecorder, DamageRecorder, PadRecorder
from replay.models import Model
from replay.motion import Kinematics
from replay.solver import Problem, Recorder, solve
from replay.stages.collision import collision_problem
from replay.stages.contact import contact_numbers
from replay.stages.frame import Stage, Workspace
from replay.stages.limits import limits_of
from replay.stages.players import held_part
from replay.stages.problem import controls_of, driven_problem
from replay.stages.replayed import replayed_model
from replay.stages.resolved import read_settings

RUN_FILES = {
    "run.json": "summary of the run",
    "timestep.csv": "time step, controlling element and added mass",
    "energy.csv": "energy ledger",
    "part_energy.csv": "energy by part",
    "histories.csv": "motion of parts",
    "states.vtkhdf": "states of the whole mesh, for ParaView",
    "states.xdmf": "the same for VisIt",
}
CONTACT_FILES = {"contact.csv": "contact by pair of parts: force, impulse, work"}
STRAP_FILES = {
    "straps.csv": "force and elongation of the chin straps",
    "rigid_sets.csv": "motion of the chin cup's hard shell",
}
BRAIN_FILES = {
    "brain_histories.csv": "strain and stress of the brain by region over time",
    "element_peaks.csv": "peaks of every brain element",
    "brain_snapshots.h5": "strain of every brain element over time",
}
PAD_FILES = {"pads.csv": "compression of the helmets' pads over time"}
DAMAGE_FILES = {
    "brain_damage.csv": "damaged volume of the brain by region over time",
    "element_damage.csv": "damage of every brain element and its onset",
    "damage_sensitivity.csv": "damage with other constants of pore growth",
}
BEFORE_A_RUN = ("settings", "assembly", "driver", "placement", "shake")
# What an interrupted run leaves and a later one goes on from.
UNFINISHED = ("checkpoint", "states.partial")


def run(workspace: Workspace, *, threads: int | None = None, checkpoint_every_s: float = 10.0) -> str | None:
    """Replay the impact, of a driven skull or of two players, going on from a checkpoint where there is one."""
    stage = Stage(workspace, "replay", after=BEFORE_A_RUN, keep=UNFINISHED)
    if stage.stopped_by:
        return stage.skip()
    refusal = run_play(stage, threads=threads, checkpoint_every_s=checkpoint_every_s)
    if refusal:
        return refusal
    gate = judge_numerics(stage)
    gate.write(stage.write("gate.json", "gate: replay numerics"))
    return stage.finish([gate])


def run_play(
    stage: Stage, *, threads: int | None, checkpoint_every_s: float, hourglass_factor: float = 1.0
) -> str | None:
    """Run the play in the stage's folder: head and helmet along its driver, or two players into each other.

    Returns
    -------
    str or None
        Why the solver stopped itself, when it did; the stage is then finished.
    """
    play = read_settings(stage)
    model = replayed_model(stage)
    controls = controls_of(
        play, play.window.duration_s, checkpoint_every_s=checkpoint_every_s, hourglass_factor=hourglass_factor
    )
    if play.collision is not None:
        placement = read_json(stage.read("placement", "placement.json"))
        problem = collision_problem(model, placement, controls, play)
    else:
        driver = Kinematics.read(stage.read("driver", "driver_6dof.csv"))
        problem = driven_problem(model, driver, controls, play.solver.contact)
    files = {**RUN_FILES, **BRAIN_FILES, **PAD_FILES}
    recorders: list[Recorder] = [brain_recorder(model), pad_recorder(model)]
    if model.has_damage:
        recorders.append(damage_recorder(model))
        files |= DAMAGE_FILES
    return run_solver(stage, problem, recorders, files, threads=threads)


def run_solver(
    stage: Stage, problem: Problem, recorders: list[Recorder], files: dict[str, str], *, threads: int | None
) -> str | None:
    """Run a problem in the stage's folder and list its files; a run that stops itself ends the play."""
    if problem.contact is not None:
        files = files | CONTACT_FILES
    if any(strap.recorded for strap in problem.straps):
        files = files | STRAP_FILES
    folder = stage.write_all(files)
    try:
        try:
            solve(problem, folder, recorders=recorders, threads=threads)
        except ResumeError as stale:
            print(f"{stale}\n    starting anew: the checkpoint is of a run that was asked something else")
            solve(problem, folder, recorders=recorders, threads=threads, resume=False)
    except InstabilityError as error:
        return stage.give_up(f"stopped by the solver's watch-dog: {error}")
    return None


def brain_recorder(model: Model) -> BrainRecorder:
    """Recorder of the brain's elements with their regions."""
    return BrainRecorder(*_brain(model))


def pad_recorder(model: Model) -> PadRecorder:
    """Recorder of all pads and chin cups, and of the foam of an apparatus."""
    roles = ("comfort_pad", "energy_pad", "chin_cup", "cushion")
    pads = {p.name: np.flatnonzero(model.element_part == k) for k, p in enumerate(model.parts) if p.role in roles}
    return PadRecorder(pads)


def damage_recorder(model: Model) -> DamageRecorder:
    """Recorder of the brain's damage variable."""
    return DamageRecorder(*_brain(model), model.materials["brain"]["parameters"])


def _brain(model: Model) -> tuple[NDArray[np.int64], NDArray[np.int64], dict[str, NDArray[np.int64]]]:
    """Rows of the struck brain's elements, their numbers, and their positions by region."""
    rows = np.flatnonzero(model.elements_of(role="brain", player=1))
    region = model.element_region[rows]
    groups = {name: np.flatnonzero(region == k) for k, name in enumerate(model.region_names) if k > 0}
    return rows, model.element_ids[rows], groups


def judge_numerics(stage: Stage) -> Gate:
    """Judge the run whose files lie in the stage's folder."""
    energy = pd.read_csv(stage.folder / "energy.csv")
    steps = pd.read_csv(stage.folder / "timestep.csv")
    parts = pd.read_csv(stage.folder / "part_energy.csv")
    summary = read_json(stage.folder / "run.json")
    model = replayed_model(stage)
    fluid = [part.pid for part in model.parts if model.materials[part.material]["law"] == "fluid"]
    return numerics_gate(
        {str(name): energy[name].to_numpy() for name in energy},
        part_energies(parts, fluid),
        {"ran_to_end": summary["ran_to_end"], **run_numbers(summary)},
        limits_of(stage),
        steps=steps["step"].to_numpy(),
        free=read_settings(stage).mode == "collision" and held_part(model) is None,
        contact=contact_numbers(summary, energy),
    )


def run_numbers(summary: dict) -> dict[str, float | str]:
    """What the numerics gate asks of ``run.json``."""
    added, mass = summary["added_mass_by_part_kg"], summary["mass_by_part_kg"]
    share = {name: added[name] / mass[name] for name in mass if mass[name] > 0}
    worst = max(share, key=lambda name: share[name])
    flow = summary["flow_residual"]
    return {
        "added_mass_share": summary["added_mass_kg"] / summary["mass_kg"],
        "added_mass_part_share": share[worst],
        "added_mass_part_share_detail": f"most in {worst}" if share[worst] > 0 else "",
        "min_time_step_s": summary["smallest_time_step_s"],
        "min_volume_ratio": summary["min_volume_ratio"],
        "flow_residual": "no law of this run solves a flow equation" if flow is None else flow,
    }
