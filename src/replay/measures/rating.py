"""ISO/TS 18571: how well one history follows another, from 0 to 1.

Four scores of two non-ambiguous histories at 10 kHz: corridor (how far apart they lie), and, after
the shift that correlates them best, phase (how far that shift is), magnitude (what is left between
them when time may be warped) and slope. Published constants; the text of the standard is not here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

RATE_HZ = 10_000.0
"""Sampling rate of the standard."""
_INNER, _OUTER, _CORRIDOR_POWER = 0.05, 0.50, 2
_MOST_SHIFT = 0.20
_WARP_WINDOW, _MOST_MAGNITUDE = 0.10, 0.50
_SMOOTHED, _MOST_SLOPE = 9, 2.0
_GRADES = ((0.94, "excellent"), (0.80, "good"), (0.58, "fair"))


@dataclass(frozen=True)
class Rating:
    """Scores from 0 to 1, and the shift [samples, positive: the comparison lags] that phase is scored by."""

    corridor: float
    phase: float
    magnitude: float
    slope: float
    shift: int

    @property
    def overall(self) -> float:
        """0.4 corridor + 0.2 phase + 0.2 magnitude + 0.2 slope."""
        return 0.4 * self.corridor + 0.2 * (self.phase + self.magnitude + self.slope)

    @property
    def grade(self) -> str:
        """Excellent, good, fair or poor, by the standard's bounds 0.94, 0.80 and 0.58."""
        return next((word for bound, word in _GRADES if self.overall > bound), "poor")


def rate(reference_time_s: ArrayLike, reference: ArrayLike, time_s: ArrayLike, values: ArrayLike) -> Rating:
    """Rate a scalar history against its reference over the span that both cover, resampled to 10 kHz.

    Parameters
    ----------
    reference_time_s, time_s : (n,), (k,)
        Rising times [s].
    reference, values : (n,), (k,)
        In one unit.

    Raises
    ------
    ValueError
        When they share fewer than 1 ms, or one of them is constant there.
    """
    t_reference, t_values = np.asarray(reference_time_s, dtype=float), np.asarray(time_s, dtype=float)
    r, v = np.asarray(reference, dtype=float), np.asarray(values, dtype=float)
    start, end = max(t_reference[0], t_values[0]), min(t_reference[-1], t_values[-1])
    at = start + np.arange(int(np.floor((end - start) * RATE_HZ + 1e-6)) + 1) / RATE_HZ
    return iso_18571(np.interp(at, t_reference, r), np.interp(at, t_values, v))


def iso_18571(reference: ArrayLike, values: ArrayLike) -> Rating:
    """Rate a history at 10 kHz against its reference.

    Parameters
    ----------
    reference, values : (n,), (n,)
        Samples at the same times.

    Raises
    ------
    ValueError
        For fewer than ten samples, or a constant history: it has no correlation.
    """
    r, v = np.asarray(reference, dtype=float), np.asarray(values, dtype=float)
    if len(r) < 10 or len(r) != len(v) or np.ptp(r) == 0.0 or np.ptp(v) == 0.0:
        message = f"{len(r)} and {len(v)} samples, of which one history is too short or constant"
        raise ValueError(message)
    shift = _best_shift(r, v)
    r_shifted, v_shifted = _overlap(r, v, shift)
    most = _MOST_SHIFT * len(r)
    return Rating(
        corridor=_corridor(r, v),
        phase=max(0.0, 1.0 - abs(shift) / most),
        magnitude=_share(_magnitude(r_shifted, v_shifted), _MOST_MAGNITUDE),
        slope=_share(_slope(r_shifted, v_shifted), _MOST_SLOPE),
        shift=shift,
    )


def _share(error: float, most: float) -> float:
    return max(0.0, 1.0 - error / most)


