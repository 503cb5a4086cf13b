"""Measures of head motion: peaks, HIC, SI, BrIC, DAMAGE.

They describe a motion. None of them is a verdict on a person.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

STANDARD_GRAVITY = 9.80665
BRIC_CRITICAL_RAD_PER_S = (66.25, 56.45, 42.87)
# Stiffness matrix of the three-body model per unit mass [1/s^2], damping ratio to stiffness [s]
# and scale [1/m] of DAMAGE (Gabler, Crandall, Panzer 2019); the scale is not verified here.
_DAMAGE_STIFFNESS = np.array([[32142.0 + 1636.0, 0.0, -1636.0], [0.0, 23493.0, 0.0], [-1636.0, 0.0, 16935.0 + 1636.0]])
_DAMAGE_DAMPING_S = 5.9148e-3
DAMAGE_BETA_UNVERIFIED_PER_M = 2.9903


@dataclass(frozen=True)
class Peak:
    """The greatest value of a history and when it occurs.

    Parameters
    ----------
    value
        In the unit of the history.
    time_s
        Time of the sample that holds it; the first of equal ones.
    """

    value: float
    time_s: float


@dataclass(frozen=True)
class HicResult:
    """A head injury criterion and its window.

    Parameters
    ----------
    value
        (t2 - t1) mean(a)^2.5, a in g, t in s; customarily quoted without a unit.
    start_s, end_s
        The window that gives it.
    """

    value: float
    start_s: float
    end_s: float


def resultant(vectors: ArrayLike) -> NDArray[np.float64]:
    """Length of each row of ``(n, 3)`` vectors; an ``(n,)`` history passes as its absolute value."""
    array = np.asarray(vectors, dtype=float)
    return np.abs(array) if array.ndim == 1 else np.sqrt((array * array).sum(axis=1))


def peak(time_s: ArrayLike, history: ArrayLike) -> Peak:
    """Return the peak of a history ``(n,)`` or of the resultant of an ``(n, 3)`` one.

    Raises
    ------
    ValueError
        When times do not rise or a value is not finite.
    """
    time, values = _checked(time_s, resultant(history))
    at = int(np.argmax(values))
    return Peak(float(values[at]), float(time[at]))


def hic(time_s: ArrayLike, acceleration_m_per_s2: ArrayLike, window_s: float) -> HicResult:
    """Head injury criterion, the exact maximum over all windows of the sampled history.

    max over t1 < t2 <= t1 + window of (t2 - t1) [int a dt / (t2 - t1)]^2.5, a in g, the
    integral by the trapezoidal rule between samples (Versace 1971; SAE J885).

    Parameters
    ----------
    time_s : (n,)
        Sample times [s], rising, not necessarily uniform.
    acceleration_m_per_s2 : (n,) or (n, 3)
        Acceleration of the head's centre of gravity [m/s^2].
    window_s
        Longest window [s]: 0.015 for HIC15, 0.036 for HIC36.

    Returns
    -------
    HicResult

    Raises
    ------
    ValueError
        When times do not rise, a value is not finite, or the window is not positive.
    """
    if not window_s > 0:
        message = f"a window of {window_s} s: it must be positive"
        raise ValueError(message)
    time, values = _checked(time_s, resultant(acceleration_m_per_s2) / STANDARD_GRAVITY)
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
    best = HicResult(0.0, float(time[0]), float(time[0]))
    longest = window_s * (1 + 1e-9)
    for lag in range(1, time.size):
        span = time[lag:] - time[:-lag]
        allowed = span <= longest
        if not allowed.any():
            break
        gain = velocity[lag:] - velocity[:-lag]
        criterion = np.where(allowed, gain * (gain / span) ** 1.5, 0.0)
        at = int(np.argmax(criterion))
        if criterion[at] > best.value:
            best = HicResult(float(criterion[at]), float(time[at]), float(time[at + lag]))
    return best


def severity_index(time_s: ArrayLike, acceleration_m_per_s2: ArrayLike) -> float:
    """Gadd's severity index: int a^2.5 dt, a in g, by the trapezoidal rule.

    Parameters
    ----------
    time_s : (n,)
        Sample times [s], rising.
    acceleration_m_per_s2 : (n,) or (n, 3)
        Acceleration of the head's centre of gravity [m/s^2].
    """
    time, values = _checked(time_s, resultant(acceleration_m_per_s2) / STANDARD_GRAVITY)
    return float(np.trapezoid(values**2.5, time))


def bric(angular_velocity_head_rad_per_s: ArrayLike) -> float:
    """Brain injury criterion: sqrt(sum (max|omega_i| / omega_ic)^2), critical 66.25, 56.45, 42.87 rad/s.

    Parameters
    ----------
    angular_velocity_head_rad_per_s : (n, 3)
        In head axes (Takhounts et al. 2013).
    """
    omega = np.asarray(angular_velocity_head_rad_per_s, dtype=float)
    if omega.ndim != 2 or omega.shape[1] != 3 or not np.isfinite(omega).all():
        message = f"angular velocity of shape {omega.shape}: (n, 3) finite values are needed"
        raise ValueError(message)
    return float(np.sqrt(((np.abs(omega).max(axis=0) / BRIC_CRITICAL_RAD_PER_S) ** 2).sum()))


def damage_deflection(time_s: ArrayLike, angular_acceleration_head_rad_per_s2: ArrayLike) -> float:
    """Greatest deflection max|d| [m] of DAMAGE's coupled three-degree-of-freedom oscillator.

    d'' + C d' + K d = alpha, with C = a1 K, started at rest; exact for an acceleration that
    is linear between uniform samples. DAMAGE itself is this times a scale whose published
    value, `DAMAGE_BETA_UNVERIFIED_PER_M`, has not been verified here.

    Parameters
    ----------
    time_s : (n,)
        Uniform sample times [s].
    angular_acceleration_head_rad_per_s2 : (n, 3)
        In head axes.
    """
    alpha = np.asarray(angular_acceleration_head_rad_per_s2, dtype=float)
    time, _ = _checked(time_s, resultant(alpha))
    zero, one = np.zeros((3, 3)), np.eye(3)
    from scipy.signal import StateSpace, lsim  # a second to import, and other rooms' numbers do not need it

    system = StateSpace(
        np.block([[zero, one], [-_DAMAGE_STIFFNESS, -_DAMAGE_DAMPING_S * _DAMAGE_STIFFNESS]]),
        np.vstack([zero, one]),
        np.hstack([one, zero]),
        zero,
    )
    uniform = np.linspace(0.0, time[-1] - time[0], time.size)
    if np.abs(time - time[0] - uniform).max() > 1e-6 * (time[1] - time[0]):
        message = "DAMAGE needs uniform samples; resample first"
        raise ValueError(message)
    _, deflection, _ = lsim(system, alpha, uniform)
    return float(np.sqrt((deflection**2).sum(axis=1)).max())


def _checked(time_s: ArrayLike, values: NDArray) -> tuple[NDArray, NDArray]:
    time = np.asarray(time_s, dtype=float)
    if time.ndim != 1 or time.size != values.size or time.size < 2:
        message = f"{time.size} times for {values.size} values: two or more of each are needed"
        raise ValueError(message)
    if not (np.isfinite(time).all() and np.isfinite(values).all()):
        row = int(np.flatnonzero(~(np.isfinite(time) & np.isfinite(values)))[0])
        message = f"sample {row + 1} is not a finite number"
        raise ValueError(message)
    if not (np.diff(time) > 0).all():
        message = f"time does not rise after sample {int(np.flatnonzero(np.diff(time) <= 0)[0]) + 1}"
        raise ValueError(message)
    return time, values
