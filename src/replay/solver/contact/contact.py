"""Contact of a run: between kick and drift it gives the velocities that no point runs into a face with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from replay.solver.contact.rooms import mesh_of, room_for_hits, room_for_slots
from replay.solver.contact.search import Search
from replay.solver.contact.settings import SOLVERS, ContactControls, PairTable, pair_table
from replay.solver.contact.surface import Surface, extract_surface
from replay.solver.kernels import contact_work as work
from replay.solver.kernels.contact_detect import SLOTS, detect
from replay.solver.kernels.contact_solve import solve
from replay.solver.kernels.contact_system import CORNERS, Carriers, Constraints, Nodes, assemble, carry, weigh
from replay.solver.kernels.lanes import VELOCITY
from replay.solver.rigid import Bodies

#: Points whose gap after the step would be below this share of a face's size are let into the problem.
_NEAR_SHARE = 1e-3
#: Fewer constraints are not worth a second thread.
_SHARED_FROM = 2000


@dataclass(frozen=True)
class Forces:
    """What the integrator knows of the forces of a kick; see `kernels.assembly.advance_nodes`.

    Parameters
    ----------
    flat, first_slot, slot
        Element forces and the lists by which nodes gather them.
    mass, inverse_mass, external
        Of the nodes [kg], [1/kg], [N].
    """

    flat: NDArray[np.float64]
    first_slot: NDArray[np.uint32]
    slot: NDArray[np.uint32]
    mass: NDArray[np.float64]
    inverse_mass: NDArray[np.float64]
    external: NDArray[np.float64]


class Contact:
    """Contact of all parts.

    Parameters
    ----------
    controls
        Settings.
    hexes : (m, 8) int64
        Node rows of the solver's order.
    element_part : (m,) int64
        Part index of each element.
    pids
        Numbers of the parts.
    nodal : (n, 8) float64
        State at time 0.
    carrier : (n,) int64
        Rigid body of each node, -1 for none.
    bodies
        The rigid bodies.
    tied : (k,) int64
        Rows of nodes that follow others across a tied interface; their faces take no part.
    """

    def __init__(
        self, controls: ContactControls, hexes: NDArray[np.int64], element_part: NDArray[np.int64],
        pids: tuple[int, ...], nodal: NDArray[np.float64], carrier: NDArray[np.int64], bodies: Bodies,
        tied: NDArray[np.int64],
    ) -> None:  # fmt: skip
        self.controls = controls
        n_nodes = len(nodal)
        surface = extract_surface(hexes, element_part, n_nodes, tied)
        self.surface = surface
        self._table: PairTable = pair_table(controls, pids)
        self.pairs, self._pair_row = _pairs(surface, self._table.active)
        self._part, self._point_part = surface.part, surface.point_parts()
        self._mesh = mesh_of(surface)
        awake = slave_points(surface, nodal[:, :3], controls)
        self._search = Search(surface, self._mesh, self._table.active, carrier, awake, nodal[:, :3])
        self._carrier, self._bodies = carrier, bodies
        self._method = SOLVERS.index(controls.solver)
        points = surface.n_points
        self._slots = room_for_slots(points)
        self._old_face = np.full((points, SLOTS), -1, np.int64)
        self._old_impulse, self._old_drag = np.zeros((points, SLOTS)), np.zeros((points, SLOTS, 3))
        self._depth = np.zeros(points)
        self._shift = np.zeros((len(surface.nodes), 3))
        self._surface_row = np.full(n_nodes, -1, np.int64)
        self._surface_row[surface.nodes] = np.arange(len(surface.nodes))
        self._number = np.full(n_nodes, -1, np.int64)
        count = bodies.count
        self._carriers = Carriers(np.zeros(count), np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((count, 3)))
        self._hits = room_for_hits(0)
        self._reserve(64)
        #: Sums over pairs of parts since time 0, see `kernels.contact_work.PAIR_SUMS`.
        self.pair_sums = np.zeros((len(self.pairs), work.PAIR_SUMS))
        #: Steps with constraints, those that did not converge, iterations, deepest penetration over the face's size.
        self.counts = np.zeros(4)
        #: Length of the last kick [s], by which multipliers become forces; all that contact has lost [J].
        self._kick, self._lost = np.zeros(1), np.zeros(1)
        self.sums = np.zeros(work.SUMS)
        self._pending = np.zeros(work.SUMS)
        self.n_constraints = 0

    def _reserve(self, n: int) -> None:
        """Make room for `n` constraints."""
        self._room = n
        self._constraints = Constraints(
            np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros((n, CORNERS), np.int64), np.zeros((n, CORNERS)),
            np.zeros((n, 3)), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n, np.int64), np.zeros(n), np.zeros(n),
            np.zeros((n, 3)),
        )  # fmt: skip
        most = min(CORNERS * n, len(self.surface.nodes))
        self._nodes = Nodes(
            np.zeros(most, np.int64), np.zeros((most, 3)), np.zeros((most, 3)), np.zeros((most, 3)),
            np.zeros(most, np.int64), np.zeros((most, 3)), np.zeros((most, 3)), np.zeros(most + 1, np.int64),
            np.zeros(CORNERS * n, np.int64), np.zeros(CORNERS * n, np.int64),
        )  # fmt: skip
        self._work = [np.zeros(n), np.zeros((n, 3)), np.zeros(n), np.zeros((n, 3)), np.zeros(n)]
        self._node_work = [np.zeros(most), np.zeros((most, 3)), np.zeros((most, 3))]

    def settle(self, nodal: NDArray[np.float64], forces: Forces, dt: float) -> None:
        """Take the last step's corrections of penetration off the velocities, after the elements have seen them."""
        self._pending[:] = 0.0
        if self._shift.any():
            work.end_shift(
                nodal, self.surface.nodes, self._shift, dt, forces.flat, forces.first_slot, forces.slot, self._pending
            )

    def apply(
        self, nodal: NDArray[np.float64], forces: Forces, dt_kick: float, dt: float, was: NDArray[np.float64]
    ) -> bool:
        """Find the multipliers and give the free nodes their velocities; the bodies get their impulses.

        Parameters
        ----------
        nodal : (n, 8) float64
            Positions at the present time, velocities after the kick (updated).
        forces
            Of the kick.
        dt_kick, dt
            Mean of the steps before and after, and the step after [s].
        was : (n_tied, 3) float64
            Velocities of the bodies' nodes before the kick [m/s].

        Returns
        -------
        bool
            Whether a body must be kicked again, with ``bodies.impulse``. `finish` must follow.
        """
        self.sums[:] = self._pending
        nodes = self.surface.nodes
        velocity = nodal[nodes, VELOCITY : VELOCITY + 3]
        closing = math.sqrt((np.ptp(velocity, axis=0) ** 2).sum()) if len(nodes) else 0.0
        reach = dt * closing + 2.0 * _NEAR_SHARE * self._search.longest_edge
        self._search.update(nodal, dt, reach + float(self._depth.max(initial=0.0)))
        if len(self._hits.distance) < len(self._search.candidates):
            self._hits = room_for_hits(len(self._search.candidates))
        detect(
            nodal, self._mesh, self._search.points, self._search.first, self._search.candidates, reach, dt,
            _NEAR_SHARE, self._old_face, self._depth, self._hits, self._slots,
        )  # fmt: skip
        n, deepest = work.survey(self._slots)
        self.counts[3] = max(self.counts[3], deepest)
        if n > self._room:
            self._reserve(2 * n)
        self.n_constraints, self._used = n, 0
        pushed = False
        if n:
            pushed = self._solve(nodal, forces, dt_kick, dt, was)
        else:
            self._old_impulse[:] = 0.0
            self._old_drag[:] = 0.0
        self._old_face[:] = self._slots.face
        self._kick[0] = dt_kick
        return pushed

    def _solve(
        self, nodal: NDArray[np.float64], forces: Forces, dt_kick: float, dt: float, was: NDArray[np.float64]
    ) -> bool:
        bodies, carriers, constraints, nodes = self._bodies, self._carriers, self._constraints, self._nodes
        if bodies.count:
            carry(bodies.quaternion, bodies.centre, bodies.mass, bodies.inverse_inertia, bodies.driven, carriers)
        ratio = dt_kick / self._kick[0] if self._kick[0] > 0 else 0.0
        n, used = assemble(
            nodal, self._mesh, self._slots, self._old_face, self._old_impulse, self._old_drag, ratio, dt,
            self._point_part, self._part, self._pair_row, self._table.friction, self._table.restitution, was,
            forces.inverse_mass, self._carrier, bodies.centre, self._number, constraints, nodes,
        )  # fmt: skip
        load, before, _ = self._node_work
        weigh(n, used, constraints, nodes, carriers, load, np.empty(bodies.count), np.empty(bodies.count))
        shared = n >= _SHARED_FROM and numba.get_num_threads() > 1
        done, converged, _ = solve(
            n, used, constraints, nodes, carriers, self.controls.most_iterations, self.controls.tolerance,
            self._method, shared, *self._work,
        )  # fmt: skip
        self.counts[:3] += 1.0, 0.0 if converged else 1.0, done
        self._used = used
        work.look_back(
            nodal, used, nodes, forces.flat, forces.first_slot, forces.slot, forces.inverse_mass, forces.external,
            dt_kick, was, before,
        )  # fmt: skip
        work.temper(n, used, constraints, nodes, before)
        pushed = work.push(
            nodal, used, nodes, forces.flat, forces.first_slot, forces.slot, forces.mass, forces.inverse_mass,
            forces.external, dt_kick, len(was), bodies.impulse, self.sums,
        )  # fmt: skip
        return bool(pushed)

    def finish(self, nodal: NDArray[np.float64], forces: Forces, dt: float) -> None:
        """Enter the step in the ledger, after the bodies have their velocities, and start corrections.

        What corrections give comes out of what contact has taken before: in all, contact makes no energy.
        """
        n, used = self.n_constraints, self._used
        if n:
            self._account(nodal, n, used, forces, dt)
        self._lost += self.sums[3] + self.sums[4]

    def _account(self, nodal: NDArray[np.float64], n: int, used: int, forces: Forces, dt: float) -> None:
        constraints, nodes = self._constraints, self._nodes
        _, before, shift = self._node_work
        work.account(
            nodal, n, used, constraints, nodes, before, self._old_impulse, self._old_drag, self.pair_sums, self.sums
        )
        if self._lost[0] > 0.0 and work.correct(n, used, constraints, nodes, self._slots, dt, self._work[4], shift):
            work.start_shift(
                nodal, used, nodes, shift, dt, self._surface_row, self._shift, forces.flat, forces.first_slot,
                forces.slot, self.sums,
            )  # fmt: skip

    def without_corrections(self, velocities: NDArray[np.float64]) -> None:
        """Take this step's corrections of penetration off velocities after the kick: they carry nothing.

        Parameters
        ----------
        velocities : (n, 3) float64
            In the solver's order (updated).
        """
        velocities[self.surface.nodes] -= self._shift

    def summary(self) -> dict[str, float]:
        """How contact went so far, for ``run.json``."""
        return {
            "steps": int(self.counts[0]),
            "unconverged_share": self.unconverged_share,
            "mean_iterations": float(self.counts[2] / self.counts[0]) if self.counts[0] else 0.0,
            "penetration_over_edge": self.penetration_over_edge,
        }

    @property
    def penetration_over_edge(self) -> float:
        """Deepest penetration so far over the size of the face."""
        return float(self.counts[3])

    @property
    def unconverged_share(self) -> float:
        """Share of the steps with constraints whose multipliers did not converge."""
        return float(self.counts[1] / self.counts[0]) if self.counts[0] else 0.0

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that a step changes, by name, for a checkpoint."""
        return {
            "face": self._old_face, "impulse": self._old_impulse, "drag": self._old_drag, "depth": self._depth,
            "shift": self._shift, "kick": self._kick, "lost": self._lost, "pair_sums": self.pair_sums,
            "counts": self.counts,
        }  # fmt: skip

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` returned."""
        for name, array in self.arrays().items():
            array[...] = arrays[name]
        self._search.forget()


