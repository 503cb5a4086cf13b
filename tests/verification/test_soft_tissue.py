"""Soft, nearly incompressible blocks (K / mu = 438,000): no locking in twist, no pressure checkerboard, energy kept."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from marching import March, controls, one_part

from replay.solver import Material
from replay.solver.blocks import structured_block

SHEAR, BULK, DENSITY = 5e3, 2.19e9, 1000.0
TISSUE = Material("tissue", "viscohyperelastic", DENSITY, {"bulk_modulus_pa": BULK, "shear_modulus_pa": SHEAR})


@pytest.mark.slow
def test_twisted_soft_bar_swings_at_its_torsional_frequency(report: Callable[..., None]) -> None:
    # free-free square bar, 4 elements across; c_t = c_s sqrt(J / I_p), J = 0.140577 a^4, I_p = a^4/6. The reference
    # has the mesh's own lumped inertia (known exactly: 1 + 2/n^2), so that stiffness alone is judged.
    across, a, length = 4, 0.01, 0.04
    nodes, hexes = structured_block((4 * across, across, across), (length, a, a), (0.0, -a / 2, -a / 2))
    turning = 0.1 * np.cos(np.pi * nodes[:, 0] / length)
    velocity = np.stack([0 * turning, -turning * nodes[:, 2], turning * nodes[:, 1]], axis=1)
    march = March(one_part(nodes, hexes, TISSUE, controls(1.0), initial_velocity=velocity))
    speed = np.sqrt(SHEAR / DENSITY * 0.140577 / ((1 + 2 / across**2) / 6))
    wave = np.pi / (8 * across)
    period = 2 * length / speed * wave / np.sin(wave)
    end = nodes[:, 0] == 0
    arm = nodes[end, 1:]
    rows: list[tuple[float, ...]] = []

    def probe(m: March) -> None:
        u = m.u[end]
        e = m.run.energies()
        rows.append((m.t, (u[:, 2] * arm[:, 0] - u[:, 1] * arm[:, 1]).sum(), e.hourglass, e.internal, e.ratio))

    march.until(0.29 * period, probe, every=20)
    t, angle, hourglass, internal, ratio = np.array(rows).T
    k = int(np.argmax(angle))
    near = slice(k - 4, k + 5)
    c = np.polyfit(t[near] - t[k], angle[near], 2)
    quarter = t[k] - 0.5 * c[1] / c[0]
    name = "twisted soft bar, 4 elements across, K/mu 4e5"
    report(name, "period over theory", 1.0, 4 * quarter / period, 0.02)
    # a linear shear strain has (1/n)^2 of its energy within the elements: at n = 4 a share of 1/16 is right
    report(name, "hourglass over internal energy", 0.0625, hourglass[k] / internal[k], 0.30)
    report(name, "energy ratio at tiny strain", 1.0, ratio.min(), 0.005)


@pytest.mark.slow
def test_sheared_soft_block_keeps_hourglass_energy_and_energy_balance(report: Callable[..., None]) -> None:
    nodes, hexes = structured_block((4, 4, 4), (0.01, 0.01, 0.01))
    velocity = np.zeros_like(nodes)
    velocity[:, 0] = 8e-4 * nodes[:, 2] / 0.01
    held = np.zeros(nodes.shape, bool)
    held[nodes[:, 2] == 0] = True
    march = March(one_part(nodes, hexes, TISSUE, controls(1.0), initial_velocity=velocity, fixed=held))
    rows: list[tuple[float, ...]] = []

    def probe(m: March) -> None:
        e = m.run.energies()
        rows.append((e.internal, e.hourglass, e.ratio))

    march.until(5e-3, probe, every=20)
    internal, hourglass, ratio = max(rows)
    name = "sheared soft block, 4 elements across, K/mu 4e5"
    report(name, "hourglass over internal energy", 0.0, hourglass / internal, 0.05)
    report(name, "energy ratio at strain 4e-4", 1.0, ratio, 0.005)


def test_confined_column_has_no_pressure_checkerboard(report: Callable[..., None]) -> None:
    width, height = 0.01, 0.03
    nodes, hexes = structured_block((4, 4, 12), (width, width, height))
    rng = np.random.default_rng(0)
    inside = (nodes > 1e-9).all(axis=1) & (nodes < np.array([width, width, height]) - 1e-9).all(axis=1)
    nodes[inside] += rng.uniform(-3e-4, 3e-4, (inside.sum(), 3))
    held = np.zeros(nodes.shape, bool)
    for axis in (0, 1):
        held[(nodes[:, axis] < 1e-9) | (nodes[:, axis] > width - 1e-9), axis] = True
    held[(nodes[:, 2] < 1e-9) | (nodes[:, 2] > height - 1e-9), 2] = True
    velocity = np.zeros_like(nodes)
    velocity[:, 2] = -0.1 * nodes[:, 2] / height
    march = March(one_part(nodes, hexes, TISSUE, controls(1.0), initial_velocity=velocity, fixed=held))
    march.until(2e-4)
    pressure = -march.stress[:, :3].mean(axis=1)
    name = "confined column of crooked elements, K/mu 4e5"
    ratio = 1 - 0.1 * 2e-4 / height
    report(name, "mean pressure [Pa]", 0.5 * BULK * (1 / ratio - ratio), pressure.mean(), 0.001)
    report(name, "largest deviation of an element over mean", 0.0, np.abs(pressure / pressure.mean() - 1).max(), 0.01)
    share = march.run.energies().bulk_viscosity / march.run.energies().internal
    report(name, "bulk viscosity over internal energy", 0.0, share, 0.01)
