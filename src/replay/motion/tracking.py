"""Landmarks followed between clicks: pyramidal Lucas-Kanade, forward and backward, with its own noise.

Each click starts a track in both directions. A step is taken from picture to picture and must lead back to where it
came from; then the clicked patch itself, turned and stretched as it is seen by now, is registered to the picture
(affine, by enhanced correlation: Evangelidis and Psarakis 2008), so that errors do not add up. Where it has changed too
much, the patch of the picture before takes its place, and its error is carried on. Between two clicks the track from
the first and the one from the second are blended from one to the other.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

Seeds = Mapping[str, Mapping[int, tuple[float, float]]]
"""Clicks (u, v) [px] by landmark and frame."""

_LEVELS = 3
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 40, 0.003)
_WEAKEST_GRADIENT = 1e-3
"""Least eigenvalue of the patch's mean squared gradient [(grey level/px)^2] below which nothing fixes a direction."""
_INTERPOLATION_PX = 0.03


@dataclass(frozen=True)
class Following:
    """How a landmark is followed, and when it counts as lost.

    Parameters
    ----------
    patch_px
        Side of the patch, odd [px].
    largest_return_px
        Distance from its start at which a step that is traced back may end [px].
    least_likeness
        Correlation of the patch with the one in the picture before.
    least_anchor_likeness, largest_correction_px
        Correlation with the clicked patch, and distance from the step's end, within which its registration is believed.
    """

    patch_px: int = 21
    largest_return_px: float = 1.0
    least_likeness: float = 0.7
    least_anchor_likeness: float = 0.85
    largest_correction_px: float = 3.0


@dataclass(frozen=True)
class Loss:
    """Where a landmark was lost: the first frame without it, coming from the click in `seed`, and why."""

    landmark: str
    seed: int
    frame: int
    reason: str


@dataclass(frozen=True)
class Digitised:
    """Tracks from clicks.

    Parameters
    ----------
    names
        Landmarks.
    frames
        ``(k,)``.
    pixels
        ``(k, n, 2)`` [px]; NaN where lost.
    sigma_px
        ``(k, n)`` standard deviation of the following, per coordinate, without the click's own [px].
    clicked
        ``(k, n)`` whether the position is a click.
    losses
        Where landmarks were lost and no other click brings them back.
    """

    names: tuple[str, ...]
    frames: np.ndarray
    pixels: np.ndarray
    sigma_px: np.ndarray
    clicked: np.ndarray
    losses: tuple[Loss, ...]

    def weight(self, click_sigma_px: float) -> np.ndarray:
        """``(k, n)`` variance of a click over that of click and following together."""
        return click_sigma_px**2 / (click_sigma_px**2 + self.sigma_px**2)


@dataclass(frozen=True)
class _Run:
    """One click followed in one direction: frames from the seed on."""

    pixels: np.ndarray
    sigma_px: np.ndarray
    reason: str


def follow(pictures: Sequence[np.ndarray], first: int, seeds: Seeds, how: Following | None = None) -> Digitised:
    """Follow every landmark from its clicks through the pictures.

    Parameters
    ----------
    pictures
        Grey ``(height, width) uint8``, of frames `first` on.
    first
        Frame of the first picture.
    seeds
        Clicks; every frame among the pictures.
    how
        Settings.
    """
    how = how or Following()
    count = len(pictures)
    names = tuple(seeds)
    pixels = np.full((count, len(names), 2), np.nan)
    sigma = np.full((count, len(names)), np.nan)
    clicked = np.zeros((count, len(names)), dtype=bool)
    losses: list[Loss] = []
    for j, name in enumerate(names):
        at = sorted(seeds[name])
        runs = {
            (frame, step): _run(pictures, frame - first, step, np.array(seeds[name][frame]), how)
            for frame in at
            for step in (-1, 1)
        }
        edges = [None, *at, None]
        for begin, end in itertools.pairwise(edges):
            _fill(pixels[:, j], sigma[:, j], runs, begin, end, first)
        for frame in at:
            pixels[frame - first, j] = seeds[name][frame]
            sigma[frame - first, j] = 0.0
            clicked[frame - first, j] = True
        losses += _losses(name, at, runs, np.isfinite(sigma[:, j]), first)
    return Digitised(names, np.arange(first, first + count), pixels, sigma, clicked, tuple(losses))


