"""The same bits after a restart at any step, and for any number of threads."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
import pytest

from replay.solver import Controls, Material, Problem, SolverPart
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.run import state_hash

MATERIALS = (
    Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3}),
    Material(
        "putty", "elastic_plastic", 1000.0, {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3, "yield_stress_pa": 1e3}
    ),
    Material(
        "tissue", "viscohyperelastic", 1000.0,
        {"bulk_modulus_pa": 2e6, "shear_modulus_pa": 5e3, "prony_ratios": [0.4, 0.3], "prony_times_s": [1e-3, 1e-2]},
    ),
    Material(
        "foam", "crushable_foam", 100.0,
        {"youngs_modulus_pa": 1e6, "plateau_stress_pa": 5e4, "densification_strain": 0.6, "rate_coefficient": 0.1},
    ),
)  # fmt: skip


def column(across: int) -> Problem:
    """Four laws in a row, thrown together."""
    nodes, hexes = structured_block((8, across, across), (0.08, 0.04, 0.04))
    nodes = nodes + 5e-4 * np.sin(nodes @ [90.0, 70.0, 50.0])[:, None] * [1.0, -0.7, 0.4]
    part = np.repeat(np.arange(4), 2)[np.minimum((nodes[hexes].mean(axis=1)[:, 0] / 0.01).astype(int), 7)]
    velocity = np.where(nodes[:, :1] > 0.04, -3.0, 3.0) * [1.0, 0.3, 0.0]
    parts = tuple(SolverPart(k + 1, m.name, m) for k, m in enumerate(MATERIALS))
    controls = Controls(1.0, mass_scaling_time_step_s=0.0)
    return Problem(nodes, hexes, part, parts, controls, initial_velocity=velocity)


def go_on(run: Integrator, steps: int) -> None:
    for _ in range(steps):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=True)
        run.drift(dt, run.time_s + dt)


def test_a_run_taken_up_at_any_step_ends_with_the_same_bits(report: Callable[..., None]) -> None:
    problem, steps = column(2), 24
    run, kept = Integrator(problem, 1e9), []
    for _ in range(steps):
        kept.append({name: array.copy() for name, array in run.arrays().items()})
        go_on(run, 1)
    different = 0
    for k, arrays in enumerate(kept):
        again = Integrator(problem, 1e9)
        again.restore(arrays)
        go_on(again, steps - k)
        different += state_hash(again) != state_hash(run)
    assert (run.variable("equivalent_plastic_strain") > 0).any()
    report("restart at each of 24 steps, four laws", "runs whose state hash differs", 0.0, different, 0.0)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="numba was started with one thread")
def test_any_number_of_threads_gives_the_same_bits(report: Callable[..., None]) -> None:
    before, hashes = numba.get_num_threads(), []
    for threads in range(1, numba.config.NUMBA_NUM_THREADS + 1):
        numba.set_num_threads(threads)
        run = Integrator(column(12), 1e9)
        go_on(run, 10)
        hashes.append(state_hash(run))
    numba.set_num_threads(before)
    different = len(set(hashes)) - 1
    report("1, 2 and more threads, four laws", "state hashes that differ from the first", 0.0, different, 0.0)
