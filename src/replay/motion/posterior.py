"""Posterior mode: what the clip can really tell, with a band on every number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from replay.motion.batch import Batch, Problem, State, cross_matrix
from replay.motion.camera import translation
from replay.motion.flips import estimate_both
from replay.motion.kinematics import Kinematics
from replay.motion.protocol import ProtocolMotion, lens_of
from replay.motion.readout import ANGULAR, LINEAR, read_out
from replay.motion.settings import CameraSettings
from replay.motion.tracks import Template, Tracks

DRAWS = 200
NULL_REPLICATES = 8
_SEED = 590940
_MOST_FRAMES = 120


@dataclass(frozen=True)
class Draws:
    """Motions of the skull CG drawn from the posterior; global axes, ``(draws, g, ...)`` on the grid `time_s`.

    Parameters
    ----------
    time_s
        ``(g,)`` [s].
    rotation
        ``(draws, g, 4)`` quaternions head to global.
    position_m, velocity_m_per_s, acceleration_m_per_s2
        ``(draws, g, 3)``.
    omega_rad_per_s, alpha_rad_per_s2
        ``(draws, g, 3)``.
    ray
        ``(3,)`` unit vector of the line of sight at the middle of the window.
    """

    time_s: np.ndarray
    rotation: np.ndarray
    position_m: np.ndarray
    velocity_m_per_s: np.ndarray
    acceleration_m_per_s2: np.ndarray
    omega_rad_per_s: np.ndarray
    alpha_rad_per_s2: np.ndarray
    ray: np.ndarray

    @property
    def along_ray(self) -> np.ndarray:
        """``(draws, g)`` CG acceleration along the line of sight."""
        return self.acceleration_m_per_s2 @ self.ray

    def peaks(self, margin_s: float) -> dict[str, np.ndarray]:
        """Peaks of every draw ``(draws,)``, the first and last `margin_s` left out; ``t0_s`` is that of alpha's."""
        inner = (self.time_s >= self.time_s[0] + margin_s) & (self.time_s <= self.time_s[-1] - margin_s)
        a = self.acceleration_m_per_s2[:, inner]
        along = self.along_ray[:, inner]
        across = np.linalg.norm(a - along[..., None] * self.ray, axis=2)
        alpha = np.linalg.norm(self.alpha_rad_per_s2[:, inner], axis=2)
        return {
            "omega_rad_per_s": np.linalg.norm(self.omega_rad_per_s[:, inner], axis=2).max(axis=1),
            "alpha_rad_per_s2": alpha.max(axis=1),
            "a_m_per_s2": np.linalg.norm(a, axis=2).max(axis=1),
            "a_across_m_per_s2": across.max(axis=1),
            "a_along_m_per_s2": np.abs(along).max(axis=1),
            "t0_s": self.time_s[inner][alpha.argmax(axis=1)],
        }

    def motion(self, draw: int) -> Kinematics:
        """One draw."""
        return Kinematics(
            self.time_s,
            self.position_m[draw],
            Rotation.from_quat(self.rotation[draw]),
            self.velocity_m_per_s[draw],
            self.acceleration_m_per_s2[draw],
            self.omega_rad_per_s[draw],
            self.alpha_rad_per_s2[draw],
        )


@dataclass(frozen=True)
class PosteriorMotion:
    """What posterior mode finds in one clip.

    Parameters
    ----------
    draws
        Motions that the clip allows.
    frames_s
        ``(k,)`` times of the frames that were read [s].
    batch
        The most likely states over the clip.
    flip_margin
        Logarithm of the odds of the chosen path against its best twin; infinite where no twin ends apart.
    event_probability
        That the rotation holds an event and not just a slow turn.
    null_peak_rad_per_s
        Peak angular velocity that the same read-out finds where the same noise falls on a head at rest; NaN where
        it was not asked for.
    """

    draws: Draws
    frames_s: np.ndarray
    batch: Batch
    flip_margin: float
    event_probability: float
    null_peak_rad_per_s: float

    @property
    def at_frames(self) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the frames that were read, and of the grid's points at them."""
        time = self.draws.time_s
        index = np.flatnonzero((self.frames_s >= time[0] - 1e-9) & (self.frames_s <= time[-1] + 1e-9))
        return index, np.searchsorted(time, self.frames_s[index] - 1e-9)

    @property
    def peaks(self) -> dict[str, np.ndarray]:
        """Peaks of every draw, the first and last frame interval left out."""
        return self.draws.peaks(float(self.frames_s[1] - self.frames_s[0]))

    @property
    def central(self) -> int:
        """The draw whose peaks lie closest to the medians: one motion that the clip allows, not a mean of many."""
        table = np.stack([values if name == "t0_s" else np.log(values) for name, values in self.peaks.items()], axis=1)
        off = (table - np.median(table, axis=0)) / np.maximum(table.std(axis=0), 1e-9)
        return int(np.argmin(np.sum(off**2, axis=1)))


