"""A soft sphere that bounces off a rigid plane: Hertz's law of impact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.contact_scenes import Steps, elastic

from replay.models.cubed_sphere import cube_lattice, directions_of, inflated_core
from replay.solver import ContactControls, Controls, Problem, SolverPart
from replay.solver.blocks import structured_block

RADIUS = 0.05
# at 1 m/s
INDENTATION, FORCE, DURATION = 2.090309e-3, 313.1109, 6.152355e-3


def quarter_ball(divisions: int, layers: int) -> tuple[np.ndarray, np.ndarray]:
    """Ball of radius 1 by a cubed sphere, x > 0 and y > 0 only: inflated core and layers about it."""
    lattice = cube_lattice(divisions)
    core = 0.6
    inner = inflated_core(lattice) * core
    sheets, hexes, current, count = [inner], [lattice.cells], lattice.surface, len(inner)
    outer = directions_of(lattice.surface_cube)
    start = inner[lattice.surface]
    for k in range(1, layers + 1):
        sheets.append(start + (outer - start) * k / layers)
        new = count + np.arange(len(outer))
        hexes.append(np.hstack([current[lattice.quads], new[lattice.quads]]))
        current, count = new, count + len(outer)
    nodes, cells = np.vstack(sheets), np.vstack(hexes)
    centre = nodes[cells].mean(axis=1)
    cells = cells[(centre[:, 0] > 0) & (centre[:, 1] > 0)]
    used = np.unique(cells)
    row = np.full(len(nodes), -1)
    row[used] = np.arange(len(used))
    return nodes[used], row[cells]


def bounce(speed: float) -> tuple[float, float, float]:
    """Greatest force, duration and indentation over Hertz's, of a ball of 24 faces a quarter turn."""
    ball, cells = quarter_ball(24, 6)
    ball *= RADIUS
    plane, slab = structured_block((1, 1, 1), (0.08, 0.08, 0.01), (-0.01, -0.01, -RADIUS - 0.01))
    nodes = np.vstack([ball, plane])
    velocity, fixed = np.zeros_like(nodes), np.zeros(nodes.shape, bool)
    velocity[: len(ball), 2] = -speed
    for axis in (0, 1):  # planes of symmetry
        fixed[: len(ball), axis] = np.abs(ball[:, axis]) < 1e-9
    fixed[len(ball) :] = True
    part = np.repeat([0, 1], [len(cells), 1])
    soft = elastic(1e7, 0.3, 1000.0)
    problem = Problem(
        nodes, np.vstack([cells, slab + len(ball)]), part, (SolverPart(1, "ball", soft), SolverPart(2, "plane", soft)),
        Controls(1.0, mass_scaling_time_step_s=0.0), initial_velocity=velocity, fixed=fixed, contact=ContactControls(),
    )  # fmt: skip
    march = Steps(problem)
    contact = march.run.contact
    assert contact is not None
    centre = int(np.argmin(np.abs(ball).sum(axis=1)))
    duration = DURATION * speed**-0.2
    rows = []
    while march.run.time_s < 1.1 * duration:
        before, t = contact.pair_sums[0, 2], march.run.time_s
        march.step()
        push = 4 * abs(contact.pair_sums[0, 2] - before) / float(contact.arrays()["kick"][0])
        rows.append((t, push, -march.x[centre, 2]))
    t, force, sunk = np.array(rows).T
    pressed = force > 0
    assert np.diff(pressed.astype(int)).tolist().count(-1) == 1  # one release
    assert contact.penetration_over_edge < 1e-3
    assert march.worst_closure < 1e-12
    mass = 1000.0 * 4 / 3 * np.pi * RADIUS**3
    assert 4 * abs(contact.pair_sums[0, 2]) == pytest.approx(2 * mass * speed, rel=0.03)
    width = int(0.02 * duration / (t[1] - t[0]))  # nodes that arrive make the force ring a little
    smooth = np.convolve(force, np.ones(width) / width, "same")
    return (
        float(smooth.max() / (FORCE * speed**1.2)), float(t[pressed][-1] / duration),
        float(sunk.max() / (INDENTATION * speed**0.8)),
    )  # fmt: skip


@pytest.mark.slow
def test_soft_sphere_on_a_rigid_plane(report: Callable[..., None]) -> None:
    # Hertz takes the sphere for a half-space: at 1 m/s its contact radius is 0.2 of its own, and the centre follows the
    # plane by some 0.1 of the indentation, which Hertz has at rest; the rest of it vanishes with the speed
    slow, fast = bounce(0.25), bounce(1.0)
    name = "soft sphere on a rigid plane (Hertz)"
    for speed, result, tolerance in (("0.25", slow, (0.05, 0.03, 0.05)), ("1", fast, (0.10, 0.06, 0.06))):
        for k, quantity in enumerate(("greatest force", "duration", "greatest indentation")):
            report(name, f"{quantity} over Hertz's, {speed} m/s", 1.0, result[k], tolerance[k])
    assert all(abs(a - 1) < 0.5 * abs(b - 1) for a, b in zip(slow, fast))
