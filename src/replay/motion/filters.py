"""Zero-phase filters whose -3 dB point is stated, on vectors and on rotations.

The moving average is symmetric and applied once: it has no phase to undo. Its amplitude at
frequency F (in cycles per sample) is ``sin(pi F N) / (N sin(pi F))``, so the length with -3 dB at F
is close to ``N = sqrt(0.196202 / F^2 + 1)``; N is odd and whole, so what is achieved is computed.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

_MINUS_3_DB = float(np.sqrt(0.5))
_TWO_PASSES = float((np.sqrt(2.0) - 1.0) ** 0.25)
"""-3 dB of a second-order Butterworth passed twice, over that of one pass (0.8022)."""


def moving_average_length(cutoff_hz: float, rate_hz: float) -> int:
    """Odd number of samples whose symmetric mean has -3 dB nearest `cutoff_hz`; 1 is no filter."""
    exact = np.sqrt(0.196202 / (cutoff_hz / rate_hz) ** 2 + 1.0)
    return max(1, 2 * int(np.floor(exact / 2.0)) + 1)


def moving_average_gain(length: int, frequency_hz: float, rate_hz: float) -> float:
    """Amplitude that a symmetric mean of `length` samples leaves of a sine."""
    x = np.pi * frequency_hz / rate_hz
    return 1.0 if x == 0.0 else float(np.sin(length * x) / (length * np.sin(x)))


def achieved_cutoff(length: int, rate_hz: float) -> float:
    """Frequency [Hz] where a symmetric mean of `length` samples has -3 dB; infinite for length 1."""
    if length == 1:
        return float("inf")

    def excess(share: float) -> float:
        return moving_average_gain(length, share * rate_hz, rate_hz) - _MINUS_3_DB

    return float(brentq(excess, 1e-9, 1.0 / length)) * rate_hz


def moving_average(values: np.ndarray, length: int) -> np.ndarray:
    """Symmetric mean of ``(n, ...)`` samples; the ends are continued by point reflection.

    Point reflection keeps a straight line straight up to its last sample.
    """
    if length == 1:
        return np.array(values, dtype=float)
    padded = _continued(np.asarray(values, dtype=float), length // 2)
    out = np.zeros_like(values, dtype=float)
    for shift in range(length):
        out += padded[shift : shift + len(values)]
    return out / length


def smooth_rotations(rotation: Rotation, length: int) -> Rotation:
    """Symmetric mean of rotations: at each sample, the mean rotation vector to its neighbours."""
    n, half = len(rotation), length // 2
    if half == 0:
        return rotation
    if n <= half:
        message = f"{n} samples are fewer than the filter's half-length {half}"
        raise ValueError(message)
    before = [(rotation[j] * rotation[0].inv()).inv() * rotation[0] for j in range(half, 0, -1)]
    after = [(rotation[n - 1 - j] * rotation[n - 1].inv()).inv() * rotation[n - 1] for j in range(1, half + 1)]
    long = Rotation.concatenate([*before, rotation, *after])
    back = rotation.inv()
    total = np.zeros((n, 3))
    for shift in range(length):
        total += (long[shift : shift + n] * back).as_rotvec()
    return Rotation.from_rotvec(total / length) * rotation


def _continued(values: np.ndarray, half: int) -> np.ndarray:
    if len(values) <= half:
        message = f"{len(values)} samples are fewer than the filter's half-length {half}"
        raise ValueError(message)
    before = 2.0 * values[0] - values[half:0:-1]
    after = 2.0 * values[-1] - values[-2 : -2 - half : -1]
    return np.concatenate([before, values, after])


def butterworth(values: np.ndarray, cutoff_hz: float, rate_hz: float) -> np.ndarray:
    """Second-order Butterworth forward and backward along axis 0; -3 dB of both passes at `cutoff_hz`."""
    return _two_passes(values, cutoff_hz / _TWO_PASSES, rate_hz)


def channel_frequency_class(values: np.ndarray, channel_class: float, rate_hz: float) -> np.ndarray:
    """SAE J211 phaseless filter along axis 0: design frequency 2.0775 CFC, -3 dB at 1.67 CFC."""
    return _two_passes(values, 2.0775 * channel_class, rate_hz)


def channel_frequency_class_cutoff(channel_class: float) -> float:
    """-3 dB of a channel frequency class [Hz]."""
    return 2.0775 * channel_class * _TWO_PASSES


def _two_passes(values: np.ndarray, design_hz: float, rate_hz: float) -> np.ndarray:
    if design_hz >= 0.5 * rate_hz:
        return np.array(values, dtype=float)
    from scipy.signal import butter, sosfiltfilt  # a second to import, and every stage imports this room

    sections = butter(2, design_hz, fs=rate_hz, output="sos")
    pad = min(len(values) - 1, int(np.ceil(3.0 * rate_hz / design_hz)))
    return sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=pad)