def reconstruct_posterior(
    tracks: Tracks,
    template: Template,
    camera: CameraSettings,
    protocol: ProtocolMotion,
    *,
    draws: int = DRAWS,
    seed: int = _SEED,
    null: bool = False,
) -> PosteriorMotion:
    """Batch estimate over the clip, then a read-out between its frames.

    Parameters
    ----------
    tracks, template, camera
        What the play names.
    protocol
        Protocol mode's reconstruction: where the search begins.
    draws
        Number of motions drawn.
    seed
        Of the draws.
    null
        Whether to simulate the null peak too.
    """
    to_head = Rotation.from_quat(camera.template_to_head)
    problem = Problem(
        points=template.points_m,
        pixels=tracks.pixels,
        weight=tracks.weight,
        arm_m=np.array(camera.helmet_to_com),
        camera=camera,
        lens=lens_of(camera),
    )
    paths = estimate_both(problem, protocol)
    costs = np.array([path.cost for path in paths])
    odds = np.exp(-0.5 * (costs - costs[0]))
    counts = np.round(draws * odds / odds.sum()).astype(int)
    rng = np.random.default_rng(seed)
    time = tracks.frames / camera.fps
    parts, probability = [], 0.0
    for path, count in zip(paths, counts):
        if count > 0:
            drawn, chance = _read_path(path, problem, time, rng, int(count), to_head)
            parts.append(drawn)
            probability += chance * count / counts.sum()
    return PosteriorMotion(
        draws=parts[0] if len(parts) == 1 else _joined(parts),
        frames_s=time,
        batch=paths[0],
        flip_margin=float(0.5 * (costs[1] - costs[0])) if len(costs) > 1 else float("inf"),
        event_probability=probability,
        null_peak_rad_per_s=_null_peak(paths[0], time, rng) if null else float("nan"),
    )


def _null_peak(batch: Batch, time: np.ndarray, rng: np.random.Generator) -> float:
    """Median peak of the angular read-out of a head at rest, seen by the same clicks with the same noise."""
    keep = _window(batch.state, time)
    information, _ = _marginal(batch.clicks_information[keep], batch.clicks_gradient[keep], slice(0, 3), slice(3, 6))
    to_body = np.swapaxes(batch.state.rotation[keep], 1, 2)
    information = to_body @ information @ np.swapaxes(to_body, 1, 2)
    roots = np.linalg.cholesky(np.linalg.inv(_floored(information)))
    peaks = []
    for _ in range(NULL_REPLICATES):
        noise = (roots @ rng.standard_normal((len(roots), 3, 1)))[..., 0]
        quiet = read_out(time[keep], noise, information, ANGULAR, rng, draws=100)
        inner = slice(
            *np.searchsorted(quiet.time_s, [quiet.time_s[0] + time[1] - time[0], quiet.time_s[-1] - time[1] + time[0]])
        )
        peaks.append(np.median(np.linalg.norm(quiet.rate[:, inner], axis=2).max(axis=1)))
    return float(np.median(peaks))


