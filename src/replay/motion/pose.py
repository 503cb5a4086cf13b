"""Pose of a rigid template in every frame at once: robust Levenberg-Marquardt from several starts.

OpenCV gives starting poses; every pose reported comes from the refinement here. Its unknowns per frame
are a rotation vector, ``(x/z, y/z, log z)`` and, where asked, log f.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from replay.motion.camera import NO_DISTORTION, Lens, project, shift_of, translation

Loss = Literal["student", "linear"]
_FREEDOM = 4.0
"""Degrees of freedom of the Student-t residual: a click ten sigma off has a thirtieth of its weight."""
_DISTINCT_RAD = np.radians(8.0)
_TURN_SIGMA_RAD = 0.25


@dataclass(frozen=True)
class Prior:
    """Gaussian knowledge of log f and log z, one value or one for each frame; None for nothing known."""

    log_f: np.ndarray | float | None = None
    log_f_sigma: np.ndarray | float = 1.0
    log_z: np.ndarray | float | None = None
    log_z_sigma: np.ndarray | float = 1.0


@dataclass(frozen=True)
class Poses:
    """Poses of the template in ``k`` frames.

    Parameters
    ----------
    rotation
        ``(k, 3, 3)`` template to camera.
    shift
        ``(k, 3)`` x/z, y/z, log z of the template's origin.
    log_f
        ``(k,)`` logarithm of the focal length [px].
    cost
        ``(k,)`` twice the negative log-likelihood, priors included.
    information
        ``(k, 7, 7)`` of (rotation vector, shift, log f); without the log f row where it was fixed.
    """

    rotation: np.ndarray
    shift: np.ndarray
    log_f: np.ndarray
    cost: np.ndarray
    information: np.ndarray

    @property
    def position_m(self) -> np.ndarray:
        """``(k, 3)`` origin of the template, camera axes [m]."""
        return translation(self.shift)

    @property
    def scale_px_per_m(self) -> np.ndarray:
        """``(k,)`` f/Z [px/m]."""
        return np.exp(self.log_f - self.shift[:, 2])


def residuals(points: np.ndarray, pixels: np.ndarray, poses: Poses, lens: Lens) -> np.ndarray:
    """Click minus projection ``(k, n, 2)`` [px]; NaN where not clicked."""
    return pixels - project(points, poses.rotation, poses.shift, poses.log_f, lens)[0]


def refine(
    points: np.ndarray,
    pixels: np.ndarray,
    start: Poses,
    lens: Lens,
    *,
    sigma_px: float | np.ndarray,
    free_focal: bool = False,
    prior: Prior | None = None,
    loss: Loss = "student",
    iterations: int = 100,
) -> Poses:
    """Most likely pose of each frame near its start; frames are independent and solved side by side.

    Parameters
    ----------
    points
        ``(n, 3)`` template [m].
    pixels
        ``(k, n, 2)`` clicks [px]; NaN where not clicked.
    start
        Where to begin.
    lens
        Principal point and distortion.
    sigma_px
        Standard deviation of a click coordinate, one for all or ``(k, n)``.
    free_focal
        Whether log f is unknown.
    prior
        What is known of log f and log z.
    loss
        ``student`` (robust) or ``linear`` (least squares).
    iterations
        At most.
    """
    prior = prior or Prior()
    size = 7 if free_focal else 6
    seen = np.isfinite(pixels[..., 0])
    clicks = np.where(seen[..., None], pixels, 0.0)
    spread = np.broadcast_to(np.asarray(sigma_px, dtype=float), seen.shape)[..., None]
    rotation, shift, log_f = start.rotation.copy(), start.shift.copy(), start.log_f.copy()

    def evaluate(rotation: np.ndarray, shift: np.ndarray, log_f: np.ndarray, rows: np.ndarray) -> tuple:
        predicted, jacobian = project(points, rotation, shift, log_f, lens)
        mask = seen[rows]
        valid = np.isfinite(predicted[..., 0]) | ~mask
        error = np.where(mask[..., None], clicks[rows] - np.nan_to_num(predicted), 0.0) / spread[rows]
        jacobian = np.where(mask[..., None, None], np.nan_to_num(jacobian), 0.0)[..., :size] / spread[rows, ..., None]
        r2 = np.einsum("kna,kna->kn", error, error)
        if loss == "student":
            cost = np.where(mask, (_FREEDOM + 2.0) * np.log1p(r2 / _FREEDOM), 0.0).sum(axis=1)
            weight = (_FREEDOM + 2.0) / (_FREEDOM + r2)
        else:
            cost, weight = r2.sum(axis=1), np.ones_like(r2)
        h = np.einsum("kn,knai,knaj->kij", weight, jacobian, jacobian)
        g = np.einsum("kn,knai,kna->ki", weight, jacobian, error)
        for mean, sigma, value, index in (
            (prior.log_f, prior.log_f_sigma, log_f, 6),
            (prior.log_z, prior.log_z_sigma, shift[:, 2], 5),
        ):
            if mean is None or index >= size:
                continue
            s = np.broadcast_to(np.asarray(sigma, dtype=float), seen.shape[:1])[rows]
            off = (np.broadcast_to(np.asarray(mean, dtype=float), seen.shape[:1])[rows] - value) / s
            cost = cost + off**2
            h[:, index, index] += 1.0 / s**2
            g[:, index] += off / s
        cost = np.where(valid.all(axis=1), cost, np.inf)
        return cost, h, g

    every = np.arange(len(rotation))
    cost, h, g = evaluate(rotation, shift, log_f, every)
    damping = np.full(len(rotation), 1e-3)
    active = np.isfinite(cost)
    for _ in range(iterations):
        rows = every[active]
        if not len(rows):
            break
        diagonal = np.einsum("kii->ki", h[rows])
        damped = h[rows].copy()
        index = np.arange(size)
        damped[:, index, index] += damping[rows, None] * diagonal + 1e-12 * diagonal.max(axis=1, keepdims=True)
        step = np.linalg.solve(damped, g[rows][..., None])[..., 0]
        turn = np.linalg.norm(step[:, :3], axis=1, keepdims=True)
        step *= np.minimum(1.0, 0.5 / np.maximum(turn, 1e-300))
        depth = np.max(np.abs(step[:, 5:]), axis=1, keepdims=True)
        step *= np.minimum(1.0, 0.5 / np.maximum(depth, 1e-300))
        new_rotation = Rotation.from_rotvec(step[:, :3]).as_matrix() @ rotation[rows]
        new_shift = shift[rows] + step[:, 3:6]
        new_log_f = log_f[rows] + (step[:, 6] if free_focal else 0.0)
        new_cost, new_h, new_g = evaluate(new_rotation, new_shift, new_log_f, rows)
        better = new_cost <= cost[rows]
        taken = rows[better]
        gain = np.where(better, cost[rows] - np.where(better, new_cost, 0.0), np.inf)
        rotation[taken], shift[taken], log_f[taken] = new_rotation[better], new_shift[better], new_log_f[better]
        cost[taken], h[taken], g[taken] = new_cost[better], new_h[better], new_g[better]
        damping[rows] = np.where(better, np.maximum(damping[rows] * 0.2, 1e-12), damping[rows] * 6.0)
        still = np.max(np.abs(step), axis=1) > 1e-12
        stuck = (gain < 1e-13 * (1.0 + cost[rows])) & (np.max(np.abs(step), axis=1) < 1e-8)
        active[rows] = still & ~stuck & (damping[rows] < 1e12)
    information = np.zeros((len(rotation), 7, 7))
    information[:, :size, :size] = h
    # rounding drifts the matrices off the rotations a little; take it out once
    rotation = Rotation.from_matrix(rotation).as_matrix()
    return Poses(rotation, shift, log_f, cost, information)


def _starts(points: np.ndarray, pixels: np.ndarray, log_f: float, lens: Lens) -> list[tuple[np.ndarray, np.ndarray]]:
    """Starting poses of one frame by OpenCV's closed forms; methods are named, never numbered."""
    f = float(np.exp(log_f))
    cx, cy = lens.principal_point
    matrix = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
    distortion = None if lens.distortion == NO_DISTORTION else np.array(lens.distortion)
    n = len(points)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    planar = spread[2] < 1e-6 * spread[0]
    if n == 3:
        methods = [cv2.SOLVEPNP_P3P]
    else:
        methods = [cv2.SOLVEPNP_EPNP]
        if planar:
            methods += [cv2.SOLVEPNP_IPPE]
        if planar or n >= 6:
            methods += [cv2.SOLVEPNP_ITERATIVE]
    found = []
    for method in methods:
        try:
            if method == cv2.SOLVEPNP_P3P:
                _, turns, moves = cv2.solveP3P(points, pixels, matrix, distortion, cv2.SOLVEPNP_P3P)
            else:
                _, turns, moves, _ = cv2.solvePnPGeneric(points, pixels, matrix, distortion, flags=method)
        except cv2.error:
            continue
        for turn, move in zip(turns, moves):
            rotation, position = cv2.Rodrigues(turn)[0], np.ravel(move)
            depth = (points @ rotation.T + position)[:, 2]
            if np.isfinite(position).all() and np.isfinite(rotation).all() and depth.min() > 1e-3:
                found.append((rotation, position))
    return found or _generic_starts(points, pixels, f, lens)


