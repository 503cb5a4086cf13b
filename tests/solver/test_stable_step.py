"""The stable step of the kernels against the eigenvalues of each element's own stiffness, all 24 of them."""

from __future__ import annotations

import dumb
import numpy as np
import pytest

from replay.solver import Controls, Material, Problem, SolverPart
from replay.solver.integrator import Integrator

CUBE = 0.5 * (1 + dumb.SIGNS)


def random_hexes(count: int, size: float, seed: int) -> np.ndarray:
    """Unit cubes with every node moved, then stretched by up to 1 : 10 and turned; positive at all corners."""
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    while len(found) < count:
        x = CUBE + size * rng.uniform(-1, 1, (8, 3))
        x = x * 10 ** rng.uniform(-0.5, 0.5, 3) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        x = x if dumb.mean_b(x)[1] > 0 else x * [1, 1, -1]
        corners = [np.linalg.det(x[list(n)] - x[k]) for k, n in enumerate(NEIGHBOURS)]
        if min(corners) > 0:
            found.append(x)
    return np.array(found)


# of each corner, in right-handed order
NEIGHBOURS = ((1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3))


def exact_step(x: np.ndarray, lame: float, shear: float, bending: float, twist: float) -> float:
    """2 / omega of the element alone, density 1: stiffness of its mean strain and of its hourglass patterns."""
    b, volume = dumb.mean_b(x)
    strain = np.zeros((6, 24))
    for node, (bx, by, bz) in enumerate(b):
        strain[:, 3 * node : 3 * node + 3] = [
            [bx, 0, 0], [0, by, 0], [0, 0, bz], [by, bx, 0], [0, bz, by], [bz, 0, bx]
        ]  # fmt: skip
    moduli = np.diag([2 * shear] * 3 + [shear] * 3)
    moduli[:3, :3] += lame
    stiffness = strain.T @ moduli @ strain / volume
    k = 2 * shear * (b**2).sum() / (16 * volume)
    for a, gamma in enumerate(dumb.GAMMA - (dumb.GAMMA @ x) @ b.T / volume):
        resistance = bending * k * np.eye(3)
        if a < 3:
            axis = dumb.SIGNS[:, a] @ x
            resistance -= (bending - twist) * k * np.outer(axis, axis) / (axis @ axis)
        stiffness += np.kron(np.outer(gamma, gamma), resistance)
    return float(2 / np.sqrt(np.linalg.eigvalsh(stiffness)[-1] * 8 / volume))


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49999])
@pytest.mark.parametrize(
    ("method", "bending", "twist"), [("stiffness", 0.0, 0.0), ("stiffness", 0.10, 0.10), ("selective", 0.19, 0.06)]
)
def test_the_step_is_stable_for_any_shape_and_not_much_shorter(
    poisson: float, method: str, bending: float, twist: float
) -> None:
    lame, shear = poisson / ((1 + poisson) * (1 - 2 * poisson)), 0.5 / (1 + poisson)
    shapes = np.concatenate([CUBE[None], random_hexes(60, 0.1, 1), random_hexes(60, 0.25, 2)])
    nodes, hexes = shapes.reshape(-1, 3), np.arange(8 * len(shapes)).reshape(-1, 8)
    settings = Controls(
        1.0, hourglass_method=method, hourglass_coefficient=0.10 if bending else 0.0, mass_scaling_time_step_s=0.0,
        bulk_viscosity_linear=0.0, bulk_viscosity_quadratic=0.0,
    )  # fmt: skip
    material = Material("m", "elastic", 1.0, {"youngs_modulus_pa": 1.0, "poisson_ratio": poisson})
    part = np.zeros(len(hexes), int)
    run = Integrator(Problem(nodes, hexes, part, (SolverPart(1, "p", material),), settings), 1e9)
    run.forces()
    step = np.zeros(len(hexes))
    run.groups[0].scatter(run.groups[0].step, step)
    share = step / [exact_step(x, lame, shear, bending, twist) for x in shapes]
    assert share.max() < 1 + 1e-12
    assert share.min() > 0.83
    assert share[0] > 0.88  # a cube
    if not bending:
        assert share[0] == pytest.approx(1.0, abs=1e-12)