def _fill(
    pixels: np.ndarray,
    sigma: np.ndarray,
    runs: Mapping[tuple[int, int], _Run],
    begin: int | None,
    end: int | None,
    first: int,
) -> None:
    """Positions between two clicks (or beyond the last): what comes from one, from the other, or both blended."""
    low = first - 1 if begin is None else begin
    high = first + len(sigma) if end is None else end
    for frame in range(low + 1, high):
        found = []
        for seed, step in ((begin, 1), (end, -1)):
            if seed is not None and abs(frame - seed) < len(runs[seed, step].sigma_px):
                run, at = runs[seed, step], abs(frame - seed)
                found.append((run.pixels[at], run.sigma_px[at]))
        if len(found) == 1:
            pixels[frame - first], sigma[frame - first] = found[0]
        elif found:
            share = (frame - low) / (high - low)
            (p, s), (q, r) = found
            pixels[frame - first] = (1.0 - share) * p + share * q
            # both errors, and the spread of two answers that differ
            apart = share * (1.0 - share) * 0.5 * float(np.sum((p - q) ** 2))
            sigma[frame - first] = np.sqrt(((1.0 - share) * s) ** 2 + (share * r) ** 2 + apart)


def _losses(name: str, at: list[int], runs: Mapping[tuple[int, int], _Run], seen: np.ndarray, first: int) -> list[Loss]:
    out = []
    for (seed, step), run in runs.items():
        frame = seed + step * len(run.sigma_px)
        inside = 0 <= frame - first < len(seen)
        beyond = frame < at[0] or frame > at[-1]
        if run.reason and inside and not seen[frame - first] and (beyond or step > 0):
            out.append(Loss(name, seed, frame, run.reason))
    return sorted(out, key=lambda loss: loss.frame)


def _run(pictures: Sequence[np.ndarray], seed: int, step: int, start: np.ndarray, how: Following) -> _Run:
    """Follow one click until the pictures end or it is lost; without a reason it reached the end."""
    pixels, sigma, reason = [start], [0.0], ""
    anchor = _Anchor(pictures[seed], start, 0.0, how.patch_px)
    k = seed + step
    while 0 <= k < len(pictures):
        before, now = pictures[k - step], pictures[k]
        moved, back = _flow(before, now, pixels[-1], how)
        reason = _lost(before, now, pixels[-1], moved, back, how)
        if reason:
            break
        found = anchor.find(now, moved, how)
        if found is None:
            # it no longer looks as it was clicked: go on from how it looked last, with the error it had there
            anchor = _Anchor(before, pixels[-1], sigma[-1] ** 2, how.patch_px)
            found = anchor.find(now, moved, how)
        if found is None:
            last, this = (_patch(a, p, how.patch_px) for a, p in ((before, pixels[-1]), (now, moved)))
            found = moved, sigma[-1] ** 2 + _noise(last, this)
        moved, variance = found
        pixels.append(moved)
        sigma.append(float(np.sqrt(variance + 0.25 * back**2)))
        k += step
    return _Run(np.array(pixels), np.array(sigma), reason)


