"""Rigid bodies of a run: their mass and inertia, their poses, the motion a driver prescribes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.arrays import WHERE
from replay.solver.kernels.bodies import BODY_SUMS, advance_bodies, prescribed_pose, present_twists
from replay.solver.kernels.lanes import POSITION, VELOCITY
from replay.solver.layout import Layout
from replay.solver.prescribed import PrescribedMotion
from replay.solver.problem import Problem

_GAUSS = 0.5773502691896257
_SIGNS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)


@dataclass(frozen=True)
class Pose:
    """Where a body is and how it moves.

    Parameters
    ----------
    position : (3,)
        Centre of gravity, or the reference point of a driven body [m].
    quaternion : (4,)
        (x, y, z, w), body to space; a free body starts at (0, 0, 0, 1).
    velocity : (3,)
        Of that point [m/s].
    angular_velocity : (3,)
        In space [rad/s].
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity: NDArray[np.float64]


def pose_at(motion: PrescribedMotion, t: float) -> Pose:
    """Prescribed pose at time `t` [s]."""
    row = np.empty(13)
    _pose_row(motion, t, row)
    return Pose(row[0:3], row[3:7], row[7:10], row[10:13])


def _pose_row(motion: PrescribedMotion, t: float, row: NDArray[np.float64]) -> None:
    """Write the prescribed pose at time `t` and its rates (13,)."""
    prescribed_pose(
        motion.times, motion.positions, motion.quaternions, motion.velocities, motion.angular_velocities, t, row
    )


def rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


