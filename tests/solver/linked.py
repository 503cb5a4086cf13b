"""Bodies to link, and what a closed system keeps."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from replay.solver import Controls, Joint, Material, Problem, RigidSet, SolverPart, Strap
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.mortar import outer_faces, tie_surfaces
from replay.solver.rigid import rotation

BONE = Material("bone", "rigid", 2000.0, {})
MODULUS = 1e6
RUBBER = Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": MODULUS, "poisson_ratio": 0.25})
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


def stacked(
    below: tuple[int, int] = (2, 3), above: tuple[int, int] = (3, 4), *, crooked: float = 0.0, offset: float = 0.0,
    tied: str = "above", layers: int = 2, **fields: Any,
) -> Problem:  # fmt: skip
    """Two blocks of 20 mm a side on one another, with other meshes on the two sides of the plane z = 10 mm."""
    nodes, hexes = structured_block((*below, layers), (0.02, 0.02, 0.01))
    upper, more = structured_block((*above, layers), (0.02, 0.02, 0.01), (offset, 0.0, 0.01))
    first = len(nodes)
    nodes = np.concatenate([nodes, upper])
    inner = ((nodes[:, :2] > 1e-9) & (nodes[:, :2] < 0.02 - 1e-9)).all(axis=1)
    bend = np.sin(np.pi * nodes[inner, 2:] / 0.02)
    nodes[inner, :2] += crooked * bend * np.sin(900.0 * nodes[inner][:, [1, 0]])
    hexes = np.concatenate([hexes, more + first])
    part = np.repeat([0, 1], [len(hexes) - len(more), len(more)])
    faces = [outer_faces(hexes[part == k]) for k in (0, 1)]
    plane = [f[(abs(nodes[f][:, :, 2] - 0.01) < 1e-9).all(axis=1)] for f in faces]
    slave, master = plane[::-1] if tied == "above" else plane
    found = tie_surfaces("seam", nodes, slave, master, 1e-3)
    parts = (SolverPart(1, "below", fields.pop("material", RUBBER)), SolverPart(2, "above", RUBBER))
    return Problem(found.nodes, hexes, part, parts, STILL, ties=[found.tie], **fields)


def everything(end: float = 4e-3) -> Problem:
    """Two tied soft blocks, a rigid foot and head made of nodes, a joint between them, and a strap over all."""
    plain = stacked()
    foot = np.flatnonzero(plain.nodes[:, 2] < 1e-9)
    head = np.flatnonzero(plain.nodes[:, 2] > 0.02 - 1e-9)
    middle = int(np.flatnonzero(abs(plain.nodes[:, 2] - 0.015) < 1e-9)[0])
    joint = Joint(
        "neck", "foot", "head", (0.01, 0.01, 0.02), np.full((3, 2), 0.3), damping_ratio=0.2, centre_stiffness=2e4,
        centre_damping_ratio=0.1,
    )  # fmt: skip
    strap = Strap("chin", np.array([foot[0], middle, head[0]]), 2e3, 0.5, pay_in_m=5e-4, pay_in_time_s=2e-3)
    velocity = np.cross([60.0, -100.0, 160.0], plain.nodes) + 0.3 * np.sin(400.0 * plain.nodes[:, ::-1])
    controls = Controls(
        end, history_interval_s=end / 10, plot_interval_s=end / 5, mass_scaling_time_step_s=0.0,
        speed_limit_m_per_s=100.0, gravity_m_per_s2=(0.0, 0.0, -9.81),
    )  # fmt: skip
    return dataclasses.replace(
        plain, rigid_sets=(RigidSet("foot", foot), RigidSet("head", head)), joints=(joint,), straps=(strap,),
        initial_velocity=velocity, controls=controls,
    )  # fmt: skip
