"""Velocities and accelerations of rotations and of points of a rigid body."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def angular_rates(rotation: Rotation, rate_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Angular velocity and acceleration of a sampled rotation, global axes.

    ``omega(k + 1/2) = Log(R(k+1) R(k)^T) rate``; at a sample omega is the mean of its two half steps
    and alpha their difference. A constant spin below half a turn a sample is exact. The first and
    last samples take omega from their only half step and alpha from their neighbour.

    Returns
    -------
    omega_rad_per_s, alpha_rad_per_s2
        ``(n, 3)`` each.
    """
    steps = (rotation[1:] * rotation[:-1].inv()).as_rotvec() * rate_hz
    omega = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
    alpha = (steps[1:] - steps[:-1]) * rate_hz
    return omega, np.concatenate([alpha[:1], alpha, alpha[-1:]])


def linear_rates(position: np.ndarray, rate_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration ``(n, 3)`` of a sampled position by central differences."""
    steps = np.diff(position, axis=0) * rate_hz
    velocity = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
    acceleration = np.diff(steps, axis=0) * rate_hz
    return velocity, np.concatenate([acceleration[:1], acceleration, acceleration[-1:]])


def carried(acceleration: np.ndarray, alpha: np.ndarray, omega: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Acceleration at the end of `arm` on a rigid body: ``a + alpha x r + omega x (omega x r)``."""
    return acceleration + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))


def integrate_rotation(start: Rotation, omega: np.ndarray, step_s: float, *, body_axes: bool = False) -> Rotation:
    """Rotations ``(n,)`` whose angular velocity ``(n, 3)`` is sampled evenly; fourth-order Magnus step.

    Parameters
    ----------
    start
        Rotation at the first sample.
    omega
        Angular velocity in global axes, or in the body's with `body_axes`.
    step_s
        Time between samples [s].
    body_axes
        Axes of `omega`.
    """
    first, second = omega[:-1], omega[1:]
    # linear omega within the step: Log = h/2 (w0 + w1) -+ h^2/12 (w0 x w1), sign by the side R' = [w]R or R[w]
    sign = 1.0 if body_axes else -1.0
    vector = 0.5 * step_s * (first + second) + sign * step_s**2 / 12.0 * np.cross(first, second)
    steps = Rotation.from_rotvec(vector).as_quat()
    out = np.empty((len(omega), 4))
    out[0] = start.as_quat()
    for k, step in enumerate(steps):
        product = _times(out[k], step) if body_axes else _times(step, out[k])
        out[k + 1] = product / np.sqrt(product @ product)
    return Rotation.from_quat(out)


def _times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )
