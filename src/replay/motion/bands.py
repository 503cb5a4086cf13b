"""Bands that were made to cover: from draws of the posterior to a number with its 95 % band.

The posterior knows the noise of the clicks but not how real motions differ from its shapes. So its centre is shifted
and its spread multiplied by constants under which, on motions with a known truth, 95 % of the truths lay inside
(split conformal, by the width of the posterior). The constants lie in ``data/bands.yaml``, made by
``benchmarks/calibrate_bands.py``. A band too wide to be a measurement is replaced by the words for it.
"""

from __future__ import annotations

from dataclasses import dataclass
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
"""An instant whose band is wider than this is not measured [s]."""
RATIOS = ("omega_rad_per_s", "alpha_rad_per_s2", "a_m_per_s2", "a_across_m_per_s2", "a_along_m_per_s2")
"""Peaks, whose errors are shares."""
QUANTITIES = (*RATIOS, "t0_s")
CURVES = ("omega", "alpha", "a")
"""Curves over time, whose bands are a multiple of the posterior's standard deviation."""
_LEAST = {"t0_s": 5.0e-4, "omega_rad_per_s": 0.01}
_LEAST_SHARE = 0.05


@dataclass(frozen=True)
class Band:
    """A number with its 95 % band; ``resolved`` is False where the band is too wide to be a measurement."""

    value: float
    low: float
    high: float
    resolved: bool

    def text(self, scale: float = 1.0, digits: int = 3) -> str:
        """``value (low to high)``, or the words that say there is none."""
        if not self.resolved:
            return NOT_RESOLVABLE
        return f"{self.value / scale:.{digits}g} ({self.low / scale:.{digits}g} to {self.high / scale:.{digits}g})"


@dataclass(frozen=True)
class Spread:
    """Centre and half-width (one sigma) of a quantity's draws; of its logarithm for a peak."""

    centre: float
    width: float


def spread(name: str, values: np.ndarray) -> Spread:
    """Median and half the distance between the 16th and 84th percentile of the draws."""
    x = np.log(np.maximum(values, 1e-12)) if name in RATIOS else values
    low, middle, high = np.quantile(x, [0.16, 0.5, 0.84])
    return Spread(float(middle), max(0.5 * float(high - low), _LEAST.get(name, _LEAST_SHARE)))


@dataclass(frozen=True)
class Calibration:
    """Constants of one quantity, interpolated over the logarithm of the posterior's width.

    Parameters
    ----------
    widths
        Knots.
    shift
        Added to the centre, in widths.
    reach
        Distance of either bound from the shifted centre, in widths.
    """

    widths: tuple[float, ...]
    shift: tuple[float, ...]
    reach: tuple[float, ...]

    def apply(self, name: str, found: Spread) -> Band:
        """Shift and widen."""
        at = float(np.log(found.width))
        knots = np.log(self.widths)
        shift, reach = (float(np.interp(at, knots, values)) for values in (self.shift, self.reach))
        centre = found.centre + shift * found.width
        bounds = centre - reach * found.width, centre, centre + reach * found.width
        if name in RATIOS:
            low, value, high = (float(np.exp(x)) for x in bounds)
            return Band(value, low, high, high <= WIDEST_RATIO * low)
        low, value, high = bounds
        return Band(value, low, high, high - low <= WIDEST_INSTANT_S)


@dataclass(frozen=True)
class Constants:
    """Everything in ``data/bands.yaml``."""

    peaks: dict[str, Calibration]
    curves: dict[str, float]
    calibrated: dict[str, tuple[float, float]]

    @classmethod
    def of(cls, raw: dict[str, Any]) -> Constants:
        """From the file's content."""
        return cls(
            {n: Calibration(**{k: tuple(v) for k, v in c.items()}) for n, c in raw["peaks"].items()},
            {n: float(v) for n, v in raw["curves"].items()},
            {n: (float(v[0]), float(v[1])) for n, v in raw["calibrated"].items()},
        )


@cache
def constants() -> Constants:
    """Read the shipped constants."""
    return Constants.of(yaml.safe_load(CONSTANTS_FILE.read_text(encoding="utf-8")))


def band(name: str, values: np.ndarray) -> Band:
    """Calibrated band of one quantity from its draws ``(n,)``."""
    return constants().peaks[name].apply(name, spread(name, values))


UNITS = {
    "omega_rad_per_s": ("angular velocity", "rad/s", 1.0),
    "alpha_rad_per_s2": ("angular acceleration", "rad/s^2", 1.0),
    "a_m_per_s2": ("CG acceleration, resultant", "g", STANDARD_GRAVITY),
    "a_across_m_per_s2": ("  across the line of sight", "g", STANDARD_GRAVITY),
    "a_along_m_per_s2": ("  along the line of sight", "g", STANDARD_GRAVITY),
    "t0_s": ("instant of peak angular acceleration", "ms", 1.0e-3),
}
"""Words, unit and its size in SI of every quantity with a band."""