def _generic_starts(
    points: np.ndarray, pixels: np.ndarray, f: float, lens: Lens
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The six ways a box can face the camera, at the depth that its size in the image tells."""
    centre = points.mean(axis=0)
    size = np.sqrt(((points - centre) ** 2).sum(axis=1).mean())
    spread = np.sqrt(((pixels - pixels.mean(axis=0)) ** 2).sum(axis=1).mean())
    z = f * size / max(spread, 1e-3)
    middle = np.append((pixels.mean(axis=0) - lens.principal_point) / f, 1.0) * z
    out = []
    for angles in ([0, 0, 0], [90, 0, 0], [180, 0, 0], [-90, 0, 0], [0, 90, 0], [0, -90, 0]):
        rotation = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
        out.append((rotation, middle - rotation @ centre))
    return out


def mirrored(points: np.ndarray, seen: np.ndarray, poses: Poses) -> Poses:
    """Depth-reversed twin of each pose: at long range it projects a flat template to the same pixels."""
    rotation, position = poses.rotation.copy(), poses.position_m.copy()
    for k in range(len(rotation)):
        visible = points[seen[k]]
        centre = visible.mean(axis=0)
        thin = np.linalg.svd(visible - centre)[2][2]
        ray = poses.rotation[k] @ centre + position[k]
        ray /= np.linalg.norm(ray)
        turned = (np.eye(3) - 2.0 * np.outer(ray, ray)) @ poses.rotation[k] @ (np.eye(3) - 2.0 * np.outer(thin, thin))
        position[k] += (poses.rotation[k] - turned) @ centre
        rotation[k] = turned
    position[:, 2] = np.maximum(position[:, 2], 1e-2)
    return replace(poses, rotation=rotation, shift=shift_of(position))


@dataclass(frozen=True)
class Choice:
    """The pose chosen in each frame among those that fit.

    Parameters
    ----------
    poses
        Chosen.
    flip_ratio
        ``(k,)`` likelihood-scaled residual of the best other pose over that of the chosen one; NaN where
        no other pose was found.
    candidates
        ``(k,)`` number of distinct poses that were found.
    """

    poses: Poses
    flip_ratio: np.ndarray
    candidates: np.ndarray


def choose(
    points: np.ndarray,
    pixels: np.ndarray,
    log_f: np.ndarray,
    lens: Lens,
    *,
    sigma_px: float | np.ndarray,
    loss: Loss = "student",
) -> Choice:
    """Best pose of each frame at a given focal length, from several starts.

    Where several poses fit a frame, the sequence of least cost is taken, in which a turn between frames costs
    as a Gaussian of 0.25 rad: this decides only what the clicks leave undecided.

    Parameters
    ----------
    points, pixels, lens, sigma_px, loss
        As in `refine`.
    log_f
        ``(k,)`` logarithm of the focal length.
    """
    seen = np.isfinite(pixels[..., 0])
    lists = [_starts(points[s], p[s], float(lf), lens) for s, p, lf in zip(seen, pixels, log_f)]
    slots = []
    for slot in range(max(len(found) for found in lists)):
        picked = [found[min(slot, len(found) - 1)] for found in lists]
        rotation = np.array([r for r, _ in picked])
        position = np.array([t for _, t in picked])
        blank = Poses(rotation, shift_of(position), log_f, np.zeros(len(log_f)), np.zeros((len(log_f), 7, 7)))
        slots.append(refine(points, pixels, blank, lens, sigma_px=sigma_px, loss=loss))
    slots += [
        refine(points, pixels, mirrored(points, seen, slot), lens, sigma_px=sigma_px, loss=loss) for slot in slots[:2]
    ]
    kept = [
        _distinct([slot.cost[k] for slot in slots], [slot.rotation[k] for slot in slots]) for k in range(len(log_f))
    ]
    path = _smoothest(slots, kept)
    order = np.arange(len(log_f))
    stacked = {name: np.stack([getattr(slot, name) for slot in slots]) for name in _FIELDS}
    poses = Poses(**{name: value[path, order] for name, value in stacked.items()})
    ratio = np.full(len(log_f), np.nan)
    floor = 1e-9
    for k, options in enumerate(kept):
        others = [slots[o].cost[k] for o in options if o != path[k]]
        if others:
            ratio[k] = np.sqrt((min(others) + floor) / (poses.cost[k] + floor))
    return Choice(poses, ratio, np.array([len(options) for options in kept]))


_FIELDS = ("rotation", "shift", "log_f", "cost", "information")


def _distinct(costs: list[float], rotations: list[np.ndarray]) -> list[int]:
    """Slots whose poses differ by more than 8 degrees, best first."""
    out: list[int] = []
    for slot in np.argsort(costs, kind="stable"):
        if not np.isfinite(costs[slot]):
            continue
        apart = all(_angle(rotations[slot], rotations[other]) > _DISTINCT_RAD for other in out)
        if apart:
            out.append(int(slot))
    return out or [0]


def _smoothest(slots: list[Poses], kept: list[list[int]]) -> np.ndarray:
    """Slot of each frame on the path of least cost (Viterbi)."""
    best = [np.array([slots[o].cost[0] for o in kept[0]])]
    back: list[np.ndarray] = []
    for k in range(1, len(kept)):
        turn = np.array(
            [
                [(_angle(slots[o].rotation[k], slots[p].rotation[k - 1]) / _TURN_SIGMA_RAD) ** 2 for p in kept[k - 1]]
                for o in kept[k]
            ]
        )
        total = best[-1][None, :] + turn
        back.append(np.argmin(total, axis=1))
        best.append(np.array([slots[o].cost[k] for o in kept[k]]) + total.min(axis=1))
    state = int(np.argmin(best[-1]))
    path = [kept[-1][state]]
    for k in range(len(kept) - 2, -1, -1):
        state = int(back[k][state])
        path.append(kept[k][state])
    return np.array(path[::-1])


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arccos(np.clip(0.5 * (np.sum(a * b) - 1.0), -1.0, 1.0)))