def _read_path(
    batch: Batch, problem: Problem, time: np.ndarray, rng: np.random.Generator, count: int, to_head: Rotation
) -> tuple[Draws, float]:
    """Angular, then linear read-out along one path."""
    state, camera = batch.state, problem.camera
    keep = _window(state, time)
    time = time[keep]
    reference = Rotation.from_matrix(state.rotation[keep])
    information, gradient = batch.clicks_information[keep], batch.clicks_gradient[keep]

    # orientation: what each frame's clicks say of the turn away from the batch, its translation left free
    # (log f is taken from the batch: a turn hardly feels it)
    turn_information, turn_gradient = _marginal(information, gradient, slice(0, 3), slice(3, 6))
    to_body = np.swapaxes(state.rotation[keep], 1, 2)
    away = np.linalg.solve(_floored(turn_information), turn_gradient[..., None])
    turns = (reference[:-1].inv() * reference[1:]).as_rotvec()
    level = np.concatenate([np.zeros((1, 3)), np.cumsum(turns, axis=0)])
    angular = read_out(
        time,
        (to_body @ away)[..., 0] + level,
        to_body @ turn_information @ np.swapaxes(to_body, 1, 2),
        ANGULAR,
        rng,
        draws=count,
    )
    grid = angular.time_s
    steps = (len(grid) - 1) // (len(time) - 1)
    share = (np.arange(len(grid)) % steps) / steps
    at = np.minimum(np.arange(len(grid)) // steps, len(time) - 2)
    share[-1] = 1.0
    between = Rotation.from_rotvec(share[:, None] * turns[at])
    base = reference[at] * between
    off = angular.level - (level[at] + share[:, None] * turns[at])
    rotation = _compose(base, off)

    # position of the CG, with the orientation as the angular read-out left it
    frames = slice(None, None, steps)
    settled = off[:, frames]
    mean_turn = np.einsum("kij,kj->ki", state.rotation[keep], settled.mean(axis=0))
    spread = np.einsum("dki,dkj->kij", settled - settled.mean(axis=0), settled - settled.mean(axis=0)) / max(
        count - 1, 1
    )
    position, position_information = _cg(batch, problem, keep, mean_turn, spread)
    centre = position.mean(axis=0)
    told = angular.event_s[np.isfinite(angular.event_s)]
    hint = None
    if len(told) > 0.5 * count:
        hint = (float(np.median(told)), float(np.sqrt(0.008**2 + np.var(told))))
    linear = read_out(time, position - centre, position_information, LINEAR, rng, draws=count, instant=hint)

    to_global = camera.rotation_to_global
    whole = _turned(to_global, rotation)
    head = (Rotation.from_quat(whole.reshape(-1, 4)) * to_head.inv()).as_quat().reshape(whole.shape)
    apply = Rotation.from_quat(whole.reshape(-1, 4)).apply

    def vectors(values: np.ndarray) -> np.ndarray:
        return to_global.apply(values.reshape(-1, 3)).reshape(values.shape)

    ray = to_global.apply(centre / np.linalg.norm(centre))
    return (
        Draws(
            time_s=grid,
            rotation=head,
            position_m=vectors(linear.level + centre),
            velocity_m_per_s=vectors(linear.rate),
            acceleration_m_per_s2=vectors(linear.slope),
            omega_rad_per_s=apply(angular.rate.reshape(-1, 3)).reshape(angular.rate.shape),
            alpha_rad_per_s2=apply(angular.slope.reshape(-1, 3)).reshape(angular.slope.shape),
            ray=ray,
        ),
        angular.event_probability,
    )


def _window(state: State, time: np.ndarray) -> slice:
    """At most 120 frames around the fastest change of the turn."""
    if len(time) <= _MOST_FRAMES:
        return slice(None)
    rotation = Rotation.from_matrix(state.rotation)
    turn = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    middle = 1 + int(np.argmax(np.linalg.norm(np.diff(turn, axis=0), axis=1)))
    first = int(np.clip(middle - _MOST_FRAMES // 2, 0, len(time) - _MOST_FRAMES))
    return slice(first, first + _MOST_FRAMES)


def _floored(information: np.ndarray) -> np.ndarray:
    floor = 1e-9 * np.einsum("kii->k", information).max()
    return information + floor * np.eye(information.shape[-1])


def _marginal(information: np.ndarray, gradient: np.ndarray, kept: slice, free: slice) -> tuple[np.ndarray, np.ndarray]:
    """Information and gradient of some unknowns with others left free (Schur complement)."""
    a, b = information[:, kept, kept], information[:, kept, free]
    c = information[:, free, free]
    scale = 1e-12 * np.einsum("kii->ki", c).max(axis=0)
    ratio = b @ np.linalg.inv(c + np.eye(c.shape[-1]) * scale[:, None])
    return a - ratio @ np.swapaxes(b, 1, 2), gradient[:, kept] - (ratio @ gradient[:, free, None])[..., 0]


def _cg(
    batch: Batch, problem: Problem, keep: slice, turn: np.ndarray, turn_covariance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """CG in camera axes ``(k, 3)`` and its information, given the settled orientation: mean, body covariance."""
    state = batch.state
    information, gradient = batch.clicks_information[keep], batch.clicks_gradient[keep]
    rotation, shift = state.rotation[keep], state.shift[keep]
    origin, arm = translation(shift), state.rotation[keep] @ problem.arm_m
    move = np.zeros((len(shift), 3, 3))
    move[:, 0, 0] = move[:, 1, 1] = origin[:, 2]
    move[:, :, 2] = origin
    c, b = information[:, 3:6, 3:6], information[:, 3:6, :3]
    scale = 1e-9 * np.einsum("kii->ki", c).max(axis=0)
    inverse = np.linalg.inv(c + np.eye(3) * scale[:, None])
    follow = -inverse @ b
    step = (inverse @ gradient[:, 3:6, None])[..., 0] + np.einsum("kij,kj->ki", follow, turn)
    carried = move @ follow - cross_matrix(arm)
    spread = carried @ rotation
    covariance = move @ inverse @ np.swapaxes(move, 1, 2) + spread @ turn_covariance @ np.swapaxes(spread, 1, 2)
    position = origin + arm + np.einsum("kij,kj->ki", move, step) - np.cross(arm, turn)
    return position, np.linalg.inv(covariance)


def _compose(base: Rotation, off: np.ndarray) -> np.ndarray:
    """Quaternions ``(draws, g, 4)`` of the base turned by `off` in its own axes."""
    small = Rotation.from_rotvec(off.reshape(-1, 3))
    tiled = Rotation.from_quat(np.tile(base.as_quat(), (len(off), 1)))
    return (tiled * small).as_quat().reshape(*off.shape[:2], 4)


def _turned(by: Rotation, quaternions: np.ndarray) -> np.ndarray:
    return (by * Rotation.from_quat(quaternions.reshape(-1, 4))).as_quat().reshape(quaternions.shape)


def _joined(parts: list[Draws]) -> Draws:
    names = (
        "rotation",
        "position_m",
        "velocity_m_per_s",
        "acceleration_m_per_s2",
        "omega_rad_per_s",
        "alpha_rad_per_s2",
    )
    return Draws(
        time_s=parts[0].time_s,
        ray=parts[0].ray,
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names},
    )
