"""Random head impacts in families: some to build the estimator and its bands with, others to test them on.

Where `Impact` is one pulse in closed form, these are sums of pulses about several axes on a slow background, integrated
on a fine grid. What differs between families is the shape of the pulses and how the axis moves; sizes and durations
are drawn from the same ranges (those that the literature on football impacts spans) for all.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from replay.motion.kinematics import STANDARD_GRAVITY, Kinematics
from replay.motion.rates import integrate_rotation
from replay.motion.synthetic.pulses import PULSES, Pulse, pulse
from replay.tables import Column, TableFormat

STEP_S = 5.0e-4
BUILDING = ("sine_squared", "skewed", "two_blows", "many_lobes")
"""Families that shaped the bands; the first three also the estimator."""
TESTING = ("half_sine", "wobbling", "mouthguard")
"""Families that had no part in building: bands are judged on these alone."""

MOUTHGUARD = TableFormat(
    "record of a mouthguard",
    (
        Column("time_ms", "time [ms]"),
        *(Column(f"lin_acc_{a}_g", f"{a} of the CG acceleration, head axes [g]") for a in "xyz"),
        *(Column(f"ang_vel_{a}_rad_s", f"{a} of the angular velocity, head axes [rad/s]") for a in "xyz"),
    ),
)
"""Format of the measured impacts that the ``mouthguard`` family is resampled from."""


@dataclass(frozen=True)
class GriddedMotion:
    """A motion on a fine grid, to be asked at any time; time 0 is near the impact.

    Parameters
    ----------
    fine
        On an even grid that covers the clip.
    """

    fine: Kinematics

    def at(self, time_s: np.ndarray) -> Kinematics:
        """Motion at any times within the grid."""
        k = self.fine

        def read(values: np.ndarray) -> np.ndarray:
            return CubicSpline(k.time_s, values)(time_s)

        index = np.clip(np.searchsorted(k.time_s, time_s, side="right") - 1, 0, len(k.time_s) - 2)
        before, after = k.rotation[index], k.rotation[index + 1]
        share = (time_s - k.time_s[index]) / (k.time_s[index + 1] - k.time_s[index])
        rotation = Rotation.from_rotvec((after * before.inv()).as_rotvec() * share[:, None]) * before
        return Kinematics(
            np.asarray(time_s, dtype=float),
            read(k.position_m),
            rotation,
            read(k.velocity_m_per_s),
            read(k.acceleration_m_per_s2),
            read(k.omega_rad_per_s),
            read(k.alpha_rad_per_s2),
        )


def draw(
    family: str,
    rng: np.random.Generator,
    span_s: tuple[float, float],
    position_m: np.ndarray,
    *,
    records: Path | None = None,
    quiet: bool = False,
) -> GriddedMotion:
    """One motion of a family.

    Parameters
    ----------
    family
        One of `BUILDING` or `TESTING`.
    rng
        Source of its sizes, durations and directions.
    span_s
        Start and end of the grid; time 0 is near the impact.
    position_m
        ``(3,)`` CG at time 0 if there were no impact, global axes.
    records
        Folder of measured records, for ``mouthguard``.
    quiet
        Leave the impact out (a null motion).
    """
    t = np.arange(span_s[0] - 0.01, span_s[1] + 0.01 + STEP_S, STEP_S)
    if family == "mouthguard":
        if records is None:
            message = "the family `mouthguard` needs the folder of its records"
            raise ValueError(message)
        omega, acceleration = _measured(rng, t, records)
    else:
        omega, acceleration = _PULSES[family](rng, t)
    if quiet:
        omega, acceleration = 0.0 * omega, 0.0 * acceleration
    omega = omega + _slow(rng, t, 1.2)
    start = Rotation.from_euler("ZYX", [-118.0 + rng.normal(0, 20), rng.normal(5, 10), rng.normal(0, 8)], degrees=True)
    rotation = integrate_rotation(start, omega, STEP_S, body_axes=True)
    # the same orientation at time 0 whatever came before
    zero = int(np.argmin(np.abs(t)))
    rotation = (start * rotation[zero].inv()) * rotation
    spin = rotation.apply(omega)
    a = rotation.apply(acceleration) + _slow(rng, t, 0.25, derivative=True)
    velocity = np.cumsum(a, axis=0) * STEP_S
    velocity += rng.normal(0.0, 2.0, 3) * [1.0, 0.5, 0.2] - velocity[zero]
    position = np.cumsum(velocity, axis=0) * STEP_S
    position += position_m - position[zero]
    alpha = np.gradient(spin, STEP_S, axis=0)
    return GriddedMotion(Kinematics(t, position, rotation, velocity, a, spin, alpha))


def _slow(rng: np.random.Generator, t: np.ndarray, size: float, *, derivative: bool = False) -> np.ndarray:
    """A few slow sines a component: what a running player's head does anyway."""
    out = np.zeros((len(t), 3))
    for axis in range(3):
        for frequency in rng.uniform(0.3, 2.5, 3):
            angle = 2.0 * np.pi * (frequency * t + rng.random())
            out[:, axis] += size * rng.normal() * np.sin(angle) * (2.0 * np.pi * frequency if derivative else 1.0)
    return out


