"""Blocks that meet: what the tests of contact build their problems from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from replay.solver import ContactControls, Controls, Material, Problem, SolverPart
from replay.solver.blocks import structured_block
from replay.solver.contact.projection import refuse_penetration
from replay.solver.integrator import Integrator

FREE = 1e12


@dataclass(frozen=True)
class Block:
    """A box of equal elements, turned about its centre, then put there; velocities turn about it too."""

    counts: tuple[int, int, int]
    lengths: tuple[float, float, float]
    centre: Sequence[float]
    material: Material
    velocity: Sequence[float] = (0.0, 0.0, 0.0)
    omega: Sequence[float] = (0.0, 0.0, 0.0)
    turn_deg: Sequence[float] = (0.0, 0.0, 0.0)


def elastic(modulus: float, poisson: float, density: float) -> Material:
    return Material(f"elastic {modulus:g} {poisson:g} {density:g}", "elastic", density,
                    {"youngs_modulus_pa": modulus, "poisson_ratio": poisson})  # fmt: skip


def rigid(density: float) -> Material:
    return Material(f"rigid {density:g}", "rigid", density, {})


def scene(
    blocks: Sequence[Block], contact: ContactControls | None, end: float = 1.0, controls: dict[str, Any] | None = None,
    **fields: Any,
) -> Problem:  # fmt: skip
    """Problem of blocks, one part each, numbered from 1."""
    nodes, hexes, part, velocity, first = [], [], [], [], 0
    for k, block in enumerate(blocks):
        x, h = structured_block(block.counts, block.lengths, [-0.5 * length for length in block.lengths])
        arm = Rotation.from_euler("xyz", block.turn_deg, degrees=True).apply(x)
        nodes.append(np.asarray(block.centre) + arm)
        velocity.append(np.asarray(block.velocity) + np.cross(block.omega, arm))
        hexes.append(h + first)
        part.append(np.full(len(h), k))
        first += len(x)
    parts = tuple(SolverPart(k + 1, f"block {k + 1}", block.material) for k, block in enumerate(blocks))
    settings = {"mass_scaling_time_step_s": 0.0, "time_step_floor_s": 0.0, **(controls or {})}
    fields.setdefault("initial_velocity", np.vstack(velocity))
    return Problem(
        np.vstack(nodes), np.vstack(hexes), np.concatenate(part), parts, Controls(end, **settings), contact=contact,
        **fields,
    )  # fmt: skip


class Steps:
    """A run step by step, with what the tests watch: energies, momentum, penetration."""

    def __init__(self, problem: Problem, *, rigid_step_s: float = 1e-5, check: bool = True) -> None:
        self.problem = problem
        if check and problem.contact is not None:
            refuse_penetration(problem)
        self.run = Integrator(problem, FREE)
        self._rigid_step = rigid_step_s
        assert self.run.contact is not None or problem.contact is None
        self.momentum0 = self.momentum
        self.worst_closure = 0.0
        self.most_total = -np.inf

    @property
    def momentum(self) -> np.ndarray:
        """Momentum of all free nodes and bodies [N s]."""
        run = self.run
        n = run.layout.n_free
        total = np.einsum("n,ni->i", run.mass[:n], run.nodal[:n, 4:7])
        free = ~run.bodies.driven
        return np.asarray(total + np.einsum("n,ni->i", run.bodies.mass[free], run.bodies.velocity[free]))

    @property
    def v(self) -> np.ndarray:
        return np.asarray(self.run.user_order(self.run.nodal[:, 4:7]))

    @property
    def x(self) -> np.ndarray:
        return np.asarray(self.run.user_order(self.run.nodal[:, :3]))

    def nodes_of(self, part: int) -> np.ndarray:
        return np.unique(self.problem.hexes[self.problem.element_part == part])

    def step(self, dt: float | None = None) -> None:
        bound = self.run.forces().step_s
        if dt is None:
            dt = self.problem.controls.time_step_factor * bound if np.isfinite(bound) else self._rigid_step
        self.run.kick(dt, drift=False)
        e = self.run.energies()
        self.worst_closure = max(self.worst_closure, abs(e.closure))
        # what is there beyond what came in: grows only if the scheme makes energy
        self.most_total = max(self.most_total, e.total - e.external_work - e.initial)
        self.run.drift(dt, self.run.time_s + dt)

    def until(self, end: float) -> Steps:
        while self.run.time_s < end * (1 - 1e-12):
            self.step()
        self.run.forces()
        return self