def _corridor(r: NDArray[np.float64], v: NDArray[np.float64]) -> float:
    """Mean over the samples: 1 within 5 % of the peak, 0 beyond 50 %, a parabola between."""
    peak = np.abs(r).max()
    between = (_OUTER * peak - np.abs(r - v)) / ((_OUTER - _INNER) * peak)
    return float((np.clip(between, 0.0, 1.0) ** _CORRIDOR_POWER).mean())


def _overlap(r: NDArray[np.float64], v: NDArray[np.float64], shift: int) -> tuple[NDArray, NDArray]:
    """Samples that meet when `v` is moved earlier by `shift`."""
    if shift >= 0:
        return r[: len(r) - shift], v[shift:]
    return r[-shift:], v[: len(v) + shift]


def _best_shift(r: NDArray[np.float64], v: NDArray[np.float64]) -> int:
    """Shift of the greatest correlation coefficient; the shorter of two equally good, the earlier of two as short."""
    best, found = -np.inf, 0
    for size in range(int(np.floor(_MOST_SHIFT * len(r))) + 1):
        for shift in (size, -size) if size else (0,):
            a, b = _overlap(r, v, shift)
            a, b = a - a.mean(), b - b.mean()
            scale = np.sqrt((a * a).sum() * (b * b).sum())  # not BLAS: its sums depend on the number of threads
            correlation = float((a * b).sum() / scale) if scale > 0 else -np.inf
            if correlation > best:
                best, found = correlation, shift
    return found


def _magnitude(r: NDArray[np.float64], v: NDArray[np.float64]) -> float:
    """Sum of |v - r| over that of |r|, along the path of dynamic time warping."""
    i, j = _warp(v, r, int(np.ceil(_WARP_WINDOW * len(r))) - 1)
    size = np.abs(r[j]).sum()
    return float(np.abs(v[i] - r[j]).sum() / size) if size > 0 else np.inf


def _warp(x: NDArray[np.float64], y: NDArray[np.float64], width: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cheapest path of squared differences from the first pair to the last, with ``|i - j| <= width``.

    Anti-diagonal by anti-diagonal, so that each is one vector operation; a step advances either index or both.
    """
    n = len(x)
    before, last = np.full(n + 1, np.inf), np.full(n + 1, np.inf)  # index i + 1
    choices: list[tuple[int, NDArray[np.int8]]] = []
    for d in range(2 * n - 1):
        low = max(0, d - n + 1, -((width - d) // 2))
        high = min(n - 1, d, (d + width) // 2)
        i = np.arange(low, high + 1)
        came = np.stack([last[i], last[i + 1], before[i]])  # from (i-1, j), (i, j-1), (i-1, j-1)
        step = came.argmin(axis=0).astype(np.int8)
        now = np.full(n + 1, np.inf)
        now[i + 1] = (x[i] - y[d - i]) ** 2 + (came.min(axis=0) if d else 0.0)
        choices.append((low, step))
        before, last = last, now
    at_x, at_y = n - 1, n - 1
    path = [(at_x, at_y)]
    while at_x or at_y:
        low, step = choices[at_x + at_y]
        taken = int(step[at_x - low])
        at_x, at_y = at_x - (taken != 1), at_y - (taken != 0)
        path.append((at_x, at_y))
    found = np.array(path[::-1], dtype=np.int64)
    return found[:, 0], found[:, 1]


def _slope(r: NDArray[np.float64], v: NDArray[np.float64]) -> float:
    """Sum of the difference of smoothed slopes over that of the reference's slope."""
    slope_r, slope_v = _smoothed(np.gradient(r)), _smoothed(np.gradient(v))
    size = np.abs(slope_r).sum()
    return float(np.abs(slope_v - slope_r).sum() / size) if size > 0 else np.inf


def _smoothed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over nine samples, over fewer towards the ends."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    k = np.arange(len(values))
    half = np.minimum(np.minimum(k, len(values) - 1 - k), _SMOOTHED // 2)
    return (sums[k + half + 1] - sums[k - half]) / (2 * half + 1)
