"""Joints and straps of a run: their forces on bodies and nodes, their share in the time step, their work."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError, InstabilityError
from replay.solver.arrays import WHERE
from replay.solver.joints import MOST_ANGLE_RAD, Joint
from replay.solver.kernels.joints import ANGLE, JOINT_COLUMNS, joint_forces, joint_work
from replay.solver.kernels.lanes import VELOCITY
from replay.solver.kernels.straps import STRAP_COLUMNS, TIGHTNESS, strap_forces, strap_work
from replay.solver.layout import Layout
from replay.solver.problem import Problem
from replay.solver.rigid import Bodies, rotation

#: Columns of the work that links take: joint springs, joint dampers, straps.
JOINT_SPRING, JOINT_DAMPER, STRAP = 0, 1, 2
#: Up to `MOST_ANGLE_RAD` the springs of a joint are at most this much stiffer than at small angles, or as stiff
#: through their geometry: ``(t/2)^2 / sin^2(t/2)``.
_TURNED = (0.5 * MOST_ANGLE_RAD / math.sin(0.5 * MOST_ANGLE_RAD)) ** 2


class Links:
    """Force elements between the bodies and nodes of a run.

    They keep no state: their forces follow from positions, velocities and time.

    Parameters
    ----------
    problem, layout, bodies
        What to build.
    mass : (n,) float64
        Of every solver node [kg].

    Attributes
    ----------
    joint_rows : (n_joints, JOINT_COLUMNS) float64
        See `kernels.joints`.
    strap_rows : (n_straps, STRAP_COLUMNS) float64
        See `kernels.straps`.
    """

    def __init__(self, problem: Problem, layout: Layout, bodies: Bodies, mass: NDArray[np.float64]) -> None:
        self.joints, self.straps = problem.joints, problem.straps
        self.active = bool(self.joints or self.straps)
        self._bodies = bodies
        self.joint_rows = np.zeros((len(self.joints), JOINT_COLUMNS))
        self.strap_rows = np.zeros((len(self.straps), STRAP_COLUMNS))
        if not self.active:
            return
        # mobility of one kilogram-free look at each body: how readily any point and any turn of it yields
        free = ~bodies.driven
        self._lightness = np.where(free, 1.0 / np.where(bodies.mass > 0, bodies.mass, 1.0), 0.0)
        self._nimbleness = np.where(free, np.linalg.eigvalsh(bodies.inverse_inertia)[:, 2], 0.0)
        self._build_straps(problem, layout, mass)
        self._build_joints(problem, layout)
        self._share_mass()

    def _build_straps(self, problem: Problem, layout: Layout, mass: NDArray[np.float64]) -> None:
        rows = [layout.node_row[strap.nodes] for strap in self.straps]
        self._first = np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.int64)
        self._node = np.concatenate([np.empty(0, np.int64), *rows])
        owner = np.full(len(layout.node_order), -1)
        for body in range(self._bodies.count):
            owner[self._bodies.tied_rows(body)] = body
        self._body = owner[self._node]
        pieces = [np.linalg.norm(np.diff(problem.nodes[strap.nodes], axis=0), axis=1).sum() for strap in self.straps]
        self._natural = np.array(pieces) + np.array([strap.slack_m for strap in self.straps])
        self._pay_in = np.array([[strap.pay_in_m, strap.pay_in_time_s] for strap in self.straps]).reshape(-1, 2)
        self._constants = np.array([[s.stiffness_n_per_m, s.damping_n_s_per_m] for s in self.straps]).reshape(-1, 2)
        self._force = np.zeros((len(self._node), 3))
        self._before = np.zeros((len(self._node), 3))
        self._touched = np.unique(self._node[self._body < 0])
        self._mobility = np.zeros(len(self._node))
        for j, (node, body) in enumerate(zip(self._node.tolist(), self._body.tolist())):
            if body < 0:
                if not mass[node] > 0:
                    number = problem.node_ids[layout.node_order[node]]
                    raise InputError(
                        WHERE, f"a strap passes node {number}, which is tied", column="straps",
                        mend="lead it over nodes of the other side of the tie",
                    )  # fmt: skip
                self._mobility[j] = 1.0 / mass[node]
            else:
                arm = problem.nodes[layout.node_order[node]] - self._bodies.centre[body]
                self._mobility[j] = self._lightness[body] + self._nimbleness[body] * float(arm @ arm)

    def _build_joints(self, problem: Problem, layout: Layout) -> None:
        n, bodies = len(self.joints), self._bodies
        self._ends = np.full((n, 2), -1, np.int64)
        self._arm, self._axes = np.zeros((n, 2, 3)), np.zeros((n, 2, 3, 3))
        self._stiffness = np.array([joint.stiffness for joint in self.joints]).reshape(n, 3, 2)
        self._damping, self._hold = np.zeros((n, 3)), np.zeros((n, 2))
        for k, joint in enumerate(self.joints):
            inertia, lightness = np.zeros((3, 3)), 0.0
            for side, name in enumerate((joint.first, joint.second)):
                self._arm[k, side], self._axes[k, side] = joint.centre, joint.axes.T
                if name is None:
                    continue
                body = layout.body_named(problem, name)
                self._ends[k, side] = body
                pose, arm = rotation(bodies.quaternion[body]), joint.centre - bodies.centre[body]
                self._arm[k, side] = pose.T @ arm
                self._axes[k, side] = pose.T @ self._axes[k, side]
                if not bodies.driven[body]:
                    inertia += pose @ bodies.inverse_inertia[body] @ pose.T
                    lightness += self._lightness[body] + self._nimbleness[body] * float(arm @ arm)
            self._check_ends(joint, self._ends[k], lightness)
            # at small angles an axis feels the reciprocal of what both bodies yield about it
            yielding = np.einsum("ai,ij,aj->a", joint.axes, inertia, joint.axes)
            self._damping[k] = 2.0 * joint.damping_ratio * np.sqrt(self._stiffness[k].mean(axis=1) / yielding)
            damping = 2.0 * joint.centre_damping_ratio * math.sqrt(joint.centre_stiffness / lightness)
            self._hold[k] = joint.centre_stiffness, damping

    def _check_ends(self, joint: Joint, ends: NDArray[np.int64], lightness: float) -> None:
        if ends[0] == ends[1]:
            found, mend = "both ends are one body", "parts that share nodes or are driven together are one"
        elif lightness == 0.0:
            found, mend = "neither end is free to move", "a joint needs a body that is not driven"
        else:
            return
        raise InputError(WHERE, found, column=f"joints.{joint.name}", mend=mend)

    def _share_mass(self) -> None:
        """Bound the stiffness and damping over mass of every link, each with its share of what it pulls at.

        A body or node that several links pull at is split among them: the greatest frequency of the whole is
        below that of the parts.
        """
        ends, bodies = self._ends, self._bodies.count
        uses = np.bincount(ends[ends >= 0], minlength=bodies)
        uses = uses + np.bincount(self._body[self._body >= 0], minlength=bodies)
        common = np.bincount(self._node, minlength=int(self._node.max()) + 1 if len(self._node) else 1)
        for j, (node, body) in enumerate(zip(self._node.tolist(), self._body.tolist())):
            self._mobility[j] *= common[node] if body < 0 else uses[body]
        self._joint_bound = np.zeros((len(self.joints), 2))
        for k in range(len(self.joints)):
            slide = turn = 0.0
            for side in (0, 1):
                body = ends[k, side]
                if body >= 0:
                    reach = float(self._arm[k, side] @ self._arm[k, side])
                    slide += uses[body] * (self._lightness[body] + self._nimbleness[body] * reach)
                    turn += uses[body] * self._nimbleness[body]
            stiff, slow = _TURNED * self._stiffness[k].max() * turn, self._damping[k].max() * turn
            self._joint_bound[k] = stiff + self._hold[k, 0] * slide, slow + self._hold[k, 1] * slide
        # the pull on an end is one tension, on an inner node up to two
        strong = np.full(len(self._node), 4.0)
        strong[self._first[:-1]] = strong[self._first[1:] - 1] = 1.0
        straps = np.repeat(np.arange(len(self.straps)), np.diff(self._first))
        yielding = np.bincount(straps, strong * self._mobility, len(self.straps))
        self._strap_bound = self._constants * yielding[:, None]

    def forces(self, nodal: NDArray[np.float64], external: NDArray[np.float64], time: float) -> None:
        """Find all forces at the present time; free nodes take theirs in `external`, bodies in their wrench.

        Raises
        ------
        InstabilityError
            When a joint has turned too far for its springs to have a meaning.
        """
        bodies = self._bodies
        bodies.look(time)
        joint_forces(
            self._ends, self._arm, self._axes, self._stiffness, self._damping, self._hold, bodies.centre,
            bodies.quaternion, bodies.twist, bodies.wrench, self.joint_rows,
        )  # fmt: skip
        strap_forces(
            self._first, self._node, self._body, self._mobility, self._natural, self._pay_in, self._constants, time,
            nodal, bodies.centre, bodies.wrench, external, self._force, self.strap_rows,
        )  # fmt: skip
        turned = np.sqrt((self.joint_rows[:, ANGLE : ANGLE + 3] ** 2).sum(axis=1))
        if not (turned <= MOST_ANGLE_RAD).all():
            k = int(np.argmax(~(turned <= MOST_ANGLE_RAD)))
            message = (
                f"joint {self.joints[k].name} has turned by {math.degrees(turned[k]):.4g} degrees at {time:.6g} s "
                f"(limit {math.degrees(MOST_ANGLE_RAD):.0f})\n    mend: stiffen it, or look at what spins its bodies"
            )
            raise InstabilityError(message)

    def limited(self, step: float) -> float:
        """Stable step of the elements, `step`, shortened by joints and straps [s].

        ``K dt^2/4 + C dt/2 <= M`` with K and C the sums over elements and links: the elements use ``dt / step`` of
        M, the links have to do with the rest.
        """
        tight = self._strap_bound[:, 0] + self.strap_rows[:, TIGHTNESS]
        stiff = max(self._joint_bound[:, 0].max(initial=0.0), tight.max(initial=0.0))
        slow = max(self._joint_bound[:, 1].max(initial=0.0), self._strap_bound[:, 1].max(initial=0.0))
        if not step > 0:
            return step
        linear = 1.0 / step + 0.5 * slow
        return 2.0 / (linear + math.sqrt(linear * linear + stiff)) if linear + stiff > 0 else math.inf

    @property
    def touched(self) -> NDArray[np.int64]:
        """Free nodes that straps pull at, solver rows."""
        return self._touched

    def before_kick(self, nodal: NDArray[np.float64]) -> None:
        """Note the velocities that the work of straps needs."""
        self._before[:] = nodal[self._node, VELOCITY : VELOCITY + 3]

    def work(self, nodal: NDArray[np.float64], dt: float) -> tuple[NDArray[np.float64], float]:
        """Work of the kick, after it.

        Returns
        -------
        taken : (3,) float64
            By joint springs, joint dampers and straps [J].
        done
            On free nodes alone, by straps [J].
        """
        bodies, taken, done = self._bodies, np.zeros(3), np.zeros(2)
        joint_work(self._ends, bodies.centre, bodies.twist, self.joint_rows, dt, taken)
        strap_work(self._node, self._body, nodal, self._before, bodies.centre, bodies.twist, self._force, dt, done)
        taken[STRAP] = -(done[0] + done[1])
        return taken, float(done[0])


__all__ = ["JOINT_DAMPER", "JOINT_SPRING", "STRAP", "Links"]
