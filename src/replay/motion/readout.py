"""What happened between the frames: a motion averaged over shapes, durations and instants of the impact.

Frames tell the integral of a rate (orientation of angular velocity, position of velocity) with known information.
The rate is a slow background plus, perhaps, one event of a known kind at an unknown instant. Given kind and instant
everything is linear and Gaussian, so each hypothesis has its evidence in closed form; the motion is drawn from all of
them in proportion to it. Peaks are then read off the drawn motions, not off the samples at the frames.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from replay.motion.events import Shape, background, few_shapes, shapes
from replay.motion.told import Told

EVENT_PRIOR = 0.9
"""Probability of an event beforehand: most clips that are clicked show one."""
_OFF_AXIS = 0.25
_FINE_S = 1.0e-3
_NEGLIGIBLE = 1.0e-3
_MOST_INSTANTS = 40


@dataclass(frozen=True)
class Scales:
    """Standard deviations beforehand, in the unit of the rate.

    Parameters
    ----------
    event
        Of an event's functions, each axis: wide enough not to pull a real impact down.
    constant, slow
        Of the background: its constant and its slow part.
    start
        Of the integral at the first frame.
    misfit
        Of what no shape can follow, in the integral at each frame.
    """

    event: float
    constant: float
    slow: float
    start: float
    misfit: float


ANGULAR = Scales(event=30.0, constant=4.0, slow=1.5, start=3.0, misfit=2.0e-3)
"""For angular velocity [rad/s] and orientation [rad]."""
LINEAR = Scales(event=4.0, constant=8.0, slow=0.8, start=100.0, misfit=5.0e-4)
"""For velocity [m/s] and position [m]."""


@dataclass(frozen=True)
class Drawn:
    """Motions drawn from the posterior, on a grid between the frames.

    Parameters
    ----------
    time_s
        ``(g,)`` grid through all frames [s].
    rate, slope, level
        ``(draws, g, 3)`` rate, its derivative and its integral from the first frame, start included.
    event_s
        ``(draws,)`` instant of the event; NaN where the draw has none.
    event_probability
        That there was an event.
    kinds
        Share of the posterior that each shape has.
    """

    time_s: np.ndarray
    rate: np.ndarray
    slope: np.ndarray
    level: np.ndarray
    event_s: np.ndarray
    event_probability: float
    kinds: dict[str, float]


def fine_grid(time_s: np.ndarray) -> np.ndarray:
    """Grid of about a millisecond that passes through every frame."""
    steps = max(1, int(np.ceil((time_s[1] - time_s[0]) / _FINE_S - 1e-9)))
    return np.interp(np.arange((len(time_s) - 1) * steps + 1) / steps, np.arange(len(time_s)), time_s)


def _integral(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Trapezoidal integral from the first sample along axis 0."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time_s).reshape(-1, *[1] * (values.ndim - 1))
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(steps, axis=0)])


@dataclass(frozen=True)
class _Fits:
    """Hypotheses of one shape at many instants under one prior: log evidence ``(h,)`` with what draws need."""

    shape: Shape
    instants: np.ndarray
    root: np.ndarray
    inner: np.ndarray
    pull: np.ndarray
    evidence: np.ndarray


class _Frames:
    """The frames' information with the background marginalised, whitened once for all hypotheses."""

    def __init__(self, time_s: np.ndarray, values: np.ndarray, information: np.ndarray, scales: Scales) -> None:
        self.time_s, self.fine_s, self.scales = time_s, fine_grid(time_s), scales
        k = len(time_s)
        rate, self.background_slope = background(time_s, self.fine_s)
        self.background_rate = rate
        self.background_level = _integral(self.fine_s, rate)
        at_frames = self.background_level[:: (len(self.fine_s) - 1) // (k - 1)]
        design = np.concatenate([np.ones((k, 1)), at_frames], axis=1)
        spread = np.array([scales.start, scales.constant, *[scales.slow] * (rate.shape[1] - 1)])
        self.scaled = design * spread
        self.spread = spread
        floor = 1e-9 * np.einsum("kii->k", information).max()
        noise = np.linalg.inv(information + floor * np.eye(3)) + scales.misfit**2 * np.eye(3)
        total = np.einsum("kr,lr->kl", self.scaled, self.scaled)[:, None, :, None] * np.eye(3)[None, :, None, :]
        index = np.arange(k)
        total[index, :, index, :] += noise
        self.whitener = np.linalg.inv(np.linalg.cholesky(total.reshape(3 * k, 3 * k)))
        self.white = self.whitener @ values.ravel()

    def whiten(self, functions: np.ndarray) -> np.ndarray:
        """Whitened design ``(h, 3k, 3r)`` of scalar functions ``(h, k, r)``, one 3-vector a function."""
        h, k, r = functions.shape
        split = self.whitener.reshape(3 * k, k, 3).transpose(0, 2, 1).reshape(9 * k, k)
        out = split @ functions.transpose(1, 0, 2).reshape(k, h * r)
        return out.reshape(3 * k, 3, h, r).transpose(2, 0, 3, 1).reshape(h, 3 * k, 3 * r)

    def event_at_frames(self, shape: Shape, instants: np.ndarray) -> np.ndarray:
        """Integrals ``(h, k, r)`` of a shape's rate from the first frame on."""
        level = shape.at(self.time_s[None, :] - instants[:, None])[0]
        return level - level[:, :1]


def _fits(frames: _Frames, shape: Shape, instants: np.ndarray, size: float, axes: list[np.ndarray]) -> Iterator[_Fits]:
    white = frames.whiten(frames.event_at_frames(shape, instants))
    inner = np.swapaxes(white, 1, 2) @ white
    pull = np.einsum("hmi,m->hi", white, frames.white)
    r = shape.rate.shape[1]
    for axis in axes:
        root = np.kron(np.eye(r), size * axis)
        matrix = np.eye(3 * r) + root @ inner @ root
        side = pull @ root
        evidence = 0.5 * np.einsum("hi,hi->h", side, np.linalg.solve(matrix, side[..., None])[..., 0])
        evidence -= 0.5 * np.linalg.slogdet(matrix)[1]
        yield _Fits(shape, instants, root, inner, pull, evidence)


def _weights(fits: list[_Fits], instant_prior: np.ndarray) -> tuple[list[np.ndarray], float]:
    """Posterior of every hypothesis and of no event; each kind, and each shape in it, as likely as the others."""
    kinds = [fit.shape.name.split()[0] for fit in fits]
    logs = []
    for fit, kind in zip(fits, kinds):
        prior = -np.log(len(set(kinds)) * kinds.count(kind) * len(fit.instants))
        logs.append(fit.evidence + prior + np.log(EVENT_PRIOR) + instant_prior)
    none = float(np.log(1.0 - EVENT_PRIOR))
    top = max(none, *(float(log.max()) for log in logs))
    total = float(np.exp(none - top)) + sum(float(np.exp(log - top).sum()) for log in logs)
    return [np.exp(log - top) / total for log in logs], float(np.exp(none - top)) / total


def read_out(
    time_s: np.ndarray,
    values: np.ndarray,
    information: np.ndarray,
    scales: Scales,
    rng: np.random.Generator,
    *,
    draws: int = 400,
    instant: tuple[float, float] | None = None,
) -> Drawn:
    """Draw motions from the posterior given what every frame tells.

    Parameters
    ----------
    time_s
        ``(k,)`` evenly spaced frames [s].
    values
        ``(k, 3)`` integral of the rate at the frames.
    information
        ``(k, 3, 3)`` inverse covariance of each; zero where a frame tells nothing.
    scales
        Knowledge beforehand.
    rng
        Source of the draws.
    draws
        Number of motions.
    instant
        Mean and standard deviation of the event's instant where another reading told it [s].
    """
    frames = _Frames(time_s, values, information, scales)
    step = float(np.clip((time_s[1] - time_s[0]) / 6.0, 1.2e-3, 6e-3))
    first, last = time_s[0] + 2.0 * step, time_s[-1] - 2.0 * step
    if instant is not None:
        first, last = max(first, instant[0] - 4.0 * instant[1]), min(last, instant[0] + 4.0 * instant[1])
    coarse = np.arange(first, max(last, first + 0.5 * step), step)
    round_axis = [np.eye(3)]

    def prior(instants: np.ndarray) -> np.ndarray:
        return 0.0 * instants if instant is None else -0.5 * ((instants - instant[0]) / instant[1]) ** 2

    fits = [fit for shape in few_shapes() for fit in _fits(frames, shape, coarse, scales.event, round_axis)]
    weights, _ = _weights(fits, prior(coarse))
    axis = _leading_axis(fits, weights)
    share = np.sum(weights, axis=0)
    threshold = max(_NEGLIGIBLE * share.max(), np.sort(share)[-min(_MOST_INSTANTS, len(share))])
    likely = coarse[share >= threshold]
    fine = np.unique(np.concatenate([likely + shift * step / 3.0 for shift in (-1.0, 0.0, 1.0)]))
    aligned = axis[:, None] * axis + _OFF_AXIS * (np.eye(3) - axis[:, None] * axis)
    fits = [fit for shape in shapes() for fit in _fits(frames, shape, fine, scales.event, [np.eye(3), aligned])]
    # both passes must spread the same prior over time: as many instants as the whole clip has at this spacing
    weights, none = _weights(fits, prior(fine) + np.log(len(fine) / (3.0 * len(coarse))))
    return _draw(frames, fits, weights, none, rng, draws)


@dataclass(frozen=True)
class Quiet:
    """A slow motion at one instant.

    Parameters
    ----------
    time_s
        ``(g,)`` grid through all frames [s].
    level, rate, slope
        ``(3,)`` integral of the rate, rate and its derivative at the instant.
    covariance
        ``(3, 3)`` of the rate.
    """

    time_s: np.ndarray
    level: np.ndarray
    rate: np.ndarray
    slope: np.ndarray
    covariance: np.ndarray


def read_quiet(told: Told, scales: Scales, until_s: float, at_s: float) -> Quiet:
    """Motion without an event at `at_s`, from the frames before `until_s` alone."""
    used = (told.time_s < until_s)[:, None]
    frames = _Frames(
        told.time_s, np.where(used, told.values, 0.0), np.where(used[..., None], told.information, 0.0), scales
    )
    white = frames.whiten(frames.scaled[None])[0]
    covariance = np.eye(white.shape[1]) - white.T @ white
    slow = (frames.white @ white).reshape(-1, 3) * frames.spread[:, None]
    here = int(np.searchsorted(frames.fine_s, at_s - 1e-9))
    rate = np.kron(frames.spread[1:] * frames.background_rate[here], np.eye(3))
    return Quiet(
        time_s=frames.fine_s,
        level=slow[0] + frames.background_level[here] @ slow[1:],
        rate=frames.background_rate[here] @ slow[1:],
        slope=frames.background_slope[here] @ slow[1:],
        covariance=rate @ covariance[3:, 3:] @ rate.T,
    )


def _leading_axis(fits: list[_Fits], weights: list[np.ndarray]) -> np.ndarray:
    best = int(np.argmax([w.max() for w in weights]))
    fit, h = fits[best], int(np.argmax(weights[best]))
    mean, _ = _coefficients(fit, h)
    return np.linalg.svd(mean.reshape(-1, 3))[2][0]


def _coefficients(fit: _Fits, h: int) -> tuple[np.ndarray, np.ndarray]:
    """Posterior mean ``(3r,)`` and a square root of the covariance of an event's coefficients."""
    matrix = np.eye(len(fit.root)) + fit.root @ fit.inner[h] @ fit.root
    factor = np.linalg.inv(np.linalg.cholesky(matrix))
    mean = fit.root @ (factor.T @ (factor @ (fit.root @ fit.pull[h])))
    return mean, fit.root @ factor.T


def _draw(
    frames: _Frames, fits: list[_Fits], weights: list[np.ndarray], none: float, rng: np.random.Generator, draws: int
) -> Drawn:
    table = np.concatenate([[none], *weights])
    owner = np.concatenate([[-1], *(np.full(len(w), i) for i, w in enumerate(weights))]).astype(int)
    place = np.concatenate([[0], *(np.arange(len(w)) for w in weights)]).astype(int)
    # systematic: the share of each hypothesis among the draws is its weight, rounded
    ticks = (np.arange(draws) + rng.random()) / draws
    picked = np.minimum(np.searchsorted(np.cumsum(table) / table.sum(), ticks), len(table) - 1)
    fine = frames.fine_s
    rate, slope, level = (np.zeros((draws, len(fine), 3)) for _ in range(3))
    event = np.full(draws, np.nan)
    residual = np.tile(frames.white, (draws, 1))
    for choice in np.unique(picked):
        if owner[choice] < 0:
            continue
        fit, h = fits[owner[choice]], place[choice]
        rows = np.flatnonzero(picked == choice)
        mean, root = _coefficients(fit, h)
        coefficients = mean + rng.standard_normal((len(rows), len(mean))) @ root.T
        instant = fit.instants[h]
        event[rows] = instant
        whole, speed, change = fit.shape.at(fine - instant)
        split = coefficients.reshape(len(rows), -1, 3)
        level[rows] = np.einsum("gr,dra->dga", whole - whole[0], split)
        rate[rows] = np.einsum("gr,dra->dga", speed, split)
        slope[rows] = np.einsum("gr,dra->dga", change, split)
        white = frames.whiten(frames.event_at_frames(fit.shape, fit.instants[h : h + 1]))[0]
        residual[rows] -= coefficients @ white.T
    # the background that belongs to each draw's event
    white = frames.whiten(frames.scaled[None])[0]
    mean = residual @ white
    covariance = np.eye(white.shape[1]) - white.T @ white
    values, vectors = np.linalg.eigh(covariance)
    noise = rng.standard_normal((draws, white.shape[1])) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    slow = (mean + noise).reshape(draws, -1, 3) * frames.spread[:, None]
    level += slow[:, :1] + np.einsum("gr,dra->dga", frames.background_level, slow[:, 1:])
    rate += np.einsum("gr,dra->dga", frames.background_rate, slow[:, 1:])
    slope += np.einsum("gr,dra->dga", frames.background_slope, slow[:, 1:])
    kinds: dict[str, float] = {}
    for fit, weight in zip(fits, weights):
        kinds[fit.shape.name] = kinds.get(fit.shape.name, 0.0) + float(weight.sum())
    return Drawn(fine, rate, slope, level, event, 1.0 - none, kinds)
