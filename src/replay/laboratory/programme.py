"""What is done to a specimen over time: a named test, its rate, and the strains it goes through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError

#: Tests of the laboratory: whether the sides are free, whether the first strain is shear, and what is done.
MODES: dict[str, tuple[bool, bool, str]] = {
    "compression": (True, False, "pressed between lubricated platens at a constant nominal rate; free sides"),
    "tension": (True, False, "pulled at a constant nominal rate; free sides"),
    "simple_shear": (False, True, "sheared at a constant rate; the strain is the amount of shear"),
    "confined": (False, False, "pressed in a rigid die at a constant nominal rate"),
    "cyclic": (True, False, "pressed and released three times at a constant nominal rate; free sides"),
    "relaxation": (True, False, "pressed at the rate, then held a hundred times as long; free sides"),
}
_CYCLES = 3
_HOLD = 100.0


@dataclass(frozen=True)
class Programme:
    """A test over time.

    Parameters
    ----------
    mode
        One of `MODES`.
    rate_per_s
        Nominal strain rate of its ramps [1/s].
    times : (n,) float64
        From 0, increasing [s].
    strains : (n,) float64
        Nominal strain, positive in the sense of the test: compression, elongation, or amount of shear.
    """

    mode: str
    rate_per_s: float
    times: NDArray[np.float64]
    strains: NDArray[np.float64]

    @property
    def free_sides(self) -> bool:
        """Whether the specimen may widen."""
        return MODES[self.mode][0]

    @property
    def sheared(self) -> bool:
        """Whether the strain is an amount of shear."""
        return MODES[self.mode][1]

    @property
    def stretches(self) -> NDArray[np.float64]:
        """Axial stretch, or amount of shear."""
        if self.sheared:
            return self.strains
        return 1.0 + self.strains if self.mode == "tension" else 1.0 - self.strains


def programme(mode: str, rate_per_s: float, strain: float, steps: int = 300) -> Programme:
    """One of the laboratory's tests.

    Parameters
    ----------
    mode
        One of `MODES`.
    rate_per_s
        Nominal strain rate [1/s].
    strain
        Largest nominal strain, positive.
    steps
        Steps of one ramp.

    Raises
    ------
    InputError
        For a test that does not exist, or a rate or strain that cannot be.
    """
    where = "laboratory"
    if mode not in MODES:
        raise InputError(where, f"{mode!r} is no test", column="mode", expected=", ".join(MODES))
    if not 0 < rate_per_s < np.inf:
        raise InputError(where, f"it is {rate_per_s!r}", column="rate_per_s", expected="a positive rate")
    most = 10.0 if MODES[mode][1] or mode == "tension" else 0.95
    if not 0 < strain <= most:
        raise InputError(where, f"it is {strain!r}", column="strain", expected=f"above 0, at most {most:g}")
    ramp = np.linspace(0.0, strain, steps + 1)
    time = ramp / rate_per_s
    if mode == "cyclic":
        up, down = ramp[1:], ramp[-2::-1]
        strains = np.concatenate([[0.0], *[np.concatenate([up, down]) for _ in range(_CYCLES)]])
        return Programme(mode, rate_per_s, time[1] * np.arange(len(strains)), strains)
    if mode == "relaxation":
        hold = time[-1] * (1.0 + np.geomspace(1e-3, _HOLD, steps))
        return Programme(mode, rate_per_s, np.append(time, hold), np.append(ramp, np.full(steps, strain)))
    return Programme(mode, rate_per_s, time, ramp)
