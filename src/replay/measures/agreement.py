"""Do two laboratories recover one motion from one play? (article, discussion: cross-program reliability).

Both motions are brought to one clock first: laboratories cut clips at different frames. Acceleration is
compared across and along the line of sight apart, because footage sees the one as pixels and the other only
as a change of size: along it, two sets of clicks may differ by what their noise alone would show, and no more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.measures.fidelity import Comparison, Motion, compare
from replay.measures.head import resultant
from replay.measures.rating import Rating, rate

ACROSS = "acceleration across the line of sight"
LINEAR = "linear acceleration"
_LEAST_OVERLAP = 0.5


@dataclass(frozen=True)
class Digitisation:
    """What one laboratory made of a play.

    Parameters
    ----------
    name
        Of the laboratory.
    record
        Whole reconstructed motion of the skull CG, on the laboratory's own clock.
    driver
        Target driver, on the same clock.
    t0_s
        Impact reference on that clock [s].
    rate_hz
        Of the footage or sensor [Hz].
    from_camera
        Whether the motion was seen from the origin of the axes; else acceleration is compared whole.
    noise_along_m_per_s2
        Peak of the acceleration along the line of sight that click noise alone shows [m/s^2], or None.
    template
        Landmark to its three coordinates [m]; empty where the bundle has none.
    helmet_to_com_m
        From the template's origin to the skull CG [m], or None.
    cutoffs_hz
        Of the filters, by name.
    video_sha256
        Of the video, "" where it was not logged.
    """

    name: str
    record: Motion
    driver: Motion
    t0_s: float
    rate_hz: float
    from_camera: bool = True
    noise_along_m_per_s2: float | None = None
    template: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    helmet_to_com_m: tuple[float, float, float] | None = None
    cutoffs_hz: Mapping[str, float] = field(default_factory=dict)
    video_sha256: str = ""


@dataclass(frozen=True)
class Agreement:
    """Two digitisations side by side; differences are the second's less the first's.

    Parameters
    ----------
    first, second
        Names of the laboratories.
    clock_shift_samples
        Samples by which the second's clock is behind the first's.
    inputs
        Checks of the inputs by name; a text says why one has no power.
    details
        A sentence for some of them.
    t0_difference_samples
        On the common clock, in samples of the footage.
    quantities
        Quantity to its comparison and rating, over the span of both drivers.
    along_ray_over_noise
        Root mean square of the difference along the line of sight over the peak that noise alone shows.
    velocity_difference_m_per_s, spin_difference_rad_per_s
        Of the drivers where both have begun; the velocity across the line of sight.
    """

    first: str
    second: str
    clock_shift_samples: int
    inputs: dict[str, float | bool | str]
    details: dict[str, str]
    t0_difference_samples: float
    quantities: dict[str, tuple[Comparison, Rating | None]]
    along_ray_over_noise: float | str
    velocity_difference_m_per_s: float
    spin_difference_rad_per_s: float

    def samples_to_peak(self, quantity: str, rate_hz: float) -> float | None:
        """Difference in time to peak, in samples of the footage."""
        delta = self.quantities[quantity][0].delta_time_to_peak_ms
        return None if delta is None else 1e-3 * delta * rate_hz


def agreement(first: Digitisation, second: Digitisation) -> Agreement:
    """Compare two digitisations of one play.

    Raises
    ------
    ValueError
        When their drivers share no time, even on one clock.
    """
    lag = clock_shift(first.record, second.record)
    shift_s = lag * _step(first.record)
    a, b = first.driver, _later(second.driver, shift_s)
    seen = first.from_camera and second.from_camera
    (across_a, along_a), (across_b, along_b) = (_split(m, seen) for m in (a, b))
    quantities = {
        ACROSS if seen else LINEAR: _pair(a, across_a, b, across_b),
        "angular acceleration": _pair(a, a.angular_acceleration_rad_per_s2, b, b.angular_acceleration_rad_per_s2),
        "angular velocity": _pair(a, a.angular_velocity_rad_per_s, b, b.angular_velocity_rad_per_s),
    }
    inputs, details = _inputs(first, second)
    start = max(a.time_s[0], b.time_s[0])
    return Agreement(
        first=first.name,
        second=second.name,
        clock_shift_samples=lag,
        inputs=inputs,
        details=details,
        t0_difference_samples=(second.t0_s + shift_s - first.t0_s) * first.rate_hz,
        quantities=quantities,
        along_ray_over_noise=_along(a, along_a, b, along_b, first, second) if seen else "no camera: compared whole",
        velocity_difference_m_per_s=_distance(_velocity_across(a, start, seen), _velocity_across(b, start, seen)),
        spin_difference_rad_per_s=_distance(
            _at(a, a.angular_velocity_rad_per_s, start), _at(b, b.angular_velocity_rad_per_s, start)
        ),
    )


def clock_shift(first: Motion, second: Motion) -> int:
    """Samples by which the second's clock is behind: the shift at which the angular velocities lie closest.

    Every whole-sample shift is tried that lets half of the shorter record overlap.
    """
    step = _step(first)
    count = int(np.floor((second.time_s[-1] - second.time_s[0]) / step + 1e-6)) + 1
    at = second.time_s[0] + step * np.arange(count)
    b = np.stack([np.interp(at, second.time_s, c) for c in second.angular_velocity_rad_per_s.T], axis=1)
    a = first.angular_velocity_rad_per_s
    least = int(np.ceil(_LEAST_OVERLAP * min(len(a), len(b))))
    best, found = np.inf, 0
    for k in range(least - len(b), len(a) - least + 1):  # b[i] meets a[i + k]
        low, high = max(0, k), min(len(a), len(b) + k)
        apart = float(((a[low:high] - b[low - k : high - k]) ** 2).sum(axis=1).mean())
        if apart < best:
            best, found = apart, k
    # By how much the two clocks differ when sample 0 of b meets sample k of a.
    return found + round((first.time_s[0] - second.time_s[0]) / step)


def template_fit(first: Mapping[str, Any], second: Mapping[str, Any]) -> tuple[float, float] | str:
    """Scale of the second template to the first, and what remains after the best rotation and scale [m].

    Parameters
    ----------
    first, second
        Landmark to coordinates [m]; the axes of the two may be turned against each other.

    Returns
    -------
    tuple or str
        Scale and root mean square residual [m], or the reason why there is none.
    """
    if not first or not second:
        return "no landmark template on both sides"
    names = [name for name in first if name in second]
    if len(names) < 3:
        return f"{len(names)} landmarks have one name in both templates; 3 are needed"
    p, q = (np.array([t[name] for name in names], dtype=float) for t in (first, second))
    p, q = p - p.mean(axis=0), q - q.mean(axis=0)
    scale = float(np.sqrt((q**2).sum() / (p**2).sum()))
    # Rotation of the least residual: Kabsch, Acta Cryst. A32 (1976) 922.
    u, _, vt = np.linalg.svd(q.T @ p)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rest = q / scale - p @ (u @ flip @ vt).T
    return scale, float(np.sqrt((rest**2).sum(axis=1).mean()))


def _inputs(first: Digitisation, second: Digitisation) -> tuple[dict[str, float | bool | str], dict[str, str]]:
    values: dict[str, float | bool | str] = {}
    details: dict[str, str] = {}
    logged = first.video_sha256 and second.video_sha256
    values["same_video"] = (
        first.video_sha256 == second.video_sha256 if logged else "the video is not logged with a hash on both sides"
    )
    values["frame_rate_difference_percent"] = 100.0 * (second.rate_hz / first.rate_hz - 1.0)
    fit = template_fit(first.template, second.template)
    if isinstance(fit, str):
        values["template_scale_percent"] = values["template_residual_mm"] = fit
    else:
        values["template_scale_percent"] = 100.0 * (fit[0] - 1.0)
        values["template_residual_mm"] = 1e3 * fit[1]
        word = "larger" if fit[0] > 1 else "smaller"
        details["template_scale_percent"] = (
            f"the landmark template of {second.name} is {100 * abs(fit[0] - 1):.2f} % {word} than that of "
            f"{first.name}, and so is every length, velocity and acceleration across the line of sight"
        )
    p, q = first.helmet_to_com_m, second.helmet_to_com_m
    values["helmet_to_com_difference_mm"] = (
        "no helmet_to_com on both sides" if p is None or q is None else 1e3 * _distance(np.array(p), np.array(q))
    )
    known = first.cutoffs_hz and second.cutoffs_hz
    values["same_filters"] = first.cutoffs_hz == second.cutoffs_hz if known else "no filters stated on both sides"
    return values, details


def _pair(a: Motion, of_a: NDArray, b: Motion, of_b: NDArray) -> tuple[Comparison, Rating | None]:
    try:
        rating = rate(a.time_s, resultant(of_a), b.time_s, resultant(of_b))
    except ValueError:
        rating = None
    return compare(a.time_s, of_a, b.time_s, of_b), rating


def _along(
    a: Motion, along_a: NDArray, b: Motion, along_b: NDArray, first: Digitisation, second: Digitisation
) -> float | str:
    noise = (first.noise_along_m_per_s2, second.noise_along_m_per_s2)
    if noise[0] is None or noise[1] is None:
        return "the noise along the line of sight is not stated on both sides"
    apart = compare(a.time_s, along_a[:, None], b.time_s, along_b[:, None]).rmse
    return apart / float(np.sqrt(0.5 * (noise[0] ** 2 + noise[1] ** 2)))


def _split(motion: Motion, seen: bool) -> tuple[NDArray, NDArray]:
    """Acceleration across ``(n, 3)`` and along ``(n,)`` the line of sight; all of it "across" without a camera."""
    if not seen:
        return motion.acceleration_m_per_s2, np.zeros(len(motion.time_s))
    ray = motion.position_m / resultant(motion.position_m)[:, None]
    along = np.einsum("ki,ki->k", motion.acceleration_m_per_s2, ray)
    return motion.acceleration_m_per_s2 - along[:, None] * ray, along


def _velocity_across(motion: Motion, at: float, seen: bool) -> NDArray:
    velocity, position = _at(motion, motion.velocity_m_per_s, at), _at(motion, motion.position_m, at)
    if not seen:
        return velocity
    ray = position / np.linalg.norm(position)
    return velocity - (velocity @ ray) * ray


def _distance(p: NDArray, q: NDArray) -> float:
    return float(np.linalg.norm(q - p))


def _at(motion: Motion, values: NDArray, time_s: float) -> NDArray:
    return np.array([np.interp(time_s, motion.time_s, column) for column in values.T])


def _later(motion: Motion, shift_s: float) -> Motion:
    return replace(motion, time_s=motion.time_s + shift_s)


def _step(motion: Motion) -> float:
    return float(np.median(np.diff(motion.time_s)))
