"""Posterior mode: what the clip can really tell, with a band on every number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from replay.motion.bands import RATIOS
from replay.motion.batch import Batch, Problem
from replay.motion.flips import estimate_both
from replay.motion.kinematics import Kinematics
from replay.motion.onset import BeforeOnset, before_onset, contact_index
from replay.motion.protocol import ProtocolMotion, lens_of
from replay.motion.readout import ANGULAR, LINEAR, read_out
from replay.motion.settings import CameraSettings
from replay.motion.told import Told, Turning, focal_told, position_told, window
from replay.motion.tracks import Template, Tracks

DRAWS = 200
NULL_REPLICATES = 8
_SEED = 590940


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

    def inner(self, margin_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Which points of the grid are at least `margin_s` from both ends, and their times [s]."""
        inside = (self.time_s >= self.time_s[0] + margin_s) & (self.time_s <= self.time_s[-1] - margin_s)
        return inside, self.time_s[inside]

    def peaks(self, margin_s: float) -> dict[str, np.ndarray]:
        """Peaks of every draw ``(draws,)`` within the margins; ``t0_s`` is alpha's, ``onset_s`` the impact's."""
        inside, time = self.inner(margin_s)
        a = self.acceleration_m_per_s2[:, inside]
        along = self.along_ray[:, inside]
        across = np.linalg.norm(a - along[..., None] * self.ray, axis=2)
        alpha = np.linalg.norm(self.alpha_rad_per_s2[:, inside], axis=2)
        total = np.linalg.norm(a, axis=2)
        return {
            "omega_rad_per_s": np.linalg.norm(self.omega_rad_per_s[:, inside], axis=2).max(axis=1),
            "alpha_rad_per_s2": alpha.max(axis=1),
            "a_m_per_s2": total.max(axis=1),
            "a_across_m_per_s2": across.max(axis=1),
            "a_along_m_per_s2": np.abs(along).max(axis=1),
            "t0_s": time[alpha.argmax(axis=1)],
            "onset_s": time[contact_index(alpha, total)],
        }

    def relative_alpha(self, margin_s: float) -> np.ndarray:
        """Mean over the draws of angular acceleration over its peak, ``(inner points,)``."""
        inside, _ = self.inner(margin_s)
        alpha = np.linalg.norm(self.alpha_rad_per_s2[:, inside], axis=2)
        return (alpha / alpha.max(axis=1, keepdims=True)).mean(axis=0)

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
    before
        Motion just before the impact.
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
    before: BeforeOnset
    flip_margin: float
    event_probability: float
    null_peak_rad_per_s: float

    @property
    def fps(self) -> float:
        """Frame rate [Hz]."""
        return 1.0 / float(self.frames_s[1] - self.frames_s[0])

    @property
    def at_frames(self) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the frames that were read, and of the grid's points at them."""
        time = self.draws.time_s
        index = np.flatnonzero((self.frames_s >= time[0] - 1e-9) & (self.frames_s <= time[-1] + 1e-9))
        return index, np.searchsorted(time, self.frames_s[index] - 1e-9)

    @property
    def peaks(self) -> dict[str, np.ndarray]:
        """Peaks of every draw, the first and last frame interval left out."""
        return self.draws.peaks(1.0 / self.fps)

    @property
    def relative_alpha(self) -> np.ndarray:
        """`Draws.relative_alpha`, the first and last frame interval left out."""
        return self.draws.relative_alpha(1.0 / self.fps)

    @property
    def central(self) -> int:
        """The draw whose peaks lie closest to the medians: one motion that the clip allows, not a mean of many."""
        table = np.stack([np.log(values) if name in RATIOS else values for name, values in self.peaks.items()], axis=1)
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
    read = [_read_path(p, problem, time, rng, int(n), to_head) for p, n in zip(paths, counts) if n > 0]
    drawn = read[0].draws if len(read) == 1 else _joined([path.draws for path in read])
    focal = focal_told(paths[0], problem, window(paths[0].state, time))
    onsets = drawn.peaks(float(time[1] - time[0]))["onset_s"]
    return PosteriorMotion(
        draws=drawn,
        frames_s=time,
        batch=paths[0],
        before=before_onset(read[0].turning, read[0].position, focal, onsets, problem),
        flip_margin=float(0.5 * (costs[1] - costs[0])) if len(costs) > 1 else float("inf"),
        event_probability=float(np.dot([path.event_probability for path in read], counts[counts > 0]) / counts.sum()),
        null_peak_rad_per_s=_null_peak(paths[0], time, rng) if null else float("nan"),
    )


