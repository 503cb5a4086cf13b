"""Bodies to link, and what a closed system keeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from replay.solver import Controls, Material, Problem, SolverPart
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.rigid import rotation

BONE = Material("bone", "rigid", 2000.0, {})
STILL = Controls(0.02, mass_scaling_time_step_s=0.0, bulk_viscosity_linear=0.0, bulk_viscosity_quadratic=0.0)


def two_bricks(
    omega: Sequence[Sequence[float]] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), count: int = 2, **fields: Any
) -> Problem:
    """Rigid bricks of 40 mm in a row along x, 10 mm apart, each turning about its own centre."""
    parts, nodes, hexes, velocity = [], [], [], []
    for k in range(count):
        x, h = structured_block((2, 2, 2), (0.04, 0.04, 0.04), (0.05 * k + 0.01 * (k > 0), 0.0, 0.0))
        turn = np.asarray(omega[k]) if k < len(omega) else np.zeros(3)
        velocity.append(np.cross(turn, x - x.mean(axis=0)) + np.array([0.3 * k, 0.0, 0.0]))
        hexes.append(h + 27 * k)
        nodes.append(x)
        parts.append(SolverPart(k + 1, f"brick-{k + 1}", BONE))
    values: dict[str, Any] = {"controls": STILL, "initial_velocity": np.concatenate(velocity), **fields}
    return Problem(np.concatenate(nodes), np.concatenate(hexes), np.repeat(np.arange(count), 8), tuple(parts), **values)


def momenta(run: Integrator) -> np.ndarray:
    """Momentum and angular momentum about the origin of everything (6,)."""
    bodies, free = run.bodies, slice(0, run.layout.n_free)
    m, x, v = run.mass[free, None], run.nodal[free, :3], run.nodal[free, 4:7]
    total = np.concatenate([(m * v).sum(axis=0), (m * np.cross(x, v)).sum(axis=0)])
    for body in range(bodies.count):
        p = bodies.mass[body] * bodies.velocity[body]
        spin = rotation(bodies.quaternion[body]) @ bodies.spin[body]
        total += np.concatenate([p, np.cross(bodies.centre[body], p) + spin])
    return total
