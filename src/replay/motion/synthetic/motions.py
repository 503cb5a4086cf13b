"""Head motions with an exact truth: impacts from pulse families, and records of real ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from replay.motion.kinematics import STANDARD_GRAVITY, Kinematics
from replay.motion.rates import integrate_rotation
from replay.motion.synthetic.pulses import Pulse, pulse

Vector = tuple[float, float, float]


class Motion(Protocol):
    """A motion of the skull CG that is known at any time; the impact is at time 0."""

    def at(self, time_s: np.ndarray) -> Kinematics:
        """True motion of the CG, global axes."""


@dataclass(frozen=True)
class Impact:
    """A head impact in closed form.

    Rotation about a fixed axis takes a pulse, then a slower sin^2 arrest by the neck, on top of
    a slow turn about a second axis; the CG takes a pulse of linear acceleration on top of
    uniform motion.

    Parameters
    ----------
    peak_alpha_rad_per_s2, alpha_duration_s
        Angular pulse; its middle is at time 0, which is its peak where it is symmetric.
    arrest_duration_s, arrest_share
        Arrest after the pulse, and the share of the gained angular velocity that it takes away.
    peak_acceleration_m_per_s2, acceleration_duration_s, acceleration_lead_s
        Linear pulse and how long its middle comes before the angular one's.
    axis, background_axis, background_rad_per_s
        Global axis of the impact's rotation; slow turn before it.
    direction, velocity_m_per_s, position_m
        Global direction of the linear pulse; velocity and position at time 0 without it.
    heading_deg, nod_deg
        Orientation at time 0 without the impact: x anterior is turned from global x by heading about z.
    family
        Shape of both pulses.
    """

    peak_alpha_rad_per_s2: float = 4500.0
    alpha_duration_s: float = 0.015
    arrest_duration_s: float = 0.070
    arrest_share: float = 0.9
    peak_acceleration_m_per_s2: float = 72.0 * STANDARD_GRAVITY
    acceleration_duration_s: float = 0.013
    acceleration_lead_s: float = 0.0010
    axis: Vector = (0.30, -0.35, 0.88)
    background_axis: Vector = (0.6, 0.8, 0.0)
    background_rad_per_s: float = 1.0
    direction: Vector = (0.94, 0.16, 0.30)
    velocity_m_per_s: Vector = (-1.6, 0.1, 0.0)
    position_m: Vector = (0.0, 1.6, 0.0)
    heading_deg: float = -118.0
    nod_deg: float = 8.0
    family: Pulse = "sine_squared"

    def at(self, time_s: np.ndarray) -> Kinematics:
        """True motion of the CG at any times [s]."""
        t = np.asarray(time_s, dtype=float)
        n, m = _unit(self.axis), _unit(self.background_axis)
        half = 0.5 * self.alpha_duration_s
        alpha1, omega1, theta1 = pulse(self.family, t, -half, self.alpha_duration_s, self.peak_alpha_rad_per_s2)
        gain = pulse(self.family, np.array([half]), -half, self.alpha_duration_s, self.peak_alpha_rad_per_s2)[1][0]
        brake = 2.0 * gain * self.arrest_share / self.arrest_duration_s
        alpha2, omega2, theta2 = pulse("sine_squared", t, half, self.arrest_duration_s, -brake)
        alpha, omega, theta = alpha1 + alpha2, omega1 + omega2, theta1 + theta2

        impact = Rotation.from_rotvec(theta[:, None] * n)
        turn = Rotation.from_rotvec((self.background_rad_per_s * t)[:, None] * m)
        start = Rotation.from_euler("ZY", [self.heading_deg, self.nod_deg], degrees=True)
        carried = impact.apply(np.tile(m, (len(t), 1))) * self.background_rad_per_s

        d = _unit(self.direction)
        begin = -self.acceleration_lead_s - 0.5 * self.acceleration_duration_s
        a, v, x = pulse(self.family, t, begin, self.acceleration_duration_s, self.peak_acceleration_m_per_s2)
        v0 = np.array(self.velocity_m_per_s)
        return Kinematics(
            time_s=t,
            position_m=np.array(self.position_m) + t[:, None] * v0 + x[:, None] * d,
            rotation=impact * turn * start,
            velocity_m_per_s=v0 + v[:, None] * d,
            acceleration_m_per_s2=a[:, None] * d,
            omega_rad_per_s=omega[:, None] * n + carried,
            alpha_rad_per_s2=alpha[:, None] * n + omega[:, None] * np.cross(n, carried),
        )


def _unit(vector: Vector) -> np.ndarray:
    v = np.array(vector, dtype=float)
    return v / np.sqrt(v @ v)


def draw_impact(rng: np.random.Generator, family: Pulse = "sine_squared", position_m: Vector | None = None) -> Impact:
    """Draw an impact as severe as those of the field, about any axis, in any direction.

    Gained angular velocity 10-45 rad/s in 8-30 ms, peak CG acceleration 20-110 g in 7-20 ms, arrest of 50-95 %
    in 50-110 ms; the head faces the camera within 60 degrees and turns at up to 3 rad/s before.

    Parameters
    ----------
    rng
        Source of randomness.
    family
        Shape of both pulses.
    position_m
        CG at time 0; default that of `Impact`.
    """
    gain, duration = rng.uniform(10.0, 45.0), rng.uniform(0.008, 0.030)
    drawn = Impact(
        alpha_duration_s=duration,
        arrest_duration_s=rng.uniform(0.050, 0.110),
        arrest_share=rng.uniform(0.5, 0.95),
        peak_acceleration_m_per_s2=rng.uniform(20.0, 110.0) * STANDARD_GRAVITY,
        acceleration_duration_s=rng.uniform(0.007, 0.020),
        acceleration_lead_s=rng.uniform(-0.002, 0.003),
        axis=_direction(rng),
        background_axis=_direction(rng),
        background_rad_per_s=rng.uniform(0.0, 3.0),
        direction=_direction(rng),
        velocity_m_per_s=(rng.uniform(-4.0, 4.0), rng.uniform(-1.0, 1.0), rng.uniform(-0.5, 0.5)),
        heading_deg=-90.0 + rng.uniform(-60.0, 60.0),
        nod_deg=rng.uniform(-15.0, 15.0),
        family=family,
    )
    # one rad/s^2 of peak gains this much: the peak follows from the gain that was drawn
    end = np.array([duration])
    drawn = replace(drawn, peak_alpha_rad_per_s2=float(gain / pulse(family, end, 0.0, duration, 1.0)[1][0]))
    return drawn if position_m is None else replace(drawn, position_m=position_m)


def _direction(rng: np.random.Generator) -> Vector:
    x, y, z = _unit(tuple(rng.normal(size=3)))
    return float(x), float(y), float(z)


_STEP_S = 5.0e-5
"""Step of the rotation's integration: its error is far below a nanoradian."""