class Bodies:
    """All rigid bodies of a run; the driven ones come first, in the order of their motions.

    Parameters
    ----------
    problem, layout
        What to build.
    node_mass : (n,) float64
        Lumped mass of every solver node, rigid elements included [kg].
    soft_mass : (n,) float64
        The share of deformable elements in it [kg].
    loads : (n, 3) float64
        On every solver node [N].

    Attributes
    ----------
    wrench : (n_bodies, 6) float64
        Force and torque about the centre that joints and straps exert, in space [N], [N m].
    twist : (n_bodies, 6) float64
        Velocity of the centre and angular velocity in space: after `look` half a step before the present time,
        after `kick` the mean over the kick [m/s], [rad/s].
    """

    def __init__(
        self,
        problem: Problem,
        layout: Layout,
        node_mass: NDArray[np.float64],
        soft_mass: NDArray[np.float64],
        loads: NDArray[np.float64],
    ) -> None:
        self.parts, self.sets = layout.body_parts, layout.body_sets
        count = len(self.parts)
        self.count = count
        self.motions = problem.prescribed
        self.driven = np.arange(count) < len(self.motions)
        self._first = layout.n_free
        self._begin, self._end = layout.body_begin, layout.body_end
        self._external = loads[layout.n_free :].copy()
        self.inner = np.zeros_like(self._external)
        self.impulse = np.zeros_like(self._external)
        self._lever = np.zeros_like(self._external)
        self._node_mass = node_mass[layout.n_free :]
        self._gravity = np.array(problem.controls.gravity_m_per_s2, float)
        self.mass = np.zeros(count)
        self.inverse_inertia = np.zeros((count, 3, 3))
        self.centre = np.zeros((count, 3))
        self.quaternion = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        self.velocity = np.zeros((count, 3))
        self.spin = np.zeros((count, 3))
        self.spin_before = np.zeros((count, 3))
        self._next_centre = np.zeros((count, 3))
        self._next_quaternion = np.zeros((count, 4))
        self.sums = np.zeros((count, BODY_SUMS))
        self.wrench, self.twist = np.zeros((count, 6)), np.zeros((count, 6))
        self._told = np.zeros((count, 13))
        for body in range(count):
            self._build(problem, layout, body, soft_mass)

    def _build(self, problem: Problem, layout: Layout, body: int, soft_mass: NDArray[np.float64]) -> None:
        here = slice(self._begin[body], self._end[body])
        rows = layout.node_order[layout.n_free :][here]
        points, lumped = problem.nodes[rows], self._node_mass[here]
        if self.driven[body]:
            pose = pose_at(self.motions[body], 0.0)
            self.centre[body], self.quaternion[body] = pose.position, pose.quaternion
            self._lever[here] = (points - pose.position) @ rotation(pose.quaternion)
            return
        mask = np.isin(problem.element_part, self.parts[body])
        density = np.array([part.material.density_kg_per_m3 for part in problem.parts])[problem.element_part[mask]]
        place, weight = points, soft_mass[layout.n_free :][here]
        if mask.any():
            within, share = _quadrature(problem.nodes[problem.hexes[mask]], density)
            place, weight = np.concatenate([within, place]), np.concatenate([share, weight])
        self.mass[body] = weight.sum()
        centre = weighted_sum(weight, place) / self.mass[body]
        inertia = inertia_tensor(weight, place - centre)
        self.centre[body] = centre
        if not np.linalg.eigvalsh(inertia)[0] > 1e-12 * np.trace(inertia):
            names = [problem.parts[k].name for k in self.parts[body]]
            names += [problem.rigid_sets[k].name for k in self.sets[body]]
            raise InputError(
                WHERE, f"the body of {', '.join(names)} has no inertia about some axis", column="rigid_sets",
                expected="three nodes that are not on one line",
            )  # fmt: skip
        self.inverse_inertia[body] = np.linalg.inv(inertia)
        self._lever[here] = points - centre
        velocity, omega = fit_rigid_motion(points, problem.initial_velocity[rows], lumped, centre)
        self.velocity[body], self.spin[body] = velocity, inertia @ omega

    def start(self, nodal: NDArray[np.float64]) -> None:
        """Give the tied nodes the velocity of their body at time 0."""
        for body in range(self.count):
            if self.driven[body]:
                pose = pose_at(self.motions[body], 0.0)
                velocity, omega = pose.velocity, pose.angular_velocity
            else:
                velocity, omega = self.velocity[body], self.inverse_inertia[body] @ self.spin[body]
            rows = slice(self._first + self._begin[body], self._first + self._end[body])
            arm = nodal[rows, POSITION : POSITION + 3] - self.centre[body]
            nodal[rows, VELOCITY : VELOCITY + 3] = velocity + np.cross(omega, arm)

    def look(self, time: float) -> None:
        """Find `twist` at the present time, for joints and straps, and let them start from no `wrench`."""
        for body, motion in enumerate(self.motions):
            _pose_row(motion, time, self._told[body])
        present_twists(
            self.driven, self._told, self.quaternion, self.velocity, self.spin, self.inverse_inertia, self.twist
        )
        self.wrench[:] = 0.0

    def kick(
        self, nodal: NDArray[np.float64], time: float, dt_kick: float, dt_drift: float, speed_limit: float = np.inf
    ) -> None:
        """Bring the velocities over the present time and find the pose at ``time + dt_drift``.

        `inner` must hold the element forces on the tied nodes, `impulse` what contact gives them.
        """
        self._velocity_before, self._spin_before = self.velocity.copy(), self.spin.copy()
        for body, motion in enumerate(self.motions):
            _pose_row(motion, time + dt_drift, self._told[body])
            self._next_centre[body] = self._told[body, 0:3]
            self._next_quaternion[body] = self._told[body, 3:7]
        advance_bodies(
            nodal, self._first, self._begin, self._end, self.inner, self.impulse, self._external, self._lever,
            self._node_mass, self.wrench, self.driven, self.mass, self.inverse_inertia, self._gravity, self.centre,
            self.quaternion, self.velocity, self.spin, self._next_centre, self._next_quaternion, self.spin_before,
            self.twist, dt_kick, dt_drift, speed_limit, self.sums,
        )  # fmt: skip

    def kick_again(
        self,
        nodal: NDArray[np.float64],
        before: NDArray[np.float64],
        time: float,
        dt_kick: float,
        dt_drift: float,
        speed_limit: float,
    ) -> None:
        """Repeat the last kick, with the impulses that contact has found; they are zero again afterwards.

        Parameters
        ----------
        nodal, time, dt_kick, dt_drift, speed_limit
            As in `kick`.
        before : (n_tied, 3) float64
            Velocities of the tied nodes before the kick [m/s].
        """
        nodal[self._first :, VELOCITY : VELOCITY + 3] = before
        self.velocity[:], self.spin[:] = self._velocity_before, self._spin_before
        self.kick(nodal, time, dt_kick, dt_drift, speed_limit)
        self.impulse[:] = 0.0

    def drift(self) -> None:
        """Take the pose that `kick` has found; the nodes move by their velocities."""
        self.centre[:] = self._next_centre
        self.quaternion[:] = self._next_quaternion

    def kinetic(self, nodal: NDArray[np.float64]) -> float:
        """Kinetic energy at the start of the run [J]."""
        total = 0.0
        for body in range(self.count):
            if self.driven[body]:
                rows = slice(self._first + self._begin[body], self._first + self._end[body])
                square = (nodal[rows, VELOCITY : VELOCITY + 3] ** 2).sum(axis=1)
                total += 0.5 * float((self._node_mass[self._begin[body] : self._end[body]] * square).sum())
            else:
                turning = self.spin[body] @ self.inverse_inertia[body] @ self.spin[body]
                total += 0.5 * float(self.mass[body] * (self.velocity[body] ** 2).sum() + turning)
        return total

    def tied_rows(self, body: int) -> slice:
        """Solver rows of the nodes of a body."""
        return slice(int(self._first + self._begin[body]), int(self._first + self._end[body]))

    def lever(self, body: int) -> NDArray[np.float64]:
        """Offsets of the tied nodes from the reference point in the body frame [m]."""
        return self._lever[self._begin[body] : self._end[body]]

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Everything that a step changes, by name, for a checkpoint."""
        return {name: getattr(self, name) for name in ("centre", "quaternion", "velocity", "spin")}


def weighted_sum(weight: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of weighted rows in one fixed order: a BLAS product depends on its number of threads."""
    return np.einsum("n,nk->k", weight, rows)


