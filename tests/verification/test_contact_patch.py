"""The contact patch test: a pressure goes through faces whose nodes do not meet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.contact_scenes import Block, Steps, elastic, scene

from replay.solver import ContactControls, Material

PRESSURE = 1e4


def pressed(lower: tuple[int, int, int], upper: tuple[int, int, int]) -> Steps:
    """Two stacked cubes, nu = 0, the lower on a bed, the upper under a pressure that is raised slowly from none."""
    soft: Material = elastic(1e6, 0.0, 1000.0)
    blocks = [
        Block(lower, (0.04, 0.04, 0.04), (0, 0, -0.02), soft), Block(upper, (0.04, 0.04, 0.04), (0, 0, 0.02), soft)
    ]  # fmt: skip
    plain = scene(blocks, ContactControls())
    top = np.isclose(plain.nodes[:, 2], 0.04)
    fixed = np.zeros(plain.nodes.shape, bool)
    fixed[np.isclose(plain.nodes[:, 2], -0.04), 2] = True
    # lateral motion has nothing to do with the patch; nu = 0 leaves it at rest but for rounding
    forces = np.zeros_like(plain.nodes)
    faces = plain.hexes[np.isclose(plain.nodes[plain.hexes][:, :, 2].max(axis=1), 0.04)][:, 4:]
    np.add.at(forces[:, 2], faces.ravel(), -PRESSURE * 0.04**2 / faces.size)
    assert top.sum() == len(np.unique(faces))
    return Steps(scene(blocks, ContactControls(), controls={"bulk_viscosity_linear": 1.0}, fixed=fixed,
                       nodal_forces=forces))  # fmt: skip


@pytest.mark.parametrize(("lower", "upper"), [((4, 4, 4), (4, 4, 4)), ((5, 5, 5), (3, 4, 4)), ((8, 8, 4), (3, 3, 3))])
def test_pressure_is_uniform(
    report: Callable[..., None], lower: tuple[int, int, int], upper: tuple[int, int, int]
) -> None:
    march = pressed(lower, upper)
    run = march.run
    stress = np.zeros(len(march.problem.hexes))
    # velocities are damped to rest: dynamic relaxation
    while run.time_s < 0.05:
        march.step()
        run.nodal[: run.layout.n_free, 4:7] *= 0.97
    stress = run.element_values("stress", 6)[:, 2]
    centre = march.problem.nodes[march.problem.hexes].mean(axis=1)[:, 2]
    error = np.abs(stress / -PRESSURE - 1)
    height = np.where(march.problem.element_part == 0, 0.04 / lower[2], 0.04 / upper[2])
    at_interface = np.abs(centre) < height
    name = f"contact patch, {lower[0]}x{lower[1]} against {upper[0]}x{upper[1]} faces, nu 0"
    report(name, "pressure inside, worst element", 0.0, error[~at_interface].max(), 0.03)
    report(name, "pressure at the interface, worst element", 0.0, error[at_interface].max(), 0.10)
