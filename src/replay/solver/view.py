"""What recorders see of a run at one time, all in the user's order of nodes and elements."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from replay.solver.integrator import Integrator
from replay.solver.kernels.geometry import element_modes
from replay.solver.kernels.lanes import POSITION
from replay.solver.ledger import Energies
from replay.solver.problem import Problem, gradients
from replay.solver.rigid import Pose, fit_pose, fit_rigid_motion, weighted_sum


class Recorder(Protocol):
    """Gathers results while a run goes on; what it holds is part of every checkpoint."""

    def sample(self, view: StateView) -> None:
        """Take the state at a history time."""

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far."""

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `state` returned."""

    def write(self, folder: Path) -> None:
        """Write the results at the end of the run."""


class ReferenceGradients:
    """Reference gradients and volumes of a mesh, computed once per run."""

    def __init__(self, problem: Problem) -> None:
        gradient, self.volume = gradients(problem.nodes, problem.hexes)
        self.scaled = (gradient / self.volume[:, None]).reshape(-1, 6, 3)


class StateView:
    """State at one time.

    Attributes
    ----------
    time_s, step, time_step_s
        Time [s], steps done, last step [s].
    coordinates, velocities : (n, 3) float64
        [m], [m/s].
    energies
        The ledger.
    links, tied
        Joints and straps, ties: their forces at this time.
    """

    def __init__(self, integrator: Integrator, velocities: NDArray[np.float64], reference: ReferenceGradients) -> None:
        self._integrator = integrator
        self._reference = reference
        self._solver_velocities = velocities
        self.problem = integrator.problem
        self.time_s = integrator.time_s
        self.step = integrator.step
        self.time_step_s = integrator.dt_s
        self.coordinates = integrator.user_order(integrator.nodal[:, POSITION : POSITION + 3])
        self.velocities = integrator.user_order(velocities)
        self.energies: Energies = integrator.energies(velocities)
        self.links, self.tied = integrator.links, integrator.tied

    @property
    def displacements(self) -> NDArray[np.float64]:
        """Displacements (n, 3) [m]."""
        return self.coordinates - self.problem.nodes

    @cached_property
    def stress(self) -> NDArray[np.float64]:
        """Cauchy stress (m, 6), order xx, yy, zz, xy, yz, zx [Pa]; without bulk viscosity, zero in rigid parts."""
        return self._integrator.element_values("stress", 6)

    def variable(self, name: str) -> NDArray[np.float64]:
        """State variable of the material laws by name (m,); zero where a law keeps none of that name."""
        return self._integrator.variable(name)

    @cached_property
    def volumes(self) -> NDArray[np.float64]:
        """Volumes (m,) [m^3]."""
        return gradients(self.coordinates, self.problem.hexes)[1]

    @property
    def reference_volumes(self) -> NDArray[np.float64]:
        """Volumes before deformation (m,) [m^3]."""
        return self._reference.volume

    @cached_property
    def von_mises(self) -> NDArray[np.float64]:
        """Von Mises stress (m,) [Pa]."""
        s = self.stress
        spread = (s[:, 0] - s[:, 1]) ** 2 + (s[:, 1] - s[:, 2]) ** 2 + (s[:, 2] - s[:, 0]) ** 2
        return np.sqrt(0.5 * spread + 3.0 * (s[:, 3:] ** 2).sum(axis=1))

    @cached_property
    def pressure(self) -> NDArray[np.float64]:
        """Pressure (m,), compression positive [Pa]."""
        return -self.stress[:, :3].mean(axis=1)

    @cached_property
    def lode(self) -> NDArray[np.float64]:
        """Third invariant ``27 J3 / (2 sigma_vm^3)`` (m,): 1 in tension, -1 in compression, 0 in shear and at rest."""
        s = self.stress
        d = s[:, :3] + self.pressure[:, None]
        third = (
            d[:, 0] * d[:, 1] * d[:, 2] + 2 * s[:, 3] * s[:, 4] * s[:, 5]
            - d[:, 0] * s[:, 4] ** 2 - d[:, 1] * s[:, 5] ** 2 - d[:, 2] * s[:, 3] ** 2
        )  # fmt: skip
        cube = self.von_mises**3
        return np.where(cube > 0, 13.5 * third / np.where(cube > 0, cube, 1.0), 0.0)

    def deformation_gradient(self) -> NDArray[np.float64]:
        """Mean deformation gradient (m, 3, 3): ``sum_c m_c (x) G0_c / V0``."""
        return self._deformation

    @cached_property
    def _deformation(self) -> NDArray[np.float64]:
        modal = np.empty((len(self.problem.hexes), 6, 3))
        element_modes(self.coordinates, self.problem.hexes, modal)
        return np.einsum("eci,ecj->eij", modal, self._reference.scaled)

    @cached_property
    def body_poses(self) -> list[Pose]:
        """Pose of every rigid body, read off its nodes."""
        bodies = self._integrator.bodies
        found = []
        for body in range(bodies.count):
            rows = bodies.tied_rows(body)
            points = self._integrator.nodal[rows, POSITION : POSITION + 3]
            mass = self._integrator.mass[rows]
            position, quaternion = fit_pose(points, bodies.lever(body), mass)
            velocity, omega = fit_rigid_motion(points, self._solver_velocities[rows], mass, position)
            if bodies.driven[body]:
                told = bodies.quaternion[body]
                quaternion = quaternion if quaternion @ told >= 0 else -quaternion
            found.append(Pose(position, quaternion, velocity, omega))
        return found

    @cached_property
    def poses(self) -> dict[int, Pose]:
        """Pose of the body of every rigid part by part number."""
        members = zip(self.body_poses, self._integrator.bodies.parts)
        return {self.problem.parts[k].pid: pose for pose, parts in members for k in parts}

    @cached_property
    def set_poses(self) -> dict[str, Pose]:
        """Pose of the body of every rigid set by name."""
        members = zip(self.body_poses, self._integrator.bodies.sets)
        return {self.problem.rigid_sets[k].name: pose for pose, sets in members for k in sets}

    @cached_property
    def part_motion(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Mass [kg], centre of gravity [m] and its velocity [m/s] of every part, from element masses."""
        hexes, index = self.problem.hexes, self.problem.element_part
        weight = self._integrator.element_mass
        count = len(self.problem.parts)
        mass = np.asarray(np.bincount(index, weight, count), float)

        def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
            element = values[hexes].mean(axis=1) * weight[:, None]
            total = np.stack([np.bincount(index, element[:, k], count) for k in range(3)], axis=1)
            return total / np.where(mass > 0, mass, 1.0)[:, None]

        return mass, mean(self.coordinates), mean(self.velocities)

    @cached_property
    def part_kinetic(self) -> NDArray[np.float64]:
        """Kinetic energy of every part, each element with an eighth of its mass at its nodes (n_parts,) [J]."""
        square = (self.velocities**2).sum(axis=1)[self.problem.hexes].mean(axis=1)
        energy = 0.5 * self._integrator.element_mass * square
        return np.asarray(np.bincount(self.problem.element_part, energy, len(self.problem.parts)), float)

    @cached_property
    def part_work(self) -> NDArray[np.float64]:
        """Work in stress, hourglass forces and bulk viscosity of every part (n_parts, 3) [J]."""
        return self._integrator.ledger.part_work.copy()

    @cached_property
    def momentum(self) -> NDArray[np.float64]:
        """Momentum of all that moves (3,) [N s]."""
        integrator = self._integrator
        free = slice(0, integrator.layout.n_free)
        total = weighted_sum(integrator.mass[free], self._solver_velocities[free])
        for body in range(integrator.bodies.count):
            rows = integrator.bodies.tied_rows(body)
            if integrator.bodies.driven[body]:
                total = total + weighted_sum(integrator.mass[rows], self._solver_velocities[rows])
            else:
                total = total + integrator.bodies.mass[body] * integrator.mean_body_velocity(body)
        return total


__all__ = ["Recorder", "ReferenceGradients", "StateView"]
