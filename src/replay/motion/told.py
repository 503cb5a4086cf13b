"""What each frame's clicks tell by themselves: of the head's turn, and of where its CG is.

The batch estimate keeps the quadratic through the log-likelihood of every frame's clicks. From it follow values with
known information, free of what the batch expects between the frames; what reads between them starts from these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from replay.motion.batch import Batch, Problem, State, cross_matrix, reference_terms
from replay.motion.camera import translation

_MOST_FRAMES = 120


@dataclass(frozen=True)
class Told:
    """The integral of a rate as the frames tell it.

    Parameters
    ----------
    time_s
        ``(k,)`` evenly spaced frames [s].
    values
        ``(k, 3)`` integral of the rate at the frames.
    information
        ``(k, 3, 3)`` inverse covariance of each; zero where a frame tells nothing.
    """

    time_s: np.ndarray
    values: np.ndarray
    information: np.ndarray


@dataclass(frozen=True)
class Turning:
    """Orientation as the frames tell it, as turns away from the batch estimate.

    Parameters
    ----------
    reference
        ``(k,)`` the batch estimate, template to camera.
    turns, level
        ``(k - 1, 3)`` its turns from frame to frame and ``(k, 3)`` their sum, template axes [rad].
    told
        Integral of the angular velocity, template axes [rad].
    """

    reference: Rotation
    turns: np.ndarray
    level: np.ndarray
    told: Told

    @classmethod
    def of(cls, batch: Batch, kept: slice, time_s: np.ndarray) -> Turning:
        """Of the kept frames: their clicks' information with the translation left free.

        Log f is taken from the batch: a turn hardly feels it.
        """
        information, gradient = marginal(
            batch.clicks_information[kept], batch.clicks_gradient[kept], slice(0, 3), slice(3, 6)
        )
        information = floored(information)
        reference = Rotation.from_matrix(batch.state.rotation[kept])
        to_body = np.swapaxes(batch.state.rotation[kept], 1, 2)
        away = np.linalg.solve(information, gradient[..., None])
        turns = (reference[:-1].inv() * reference[1:]).as_rotvec()
        level = np.concatenate([np.zeros((1, 3)), np.cumsum(turns, axis=0)])
        told = Told(time_s[kept], (to_body @ away)[..., 0] + level, to_body @ information @ np.swapaxes(to_body, 1, 2))
        return cls(reference, turns, level, told)

    def between(self, points: int) -> tuple[Rotation, np.ndarray]:
        """Batch orientation and its integral ``(points, 3)`` on an even grid through all frames."""
        steps = (points - 1) // (len(self.level) - 1)
        share = (np.arange(points) % steps) / steps
        at = np.minimum(np.arange(points) // steps, len(self.level) - 2)
        share[-1] = 1.0
        part = share[:, None] * self.turns[at]
        return self.reference[at] * Rotation.from_rotvec(part), self.level[at] + part


def position_told(
    batch: Batch, problem: Problem, kept: slice, time_s: np.ndarray, turn: np.ndarray, covariance: np.ndarray
) -> Told:
    """CG in camera axes as the frames tell it, given the settled orientation.

    Parameters
    ----------
    turn
        ``(k, 3)`` mean turn away from the batch, camera axes [rad].
    covariance
        ``(k, 3, 3)`` of the orientation, template axes [rad^2].
    """
    state = batch.state
    information, gradient = batch.clicks_information[kept], batch.clicks_gradient[kept]
    rotation, shift = state.rotation[kept], state.shift[kept]
    origin, arm = translation(shift), state.rotation[kept] @ problem.arm_m
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
    total = move @ inverse @ np.swapaxes(move, 1, 2) + spread @ covariance @ np.swapaxes(spread, 1, 2)
    position = origin + arm + np.einsum("kij,kj->ki", move, step) - np.cross(arm, turn)
    return Told(time_s[kept], position, np.linalg.inv(total))


def focal_told(batch: Batch, problem: Problem, kept: slice) -> np.ndarray:
    """Information ``(k,)`` on log f of each kept frame: by its clicks' perspective, and where it is known by frame."""
    information, _ = marginal(batch.clicks_information[kept], batch.clicks_gradient[kept], slice(6, 7), slice(0, 6))
    known = sum(1.0 / sigma**2 for column, _, sigma in reference_terms(problem) if column == 6)
    return np.maximum(information[:, 0, 0], 0.0) + known + 1e-12


def window(state: State, time: np.ndarray) -> slice:
    """At most 120 frames of a clip, around the fastest change of the turn."""
    if len(time) <= _MOST_FRAMES:
        return slice(None)
    rotation = Rotation.from_matrix(state.rotation)
    turn = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    middle = 1 + int(np.argmax(np.linalg.norm(np.diff(turn, axis=0), axis=1)))
    first = int(np.clip(middle - _MOST_FRAMES // 2, 0, len(time) - _MOST_FRAMES))
    return slice(first, first + _MOST_FRAMES)


def floored(information: np.ndarray) -> np.ndarray:
    """Information ``(k, n, n)`` without what rounding made of nothing: two landmarks leave a direction untold."""
    floor = 1e-9 * np.einsum("kii->k", information).max()
    values, vectors = np.linalg.eigh(0.5 * (information + np.swapaxes(information, 1, 2)))
    return (vectors * np.maximum(values, floor)[:, None]) @ np.swapaxes(vectors, 1, 2)


def marginal(information: np.ndarray, gradient: np.ndarray, kept: slice, free: slice) -> tuple[np.ndarray, np.ndarray]:
    """Information and gradient of some unknowns with others left free (Schur complement)."""
    a, b = information[:, kept, kept], information[:, kept, free]
    c = information[:, free, free]
    scale = 1e-12 * np.einsum("kii->ki", c).max(axis=0)
    ratio = b @ np.linalg.inv(c + np.eye(c.shape[-1]) * scale[:, None])
    return a - ratio @ np.swapaxes(b, 1, 2), gradient[:, kept] - (ratio @ gradient[:, free, None])[..., 0]
