"""The tables and states that a run leaves behind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.solver.materials import LAWS, law_fields
from replay.solver.problem import Problem
from replay.solver.time_step import StepBound
from replay.solver.view import StateView
from replay.solver.vtkhdf import StatesWriter
from replay.tables import Column, TableFormat

TIME_STEP_TABLE = TableFormat(
    "time steps",
    (
        Column("time_s", "time of the run"),
        Column("step", "steps done", "int"),
        Column("time_step_s", "last step"),
        Column(
            "stable_step_s",
            "stable step before the factor: the controlling element's, shortened by joints, straps and ties",
        ),
        Column("element_id", "controlling element; -1 where nothing deforms", "int"),
        Column("pid", "its part; -1 where nothing deforms", "int"),
        Column("added_mass_kg", "mass added by mass scaling"),
    ),
)
ENERGY_TABLE = TableFormat(
    "energy ledger",
    (
        Column("time_s", "time of the run"),
        Column("kinetic_J", "kinetic energy, mean of the half steps before and after"),
        Column("internal_J", "work of the element stresses at mid-step rates"),
        Column("hourglass_J", "work of the hourglass forces"),
        Column("bulk_viscosity_J", "work lost in bulk viscosity"),
        Column("contact_normal_J", "work lost in normal contact"),
        Column("friction_J", "work lost in friction"),
        Column("external_work_J", "work of drivers, supports, loads and weight"),
        Column("joint_spring_J", "work taken by the springs of joints"),
        Column("joint_damper_J", "work lost in the dampers of joints"),
        Column("strap_J", "work taken by straps: stored and lost, less what paying in brings"),
        Column("tie_J", "work taken by rigid and tied nodes: rounding"),
        Column("added_mass_kinetic_J", "share of the kinetic energy that belongs to added mass"),
        Column("plastic_J", "share of the internal energy that plastic flow has turned into heat"),
        Column("integration_J", "work of nodal forces on elements beyond stress, hourglass and viscosity"),
        Column("total_J", "kinetic + internal + hourglass + viscosity + contact + friction + joints + straps + ties"),
        Column("ratio", "total over initial energy plus external work"),
        Column("closure", "relative residual of the discrete energy identity: rounding only"),
        Column("momentum_x_N_s", "momentum of all that moves"),
        Column("momentum_y_N_s", "momentum of all that moves"),
        Column("momentum_z_N_s", "momentum of all that moves"),
    ),
)
PART_ENERGY_TABLE = TableFormat(
    "energy by part",
    (
        Column("time_s", "time of the run"),
        Column("pid", "part number", "int"),
        Column("part", "part name", "text"),
        Column("kinetic_J", "kinetic energy of its elements"),
        Column("internal_J", "work of its stresses"),
        Column("hourglass_J", "work of its hourglass forces"),
        Column("bulk_viscosity_J", "work lost in its bulk viscosity"),
    ),
)
_TURN = (
    Column("qx", "orientation of a rigid part, body to space", may_be_empty=True),
    Column("qy", "orientation", may_be_empty=True),
    Column("qz", "orientation", may_be_empty=True),
    Column("qw", "orientation", may_be_empty=True),
)
HISTORY_TABLE = TableFormat(
    "motion of parts",
    (
        Column("time_s", "time of the run"),
        Column("pid", "part number", "int"),
        Column("part", "part name", "text"),
        Column("x_m", "centre of gravity; the reference point of a driven part, read off its nodes"),
        Column("y_m", "the same"),
        Column("z_m", "the same"),
        *_TURN,
        Column("vx_m_per_s", "velocity of that point"),
        Column("vy_m_per_s", "the same"),
        Column("vz_m_per_s", "the same"),
        Column("omega_x_rad_per_s", "angular velocity of a rigid part, in space", may_be_empty=True),
        Column("omega_y_rad_per_s", "the same", may_be_empty=True),
        Column("omega_z_rad_per_s", "the same", may_be_empty=True),
    ),
)
POINT_FIELDS = {"displacement_m": 3, "velocity_m_per_s": 3}
CELL_FIELDS = {"stress_Pa": 6, "von_mises_Pa": 1, "pressure_Pa": 1, "lode": 1, "volume_ratio": 1}


class Histories:
    """Rows of the four tables, gathered in memory and written at the end.

    They are part of every checkpoint, so that a resumed run writes the same bytes.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._step: list[list[float]] = []
        self._energy: list[list[float]] = []
        self._parts: list[NDArray[np.float64]] = []
        self._motion: list[NDArray[np.float64]] = []

    def sample(self, view: StateView, bound: StepBound, added_mass_kg: float) -> None:
        """Add a row to every table."""
        element, pid = -1, -1
        if bound.element >= 0:
            element = int(self._problem.element_ids[bound.element])
            pid = self._problem.part_of(bound.element).pid
        stable = bound.step_s if np.isfinite(bound.step_s) else view.time_step_s
        self._step.append([view.time_s, view.step, view.time_step_s, stable, element, pid, added_mass_kg])
        e = view.energies
        self._energy.append(
            [
                view.time_s, e.kinetic, e.internal, e.hourglass, e.bulk_viscosity, e.contact_normal, e.friction,
                e.external_work, e.joint_spring, e.joint_damper, e.strap, e.tie,
                e.added_mass_kinetic, e.plastic, e.integration, e.total, e.ratio, e.closure,
                *view.momentum,
            ]
        )  # fmt: skip
        self._parts.append(np.column_stack([view.part_kinetic, view.part_work]))
        _, centre, velocity = view.part_motion
        empty = np.full((len(centre), 4), np.nan)
        rows = np.column_stack([centre, empty, velocity, empty[:, :3]])
        for k, part in enumerate(self._problem.parts):
            if part.pid in view.poses:
                pose = view.poses[part.pid]
                rows[k] = np.concatenate([pose.position, pose.quaternion, pose.velocity, pose.angular_velocity])
        self._motion.append(rows)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far."""
        parts = len(self._problem.parts)
        return {
            "step": np.array(self._step).reshape(-1, len(TIME_STEP_TABLE.names)),
            "energy": np.array(self._energy).reshape(-1, len(ENERGY_TABLE.names)),
            "parts": np.array(self._parts).reshape(-1, parts, 4),
            "motion": np.array(self._motion).reshape(-1, parts, 13),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `state` returned."""
        self._step, self._energy = state["step"].tolist(), state["energy"].tolist()
        self._parts, self._motion = list(state["parts"]), list(state["motion"])

    def write(self, folder: Path) -> None:
        """Write timestep.csv, energy.csv, part_energy.csv and histories.csv."""
        state = self.state()
        pids = [part.pid for part in self._problem.parts]
        names = [part.name for part in self._problem.parts]
        times = state["energy"][:, 0]
        whole = {"step", "element_id", "pid"}
        TIME_STEP_TABLE.write(
            folder / "timestep.csv",
            {
                name: column.astype(int) if name in whole else column
                for name, column in zip(TIME_STEP_TABLE.names, state["step"].T)
            },
        )
        ENERGY_TABLE.write(folder / "energy.csv", dict(zip(ENERGY_TABLE.names, state["energy"].T)))
        keys = {"time_s": np.repeat(times, len(pids)), "pid": pids * len(times), "part": names * len(times)}
        for table, name, rows in (
            (PART_ENERGY_TABLE, "part_energy.csv", state["parts"]),
            (HISTORY_TABLE, "histories.csv", state["motion"]),
        ):
            columns = rows.reshape(-1, rows.shape[2]).T
            table.write(folder / name, {**keys, **dict(zip(table.names[3:], columns))})