class _Anchor:
    """How a landmark looked where its position was known, and the affine map that takes this patch to the picture."""

    def __init__(self, picture: np.ndarray, at: np.ndarray, variance: float, size: int) -> None:
        self._patch = _patch(picture, at, size).astype(np.float32)
        self._variance = variance
        self._shape = np.eye(2)

    def find(self, picture: np.ndarray, near: np.ndarray, how: Following) -> tuple[np.ndarray, float] | None:
        """Position and variance by affine registration, or nothing where the patch does not fit near there."""
        size = how.patch_px
        half, reach = (size - 1) / 2.0, 2 * size
        corner = np.round(near).astype(int) - reach
        window = _patch(picture, corner + reach, 2 * reach + 1).astype(np.float32)
        middle = np.array([half, half])
        warp, everywhere = np.empty((2, 3), dtype=np.float32), np.ones(window.shape, dtype=np.uint8)
        warp[:, :2] = self._shape
        warp[:, 2] = near - corner - self._shape @ middle
        try:
            likeness, solved = cv2.findTransformECC(
                self._patch, window, warp, cv2.MOTION_AFFINE, _CRITERIA, everywhere, 1
            )
        except cv2.error:
            return None
        warp = np.asarray(solved, dtype=np.float32)
        at = warp[:, :2] @ middle + warp[:, 2] + corner
        stretch = np.linalg.svd(warp[:, :2], compute_uv=False)
        if (
            likeness < how.least_anchor_likeness
            or np.linalg.norm(at - near) > how.largest_correction_px
            or not (stretch[1] > 0.3 and stretch[0] < 3.0)
        ):
            return None
        self._shape = warp[:, :2].astype(float)
        seen = cv2.warpAffine(window, warp, (size, size), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        return at.astype(float), self._variance + _noise(self._patch.astype(float), seen.astype(float))


def _flow(source: np.ndarray, target: np.ndarray, point: np.ndarray, how: Following) -> tuple[np.ndarray, float]:
    """Where a point goes, and how far from it the way back ends [px]; infinity where either has no answer."""

    def solve(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, bool]:
        start = p.reshape(1, 1, 2).astype(np.float32)
        side = (how.patch_px, how.patch_px)
        found, good, _ = cv2.calcOpticalFlowPyrLK(
            a, b, start, start.copy(), winSize=side, maxLevel=_LEVELS, criteria=_CRITERIA
        )
        return found[0, 0].astype(float), bool(good[0, 0])

    moved, good = solve(source, target, point)
    if not good:
        return moved, np.inf
    returned, good = solve(target, source, moved)
    return moved, float(np.linalg.norm(returned - point)) if good else np.inf


def _lost(
    before: np.ndarray, now: np.ndarray, point: np.ndarray, moved: np.ndarray, back: float, how: Following
) -> str:
    height, width = now.shape
    if not (0.0 <= moved[0] <= width - 1.0 and 0.0 <= moved[1] <= height - 1.0):
        return "it left the picture"
    if not back < how.largest_return_px:
        return "the way back does not lead to its start"
    likeness = _likeness(before, now, point, moved, how.patch_px)
    if likeness < how.least_likeness:
        return f"it looks different from one frame to the next (correlation {likeness:.2f})"
    return ""


def _patch(picture: np.ndarray, at: np.ndarray, size: int) -> np.ndarray:
    return cv2.getRectSubPix(picture, (size, size), (float(at[0]), float(at[1]))).astype(float)


def _likeness(a: np.ndarray, b: np.ndarray, p: np.ndarray, q: np.ndarray, size: int) -> float:
    """Correlation of two patches; 0 where one is flat."""
    x, y = _patch(a, p, size), _patch(b, q, size)
    x, y = x - x.mean(), y - y.mean()
    scale = np.sqrt(np.sum(x * x) * np.sum(y * y))
    return float(np.sum(x * y) / scale) if scale > 0.0 else 0.0


def _noise(x: np.ndarray, y: np.ndarray) -> float:
    """Variance of the registration of two patches, mean of both coordinates [px^2].

    What is left between two registered patches is noise of both; a position's covariance is its variance times the
    inverse of the sum of squared gradients, as for any least-squares fit. Interpolation errs by some hundredths of a
    pixel beside.
    """
    left = (y - y.mean()) - (x - x.mean())
    gv, gu = np.gradient(0.5 * (x + y))
    normal = np.array([[np.sum(gu * gu), np.sum(gu * gv)], [np.sum(gu * gv), np.sum(gv * gv)]])
    if np.linalg.eigvalsh(normal)[0] < _WEAKEST_GRADIENT * x.size:
        return float(x.size)
    return float(np.var(left) * np.trace(np.linalg.inv(normal)) / 2.0) + _INTERPOLATION_PX**2
