"""Depth-reversed twins of a whole path: from afar a thin template and its mirror image are the same picture.

Both paths are estimated over the whole clip and compared by their likelihood there, in which the motion between
frames counts too. What the clicks cannot decide stays undecided, and is said.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from replay.motion.batch import Batch, Problem, State, estimate
from replay.motion.pose import mirrored, refine
from replay.motion.protocol import ProtocolMotion

_APART_RAD = np.radians(8.0)
_JUMP_RAD = 0.6


def starts(problem: Problem, motion: ProtocolMotion) -> list[State]:
    """Paths to start from: protocol mode's, and the smooth ones through its poses and their mirrored twins.

    From the middle frame outwards, a path takes at each frame the pose, or twin, that turns least.
    """
    poses = motion.poses
    pixels, seen = problem.pixels[motion.used], problem.seen[motion.used]
    sigma = problem.camera.click_sigma_px / np.sqrt(problem.weight[motion.used])
    twin = refine(problem.points, pixels, mirrored(problem.points, seen, poses), problem.lens, sigma_px=sigma)
    found = [_bridged(motion, poses.rotation, poses.shift)]
    pairs = np.stack([poses.rotation, twin.rotation]), np.stack([poses.shift, twin.shift])
    middle = len(poses.rotation) // 2
    for first in (0, 1):
        choice = np.zeros(len(poses.rotation), dtype=int)
        choice[middle] = first
        for order in (range(middle + 1, len(choice)), range(middle - 1, -1, -1)):
            previous = pairs[0][first, middle]
            for k in order:
                choice[k] = int(np.argmax([np.sum(pairs[0][s, k] * previous) for s in (0, 1)]))
                previous = pairs[0][choice[k], k]
        index = np.arange(len(choice))
        found.append(_bridged(motion, pairs[0][choice, index], pairs[1][choice, index]))
    found.append(_without_jumps(found[0]))
    return [state for i, state in enumerate(found) if all(_differs(state, other) for other in found[:i])]


def _differs(one: State, other: State) -> bool:
    """Whether two starts are far enough apart anywhere to end apart."""
    turn = Rotation.from_matrix(np.swapaxes(one.rotation, 1, 2) @ other.rotation).magnitude()
    return bool(turn.max() > 0.1 * _APART_RAD)


def _without_jumps(state: State) -> State:
    """The same path carried over frames that jump out of it and back: what one wild click can do to few landmarks."""
    rotation = Rotation.from_matrix(state.rotation)
    turn = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    jumps = np.zeros(len(rotation), dtype=bool)
    jumps[1:-1] = np.linalg.norm(np.diff(turn, axis=0), axis=1) > _JUMP_RAD
    kept = np.flatnonzero(~jumps)
    if len(kept) < 3:
        return state
    every = np.clip(np.arange(len(rotation)), kept[0], kept[-1])
    between = Slerp(kept, rotation[kept])(every).as_matrix()
    columns = [np.interp(np.arange(len(rotation)), kept, state.shift[kept, i]) for i in range(3)]
    return State(between, np.stack(columns, axis=1), state.log_f)


def _bridged(motion: ProtocolMotion, rotation: np.ndarray, shift: np.ndarray) -> State:
    """Poses of the used frames carried over the others."""
    every = np.arange(len(motion.used))
    at = every[motion.used]
    between = Slerp(at, Rotation.from_matrix(rotation))(np.clip(every, at[0], at[-1])).as_matrix()
    columns = [np.interp(every, at, shift[:, i]) for i in range(3)]
    log_f = np.interp(every, at, motion.poses.log_f)
    return State(between, np.stack(columns, axis=1), log_f)


def estimate_both(problem: Problem, motion: ProtocolMotion) -> list[Batch]:
    """Estimates from every start that end apart, the most likely first, all with one click noise."""
    found: list[Batch] = []
    sigma: float | None = None
    for start in starts(problem, motion):
        batch = estimate(problem, start, sigma_px=sigma)
        if sigma is None:
            sigma = batch.sigma_px
        elif found:
            batch = replace(batch, sigma_measured=found[0].sigma_measured)
        if all(apart(batch.state, other.state) for other in found):
            found.append(batch)
        else:
            twin = next(i for i, other in enumerate(found) if not apart(batch.state, other.state))
            if batch.cost < found[twin].cost:
                found[twin] = batch
    return sorted(found, key=lambda batch: batch.cost)


def apart(one: State, other: State) -> bool:
    """Whether two paths differ by more than 8 degrees in the middling frame."""
    turn = Rotation.from_matrix(np.swapaxes(one.rotation, 1, 2) @ other.rotation).magnitude()
    return bool(np.quantile(turn, 0.75) > _APART_RAD)
