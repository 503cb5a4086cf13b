"""Motion of the skull CG as every stage exchanges it: one class, one file format."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from replay.tables import Column, TableFormat

STANDARD_GRAVITY = 9.80665
"""Standard gravity [m/s^2]."""


def _triple(stem: str, unit: str, meaning: str) -> tuple[Column, ...]:
    return tuple(Column(f"{stem}_{axis}{unit}", f"{axis} component of {meaning}") for axis in "xyz")


_POSE_COLUMNS = (
    *(Column(f"{axis}_m", f"{axis} of the skull CG, global [m]") for axis in "xyz"),
    *(Column(f"q{c}", f"quaternion head to global, {c} (scalar last)") for c in "xyzw"),
    *(Column(f"v{axis}_m_per_s", f"{axis} of the CG velocity, global [m/s]") for axis in "xyz"),
    *(Column(f"a{axis}_m_per_s2", f"{axis} of the CG acceleration, global [m/s^2]") for axis in "xyz"),
    *_triple("omega", "_rad_per_s", "angular velocity, global [rad/s]"),
    *_triple("alpha", "_rad_per_s2", "angular acceleration, global [rad/s^2]"),
)

KINEMATICS = TableFormat(
    "kinematics of the skull CG",
    (
        Column("time_s", "time [s]; the first frame's number over the frame rate, or the wearable's clock"),
        *_POSE_COLUMNS,
        *_triple("a_head", "_m_per_s2", "CG acceleration, head axes [m/s^2]"),
        *_triple("omega_head", "_rad_per_s", "angular velocity, head axes [rad/s]"),
        *_triple("alpha_head", "_rad_per_s2", "angular acceleration, head axes [rad/s^2]"),
        Column("a_m_per_s2", "resultant CG acceleration [m/s^2]"),
        Column("omega_rad_per_s", "resultant angular velocity [rad/s]"),
        Column("alpha_rad_per_s2", "resultant angular acceleration [rad/s^2]"),
    ),
)
"""Format of ``kinematics.csv``."""

DRIVER = TableFormat(
    "driver of the skull CG", (Column("time_s", "time since the start of the replayed window [s]"), *_POSE_COLUMNS)
)
"""Format of ``driver_6dof.csv``."""


@dataclass(frozen=True)
class Kinematics:
    """Rigid motion of the head, all of the skull CG, global axes.

    Parameters
    ----------
    time_s
        ``(n,)`` evenly spaced [s].
    position_m, velocity_m_per_s, acceleration_m_per_s2
        ``(n, 3)``.
    rotation
        ``n`` rotations, head to global.
    omega_rad_per_s, alpha_rad_per_s2
        ``(n, 3)`` angular velocity and acceleration.
    """

    time_s: np.ndarray
    position_m: np.ndarray
    rotation: Rotation
    velocity_m_per_s: np.ndarray
    acceleration_m_per_s2: np.ndarray
    omega_rad_per_s: np.ndarray
    alpha_rad_per_s2: np.ndarray

    @property
    def linear_resultant(self) -> np.ndarray:
        """``(n,)`` magnitude of the CG acceleration [m/s^2]."""
        return np.linalg.norm(self.acceleration_m_per_s2, axis=1)

    @property
    def omega_resultant(self) -> np.ndarray:
        """``(n,)`` magnitude of the angular velocity [rad/s]."""
        return np.linalg.norm(self.omega_rad_per_s, axis=1)

    @property
    def alpha_resultant(self) -> np.ndarray:
        """``(n,)`` magnitude of the angular acceleration [rad/s^2]."""
        return np.linalg.norm(self.alpha_rad_per_s2, axis=1)

    def in_head_axes(self, vectors: np.ndarray) -> np.ndarray:
        """Components ``(n, 3)`` of global vectors along the head's axes."""
        return self.rotation.inv().apply(vectors)

    def columns(self, *, head: bool = True) -> dict[str, np.ndarray]:
        """Columns of `KINEMATICS`, or of `DRIVER` with ``head=False``."""
        out: dict[str, np.ndarray] = {"time_s": self.time_s}
        quaternion = _continuous(self.rotation.as_quat())
        for i, axis in enumerate("xyz"):
            out[f"{axis}_m"] = self.position_m[:, i]
            out[f"v{axis}_m_per_s"] = self.velocity_m_per_s[:, i]
            out[f"a{axis}_m_per_s2"] = self.acceleration_m_per_s2[:, i]
            out[f"omega_{axis}_rad_per_s"] = self.omega_rad_per_s[:, i]
            out[f"alpha_{axis}_rad_per_s2"] = self.alpha_rad_per_s2[:, i]
        for i, component in enumerate("xyzw"):
            out[f"q{component}"] = quaternion[:, i]
        if not head:
            return out
        for stem, unit, vectors in (
            ("a_head", "_m_per_s2", self.acceleration_m_per_s2),
            ("omega_head", "_rad_per_s", self.omega_rad_per_s),
            ("alpha_head", "_rad_per_s2", self.alpha_rad_per_s2),
        ):
            local = self.in_head_axes(vectors)
            for i, axis in enumerate("xyz"):
                out[f"{stem}_{axis}{unit}"] = local[:, i]
        out["a_m_per_s2"] = self.linear_resultant
        out["omega_rad_per_s"] = self.omega_resultant
        out["alpha_rad_per_s2"] = self.alpha_resultant
        return out

    def write(self, path: Path) -> None:
        """Write ``kinematics.csv``."""
        KINEMATICS.write(path, self.columns())

    def write_driver(self, path: Path) -> None:
        """Write ``driver_6dof.csv``."""
        DRIVER.write(path, self.columns(head=False))

    @classmethod
    def read(cls, path: Path) -> Kinematics:
        """Read ``kinematics.csv`` or ``driver_6dof.csv``.

        Raises
        ------
        InputError, InputErrors
            For a file that lacks a column or a value.
        """
        frame = DRIVER.read(path)

        def triple(template: str) -> np.ndarray:
            # a copy: a view of a table may not be written, and rotations refuse what may not be
            return frame[[template.format(axis) for axis in "xyz"]].to_numpy(copy=True)

        return cls(
            time_s=frame["time_s"].to_numpy(),
            position_m=triple("{}_m"),
            rotation=Rotation.from_quat(frame[["qx", "qy", "qz", "qw"]].to_numpy()),
            velocity_m_per_s=triple("v{}_m_per_s"),
            acceleration_m_per_s2=triple("a{}_m_per_s2"),
            omega_rad_per_s=triple("omega_{}_rad_per_s"),
            alpha_rad_per_s2=triple("alpha_{}_rad_per_s2"),
        )


def _continuous(quaternion: np.ndarray) -> np.ndarray:
    """Flip signs so that no neighbours are on opposite sides of the sphere; the first has w >= 0."""
    out = quaternion.copy()
    if out[0, 3] < 0:
        out[0] *= -1
    for k in range(1, len(out)):
        if out[k] @ out[k - 1] < 0:
            out[k] *= -1
    return out