def _direction(rng: np.random.Generator) -> np.ndarray:
    v = rng.standard_normal(3)
    return v / np.sqrt(v @ v)


def _off(axis: np.ndarray, rng: np.random.Generator, degrees: float) -> np.ndarray:
    side = np.cross(axis, _direction(rng))
    side /= np.sqrt(side @ side)
    return np.cos(np.radians(degrees)) * axis + np.sin(np.radians(degrees)) * side


@dataclass(frozen=True)
class _Sizes:
    gain_rad_per_s: float
    duration_s: float
    arrest_s: float
    share: float
    speed_m_per_s: float
    push_s: float
    lead_s: float


def _sizes(rng: np.random.Generator, least_arrest_s: float = 0.040) -> _Sizes:
    """Sizes of an impact: 18-50 rad/s over 8-25 ms, 1.5-6 m/s over 7-20 ms."""
    return _Sizes(
        gain_rad_per_s=float(np.exp(rng.uniform(np.log(18.0), np.log(50.0)))),
        duration_s=float(np.exp(rng.uniform(np.log(0.008), np.log(0.025)))),
        arrest_s=float(np.exp(rng.uniform(np.log(least_arrest_s), np.log(0.120)))),
        share=float(rng.uniform(0.5, 1.2)),
        speed_m_per_s=float(np.exp(rng.uniform(np.log(1.5), np.log(6.0)))),
        push_s=float(np.exp(rng.uniform(np.log(0.007), np.log(0.020)))),
        lead_s=float(rng.uniform(0.0, 0.004)),
    )


def _rise(family: Pulse, t: np.ndarray, begin: float, duration: float) -> np.ndarray:
    """Integral of a pulse, from 0 to 1."""
    return pulse(family, t, begin, duration, 1.0)[1] / (duration * _area(family))


def _unit(family: Pulse, t: np.ndarray, begin: float, duration: float) -> np.ndarray:
    """Pulse of unit area."""
    return pulse(family, t, begin, duration, 1.0)[0] / (duration * _area(family))


def _area(family: Pulse) -> float:
    return float(PULSES[family](np.ones(1))[1][0])


def _impact(rng: np.random.Generator, t: np.ndarray, family: Pulse) -> tuple:
    """Pulse, arrest by a slower pulse of the same kind, and a push of the CG."""
    s, axis = _sizes(rng, least_arrest_s=0.015), _direction(rng)
    up = _rise(family, t, -0.5 * s.duration_s, s.duration_s)
    down = _rise(family, t, 0.5 * s.duration_s, s.arrest_s)
    rate = s.gain_rad_per_s * (up - s.share * down)
    push = s.speed_m_per_s * _unit(family, t, -0.5 * s.push_s - s.lead_s, s.push_s)
    return rate[:, None] * axis, push[:, None] * _direction(rng), s, axis