class States:
    """The states file of a run, opened anew or where a checkpoint left it."""

    def __init__(self, problem: Problem, folder: Path, volume: NDArray[np.float64], *, resume_at: int | None) -> None:
        pid = np.array([part.pid for part in problem.parts])[problem.element_part]
        self._volume = volume
        laws = sorted({part.material.law for part in problem.parts})
        self._law_fields = {name: kept for law in laws for name, kept in law_fields(LAWS[law]).items()}
        self._writer = StatesWriter(
            folder / "states.vtkhdf", problem.nodes, problem.hexes, problem.node_ids, problem.element_ids, pid,
            POINT_FIELDS, CELL_FIELDS | dict.fromkeys(self._law_fields, 1), resume=resume_at is not None,
        )  # fmt: skip
        if resume_at is not None:
            self._writer.rewind(resume_at)

    @property
    def count(self) -> int:
        """States written so far."""
        return self._writer.n_states

    def append(self, view: StateView) -> None:
        """Add a state."""
        self._writer.append(
            view.time_s,
            {
                "displacement_m": view.displacements,
                "velocity_m_per_s": view.velocities,
                "stress_Pa": view.stress,
                "von_mises_Pa": view.von_mises,
                "pressure_Pa": view.pressure,
                "lode": view.lode,
                "volume_ratio": view.volumes / self._volume,
                **{name: view.variable(kept) for name, kept in self._law_fields.items()},
            },
        )

    def sync(self) -> None:
        """Force the states onto the disk, before a checkpoint that counts them."""
        self._writer.sync()

    def close(self) -> None:
        """Finish the file."""
        self._writer.close()

    def abandon(self) -> None:
        """Leave the growing file for a later run."""
        self._writer.abandon()
