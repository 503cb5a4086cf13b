"""Histories of what links parts: angles and moments of joints, tensions of straps, forces across ties, rigid sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.solver.kernels.joints import ANGLE, DAMPER_FORCE, GAP, OWN_MOMENT, SPRING_FORCE
from replay.solver.kernels.straps import LENGTH, NATURAL, TENSION
from replay.solver.problem import Problem
from replay.solver.view import Recorder, StateView
from replay.tables import Column, TableFormat


def _three(name: str, unit: str, meaning: str) -> tuple[Column, ...]:
    return tuple(Column(f"{name}_{axis}_{unit}", meaning if axis == "x" else "the same") for axis in "xyz")


_TIME = Column("time_s", "time of the run")
JOINT_TABLE = TableFormat(
    "joints",
    (
        _TIME,
        Column("joint", "name of the joint", "text"),
        *_three("angle", "rad", "rotation vector of the second body against the first, in joint axes"),
        *_three("moment", "N_m", "moment of springs and dampers on the second body, in joint axes"),
        *_three("force", "N", "force at the centre on the second body, in space"),
        Column("gap_m", "distance of the two bodies' centres of the joint"),
    ),
)
STRAP_TABLE = TableFormat(
    "straps",
    (
        _TIME,
        Column("strap", "name of the strap", "text"),
        Column("length_m", "length along its nodes"),
        Column("natural_length_m", "length above which it pulls"),
        Column("tension_N", "tension"),
    ),
)
TIE_TABLE = TableFormat(
    "tied interfaces",
    (
        _TIME,
        Column("tie", "name of the interface", "text"),
        *_three("force", "N", "force of the tied side's elements on the masters' side"),
    ),
)
RIGID_SET_TABLE = TableFormat(
    "motion of rigid sets",
    (
        _TIME,
        Column("rigid_set", "name of the set", "text"),
        *(Column(f"{axis}_m", "centre of gravity, or the reference point of a driven body") for axis in "xyz"),
        *(Column(f"q{axis}", "orientation, body to space") for axis in "xyzw"),
        *(Column(f"v{axis}_m_per_s", "velocity of that point") for axis in "xyz"),
        *(Column(f"omega_{axis}_rad_per_s", "angular velocity in space") for axis in "xyz"),
    ),
)


class TableRecorder:
    """Rows of one table, a few of the same names at every history time.

    Parameters
    ----------
    table
        Its first two columns are the time and the name.
    file
        Name of the file.
    names
        One a row.
    rows
        Everything beyond time and name from the state, (n_names, n_columns - 2).
    """

    def __init__(
        self, table: TableFormat, file: str, names: list[Any], rows: Callable[[StateView], NDArray[np.float64]]
    ) -> None:
        self._table, self._file, self._names, self._rows = table, file, names, rows
        self._width = len(table.names) - 2
        self._times: list[float] = []
        self._values: list[NDArray[np.float64]] = []

    def sample(self, view: StateView) -> None:
        """Take the state at a history time."""
        self._times.append(view.time_s)
        self._values.append(np.asarray(self._rows(view), float).reshape(len(self._names), self._width).copy())

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far."""
        values = np.array(self._values).reshape(-1, len(self._names), self._width)
        return {"times": np.array(self._times), "values": values}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `state` returned."""
        self._times, self._values = state["times"].tolist(), list(state["values"])

    def write(self, folder: Path) -> None:
        """Write the table."""
        state = self.state()
        time, name, *rest = self._table.names
        keys = {time: np.repeat(state["times"], len(self._names)), name: self._names * len(self._times)}
        self._table.write(folder / self._file, {**keys, **dict(zip(rest, state["values"].reshape(-1, self._width).T))})


def link_recorders(problem: Problem) -> list[Recorder]:
    """Recorders of all that a problem has of joints, straps, ties and rigid sets."""
    kept = tuple(k for k, strap in enumerate(problem.straps) if strap.recorded)
    straps = tuple(problem.straps[k] for k in kept)
    kinds: tuple[tuple[TableFormat, str, tuple[Any, ...], Callable[[StateView], NDArray[np.float64]]], ...] = (
        (JOINT_TABLE, "joints.csv", problem.joints, _joint_rows),
        (STRAP_TABLE, "straps.csv", straps, lambda view: view.links.strap_rows[kept, :][:, [LENGTH, NATURAL, TENSION]]),
        (TIE_TABLE, "ties.csv", problem.ties, lambda view: view.tied.resultants()),
        (RIGID_SET_TABLE, "rigid_sets.csv", problem.rigid_sets, _set_rows),
    )
    return [TableRecorder(table, file, [i.name for i in items], rows) for table, file, items, rows in kinds if items]


def _joint_rows(view: StateView) -> NDArray[np.float64]:
    row = view.links.joint_rows
    force = row[:, SPRING_FORCE : SPRING_FORCE + 3] + row[:, DAMPER_FORCE : DAMPER_FORCE + 3]
    return np.hstack([row[:, ANGLE : ANGLE + 3], row[:, OWN_MOMENT : OWN_MOMENT + 3], force, row[:, GAP : GAP + 1]])


def _set_rows(view: StateView) -> NDArray[np.float64]:
    poses = [view.set_poses[rigid_set.name] for rigid_set in view.problem.rigid_sets]
    return np.array([np.concatenate([p.position, p.quaternion, p.velocity, p.angular_velocity]) for p in poses])
