"""Beams: what hourglass control must give back, and where it must admit that the mesh is too coarse."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from marching import March, controls, crossing_period, elastic, one_part

from replay.gates import Limits, numerics_gate, part_energies
from replay.solver import Problem, solve
from replay.solver.blocks import structured_block
from replay.stages.impact import run_numbers

LOAD, POISSON = 4e3, 0.25
STATIC_TIP = 0.051475
FREQUENCY = 517.830


def step_loaded(through: int, method: str, **settings: float) -> Problem:
    """Cantilever 10 x 2 x 2 with a step load of 4000 over its end."""
    nodes, hexes = structured_block((5 * through, through, through), (10.0, 2.0, 2.0))
    held = np.zeros(nodes.shape, bool)
    held[nodes[:, 0] == 0] = True
    force = np.zeros_like(nodes)
    faces = hexes[np.isclose(nodes[hexes].max(axis=1)[:, 0], 10.0)][:, [1, 2, 5, 6]]
    np.add.at(force[:, 2], faces.ravel(), LOAD / faces.size)
    quiet = controls(
        1.8 / FREQUENCY, hourglass_method=method, bulk_viscosity_linear=0.0, bulk_viscosity_quadratic=0.0, **settings
    )
    return one_part(nodes, hexes, elastic(2e7, POISSON, 7.34e-4), quiet, nodal_forces=force, fixed=held)


def cantilever(through: int, method: str = "stiffness") -> tuple[float, float]:
    """Peak tip deflection under a step load over the static one, and hourglass over internal energy there."""
    march = March(step_loaded(through, method))
    end = np.isclose(march.problem.nodes[:, 0], 10.0)
    rows: list[tuple[float, float, float]] = []

    def probe(m: March) -> None:
        e = m.run.energies()
        rows.append((m.u[end, 2].mean(), e.hourglass, e.internal))

    march.until((1.8 if through == 1 else 0.65) / FREQUENCY, probe)
    tip, hourglass, internal = max(rows)
    return tip / STATIC_TIP, hourglass / internal


@pytest.mark.parametrize("method", ["stiffness", "selective"])
def test_cantilever_four_elements_through_gives_the_static_deflection_twice(
    report: Callable[..., None], method: str
) -> None:
    ratio, hourglass = cantilever(4, method)
    name = f"cantilever 10 x 2 x 2, 4 elements through, {method} form"
    report(name, "peak of the step response over static tip", 2.0, ratio, 0.03)
    report(name, "hourglass over internal energy", 0.0, hourglass, 0.05)


def test_cantilever_deflection_converges_with_the_second_order(report: Callable[..., None]) -> None:
    two, four, eight = (cantilever(n)[0] for n in (2, 4, 8))
    order = np.log2((two - four) / (four - eight))
    report("cantilever 10 x 2 x 2, 2, 4 and 8 elements through", "order of convergence", 2.0, order, 0.15)


def test_a_beam_of_one_element_bends_by_hourglass_forces_alone(report: Callable[..., None]) -> None:
    # against a bending pattern of a cube 2 (1 + nu) / 9 would be exact: the coefficient is a share of the stiffness
    ratio, hourglass = cantilever(1)
    share = 0.10 / (2 * (1 + POISSON) / 9)
    name = "cantilever 10 x 2 x 2, 1 element through"
    report(name, "peak of the step response over static tip", 2.0 / share, ratio, 0.06)
    assert hourglass > 50
    ratio, hourglass = cantilever(2)
    name = "cantilever 10 x 2 x 2, 2 elements through"
    report(name, "peak of the step response over static tip", 2.0 / (1 - 1 / 4 + share / 4), ratio, 0.06)
    report(name, "hourglass over internal energy", share / 3, hourglass, 0.06)


@pytest.mark.parametrize(("through", "verdict"), [(1, "fail"), (4, "pass")])
def test_the_hourglass_gate_refuses_the_beam_of_one_element_and_passes_four(
    through: int, verdict: str, tmp_path: Path
) -> None:
    problem = step_loaded(through, "stiffness", history_interval_s=2e-5)
    summary = solve(problem, tmp_path, progress=None)
    energy = pd.read_csv(tmp_path / "energy.csv")
    gate = numerics_gate(
        {str(name): energy[name].to_numpy() for name in energy},
        part_energies(pd.read_csv(tmp_path / "part_energy.csv")),
        {"ran_to_end": summary.ran_to_end, **run_numbers(dataclasses.asdict(summary))},
        Limits.load(),
        steps=pd.read_csv(tmp_path / "timestep.csv")["step"].to_numpy(),
    )
    found = {check.name.partition(":")[0]: check.verdict for check in gate.checks}
    assert found["hourglass_share"] == verdict
    assert (gate.verdict == "fail") == (verdict == "fail")
    assert all(v in ("pass", "vacuous") for name, v in found.items() if name != "hourglass_share")


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "root", "exact"), [(1, 1.8751041, 209.5475), (2, 4.6940911, 1313.212)])
def test_slender_cantilever_frequencies(report: Callable[..., None], mode: int, root: float, exact: float) -> None:
    length, depth = 0.2, 0.01
    through = 4 if mode == 1 else 6
    nodes, hexes = structured_block((15 * through, through, through), (length, depth, depth))
    held = np.zeros(nodes.shape, bool)
    held[nodes[:, 0] == 0] = True
    x = root * nodes[:, 0] / length
    s = (np.cosh(root) + np.cos(root)) / (np.sinh(root) + np.sin(root))
    shape = np.cosh(x) - np.cos(x) - s * (np.sinh(x) - np.sin(x))
    slope = (np.sinh(x) + np.sin(x) - s * (np.cosh(x) - np.cos(x))) * root / length
    velocity = np.zeros_like(nodes)
    velocity[:, 2] = 1e-3 * shape
    velocity[:, 0] = -1e-3 * (nodes[:, 2] - depth / 2) * slope
    problem = one_part(nodes, hexes, elastic(210e9, 0.3, 7800.0), controls(1.0), initial_velocity=velocity, fixed=held)
    middle = np.isclose(nodes[:, 1], 0) & np.isclose(nodes[:, 2], 0)
    weight = shape[middle]  # what is seen of the other mode is orthogonal to this one
    seen = (0.8 if mode == 1 else 3.3) / exact
    times, signal = March(problem).record(seen, lambda m: weight @ m.u[middle, 2], every=5)
    if mode == 1:  # one crossing, half a period after the start
        late = times > 0.3 / exact
        k = int(np.flatnonzero(signal[late] < 0)[0])
        t, u = times[late], signal[late]
        frequency = 0.5 / (t[k - 1] + u[k - 1] * (t[k] - t[k - 1]) / (u[k - 1] - u[k]))
    else:
        frequency = 1 / crossing_period(times[1:], signal[1:])
    name = f"slender steel cantilever, {through} elements through"
    report(name, f"frequency {mode} [Hz]", exact, frequency, 0.02)
