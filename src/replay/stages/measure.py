"""Stage ``measures``: head, brain and mechanical action, as process diagnostics."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from replay.files import write_json
from replay.gates import convergence_class, read_gate
from replay.measures import (
    DAMAGE_VOLUME_TABLE,
    Motion,
    crossover_time,
    damage_summary,
    head_measures,
    kinetic_energy_of,
    mechanical_action,
    pad_summary,
    regional_summary,
    write_action,
)
from replay.motion import Kinematics
from replay.stages.channels import peaks_behind_filters
from replay.stages.fidelity import skull_motion
from replay.stages.forces import forces
from replay.stages.frame import Stage, Workspace
from replay.stages.limits import limits_of
from replay.stages.replayed import replayed_model

_DRIVEN = "a driven head has no impactor: the crossover is that of head and helmet"
_COLLISION = "the impactor is all of what strikes; the crossover is that of the struck head and the impactor"


def run(workspace: Workspace) -> str | None:
    """Measure the replayed head; nothing here is an injury criterion or a verdict on a person."""
    stage = Stage(workspace, "measures", after=["settings", "assembly", "placement", "replay", "sensitivity"])
    if stage.stopped_by:
        return stage.skip()
    model = replayed_model(stage)
    energy = pd.read_csv(stage.read("replay", "part_energy.csv"))
    brain = pd.read_csv(stage.read("replay", "brain_histories.csv"))
    gate = read_gate(stage.read("sensitivity", "gate.json"), limits_of(stage))

    time = energy["time_s"].unique()
    bodies = {
        assembly: [p.pid for p in model.parts if p.assembly == assembly and p.player == 1]
        for assembly in ("head", "helmet")
    }
    bodies["impactor"] = [p.pid for p in model.parts if p.player == 2]
    action = {name: mechanical_action(time, kinetic_energy_of(energy, pids)) for name, pids in bodies.items() if pids}
    head, impactor = action["head"], action.get("impactor")
    write_action(
        stage.write("action.csv", "mechanical action of head, helmet and impactor", unit="J s"),
        time,
        head,
        action["helmet"],
        impactor,
    )
    damage = None
    if model.has_damage:
        found = pd.read_csv(stage.read("replay", "brain_damage.csv"))
        found["head_J_s"] = np.interp(found["time_s"], time, head)
        path = stage.write("damage_volume.csv", "damaged volume by region against time and action", unit="m^3")
        DAMAGE_VOLUME_TABLE.write(path, {name: found[name] for name in DAMAGE_VOLUME_TABLE.names})
        damage = damage_summary(found)
    _head_motion(stage)
    motion = skull_motion(stage)
    filtered = peaks_behind_filters(motion) if stage.made("placement", "placement.json") else []
    write_json(
        stage.write("measures.json", "head, brain and action measures with unit, definition and source"),
        {
            "statement": "process diagnostics; no statement on injury or on a player",
            "head": head_measures(in_head_axes(motion), file="replay/histories.csv") + filtered,
            "brain": regional_summary(brain),
            "damage": damage,
            **forces(stage, model),
            "pads": pad_summary(pd.read_csv(stage.read("replay", "pads.csv"))),
            "brain_convergence_class": convergence_class(gate),
            "action": {
                "unit": "J s",
                "head": float(head[-1]),
                "helmet": float(action["helmet"][-1]),
                "impactor": None if impactor is None else float(impactor[-1]),
                **_crossover(time, head, action["helmet"] if impactor is None else impactor),
                "note": _DRIVEN if impactor is None else _COLLISION,
            },
        },
    )
    return stage.finish()


def _head_motion(stage: Stage) -> None:
    """Write the struck head's motion in the format of the reconstruction, to be compared or filmed again."""
    m = skull_motion(stage)
    Kinematics(
        m.time_s,
        m.position_m,
        Rotation.from_quat(m.quaternion),
        m.velocity_m_per_s,
        m.acceleration_m_per_s2,
        m.angular_velocity_rad_per_s,
        m.angular_acceleration_rad_per_s2,
    ).write(stage.write("head_motion.csv", "motion of the struck head's CG, in the format of kinematics.csv"))


def _crossover(time: np.ndarray, head: np.ndarray, other: np.ndarray) -> dict[str, float | None]:
    """When the actions of head and impactor (of a driven head: head and helmet) cross; None where they do not."""
    found = crossover_time(time, head, other)
    return {"crossover_time_s": None if np.isnan(found) else found}


def in_head_axes(motion: Motion) -> dict[str, np.ndarray]:
    """Columns of the head-axis motion that `head_measures` takes."""
    turn = Rotation.from_quat(motion.quaternion).inv()
    out = {"time_s": motion.time_s}
    for stem, vectors, unit in (
        ("a_head", motion.acceleration_m_per_s2, "_m_per_s2"),
        ("omega_head", motion.angular_velocity_rad_per_s, "_rad_per_s"),
        ("alpha_head", motion.angular_acceleration_rad_per_s2, "_rad_per_s2"),
    ):
        local = turn.apply(vectors)
        out |= {f"{stem}_{axis}{unit}": local[:, i] for i, axis in enumerate("xyz")}
    return out
