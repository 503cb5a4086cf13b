"""Bodies made of nodes, and motions that drive bodies: samples of a pose and its rates, checked at the door."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.arrays import WHERE, checked_array
from replay.tables import Column, TableFormat

MOTION_TABLE = TableFormat(
    "prescribed motion of a body",
    (
        Column("time_s", "time since the start of the run"),
        *(Column(f"{axis}_m", "reference point of the body") for axis in "xyz"),
        *(Column(f"q{axis}", "orientation, body to space, scalar last") for axis in "xyzw"),
        *(Column(f"v{axis}_m_per_s", "velocity of that point") for axis in "xyz"),
        *(Column(f"omega_{axis}_rad_per_s", "angular velocity in space") for axis in "xyz"),
    ),
)


@dataclass(frozen=True)
class RigidSet:
    """Nodes that move as one body, with the mass that their elements lump on them.

    Parameters
    ----------
    name
        Unique; for joints, motions, outputs and messages.
    nodes : (k,) int
        Rows of the problem's nodes, at least three that are not on one line. A set that shares a node with a
        rigid part or another set is one body with it.
    """

    name: str
    nodes: NDArray[np.int64]


@dataclass(frozen=True)
class PrescribedMotion:
    """Rigid parts and sets driven as one body along a given 6-DOF motion.

    A node of the body goes along ``X(t) = x(t) + R(t) R(0)^T (X(0) - x(0))``, where time 0 is the
    start of the run; x by cubic Hermite interpolation, R by Hermite interpolation of the
    quaternion.

    Parameters
    ----------
    pids
        Numbers of rigid parts.
    times : (k,) float64
        Increasing [s]; the first is at or before 0, the last at or after the end of the run.
    positions, velocities : (k, 3) float64
        Of the reference point [m], [m/s].
    quaternions : (k, 4) float64
        (x, y, z, w), body to space.
    angular_velocities : (k, 3) float64
        In space [rad/s].
    rigid_sets
        Names of rigid node sets that move along.
    """

    pids: tuple[int, ...]
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    quaternions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    angular_velocities: NDArray[np.float64]
    rigid_sets: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        times = checked_array(self.times, "prescribed.times", (None,))
        k = len(times)
        object.__setattr__(self, "pids", tuple(int(p) for p in self.pids))
        object.__setattr__(self, "rigid_sets", tuple(self.rigid_sets))
        object.__setattr__(self, "times", times)
        for name, width in (("positions", 3), ("velocities", 3), ("angular_velocities", 3), ("quaternions", 4)):
            object.__setattr__(self, name, checked_array(getattr(self, name), f"prescribed.{name}", (k, width)))
        if k < 2 or (np.diff(times) <= 0).any():
            raise InputError(
                WHERE,
                "the times do not increase",
                column="prescribed.times",
                expected="at least two times, each later than the one before",
            )
        size = np.linalg.norm(self.quaternions, axis=1)
        if (abs(size - 1) > 1e-6).any():
            row = int(np.argmax(abs(size - 1)))
            raise InputError(
                WHERE,
                f"quaternion {row} has length {size[row]:.6g}",
                column="prescribed.quaternions",
                expected="unit quaternions (x, y, z, w)",
            )
        # neighbours on one side of the sphere: q and -q are one rotation, but their mean is not
        turns = np.cumprod(np.where((self.quaternions[1:] * self.quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0))
        quaternions = self.quaternions / size[:, None]
        quaternions[1:] *= turns[:, None]
        object.__setattr__(self, "quaternions", quaternions)

    def check(self, rigid: Mapping[int | str, str], deforming: Mapping[int, str], end_s: float) -> None:
        """Refuse a motion that drives what is not there, or ends before the run does.

        Parameters
        ----------
        rigid, deforming
            Names of rigid parts and sets by number or name; of deformable parts by number.
        end_s
            End of the run [s].

        Raises
        ------
        InputError
            Naming the part or set.
        """
        for pid in self.pids:
            if pid in deforming:
                raise InputError(
                    WHERE,
                    f"part {pid} ({deforming[pid]!r}) deforms",
                    column="prescribed.pids",
                    expected="parts of the law 'rigid'",
                )
        for column, keys in (("prescribed.pids", self.pids), ("prescribed.rigid_sets", self.rigid_sets)):
            for key in keys:
                if key not in rigid:
                    kind = "part" if column.endswith("pids") else "rigid set"
                    raise InputError(
                        WHERE, f"{kind} {key} does not exist", column=column, expected=", ".join(map(str, rigid))
                    )
        if not self.pids and not self.rigid_sets:
            raise InputError(WHERE, "no part is driven", column="prescribed.pids", expected="at least one part")
        if self.times[0] > 1e-12 * end_s or self.times[-1] < end_s * (1 - 1e-9):
            raise InputError(
                WHERE,
                f"the motion is known from {self.times[0]:.6g} to {self.times[-1]:.6g} s, "
                f"the run lasts from 0 to {end_s:.6g} s",
                column="prescribed.times",
                mend="shorten the run or extend the motion",
            )


def read_motion(path: Path, pids: Sequence[int], rigid_sets: Sequence[str] = ()) -> PrescribedMotion:
    """Motion of some rigid parts and sets from a file of `MOTION_TABLE`; more columns do no harm.

    Raises
    ------
    InputError, InputErrors
        For a file that lacks a column or a value.
    """
    frame = MOTION_TABLE.read(path)

    def columns(template: str, axes: str = "xyz") -> NDArray[np.float64]:
        return frame[[template.format(axis) for axis in axes]].to_numpy(float)

    return PrescribedMotion(
        tuple(pids), frame["time_s"].to_numpy(float), columns("{}_m"), columns("q{}", "xyzw"),
        columns("v{}_m_per_s"), columns("omega_{}_rad_per_s"), tuple(rigid_sets),
    )  # fmt: skip