class RecordedMotion:
    """A recorded motion, filmed from anywhere.

    Components of angular velocity and CG acceleration in head axes are taken from the record; cubic splines through
    them are the truth, orientation, velocity and position their integrals. Outside the record omega stays what it was
    at the end and the acceleration is zero.

    Parameters
    ----------
    record
        At least four samples.
    position_m, velocity_m_per_s
        Of the CG at time 0, which is the record's greatest angular acceleration.
    heading_deg, nod_deg
        Orientation at time 0, as in `Impact`.
    """

    def __init__(
        self,
        record: Kinematics,
        *,
        position_m: Vector = (0.0, 1.6, 0.0),
        velocity_m_per_s: Vector = (0.0, 0.0, 0.0),
        heading_deg: float = -118.0,
        nod_deg: float = 8.0,
    ) -> None:
        time, omega = np.array(record.time_s), record.in_head_axes(np.array(record.omega_rad_per_s))
        rates = np.linalg.norm(CubicSpline(time, omega)(time, 1), axis=1)
        time -= time[int(np.argmax(rates))]
        self._start, self._end = float(time[0]), float(time[-1])
        self._omega = CubicSpline(time, omega)
        before, after = int(np.ceil(-self._start / _STEP_S)), int(np.ceil(self._end / _STEP_S))
        self._first = -before * _STEP_S
        grid = np.arange(-before, after + 1) * _STEP_S
        turn = integrate_rotation(Rotation.identity(), self._omega_at(grid)[0], _STEP_S, body_axes=True)
        facing = Rotation.from_euler("ZY", [heading_deg, nod_deg], degrees=True)
        self._rotation = facing * turn[before].inv() * turn
        # acceleration in global axes of the new orientation, as one spline whose integrals are exact
        local = record.in_head_axes(np.array(record.acceleration_m_per_s2))
        self._acceleration = CubicSpline(time, self._rotation_at(time).apply(local))
        self._velocity = self._acceleration.antiderivative(1)
        self._path = self._acceleration.antiderivative(2)
        self._v0 = np.array(velocity_m_per_s) - self._velocity(0.0)
        self._x0 = np.array(position_m) - self._path(0.0)

    @classmethod
    def read(cls, path: Path, **placing: Vector | float) -> RecordedMotion:
        """Motion of a ``kinematics.csv``, ``driver_6dof.csv`` or ``truth.csv``.

        Raises
        ------
        InputError, InputErrors
            For a file that is none of these.
        """
        return cls(Kinematics.read(path), **placing)  # type: ignore[arg-type]

    def _omega_at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angular velocity and acceleration, head axes."""
        inside = ((t >= self._start) & (t <= self._end))[:, None]
        clipped = np.clip(t, self._start, self._end)
        return self._omega(clipped), np.where(inside, self._omega(clipped, 1), 0.0)

    def _rotation_at(self, t: np.ndarray) -> Rotation:
        base = np.clip(np.floor((t - self._first) / _STEP_S).astype(int), 0, len(self._rotation) - 1)
        rest = t - (self._first + base * _STEP_S)
        middle = self._omega_at(t - 0.5 * rest)[0]
        return self._rotation[base] * Rotation.from_rotvec(middle * rest[:, None])

    def at(self, time_s: np.ndarray) -> Kinematics:
        """True motion of the CG at any times [s]."""
        t = np.asarray(time_s, dtype=float)
        rotation = self._rotation_at(t)
        omega, alpha = (rotation.apply(v) for v in self._omega_at(t))
        inside = ((t >= self._start) & (t <= self._end))[:, None]
        clipped = np.clip(t, self._start, self._end)
        beyond = (t - clipped)[:, None]
        velocity = self._v0 + self._velocity(clipped)
        return Kinematics(
            time_s=t,
            position_m=self._x0 + self._v0 * t[:, None] + self._path(clipped) + self._velocity(clipped) * beyond,
            rotation=rotation,
            velocity_m_per_s=velocity,
            acceleration_m_per_s2=np.where(inside, self._acceleration(clipped), 0.0),
            omega_rad_per_s=omega,
            alpha_rad_per_s2=alpha,
        )
