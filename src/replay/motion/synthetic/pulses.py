"""Families of pulses of unit length and height, each with its first and second integral in closed form."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.polynomial import Polynomial

Pulse = Literal["sine_squared", "half_sine", "triangle", "skewed", "double"]
Shape = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Value, first and second integral from 0 of a pulse at ``s`` in [0, 1]."""


def _sine_squared(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    k = 2.0 * np.pi
    return (
        0.5 * (1.0 - np.cos(k * s)),
        0.5 * (s - np.sin(k * s) / k),
        0.5 * (0.5 * s * s + (np.cos(k * s) - 1.0) / (k * k)),
    )


def _half_sine(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    k = np.pi
    return np.sin(k * s), (1.0 - np.cos(k * s)) / k, s / k - np.sin(k * s) / (k * k)


def _triangle(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    late = np.maximum(s - 0.5, 0.0)
    return 2.0 * s - 4.0 * late, s**2 - 2.0 * late**2, s**3 / 3.0 - 2.0 * late**3 / 3.0


def _polynomial(shape: Polynomial, peak: float) -> Shape:
    value = shape / shape(peak)
    first = value.integ()
    second = first.integ()
    return lambda s: (value(s), first(s), second(s))


_S, _REST = Polynomial([0.0, 1.0]), Polynomial([1.0, -1.0])
_FIRST_LOBE, _SECOND_LOBE = _S**3 * _REST**9, _S**9 * _REST**3

PULSES: dict[Pulse, Shape] = {
    "sine_squared": _sine_squared,
    "half_sine": _half_sine,
    "triangle": _triangle,
    # steep rise, long fall: greatest at a quarter
    "skewed": _polynomial(_S**2 * _REST**6, 0.25),
    # two lobes, the second six tenths of the first: helmet contact, then body contact
    "double": _polynomial(_FIRST_LOBE + 0.6 * _SECOND_LOBE, 0.25),
}
"""Pulse families by name; greatest value 1 (`double` to 0.1 %)."""


def pulse(
    family: Pulse, t: np.ndarray, begin: float, duration: float, peak: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value, first and second integral of a pulse at any times.

    Parameters
    ----------
    family
        Shape.
    t
        ``(n,)`` times [s].
    begin, duration
        Start and length [s].
    peak
        Greatest value.
    """
    s = np.clip(t - begin, 0.0, duration) / duration
    beyond = np.maximum(t - begin - duration, 0.0)
    value, first, second = PULSES[family](s)
    end = PULSES[family](np.ones(1))[1][0]
    inside = (t > begin) & (t < begin + duration)
    return (
        np.where(inside, peak * value, 0.0),
        peak * duration * first,
        peak * duration**2 * second + peak * duration * end * beyond,
    )
