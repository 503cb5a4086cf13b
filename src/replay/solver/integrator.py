"""Central differences: forces, kick, drift; the state of a run and nothing of its files.

Positions and stresses live at times t_n, velocities half a step before or after. A step is

    forces      elements come to t_n with the velocities that moved them there, and give f(t_n)
    kick        v(n+1/2) = v(n-1/2) + (dt_before + dt_after)/2 M^-1 f(t_n)
    drift       x(n+1) = x(n) + dt_after v(n+1/2)

and the first kick takes half a step, so that the given velocities hold at time 0. Joints and straps pull
with the forces, tied nodes hand theirs over before the kick; contact has its place between kick and drift.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.solver.contact.contact import Contact, Forces
from replay.solver.elements import ElementGroup
from replay.solver.kernels.assembly import CHUNK, RUNAWAYS, advance_nodes, drift_nodes, gather_forces
from replay.solver.kernels.lanes import NODE_COLUMNS, POSITION, VELOCITY
from replay.solver.layout import Layout, arrange
from replay.solver.ledger import Energies, Ledger
from replay.solver.links import Links
from replay.solver.problem import Problem, gradients
from replay.solver.rigid import Bodies
from replay.solver.tied_nodes import TiedNodes
from replay.solver.time_step import AddedMass, StepBound, scale_masses, smallest_step


class Integrator:
    """A run between two steps.

    Parameters
    ----------
    problem
        Checked arrays and settings.
    speed_limit_m_per_s
        Nodes faster than this are counted by `kick`.

    Attributes
    ----------
    nodal : (n, 8) float64
        Positions [m] and velocities [m/s] in the solver's order.
    time_s, step, dt_s
        Present time [s], steps done, last step [s].
    """

    def __init__(self, problem: Problem, speed_limit_m_per_s: float) -> None:
        self.problem = problem
        plain = arrange(problem)
        self.tied = TiedNodes(problem, plain)
        self.layout: Layout = self.tied.rearrange(plain)
        n, order = len(problem.nodes), self.layout.node_order
        self.nodal = _aligned(n)
        self.nodal[:, POSITION : POSITION + 3] = problem.nodes[order]
        self.nodal[:, VELOCITY : VELOCITY + 3] = problem.initial_velocity[order]
        self._force = np.zeros((self.layout.n_rows, 3))
        self.groups = [ElementGroup(problem, self.layout, k, self._force) for k in range(len(self.layout.groups))]
        self.added_mass: AddedMass = scale_masses(problem, self.groups, self.nodal)
        self._lump()
        self.bodies = Bodies(problem, self.layout, self.mass, self._soft_mass, self._loads)
        self.bodies.start(self.nodal)
        self.tied.move(self.nodal)
        self.links = Links(problem, self.layout, self.bodies, self.mass)
        self.speed_limit = speed_limit_m_per_s
        self._sums = np.zeros(((self.layout.n_free + CHUNK - 1) // CHUNK, 4))
        free = self.nodal[: self.layout.n_free, VELOCITY : VELOCITY + 3]
        moving = 0.5 * float((self.mass[: self.layout.n_free] * (free**2).sum(axis=1)).sum())
        self.contact: Contact | None = None
        if problem.contact is not None:
            self.contact = Contact(
                problem.contact, self.layout.node_row[problem.hexes], problem.element_part,
                tuple(part.pid for part in problem.parts), self.nodal, self.layout.carrier, self.bodies,
                self.tied.nodes,
            )  # fmt: skip
        self._forces = Forces(
            self._force, self.layout.first_slot, self.layout.slot, self.mass, self._inverse_mass, self._external
        )
        self.ledger = Ledger(len(problem.parts), moving + self.bodies.kinetic(self.nodal))
        self.time_s, self.step, self.dt_s = 0.0, 0, 0.0
        self.runaways = 0
        self._drifted = False
        self._body_velocity = self._body_velocity_before = self.bodies.velocity.copy()

    def _lump(self) -> None:
        """Share element masses among their nodes; rigid elements count by their volume."""
        problem, layout = self.problem, self.layout
        element_mass = np.zeros(len(problem.hexes))
        self.element_added_mass = np.zeros(len(problem.hexes))
        for group in self.groups:
            group.scatter(group.mass, element_mass)
            group.scatter(group.mass - group.physical_mass, self.element_added_mass)
        soft = _nodal_share(element_mass, problem, layout)
        rigid = np.array([part.material.is_rigid for part in problem.parts])[problem.element_part]
        if rigid.any():
            density = np.array([part.material.density_kg_per_m3 for part in problem.parts])[problem.element_part[rigid]]
            element_mass[rigid] = density * gradients(problem.nodes, problem.hexes[rigid])[1]
        self.element_mass = element_mass
        self.mass = _nodal_share(element_mass, problem, layout)
        self._soft_mass = soft
        self._added_mass = _nodal_share(self.element_added_mass, problem, layout)
        self.tied.share_masses(self.mass, soft, self._added_mass)
        order = layout.node_order
        still = problem.fixed[order] | (self.mass == 0)[:, None]
        self._inverse_mass = np.where(still, 0.0, 1.0 / np.where(still, 1.0, self.mass[:, None]))
        gravity = np.asarray(problem.controls.gravity_m_per_s2, float)
        self._loads = self.tied.share_loads(problem.nodal_forces[order])
        self._external = self._loads + self.mass[:, None] * gravity
        self._steady = self._external.copy()

    def forces(self) -> StepBound:
        """Bring all elements to the present time; return the smallest stable step."""
        for group in self.groups:
            group.forces(self.nodal, self.dt_s)
        self.tied.share(self._force)
        bound = smallest_step(self.groups, self.ledger.part_work)
        step = bound.step_s * self.tied.step_scale
        if self.links.active:
            self._external[self.links.touched] = self._steady[self.links.touched]
            self.links.forces(self.nodal, self._external, self.time_s)
            step = self.links.limited(step)
        if self.contact is not None:
            self.contact.settle(self.nodal, self._forces, self.dt_s)
        return StepBound(step, bound.element)

    def inner_forces(self) -> NDArray[np.float64]:
        """Sums of the element forces at the nodes, after `forces`, in the user's order (n, 3) [N]."""
        result = np.empty((len(self.nodal), 3))
        gather_forces(self._force, self.layout.first_slot, self.layout.slot, 0, len(self.nodal), result)
        return self.user_order(result)

    def kick(self, dt_next: float, *, drift: bool) -> None:
        """Bring the velocities half a step past the present time.

        Parameters
        ----------
        dt_next
            Length of the coming step [s].
        drift
            Whether to move the nodes at once (`drift` finishes the step then), or later.
        """
        layout = self.layout
        dt_kick = 0.5 * (self.dt_s + dt_next)
        contact, first, limit = self.contact, layout.n_free, self.speed_limit
        self._drifted = drift and contact is None
        before = self.nodal[first:, VELOCITY : VELOCITY + 3].copy() if contact is not None else None
        if self.links.active:
            self.links.before_kick(self.nodal)
        advance_nodes(
            self.nodal, first, self._force, layout.first_slot, layout.slot, self.mass, self._inverse_mass,
            self._external, dt_kick, dt_next if self._drifted else 0.0, limit, self._sums,
        )  # fmt: skip
        if self.bodies.count:
            self._body_velocity_before = self.bodies.velocity.copy()
            gather_forces(self._force, layout.first_slot, layout.slot, first, len(self.nodal), self.bodies.inner)
            self.bodies.kick(self.nodal, self.time_s, dt_kick, dt_next, limit)
        self.tied.move(self.nodal)
        if contact is not None and before is not None:
            if contact.apply(self.nodal, self._forces, dt_kick, dt_next, before):
                self.bodies.kick_again(self.nodal, before, self.time_s, dt_kick, dt_next, limit)
            contact.finish(self.nodal, self._forces, dt_next)
            self.tied.move(self.nodal)
        self.runaways = int(self._sums[:, RUNAWAYS].sum() + self.bodies.sums[:, 4].sum())
        linked = self.links.work(self.nodal, dt_kick) if self.links.active else None
        self.ledger.advance(self._sums, self.bodies.sums, linked, None if contact is None else contact.sums)

    def drift(self, dt_next: float, time_next: float) -> None:
        """Move everything to the end of the step."""
        first = self.layout.n_free if self._drifted else 0
        drift_nodes(self.nodal, first, len(self.nodal), dt_next)
        self.tied.move(self.nodal)
        self.tied.place(self.nodal)
        if self.bodies.count:
            self.bodies.drift()
        self.time_s, self.dt_s = time_next, dt_next
        self.step += 1

    def velocities(self) -> NDArray[np.float64]:
        """Copy of the velocities as they stand, in the solver's order (n, 3) [m/s]."""
        return self.nodal[:, VELOCITY : VELOCITY + 3].copy()

    def present_velocities(self, before: NDArray[np.float64], dt_next: float) -> NDArray[np.float64]:
        """Velocities at the present time, from those half a step before and, after `kick`, half a step past it."""
        share = self.dt_s / (self.dt_s + dt_next)
        self._body_velocity = self._body_velocity_before + share * (self.bodies.velocity - self._body_velocity_before)
        after = self.velocities()
        if self.contact is not None:
            self.contact.without_corrections(after)
        return before + share * (after - before)

    def mean_body_velocity(self, body: int) -> NDArray[np.float64]:
        """Velocity of a free body's centre at the present time, after `present_velocities` [m/s]."""
        return self._body_velocity[body]

    def energies(self, velocities: NDArray[np.float64] | None = None) -> Energies:
        """Ledger at the present time, after `kick`.

        Parameters
        ----------
        velocities : (n, 3) float64, optional
            At the present time, solver order; for the share of added mass.
        """
        added = 0.0
        if velocities is not None and self.added_mass.total_kg > 0:
            added = 0.5 * float((self._added_mass * (velocities**2).sum(axis=1)).sum())
        return self.ledger.energies(added, self._plastic_work())

    def user_order(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Bring nodal rows back to the user's order."""
        return rows[self.layout.node_row]

    def element_values(self, name: str, width: int) -> NDArray[np.float64]:
        """State of all elements in the user's order, (m, width); zero for rigid ones."""
        result = np.zeros((len(self.problem.hexes), width))
        for group in self.groups:
            group.scatter(getattr(group, name), result)
        return result

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Everything that a step changes, by name."""
        result = {"nodal": self.nodal, "clock": np.array([self.time_s, self.dt_s, float(self.step)])}
        for group in self.groups:
            result |= {f"{group.group.law}.{name}": array for name, array in group.arrays().items()}
        result |= {f"bodies.{name}": array for name, array in self.bodies.arrays().items()}
        result |= {f"ledger.{name}": array for name, array in self.ledger.arrays().items()}
        if self.contact is not None:
            result |= {f"contact.{name}": array for name, array in self.contact.arrays().items()}
        return result

    def variable(self, name: str) -> NDArray[np.float64]:
        """State variable of the laws by name in the user's order (m,); zero where a law keeps none of that name."""
        result = np.zeros(len(self.problem.hexes))
        for group in self.groups:
            if (values := group.variable(name)) is not None:
                group.scatter(values, result)
        return result

    def _plastic_work(self) -> float:
        total = 0.0
        for group in self.groups:
            if (density := group.variable("plastic_work_j_per_m3")) is not None:
                total += float((density * group.reference_volume)[group.group.filled].sum())
        return total

    def restore(self, arrays: dict[str, NDArray[np.float64]]) -> None:
        """Go back to what `arrays` returned; the next call must be `forces`."""
        for name, array in self.arrays().items():
            if name not in ("clock",) and not name.startswith(("ledger.", "contact.")):
                array[...] = arrays[name]
        self.ledger.restore({name[7:]: value for name, value in arrays.items() if name.startswith("ledger.")})
        if self.contact is not None:
            self.contact.restore({name[8:]: value for name, value in arrays.items() if name.startswith("contact.")})
        time, dt, step = arrays["clock"].tolist()
        self.time_s, self.dt_s, self.step = time, dt, int(step)


def _nodal_share(element_mass: NDArray[np.float64], problem: Problem, layout: Layout) -> NDArray[np.float64]:
    rows = layout.node_row[problem.hexes].ravel()
    return np.asarray(np.bincount(rows, np.repeat(element_mass / 8, 8), len(problem.nodes)), float)


def _aligned(n: int) -> NDArray[np.float64]:
    """Nodal array whose rows are cache lines."""
    raw = np.zeros(n * NODE_COLUMNS + 8)
    start = (-(raw.ctypes.data // 8)) % 8
    return raw[start : start + n * NODE_COLUMNS].reshape(n, NODE_COLUMNS)
