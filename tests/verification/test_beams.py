"""Beams: what hourglass control must give back, and where it must admit that the mesh is too coarse."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from marching import March, controls, crossing_period, elastic, one_part

from replay.solver.blocks import structured_block

STATIC_TIP = 0.051475
FREQUENCY = 517.830


def cantilever(through: int, load: float = 4e3) -> tuple[float, float]:
    """Peak tip deflection under a step load over the static one, and hourglass over internal energy there."""
    nodes, hexes = structured_block((5 * through, through, through), (10.0, 2.0, 2.0))
    held = np.zeros(nodes.shape, bool)
    held[nodes[:, 0] == 0] = True
    force = np.zeros_like(nodes)
    end = np.isclose(nodes[:, 0], 10.0)
    faces = hexes[np.isclose(nodes[hexes].max(axis=1)[:, 0], 10.0)][:, [1, 2, 5, 6]]
    np.add.at(force[:, 2], faces.ravel(), load / faces.size)
    settings = controls(1.0, bulk_viscosity_linear=0.0, bulk_viscosity_quadratic=0.0)
    march = March(one_part(nodes, hexes, elastic(2e7, 0.25, 7.34e-4), settings, nodal_forces=force, fixed=held))
    rows: list[tuple[float, float, float]] = []

    def probe(m: March) -> None:
        e = m.run.energies()
        rows.append((m.u[end, 2].mean(), e.hourglass, e.internal))

    march.until((1.8 if through == 1 else 0.65) / FREQUENCY, probe)
    tip, hourglass, internal = max(rows)
    return tip / (STATIC_TIP * load / 4e3), hourglass / internal


def test_cantilever_four_elements_through_gives_the_static_deflection_twice(report: Callable[..., None]) -> None:
    ratio, hourglass = cantilever(4)
    name = "cantilever 10 x 2 x 2, 4 elements through"
    report(name, "peak of the step response over static tip", 2.0, ratio, 0.03)
    report(name, "hourglass over internal energy", 0.0, hourglass, 0.05)


def test_cantilever_deflection_converges(report: Callable[..., None]) -> None:
    errors = [abs(cantilever(n)[0] / 2.0 - 1.0) for n in (2, 4)]
    assert errors[1] < 0.2 * errors[0]  # at least the second order, four to one, and the dynamic part


def test_hourglass_energy_betrays_a_beam_one_element_thick() -> None:
    ratio, hourglass = cantilever(1)
    assert hourglass > 0.10  # the gate's limit
    assert ratio > 2 * 1.3
    _, two = cantilever(2)
    assert 0.05 < two < 0.20


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
