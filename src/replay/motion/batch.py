"""One estimate over the whole clip: every frame's pose and focal length at once.

The unknowns of frame k are a rotation, ``(x/z, y/z, log z)`` and log f. Clicks pull on them with a Student-t
likelihood; between frames, second differences of orientation and of the CG's position are small (an acceleration
prior, itself Student-t: an impact is rare, not impossible), and log f is smooth. The normal equations couple a
frame with its two neighbours on either side, so they are banded, and so is their solution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded, solveh_banded
from scipy.spatial.transform import Rotation
from scipy.special import exp1

from replay.motion.camera import Lens, project, translation
from replay.motion.focal import WEAK_SIGMA_LOG_F, guess
from replay.motion.settings import CameraSettings

UNKNOWNS = 7
"""Of a frame: rotation vector, x/z, y/z, log z, log f."""
_BAND = 3 * UNKNOWNS
CLICK_FREEDOM = 4.0
"""Degrees of freedom of the Student-t click."""
_FEWEST_FREEDOM = 20.0


@dataclass(frozen=True)
class Smoothness:
    """What is expected of a head between frames, in seconds and not in frames.

    Parameters
    ----------
    alpha_rad_per_s2, acceleration_m_per_s2
        Scales of the Student-t second differences: large for a head that turns and runs, small for an impact.
    freedom
        Their degrees of freedom; few, so that an impact's hundredfold acceleration costs little more than a tenfold.
    zoom_per_s, zoom_per_s2
        Standard deviations of the first and second time derivative of log f while a lens zooms.
    fixed_per_s, fixed_per_s2
        The same for a lens that does not.
    """

    alpha_rad_per_s2: float = 300.0
    acceleration_m_per_s2: float = 60.0
    freedom: float = 2.0
    zoom_per_s: float = 0.3
    zoom_per_s2: float = 3.0
    fixed_per_s: float = 1.0e-3
    fixed_per_s2: float = 1.0e-2


@dataclass(frozen=True)
class State:
    """Pose and focal length of ``k`` consecutive frames, camera axes.

    Parameters
    ----------
    rotation
        ``(k, 3, 3)`` template to camera.
    shift
        ``(k, 3)`` x/z, y/z, log z of the template's origin.
    log_f
        ``(k,)`` logarithm of the focal length [px].
    """

    rotation: np.ndarray
    shift: np.ndarray
    log_f: np.ndarray

    def moved(self, step: np.ndarray) -> State:
        """State after a step ``(k, 7)``; rotations are turned from the left."""
        turned = Rotation.from_rotvec(step[:, :3]) * Rotation.from_matrix(self.rotation)
        return State(turned.as_matrix(), self.shift + step[:, 3:6], self.log_f + step[:, 6])


@dataclass(frozen=True)
class Problem:
    """Clicks of one clip with everything that is known beforehand.

    Parameters
    ----------
    points
        ``(n, 3)`` template [m].
    pixels
        ``(k, n, 2)`` clicks [px]; NaN where not clicked.
    weight
        ``(k, n)`` in (0, 1]: a click's variance is that of a careful click over its weight.
    arm_m
        ``(3,)`` from the template's origin to the skull CG, template axes [m].
    camera
        Frame rate, lens and references.
    lens
        Principal point and distortion.
    smoothness
        Expectation between frames.
    """

    points: np.ndarray
    pixels: np.ndarray
    weight: np.ndarray
    arm_m: np.ndarray
    camera: CameraSettings
    lens: Lens
    smoothness: Smoothness = Smoothness()

    @property
    def seen(self) -> np.ndarray:
        """``(k, n)`` whether a landmark was clicked."""
        return np.isfinite(self.pixels[..., 0])


@dataclass(frozen=True)
class Batch:
    """The most likely state, and how sharply the clicks hold it.

    Parameters
    ----------
    state
        Estimate.
    cost
        Twice the negative logarithm of likelihood and prior.
    sigma_px
        Standard deviation of one click coordinate, and whether the residuals told it.
    sigma_measured
        See `sigma_px`.
    weights
        ``(k, n)`` weight of each click in the end, about 1 for an ordinary one; 0 where not clicked.
    errors_px
        ``(k, n, 2)`` click less projection; NaN where not clicked.
    clicks_information, clicks_gradient
        ``(k, 7, 7)`` and ``(k, 7)``: the quadratic through the log-likelihood of each frame's clicks alone.
    covariance
        ``(k, 7, 7)`` of each frame's state, priors included.
    iterations
        Gauss-Newton steps taken.
    """

    state: State
    cost: float
    sigma_px: float
    sigma_measured: bool
    weights: np.ndarray
    errors_px: np.ndarray
    clicks_information: np.ndarray
    clicks_gradient: np.ndarray
    covariance: np.ndarray
    iterations: int


def left_jacobian_inverse(vectors: np.ndarray) -> np.ndarray:
    """Derivative ``(..., 3, 3)`` of Log(Exp(d) Exp(v)) by d at 0; that of Log(Exp(v) Exp(d)) is the transpose."""
    angle = np.linalg.norm(vectors, axis=-1)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    b = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, 1.0 / safe**2 - 0.5 / (safe * np.tan(0.5 * safe)))
    hat = cross_matrix(vectors)
    return np.eye(3) - 0.5 * hat + b[..., None, None] * (hat @ hat)


def cross_matrix(vectors: np.ndarray) -> np.ndarray:
    """``(..., 3, 3)`` matrices of the cross product from the left."""
    out = np.zeros((*vectors.shape[:-1], 3, 3))
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def click_terms(problem: Problem, state: State, sigma_px: float) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Cost (infinite behind the camera), weights ``(k, n)``, information ``(k, 7, 7)`` and gradient ``(k, 7)``."""
    seen = problem.seen
    predicted, jacobian = project(problem.points, state.rotation, state.shift, state.log_f, problem.lens)
    if not np.isfinite(predicted[seen]).all():
        return np.inf, seen * 0.0, np.zeros((len(seen), 7, 7)), np.zeros((len(seen), 7))
    sharpness = np.sqrt(problem.weight) / sigma_px
    error = np.where(seen[..., None], sharpness[..., None] * (problem.pixels - predicted), 0.0)
    jacobian = np.where(seen[..., None, None], sharpness[..., None, None] * jacobian, 0.0)
    r2 = np.einsum("kna,kna->kn", error, error)
    cost = float(np.sum((CLICK_FREEDOM + 2.0) * np.log1p(r2 / CLICK_FREEDOM)))
    weights = np.where(seen, (CLICK_FREEDOM + 2.0) / (CLICK_FREEDOM + r2), 0.0)
    weighted = (weights[..., None, None] * jacobian).reshape(len(seen), -1, UNKNOWNS)
    flat = jacobian.reshape(len(seen), -1, UNKNOWNS)
    information = np.swapaxes(weighted, 1, 2) @ flat
    gradient = np.einsum("kmi,km->ki", weighted, error.reshape(len(seen), -1))
    return cost, weights, information, gradient


