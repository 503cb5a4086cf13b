"""Bands that were made to cover: from draws of the posterior to a number with its 95 % band.

The posterior knows the noise of the clicks but not how real motions differ from its shapes. So its centre is shifted
and its spread multiplied by constants under which, on motions with a known truth, 95 % of the truths lay inside
(split conformal, by the width of the posterior, with a factor for the frame rate). The constants lie in
``data/bands.yaml``, made by ``benchmarks/calibrate_bands.py``. A band too wide to be a measurement is replaced by the
words for it.

The instant of peak angular acceleration is no centre with a width: impacts have several lobes of like height, and which
is greatest is often not in the footage. Its band is the set of instants at which the drawn motions' acceleration, each
over its own peak, is in the mean above a calibrated share of its greatest: one interval, or several that compete.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from replay.motion.kinematics import STANDARD_GRAVITY

CONSTANTS_FILE = Path(__file__).with_name("data") / "bands.yaml"
NOT_RESOLVABLE = "not resolvable from this footage"
WIDEST_RATIO = 3.0
"""A peak whose upper bound is further than this from its lower one is not measured."""
WIDEST_INSTANT_S = 0.040
"""An instant whose band is longer than this, all its parts together, is not measured [s]."""
LEAST_EVENT = 0.5
"""Probability of an impact below which it has no instant."""
INSTANTS = ("t0_s", "onset_s")
RATIOS = ("omega_rad_per_s", "alpha_rad_per_s2", "a_m_per_s2", "a_across_m_per_s2", "a_along_m_per_s2")
"""Peaks, whose errors are shares."""
QUANTITIES = (*RATIOS, *INSTANTS)
CURVES = ("omega", "alpha", "a")
"""Curves over time, whose bands are a multiple of the posterior's standard deviation."""
BEFORE = ("velocity", "omega")
"""Velocities just before the impact, whose bands are too."""
_LEAST = {"onset_s": 2.0e-3, "omega_rad_per_s": 0.01}
_LEAST_SHARE = 0.05


@dataclass(frozen=True)
class Part:
    """One interval of a band that is not in one piece, and the chance that it is the one."""

    low: float
    high: float
    chance: float


@dataclass(frozen=True)
class Band:
    """A number with its 95 % band; ``resolved`` is False where the band is too wide to be a measurement.

    Parameters
    ----------
    value, low, high
        Most likely value, and ends of the band.
    resolved
        See above.
    parts
        Intervals that the band consists of, where it is not in one piece.
    """

    value: float
    low: float
    high: float
    resolved: bool
    parts: tuple[Part, ...] = ()

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end."""
        return self.low, self.high

    def of_event(self, probability: float) -> Band:
        """The same band of an instant, not resolved where there hardly was an event."""
        return replace(self, resolved=self.resolved and probability >= LEAST_EVENT)

    def covers(self, truth: float) -> bool:
        """Whether a value lies in the band."""
        pieces = [(part.low, part.high) for part in self.parts] or [(self.low, self.high)]
        return any(low <= truth <= high for low, high in pieces)

    def text(self, scale: float = 1.0, form: str = ".3g") -> str:
        """``value (low to high)``, the parts that compete, or the words that say there is none."""
        if not self.resolved:
            return NOT_RESOLVABLE
        if self.parts:
            pieces = (f"{p.low / scale:{form}} to {p.high / scale:{form}} ({100 * p.chance:.0f} %)" for p in self.parts)
            return " or ".join(pieces)
        value, low, high = (f"{x / scale:{form}}" for x in (self.value, *self.ends))
        return f"{value} ({low} to {high})"


@dataclass(frozen=True)
class Spread:
    """Centre and half-width (one sigma) of a quantity's draws; of its logarithm for a peak."""

    centre: float
    width: float


def spread(name: str, values: np.ndarray) -> Spread:
    """Median and half the distance between the 16th and 84th percentile of the draws."""
    return spread_of(name, *np.quantile(values, [0.16, 0.5, 0.84]))


def spread_of(name: str, *quantiles: float) -> Spread:
    """`spread` from the 16th, 50th and 84th percentile of the draws."""
    x = np.log(np.maximum(quantiles, 1e-12)) if name in RATIOS else np.asarray(quantiles)
    return Spread(float(x[1]), max(0.5 * float(x[2] - x[0]), _LEAST.get(name, _LEAST_SHARE)))


@dataclass(frozen=True)
class Calibration:
    """Constants of one quantity, interpolated over the logarithm of the posterior's width.

    Parameters
    ----------
    widths
        Knots. A posterior surer than the first, that of the calibration's sharpest third, counts as that one: it does
        not know how far its shapes are from the truth.
    shift
        Added to the centre, in widths.
    below, above
        Distance of either bound from the shifted centre, in widths: frames oftener miss a peak than invent one.
    factor
        Of both distances, by frame rate.
    """

    widths: tuple[float, ...]
    shift: tuple[float, ...]
    below: tuple[float, ...]
    above: tuple[float, ...]
    factor: tuple[float, ...]

    def at(self, width: float) -> np.ndarray:
        """Shift, and distances below and above."""
        knots = np.log(self.widths)
        return np.array([np.interp(np.log(width), knots, values) for values in (self.shift, self.below, self.above)])