def inertia_tensor(mass: NDArray[np.float64], arm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inertia of point masses about the origin of `arm` (3, 3) [kg m^2]."""
    second = np.einsum("n,ni,nj->ij", mass, arm, arm)
    return np.eye(3) * np.trace(second) - second


def fit_rigid_motion(
    points: NDArray[np.float64], velocities: NDArray[np.float64], mass: NDArray[np.float64], about: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocity of a point and angular velocity with the momenta of given point masses.

    Parameters
    ----------
    points, velocities : (n, 3)
        [m], [m/s].
    mass : (n,)
        [kg].
    about : (3,)
        The point whose velocity is asked for [m].
    """
    total = mass.sum()
    centre = weighted_sum(mass, points) / total
    mean = weighted_sum(mass, velocities) / total
    arm = points - centre
    spin = weighted_sum(mass, np.cross(arm, velocities - mean))
    omega = np.linalg.solve(inertia_tensor(mass, arm), spin).astype(float)
    return mean + np.cross(omega, about - centre), omega


def fit_pose(
    points: NDArray[np.float64], lever: NDArray[np.float64], mass: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Position of the reference point and quaternion that carry `lever` to `points` in the least-squares sense.

    Kabsch's method: the pose is read off where the nodes are, not off what they were told.
    """
    total = mass.sum()
    a, b = weighted_sum(mass, lever) / total, weighted_sum(mass, points) / total
    u, _, vt = np.linalg.svd(np.einsum("n,ni,nj->ij", mass, lever - a, points - b))
    turn_back = np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))])
    matrix = vt.T @ turn_back @ u.T
    return b - matrix @ a, quaternion_of(matrix)


def quaternion_of(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit quaternion (x, y, z, w), w >= 0, of a rotation matrix."""
    m = matrix
    # the largest eigenvector of Bar-Itzhack's symmetric matrix
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
            [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
            [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    q = np.linalg.eigh(k)[1][:, 3]
    return q if q[3] >= 0 else -q


def _quadrature(corners: NDArray[np.float64], density: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Points and masses of 2 x 2 x 2 Gauss integration of trilinear elements."""
    places, weights = [], []
    for signs in _SIGNS:
        xi = signs * _GAUSS
        terms = 1 + xi * _SIGNS
        shape = terms.prod(axis=1) / 8
        slope = np.stack([_SIGNS[:, k] * np.delete(terms, k, axis=1).prod(axis=1) / 8 for k in range(3)])
        jacobian = np.linalg.det(np.einsum("ka,eai->eki", slope, corners))
        places.append(np.einsum("a,eai->ei", shape, corners))
        weights.append(density * jacobian)
    mass = np.concatenate(weights)
    if not mass.sum() > 0:
        raise InputError(WHERE, "a rigid part has no volume", column="hexes")
    return np.concatenate(places), mass