def smoothness_terms(problem: Problem, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Residuals ``(k - 2, 8)`` between three neighbours and their derivatives ``(k - 2, 8, 21)``.

    The first three are the change of the turn from frame to frame, the next three the second difference of the
    CG's position, the last two the slope and curvature of log f; all in their standard deviations.
    """
    smooth, dt = problem.smoothness, 1.0 / problem.camera.fps
    rotation = Rotation.from_matrix(state.rotation)
    turn = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    before, after = turn[:-1], turn[1:]
    k = len(state.log_f)
    error = np.empty((k - 2, 8))
    jacobian = np.zeros((k - 2, 8, _BAND))

    # Log(Exp(d1) R1 R0' Exp(-d0)): the left inverse Jacobian for d1, minus the right one (its transpose) for d0
    scale = 1.0 / (smooth.alpha_rad_per_s2 * dt**2)
    error[:, :3] = scale * (after - before)
    left = left_jacobian_inverse(turn)
    right = np.swapaxes(left, 1, 2)
    jacobian[:, :3, 0:3] = scale * right[:-1]
    jacobian[:, :3, 7:10] = -scale * (right[1:] + left[:-1])
    jacobian[:, :3, 14:17] = scale * left[1:]

    scale = 1.0 / (smooth.acceleration_m_per_s2 * dt**2)
    arm = state.rotation @ problem.arm_m
    origin = translation(state.shift)
    position = origin + arm
    error[:, 3:6] = scale * (position[2:] - 2.0 * position[1:-1] + position[:-2])
    slope = np.zeros((k, 3, 6))
    slope[:, :, :3] = -cross_matrix(arm)
    slope[:, 0, 3] = slope[:, 1, 4] = origin[:, 2]
    slope[:, :, 5] = origin
    for start, factor, frames in ((0, 1.0, slope[:-2]), (7, -2.0, slope[1:-1]), (14, 1.0, slope[2:])):
        jacobian[:, 3:6, start : start + 6] = factor * scale * frames

    zooms = problem.camera.lens == "zoom"
    first = 1.0 / (2.0 * dt * (smooth.zoom_per_s if zooms else smooth.fixed_per_s))
    second = 1.0 / (dt**2 * (smooth.zoom_per_s2 if zooms else smooth.fixed_per_s2))
    f = state.log_f
    error[:, 6] = first * (f[2:] - f[:-2])
    error[:, 7] = second * (f[2:] - 2.0 * f[1:-1] + f[:-2])
    jacobian[:, 6, 6], jacobian[:, 6, 20] = -first, first
    jacobian[:, 7, 6], jacobian[:, 7, 13], jacobian[:, 7, 20] = second, -2.0 * second, second
    return error, jacobian


def reference_terms(problem: Problem) -> list[tuple[int, float, float]]:
    """What is known of log z (column 5) and log f (column 6) of every frame: column, mean, standard deviation.

    A reference for the whole clip is spread evenly: `k` frames each with the square root of `k` times its sigma.
    """
    camera, many = problem.camera, np.sqrt(len(problem.pixels))
    share = 1.0 if camera.lens == "zoom" else many
    if camera.focal_length_px is not None and camera.focal_length_sigma_px is not None:
        return [
            (6, float(np.log(camera.focal_length_px)), share * camera.focal_length_sigma_px / camera.focal_length_px)
        ]
    if camera.camera_distance_m is not None and camera.camera_distance_sigma_m is not None:
        sigma = camera.camera_distance_sigma_m / camera.camera_distance_m
        return [(5, float(np.log(camera.camera_distance_m)), many * sigma)]
    return [(6, guess(camera), many * WEAK_SIGMA_LOG_F)]


class _Normal:
    """Cost, banded normal matrix and gradient at one state."""

    def __init__(self, problem: Problem, state: State, sigma_px: float) -> None:
        self.cost, self.weights, self.information, self.gradient = click_terms(problem, state, sigma_px)
        error, jacobian = smoothness_terms(problem, state)
        v = problem.smoothness.freedom
        weight = np.ones_like(error)
        for part in (slice(0, 3), slice(3, 6)):
            r2 = np.sum(error[:, part] ** 2, axis=1, keepdims=True)
            self.cost += float(np.sum((v + 3.0) * np.log1p(r2 / v)))
            weight[:, part] = (v + 3.0) / (v + r2)
        self.cost += float(np.sum(error[:, 6:] ** 2))
        k = len(state.log_f)
        blocks = self.information.copy()
        self.slope = self.gradient.copy()
        for column, mean, sigma in reference_terms(problem):
            value = state.log_f if column == 6 else state.shift[:, 2]
            off = (mean - value) / sigma
            self.cost += float(off @ off)
            blocks[:, column, column] += 1.0 / sigma**2
            self.slope[:, column] += off / sigma
        weighted = weight[..., None] * jacobian
        windows = np.swapaxes(weighted, 1, 2) @ jacobian
        pull = -np.einsum("kmi,km->ki", weighted, error).reshape(k - 2, 3, UNKNOWNS)
        for place in range(3):
            self.slope[place : k - 2 + place] += pull[:, place]
        self.band = np.zeros((_BAND, UNKNOWNS * k))
        starts = UNKNOWNS * np.arange(k - 2)
        for j in range(_BAND):
            for i in range(j, _BAND):
                self.band[i - j, starts + j] += windows[:, i, j]
        starts = UNKNOWNS * np.arange(k)
        for j in range(UNKNOWNS):
            for i in range(j, UNKNOWNS):
                self.band[i - j, starts + j] += blocks[:, i, j]


def estimate(problem: Problem, start: State, *, sigma_px: float | None = None, iterations: int = 60) -> Batch:
    """Most likely state near a start; damped Gauss-Newton with reweighting.

    Parameters
    ----------
    problem
        Clicks and knowledge; at least five frames.
    start
        Where to begin.
    sigma_px
        Standard deviation of a click coordinate where it is known; otherwise estimated from the residuals, starting
        from the camera file's.
    iterations
        At most, for each of the passes between which the noise is estimated.
    """
    sigma, measured, taken = sigma_px or problem.camera.click_sigma_px, False, 0
    state, normal, steps = _descend(problem, start, sigma, iterations)
    taken += steps
    for _ in range(0 if sigma_px is not None else 3):
        told, measured = _click_noise(problem, state, normal, sigma)
        if not measured or abs(told / sigma - 1.0) < 0.01:
            break
        sigma = told
        state, normal, steps = _descend(problem, state, sigma, iterations)
        taken += steps
    predicted = project(problem.points, state.rotation, state.shift, state.log_f, problem.lens)[0]
    # the normalisation of the likelihood: what a wider noise pays for its better fit
    count = float(problem.seen.sum())
    return Batch(
        state=state,
        cost=normal.cost + 4.0 * count * float(np.log(sigma)),
        sigma_px=float(sigma),
        sigma_measured=measured,
        weights=normal.weights,
        errors_px=problem.pixels - predicted,
        clicks_information=normal.information,
        clicks_gradient=normal.gradient,
        covariance=_covariance(normal),
        iterations=taken,
    )


def _descend(problem: Problem, state: State, sigma: float, iterations: int) -> tuple[State, _Normal, int]:
    normal = _Normal(problem, state, sigma)
    damping, taken = 1e-4, 0
    for _ in range(iterations):
        damped = normal.band.copy()
        damped[0] *= 1.0 + damping
        try:
            step = solveh_banded(damped, normal.slope.ravel(), lower=True).reshape(-1, UNKNOWNS)
        except np.linalg.LinAlgError:  # rounding made it indefinite: a shorter step is a safer one
            damping *= 100.0
            continue
        largest = max(np.abs(step[:, :3]).max() / 0.5, np.abs(step[:, 5:]).max() / 0.5, 1.0)
        step = step / largest
        tried = state.moved(step)
        new = _Normal(problem, tried, sigma)
        taken += 1
        if new.cost <= normal.cost:
            gain = normal.cost - new.cost
            state, normal, damping = tried, new, max(0.2 * damping, 1e-9)
            if gain < 1e-7 * (1.0 + abs(normal.cost)) and largest == 1.0:
                break
        else:
            damping *= 8.0
            if damping > 1e8:
                break
    return state, normal, taken


def _covariance(normal: _Normal) -> np.ndarray:
    size = normal.band.shape[1]
    factor = cholesky_banded(normal.band, lower=True)
    full = cho_solve_banded((factor, True), np.eye(size))
    blocks = full.reshape(size // UNKNOWNS, UNKNOWNS, size // UNKNOWNS, UNKNOWNS)
    index = np.arange(size // UNKNOWNS)
    return blocks[index, :, index, :]


def _click_noise(problem: Problem, state: State, normal: _Normal, sigma: float) -> tuple[float, bool]:
    """Standard deviation of a click from the weighted residuals and the equations that the state left free.

    A wild click counts no more than six ordinary ones, whatever its distance. The constant makes the estimate right
    where clicks are Gaussian: the mean of w r^2 is then (v + 2) (1 - v/2 exp(v/2) E1(v/2)), not 2.
    """
    seen = problem.seen
    freedom = 2.0 * seen.sum() - float(np.einsum("kij,kji->", normal.information, _covariance(normal)))
    if freedom < _FEWEST_FREEDOM or (seen.sum(axis=1) >= 4).sum() < 3:
        return sigma, False
    predicted = project(problem.points, state.rotation, state.shift, state.log_f, problem.lens)[0]
    squared = np.where(seen, problem.weight * np.sum((problem.pixels - predicted) ** 2, axis=2), 0.0)
    half = 0.5 * CLICK_FREEDOM
    usual = 0.5 * (CLICK_FREEDOM + 2.0) * (1.0 - half * np.exp(half) * exp1(half))
    return max(float(np.sqrt(np.sum(normal.weights * squared) / (usual * freedom))), 1e-3), True