@dataclass(frozen=True)
class Constants:
    """Everything in ``data/bands.yaml``; what goes by frame rate is interpolated over its logarithm.

    Parameters
    ----------
    rates
        Frame rates of the calibration [Hz].
    peaks
        By quantity.
    curves, before
        Multiples of the standard deviation.
    instant, instant_odds
        Least share of its greatest value that the drawn motions' mean relative acceleration has at t0; power of it
        that the chances of several lobes go with.
    calibrated
        Range of each fact of the footage.
    """

    rates: tuple[float, ...]
    peaks: dict[str, Calibration]
    curves: dict[str, tuple[float, ...]]
    before: dict[str, float]
    instant: float
    instant_odds: float
    calibrated: dict[str, tuple[float, float]]

    @classmethod
    def of(cls, raw: dict[str, Any]) -> Constants:
        """From the file's content."""
        return cls(
            tuple(raw["rates"]),
            {n: Calibration(**{k: tuple(v) for k, v in known.items()}) for n, known in raw["peaks"].items()},
            {n: tuple(v) for n, v in raw["curves"].items()},
            {n: float(v) for n, v in raw["before"].items()},
            float(raw["instant"]),
            float(raw["instant_odds"]),
            {n: (float(v[0]), float(v[1])) for n, v in raw["calibrated"].items()},
        )

    def at_rate(self, values: tuple[float, ...], fps: float) -> float:
        """One of the constants at a frame rate; the nearest beyond the ends."""
        return float(np.interp(np.log(fps), np.log(self.rates), values))

    def apply(self, name: str, found: Spread, fps: float) -> Band:
        """Shift and widen."""
        known = self.peaks[name]
        width, factor = max(found.width, known.widths[0]), self.at_rate(known.factor, fps)
        shift, below, above = known.at(width) * [width, factor * width, factor * width]
        centre = found.centre + shift
        if name in RATIOS:
            low, value, high = (float(np.exp(x)) for x in (centre - below, centre, centre + above))
            return Band(value, low, high, high <= WIDEST_RATIO * low)
        return Band(centre, centre - below, centre + above, below + above <= WIDEST_INSTANT_S)

    def instants(self, time_s: np.ndarray, relative_alpha: np.ndarray) -> Band:
        """Band of t0: the level set, and the chance of each of its pieces.

        Chances go with a power of the pieces' greatest relative acceleration, the likeliest where true lobes are known.

        Parameters
        ----------
        time_s, relative_alpha
            ``(g,)`` grid [s], and mean over the draws of angular acceleration over its peak.
        """
        half = 0.5 * float(time_s[1] - time_s[0])
        pieces = level_set(relative_alpha, self.instant)
        odds = np.array([relative_alpha[a:b].max() for a, b in pieces]) ** self.instant_odds
        parts = tuple(
            Part(float(time_s[a]) - half, float(time_s[b - 1]) + half, float(chance))
            for (a, b), chance in zip(pieces, odds / odds.sum())
        )
        return Band(
            value=float(time_s[np.argmax(relative_alpha)]),
            low=parts[0].low,
            high=parts[-1].high,
            resolved=sum(part.high - part.low for part in parts) <= WIDEST_INSTANT_S,
            parts=parts if len(parts) > 1 else (),
        )


def level_set(curve: np.ndarray, share: float) -> np.ndarray:
    """First and past-last index ``(n, 2)`` of the pieces in which a curve is above a share of its greatest."""
    inside = np.concatenate([[0], (curve >= share * curve.max()).astype(int), [0]])
    return np.flatnonzero(np.diff(inside)).reshape(-1, 2)


@cache
def constants() -> Constants:
    """Read the shipped constants."""
    return Constants.of(yaml.safe_load(CONSTANTS_FILE.read_text(encoding="utf-8")))


def band(name: str, values: np.ndarray, fps: float) -> Band:
    """Calibrated band of a peak or of the onset from its draws ``(n,)``."""
    return constants().apply(name, spread(name, values), fps)


UNITS = {
    "omega_rad_per_s": ("peak angular velocity", "rad/s", 1.0),
    "alpha_rad_per_s2": ("peak angular acceleration", "rad/s^2", 1.0),
    "a_m_per_s2": ("peak acceleration of the CG", "g", STANDARD_GRAVITY),
    "a_across_m_per_s2": ("  its part across the line of sight", "g", STANDARD_GRAVITY),
    "a_along_m_per_s2": ("  its part along the line of sight", "g", STANDARD_GRAVITY),
    "t0_s": ("instant of peak angular acceleration", "ms", 1.0e-3),
    "onset_s": ("onset of the impact", "ms", 1.0e-3),
}
"""Words, unit and its size in SI of every quantity with a band."""
