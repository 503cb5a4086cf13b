"""Shapes that an impact may have in time: what the read-out between frames averages over.

A shape is a few functions of time with prior variances; the motion is their sum with one 3-vector each. Two kinds:

- *pulse*: the rate rises by one sin^2 pulse of acceleration and is taken away by a slower one;
- *event-aligned*: the acceleration is a random function whose strength depends on the time since the event alone.

The first is sharp and may be wrong, the second is vague and seldom is. Nothing here knows a frame rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

STEP_S = 5.0e-4
"""Grid on which shapes are tabulated [s]."""
_BEFORE_S, _AFTER_S = 0.060, 0.300
_SHARE, _SHARE_SPREAD = 0.75, 0.35
"""Mean and standard deviation of the share of the gained rate that the arrest takes away."""


@dataclass(frozen=True)
class Shape:
    """One shape, tabulated around its event at time 0.

    Parameters
    ----------
    name
        Kind and durations.
    time_s
        ``(m,)`` grid [s]; functions are constant beyond its ends.
    rate
        ``(m, r)`` functions of unit size whose sum is the rate (angular velocity, or linear velocity).
    slope
        ``(m, r)`` their time derivatives [1/s]; zero beyond the ends.
    """

    name: str
    time_s: np.ndarray
    rate: np.ndarray
    slope: np.ndarray

    def at(self, since_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Integral of the rate, rate and slope ``(..., r)`` at any times since the event."""
        level = np.cumsum(self.rate, axis=0) * STEP_S - 0.5 * STEP_S * self.rate
        place = (since_s - self.time_s[0]) / STEP_S
        index = np.clip(np.floor(place).astype(int), 0, len(self.time_s) - 2)
        share = np.clip(place - index, 0.0, 1.0)[..., None]
        beyond = np.maximum(since_s - self.time_s[-1], 0.0)[..., None]
        out = [(1.0 - share) * table[index] + share * table[index + 1] for table in (level, self.rate, self.slope)]
        inside = (beyond == 0.0) & (since_s >= self.time_s[0])[..., None]
        return out[0] + beyond * self.rate[-1], out[1], np.where(inside, out[2], 0.0)


def _grid() -> np.ndarray:
    return np.arange(-_BEFORE_S, _AFTER_S + 0.5 * STEP_S, STEP_S)


def _rise(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Integral from 0 to 1 of a sin^2 pulse over 0 < x < 1, and the pulse."""
    s = np.clip(x, 0.0, 1.0)
    return s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi), np.where((x > 0) & (x < 1), 1.0 - np.cos(2.0 * np.pi * s), 0.0)


def pulse(duration_s: float, arrest_s: float) -> Shape:
    """Return a pulse of `duration_s` centred on the event, and an arrest of `arrest_s` that follows it.

    Two functions: a pulse whose arrest takes away its usual share, and a little more or less of the arrest.
    """
    t = _grid()
    up, up_slope = _rise(t / duration_s + 0.5)
    down, down_slope = _rise((t - 0.5 * duration_s) / arrest_s)
    rate = np.stack([up - _SHARE * down, _SHARE_SPREAD * down], axis=1)
    slope = np.stack(
        [up_slope / duration_s - _SHARE * down_slope / arrest_s, _SHARE_SPREAD * down_slope / arrest_s], axis=1
    )
    return Shape(f"pulse {duration_s * 1e3:g}/{arrest_s * 1e3:g} ms", t, rate, slope)


def event_aligned(duration_s: float, rank: int = 8) -> Shape:
    """Random acceleration that sets in with the event, decays with `duration_s`, and leaves a slow rest.

    The first `rank` principal functions of the rate, scaled to their standard deviations. The fast part is
    correlated over a third of its duration, the slow rest (of the neck) over 25 ms and lasts 80 ms.
    """
    t = _grid()
    covariance = np.zeros((len(t), len(t)))
    since = t + 0.5 * duration_s
    for decay, correlation, size in ((duration_s, duration_s / 3.0, 1.0), (0.080, 0.025, 0.5)):
        envelope = np.where(
            since > 0, np.minimum(since / (0.5 * decay), 1.0) * np.exp(-np.maximum(since, 0) / decay), 0.0
        )
        acceleration = np.exp(-0.5 * ((t[:, None] - t) / correlation) ** 2) * np.outer(envelope, envelope)
        rate = np.cumsum(np.cumsum(acceleration, axis=0), axis=1) * STEP_S**2
        covariance += size**2 * rate / np.diag(rate).max()
    values, vectors = np.linalg.eigh(covariance)
    functions = (vectors[:, ::-1] * np.sqrt(np.maximum(values[::-1], 0.0)))[:, :rank]
    functions = functions - functions[0]
    functions *= np.sign(functions[np.argmax(np.abs(functions), axis=0), np.arange(rank)])
    return Shape(f"event {duration_s * 1e3:g} ms", t, functions, np.gradient(functions, STEP_S, axis=0))


@cache
def few_shapes() -> tuple[Shape, ...]:
    """Return shapes far enough apart to find an event's instant by."""
    pulses = tuple(pulse(d, a) for d in (0.008, 0.015, 0.028) for a in (0.020, 0.050, 0.120))
    return (*pulses, event_aligned(0.016))


@cache
def shapes() -> tuple[Shape, ...]:
    """Return the shapes that are averaged over; neighbours differ by less than good footage could tell."""
    durations = (0.005, 0.007, 0.0095, 0.0125, 0.0165, 0.022, 0.030)
    pulses = tuple(pulse(d, a) for d in durations for a in (0.015, 0.030, 0.055, 0.090, 0.140))
    return (*pulses, *(event_aligned(d) for d in (0.008, 0.012, 0.018, 0.027)))


def background(
    time_s: np.ndarray, fine_s: np.ndarray, *, correlation_s: float = 0.150
) -> tuple[np.ndarray, np.ndarray]:
    """Slow motion of a head that nobody struck: functions of unit size over a clip.

    A constant and the leading principal functions of a squared-exponential process.

    Returns
    -------
    rate, slope
        ``(fine, r)`` functions and their derivatives on the fine grid.
    """
    nodes = np.linspace(time_s[0], time_s[-1], max(8, int(np.ceil((time_s[-1] - time_s[0]) / (0.25 * correlation_s)))))
    kernel = np.exp(-0.5 * ((nodes[:, None] - nodes) / correlation_s) ** 2)
    values, vectors = np.linalg.eigh(kernel)
    kept = values > 1e-3 * values.max()
    cross = np.exp(-0.5 * ((fine_s[:, None] - nodes) / correlation_s) ** 2)
    functions = cross @ (vectors[:, kept] / np.sqrt(values[kept]))
    rate = np.concatenate([np.ones((len(fine_s), 1)), functions], axis=1)
    return rate, np.gradient(rate, fine_s, axis=0)