def _sine_squared(rng: np.random.Generator, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    omega, push, _, _ = _impact(rng, t, "sine_squared")
    return omega, push


def _skewed(rng: np.random.Generator, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A fast rise and a slow fall, and a smaller turn about another axis that comes later."""
    omega, push, s, axis = _impact(rng, t, "skewed")
    late = _rise("skewed", t, rng.uniform(0.0, 0.5) * s.duration_s, 2.0 * s.duration_s)
    late -= _rise("skewed", t, 1.5 * s.duration_s, s.arrest_s)
    size = rng.uniform(0.1, 0.4) * s.gain_rad_per_s
    return omega + size * late[:, None] * _off(axis, rng, 90.0), push


def _two_blows(rng: np.random.Generator, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The second blow is smaller, 15 to 50 ms later, about an axis up to 60 degrees away."""
    first, push, s, axis = _impact(rng, t, "sine_squared")
    delay, size = rng.uniform(0.015, 0.050), rng.uniform(0.2, 0.7)
    up = _rise("sine_squared", t, delay, s.duration_s)
    up -= _rise("sine_squared", t, delay + s.duration_s, s.arrest_s)
    second = size * s.gain_rad_per_s * up[:, None] * _off(axis, rng, rng.uniform(0.0, 60.0))
    again = size * s.speed_m_per_s * _unit("sine_squared", t, delay, s.push_s)
    return first + second, push + again[:, None] * _direction(rng)


def _many_lobes(rng: np.random.Generator, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two to four lobes of like angular acceleration, 6 to 30 ms apart, about axes up to 90 degrees away, some back."""
    s, axis = _sizes(rng, least_arrest_s=0.015), _direction(rng)
    begin = -0.5 * s.duration_s
    omega, push = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for _ in range(rng.integers(2, 5)):
        duration = s.duration_s * float(np.exp(rng.uniform(np.log(0.5), np.log(1.5))))
        about = _off(axis, rng, rng.uniform(0.0, 90.0)) * (1.0 if rng.random() < 0.7 else -1.0)
        gain = rng.uniform(0.5, 1.0) * duration
        omega += gain * _rise("sine_squared", t, begin, duration)[:, None] * about
        push += rng.uniform(0.3, 1.0) * _unit("sine_squared", t, begin - s.lead_s, s.push_s)[:, None] * _direction(rng)
        end = begin + duration
        begin += rng.uniform(0.006, 0.030)
    omega *= (1.0 - s.share * _rise("sine_squared", t, end, s.arrest_s))[:, None]
    omega *= s.gain_rad_per_s / np.linalg.norm(omega, axis=1).max()
    return omega, push * s.speed_m_per_s / np.linalg.norm(push.sum(axis=0) * STEP_S)


def _half_sine(rng: np.random.Generator, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A half-sine of acceleration, then an exponential return of the rate towards a part of its gain."""
    s, axis = _sizes(rng), _direction(rng)
    up = _rise("half_sine", t, -0.5 * s.duration_s, s.duration_s)
    since = np.maximum(t - 0.5 * s.duration_s, 0.0)
    left = 1.0 - s.share * (1.0 - np.exp(-since / (0.5 * s.arrest_s)))
    push = s.speed_m_per_s * _unit("half_sine", t, -0.5 * s.push_s - s.lead_s, s.push_s)
    return (s.gain_rad_per_s * up * left)[:, None] * axis, push[:, None] * _direction(rng)


def _wobbling(rng: np.random.Generator, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A damped oscillation of the rate about an axis that turns: the neck as a spring."""
    s, axis = _sizes(rng), _direction(rng)
    since = np.maximum(t + 0.5 * s.duration_s, 0.0)
    frequency, decay = 1.0 / (4.0 * s.duration_s + s.arrest_s), 0.5 * s.arrest_s
    shape = (1.0 - np.exp(-((2.0 * since / s.duration_s) ** 2))) * np.exp(-since / (2.0 * decay))
    shape = shape * np.cos(2.0 * np.pi * frequency * np.maximum(since - 0.5 * s.duration_s, 0.0))
    turn = np.radians(rng.uniform(-40.0, 40.0)) * (1.0 - np.exp(-since / 0.03))
    side = _off(axis, rng, 90.0)
    omega = s.gain_rad_per_s * shape[:, None] * (np.cos(turn)[:, None] * axis + np.sin(turn)[:, None] * side)
    x = np.maximum(t + 0.6 * s.push_s, 0.0) / (0.3 * s.push_s)
    push = x**2 * np.exp(-x) / (0.6 * s.push_s)
    return omega, s.speed_m_per_s * push[:, None] * _direction(rng)


_PULSES = {
    "sine_squared": _sine_squared,
    "skewed": _skewed,
    "two_blows": _two_blows,
    "many_lobes": _many_lobes,
    "half_sine": _half_sine,
    "wobbling": _wobbling,
}


_SETTLING_SAMPLES = 5


def _measured(rng: np.random.Generator, t: np.ndarray, records: Path) -> tuple[np.ndarray, np.ndarray]:
    """One measured impact, turned at random, scaled by 0.7 to 1.3, faded in and out where the record ends."""
    files = sorted(Path(records).glob("impact_*.csv"))
    table = MOUTHGUARD.read(files[rng.integers(len(files))])
    # the device's own filter rings up over the first milliseconds of a record: no motion of the head
    table = table.iloc[_SETTLING_SAMPLES:-_SETTLING_SAMPLES]
    clock = table["time_ms"].to_numpy() * 1e-3
    omega = table[[f"ang_vel_{a}_rad_s" for a in "xyz"]].to_numpy()
    push = table[[f"lin_acc_{a}_g" for a in "xyz"]].to_numpy() * STANDARD_GRAVITY
    change = np.linalg.norm(np.gradient(omega, clock, axis=0), axis=1)
    clock = clock - clock[int(np.argmax(change))]
    turn = Rotation.from_quat(rng.standard_normal(4))
    size = rng.uniform(0.7, 1.3)
    inside = np.clip(t, clock[0], clock[-1])
    away = np.maximum(np.abs(t - inside) / 0.060, 0.0)
    fade = np.where(away < 1.0, 0.5 * (1.0 + np.cos(np.pi * np.minimum(away, 1.0))), 0.0)
    gone = np.where(away > 0.0, 0.0, 1.0)
    spin = CubicSpline(clock, omega)(inside) * fade[:, None]
    felt = CubicSpline(clock, push)(inside) * gone[:, None]
    return size * turn.apply(spin), size * turn.apply(felt)