def _null_peak(batch: Batch, time: np.ndarray, rng: np.random.Generator) -> float:
    """Median peak of the angular read-out of a head at rest, seen by the same clicks with the same noise."""
    told = Turning.of(batch, window(batch.state, time), time).told
    roots = np.linalg.cholesky(np.linalg.inv(told.information))
    peaks = []
    for _ in range(NULL_REPLICATES):
        noise = (roots @ rng.standard_normal((len(roots), 3, 1)))[..., 0]
        quiet = read_out(told.time_s, noise, told.information, ANGULAR, rng, draws=100)
        inner = slice(
            *np.searchsorted(quiet.time_s, [quiet.time_s[0] + time[1] - time[0], quiet.time_s[-1] - time[1] + time[0]])
        )
        peaks.append(np.median(np.linalg.norm(quiet.rate[:, inner], axis=2).max(axis=1)))
    return float(np.median(peaks))


@dataclass(frozen=True)
class _Read:
    """One path: its draws, what its frames tell, and whether there is an event."""

    draws: Draws
    turning: Turning
    position: Told
    event_probability: float


def _read_path(
    batch: Batch, problem: Problem, time: np.ndarray, rng: np.random.Generator, count: int, to_head: Rotation
) -> _Read:
    """Angular, then linear read-out along one path."""
    camera, kept = problem.camera, window(batch.state, time)
    turning = Turning.of(batch, kept, time)
    told = turning.told
    angular = read_out(told.time_s, told.values, told.information, ANGULAR, rng, draws=count)
    base, level = turning.between(len(angular.time_s))
    off = angular.level - level
    rotation = _compose(base, off)

    # position of the CG, with the orientation as the angular read-out left it
    settled = off[:, :: (len(angular.time_s) - 1) // (len(told.time_s) - 1)]
    mean = settled.mean(axis=0)
    spread = np.einsum("dki,dkj->kij", settled - mean, settled - mean) / max(count - 1, 1)
    turned = np.einsum("kij,kj->ki", batch.state.rotation[kept], mean)
    position = position_told(batch, problem, kept, time, turned, spread)
    centre = position.values.mean(axis=0)
    found = angular.event_s[np.isfinite(angular.event_s)]
    hint = None
    if len(found) > 0.5 * count:
        hint = (float(np.median(found)), float(np.sqrt(0.008**2 + np.var(found))))
    linear = read_out(
        position.time_s, position.values - centre, position.information, LINEAR, rng, draws=count, instant=hint
    )

    to_global = camera.rotation_to_global
    whole = _turned(to_global, rotation)
    head = (Rotation.from_quat(whole.reshape(-1, 4)) * to_head.inv()).as_quat().reshape(whole.shape)
    apply = Rotation.from_quat(whole.reshape(-1, 4)).apply

    def vectors(values: np.ndarray) -> np.ndarray:
        return to_global.apply(values.reshape(-1, 3)).reshape(values.shape)

    ray = to_global.apply(centre / np.linalg.norm(centre))
    draws = Draws(
        time_s=angular.time_s,
        rotation=head,
        position_m=vectors(linear.level + centre),
        velocity_m_per_s=vectors(linear.rate),
        acceleration_m_per_s2=vectors(linear.slope),
        omega_rad_per_s=apply(angular.rate.reshape(-1, 3)).reshape(angular.rate.shape),
        alpha_rad_per_s2=apply(angular.slope.reshape(-1, 3)).reshape(angular.slope.shape),
        ray=ray,
    )
    return _Read(draws, turning, position, angular.event_probability)


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