def _pairs(surface: Surface, active: NDArray[np.bool_]) -> tuple[tuple[tuple[int, int], ...], NDArray[np.int64]]:
    """Pairs of parts with a surface that may touch, and the row of each."""
    present = np.unique(surface.part).tolist()
    pairs = tuple((a, b) for a, b in combinations_with_replacement(present, 2) if active[a, b])
    row = np.full(active.shape, -1, np.int64)
    for k, (a, b) in enumerate(pairs):
        row[a, b] = row[b, a] = k
    return pairs, row


def slave_points(surface: Surface, nodes: NDArray[np.float64], controls: ContactControls) -> NDArray[np.bool_]:
    """Mask of the slave points that take part: all nodes, and centres of faces about which the surface turns."""
    awake = np.ones(surface.n_points, bool)
    centres = awake[len(surface.nodes) :]
    centres[:] = False
    if controls.points == "center_plus_corners" and len(surface.faces):
        corners = nodes[surface.faces]
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        normal /= np.sqrt((normal**2).sum(axis=1))[:, None]
        turn = (normal[:, None, :] * normal[surface.neighbours]).sum(axis=2)
        turn[surface.neighbours < 0] = 1.0
        centres[:] = turn.min(axis=1) < math.cos(math.radians(controls.centre_angle_deg))
    return awake
