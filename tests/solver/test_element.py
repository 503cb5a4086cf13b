"""The element against a textbook version of itself, and what a linear field must do to it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import dumb
import numba
import numpy as np
import pytest
from material_point import PARAMETERS
from numba.core import config

from replay.solver import LAWS, Controls, Material, Problem, SolverPart
from replay.solver.blocks import structured_block
from replay.solver.checkpoint import Checkpoints, identity
from replay.solver.elements import ElementGroup, law_kernel
from replay.solver.integrator import Integrator
from replay.solver.kernels.lanes import LANES
from replay.solver.run import state_hash

CUBE = 0.5 * (1 + dumb.SIGNS)


def crooked(seed: int, n: int = 20) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    nodes = (CUBE + 0.2 * rng.uniform(-1, 1, (n, 8, 3))).reshape(-1, 3)
    return nodes, np.arange(8 * n).reshape(n, 8)


def problem(nodes: np.ndarray, hexes: np.ndarray, material: Material, **fields: Any) -> Problem:
    controls = fields.pop("controls", Controls(1.0, mass_scaling_time_step_s=0.0))
    return Problem(nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "p", material),), controls, **fields)


def per_element(group: ElementGroup, values: np.ndarray, count: int) -> np.ndarray:
    result = np.zeros((count, values.shape[1]))
    group.scatter(values, result)
    return result


def test_fast_element_agrees_with_the_textbook() -> None:
    nodes, hexes = crooked(1)
    rng = np.random.default_rng(2)
    material = Material("m", "elastic", 900.0, {"youngs_modulus_pa": 3e5, "poisson_ratio": 0.35})
    lame, shear = 3e5 * 0.35 / (1.35 * 0.3), 3e5 / 2.7
    stress = rng.normal(size=(len(hexes), 6)) * 1e3
    run = Integrator(problem(nodes, hexes, material, initial_stress=stress), 1e9)
    group = run.groups[0]
    group.hourglass[:] = rng.normal(size=group.hourglass.shape) * 30
    hourglass = per_element(group, group.hourglass, len(hexes))
    velocity = rng.normal(size=nodes.shape) * 2
    dt = 0.02
    order = run.layout.node_order
    run.nodal[:, 4:7] = velocity[order]
    group.forces(run.nodal, dt)
    forces = run.inner_forces()[hexes]  # no node is shared
    new_stress = per_element(group, group.stress, len(hexes))
    new_hourglass = per_element(group, group.hourglass, len(hexes))
    for e in range(len(hexes)):
        x, v = nodes[hexes[e]], velocity[hexes[e]]
        volume = dumb.mean_b(x)[1]
        f, s, q = dumb.elastic_step(
            x, v, dumb.symmetric(stress[e]), hourglass[e].reshape(4, 3), dt, 900.0 * volume, lame, shear, 0.1, 0.06, 1.2
        )
        assert np.abs(dumb.symmetric(new_stress[e]) - s).max() < 1e-11 * np.abs(s).max()
        assert np.abs(new_hourglass[e].reshape(4, 3) - q).max() < 1e-11 * np.abs(q).max()
        assert np.abs(forces[e] - f).max() < 1e-11 * np.abs(f).max()


def test_forces_of_an_element_are_in_balance() -> None:
    nodes, hexes = crooked(3)
    rng = np.random.default_rng(4)
    stress = rng.normal(size=(len(hexes), 6))
    material = Material("m", "elastic", 1.0, {"youngs_modulus_pa": 10.0, "poisson_ratio": 0.2})
    run = Integrator(problem(nodes, hexes, material, initial_stress=stress), 1e9)
    group = run.groups[0]
    group.hourglass[:] = rng.normal(size=group.hourglass.shape)
    group.forces(run.nodal, 0.0)
    f = run.inner_forces()[hexes]
    assert np.abs(f.sum(axis=1)).max() < 1e-13
    assert np.abs(np.cross(nodes[hexes], f).sum(axis=1)).max() < 1e-13


def test_batches_of_two_laws_sum_like_elements_one_by_one() -> None:
    nodes, hexes = structured_block((12, 10, 12), (1.0, 1.0, 1.0))
    nodes += 0.01 * np.sin(17.0 * nodes[:, [1, 2, 0]])
    elastic = Material("e", "elastic", 1000.0, {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3})
    fluid = Material("f", "fluid", 1000.0, {"bulk_modulus_pa": 1e6, "shear_modulus_pa": 1e3})
    parts = (SolverPart(1, "e", elastic), SolverPart(2, "f", fluid))
    part = (nodes[hexes].mean(axis=1)[:, 0] > 0.6).astype(int)
    controls = Controls(1.0, mass_scaling_time_step_s=0.0)
    velocity = np.sin(11.0 * nodes[:, [2, 0, 1]])

    def forces(nodes: np.ndarray, hexes: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        run = Integrator(Problem(nodes, hexes, part, parts, controls, initial_velocity=velocity), 1e9)
        assert max(len(b.first_row) for b in run.layout.batches) > 2, "several batches"
        for _ in range(3):
            run.forces()
            run.drift(1e-4, run.time_s + 1e-4)  # without a kick, both fly on alike
        run.forces()
        return run.inner_forces()

    apart = forces(nodes[hexes].reshape(-1, 3), np.arange(hexes.size).reshape(-1, 8), velocity[hexes].reshape(-1, 3))
    one_by_one = np.zeros_like(nodes)
    for corner in range(8):
        np.add.at(one_by_one, hexes[:, corner], apart.reshape(-1, 8, 3)[:, corner])
    together = forces(nodes, hexes, velocity)
    assert np.abs(together - one_by_one).max() < 1e-11 * np.abs(apart).max()


@pytest.mark.parametrize("law", sorted(set(LAWS) - {"rigid"}))
def test_every_law_goes_on_from_a_checkpoint_with_the_same_bits(law: str, tmp_path: Path) -> None:
    nodes, hexes = crooked(9, 3)
    velocity = np.random.default_rng(10).normal(size=nodes.shape) * 5.0
    task = problem(nodes, hexes, Material("m", law, 1e3, PARAMETERS[law]), initial_velocity=velocity)

    def go_on(run: Integrator) -> None:
        for _ in range(15):
            dt = 0.9 * run.forces().step_s
            run.kick(dt, drift=True)
            run.drift(dt, run.time_s + dt)

    first, second = Integrator(task, 1e9), Integrator(task, 1e9)
    go_on(first)
    checkpoints = Checkpoints(tmp_path, identity(task))
    checkpoints.write(first.step, first.arrays())
    kept = checkpoints.read()
    assert kept is not None
    second.restore(kept)
    for name in LAWS[law].STATE:
        if name != "closing_rate":  # a rate that this foam does not look at
            assert (first.variable(name) != 0).all(), name
    go_on(first)
    go_on(second)
    assert state_hash(second) == state_hash(first)


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")
@pytest.mark.parametrize("law", sorted(set(LAWS) - {"rigid"}))
def test_packed_instructions_dominate_the_lane_loop(law: str) -> None:
    nodes, hexes = crooked(8, LANES)
    group = Integrator(problem(nodes, hexes, Material("m", law, 1e3, PARAMETERS[law])), 1e9).groups[0]
    arguments = group.kernel_arguments(np.zeros((len(nodes), 8)), 0.0)
    nodal, connectivity, place, _, _, _, *fields = arguments
    mass, reference, stress, hourglass, state, parameters, *rest = fields
    block = law_kernel(law).py_func.__globals__["run_block"]
    whole = (
        0, 1, 0, nodal, connectivity, place, mass, reference, stress, hourglass, state, parameters, 0, *rest,
    )  # fmt: skip
    block.compile(tuple(numba.typeof(a) for a in whole))
    whole_text = next(iter(block.inspect_asm().values()))
    # the loop alone: what it calls for single elements is compiled beside it
    text = "".join(re.findall(rf"^\S*block_forces_{law}\S*:\n(.*?)\.cfi_endproc", whole_text, re.MULTILINE | re.DOTALL))
    arithmetic = r"\bv?(?:add|sub|mul|div|sqrt|max|min)"
    packed = len(re.findall(arithmetic + r"pd\b", text))
    scalar = len(re.findall(arithmetic + r"sd\b", text))
    assert packed > 10 * scalar, f"{packed} packed, {scalar} scalar"
