"""``initial_conditions_t0.csv``: the head's state at t0, at the start of the window, and just before the impact."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.motion.bands import constants
from replay.motion.driver import axis_points
from replay.motion.kinematics import Kinematics
from replay.motion.onset import BeforeOnset
from replay.tables import Column, TableFormat


def _vector(template: str, meaning: str) -> tuple[Column, ...]:
    return tuple(Column(template.format(axis), f"{axis} {meaning}") for axis in "xyz")


INITIAL_CONDITIONS = TableFormat(
    "initial conditions",
    (
        Column("mode", "protocol, posterior or wearable", kind="text"),
        Column(
            "instant",
            "t0; window_start: first sample of the driver; onset: just before the impact, from the frames before it",
            kind="text",
        ),
        Column("time_s", "time on the clock of kinematics.csv [s]"),
        *_vector("{}_m", "of the skull CG, global [m]"),
        *(Column(f"q{c}", f"quaternion head to global, {c}") for c in "xyzw"),
        *_vector("v{}_m_per_s", "of the CG velocity, global [m/s]"),
        *_vector("omega_{}_rad_per_s", "of the angular velocity, global [rad/s]"),
        Column("spin_rad_per_s", "magnitude of the angular velocity, about the axis from P to Q [rad/s]"),
        *_vector("p{}_m", "of P, on the axis: the skull CG [m]"),
        *_vector("q{}_axis_m", "of Q, one metre along the axis [m]"),
        Column("a_m_per_s2", "resultant CG acceleration [m/s^2]"),
        Column("alpha_rad_per_s2", "resultant angular acceleration [rad/s^2]"),
        Column("spin_lo_rad_per_s", "lower end of the spin's 95 % band [rad/s]", may_be_empty=True),
        Column("spin_hi_rad_per_s", "upper end of the spin's 95 % band [rad/s]", may_be_empty=True),
        Column("time_lo_s", "lower end of the instant's 95 % band [s]", may_be_empty=True),
        Column("time_hi_s", "upper end of the instant's 95 % band [s]", may_be_empty=True),
        *(
            Column(f"{stem}_{end}_{unit}", f"{words} end of its 95 % band, onset only [{said}]", may_be_empty=True)
            for stems, unit, said in (
                (("vx", "vy", "vz"), "m_per_s", "m/s"),
                (("omega_x", "omega_y", "omega_z"), "rad_per_s", "rad/s"),
            )
            for stem in stems
            for end, words in (("lo", "lower"), ("hi", "upper"))
        ),
    ),
)
"""Format of ``initial_conditions_t0.csv``: protocol mode, then posterior mode where there is one."""


def condition(
    mode: str, instant: str, time_s: float, motion: Kinematics, at: int, bands: dict[str, tuple[float, float]]
) -> dict[str, Any]:
    """One row: the state at a sample of a motion, and the bands of what has one, by name of its column.

    Parameters
    ----------
    mode, instant, time_s
        First columns.
    motion, at
        Motion and the index of its sample.
    bands
        Lower and upper end by a column's name, e.g. ``vx_m_per_s``.
    """
    columns = motion.columns()
    axis: dict[str, Any] = axis_points(motion.position_m[at], motion.omega_rad_per_s[at])
    row: dict[str, Any] = dict.fromkeys(INITIAL_CONDITIONS.names, float("nan"))
    row |= {name: float(columns[name][at]) for name in row if name in columns}
    row |= {"mode": mode, "instant": instant, "time_s": float(time_s), "spin_rad_per_s": axis["spin_rad_per_s"]}
    for i, a in enumerate("xyz"):
        row[f"p{a}_m"], row[f"q{a}_axis_m"] = float(axis["P_m"][i]), float(axis["Q_m"][i])
    for name, ends in bands.items():
        unit = next(unit for unit in ("_rad_per_s", "_m_per_s", "_s") if name.endswith(unit))
        for end, value in zip(("lo", "hi"), ends):
            row[f"{name.removesuffix(unit)}_{end}{unit}"] = float(value)
    return row


def velocity_bands(before: BeforeOnset) -> dict[str, tuple[float, float]]:
    """95 % bands of the velocities just before the impact, by name of their column."""
    known, motion = constants(), before.motion
    out = {}
    for stem, unit, kind, values, sigma in (
        ("v", "m_per_s", "velocity", motion.velocity_m_per_s[0], before.sigma_velocity_m_per_s),
        ("omega_", "rad_per_s", "omega", motion.omega_rad_per_s[0], before.sigma_omega_rad_per_s),
    ):
        half = known.before[kind] * sigma
        for i, a in enumerate("xyz"):
            out[f"{stem}{a}_{unit}"] = (float(values[i] - half[i]), float(values[i] + half[i]))
    # the spin's deviation is that along the axis
    spin = motion.omega_resultant[0]
    along = float(np.linalg.norm(half * motion.omega_rad_per_s[0]) / max(spin, 1e-9))
    return {**out, "spin_rad_per_s": (max(float(spin) - along, 0.0), float(spin) + along)}
