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


def first_quarter(
    march: March, period: float, signal: Callable[[March], float], every: int = 20
) -> tuple[float, float, float]:
    """Period over the one expected, from the first peak of the signal; hourglass share there; least energy ratio."""
    rows: list[tuple[float, ...]] = []

    def probe(m: March) -> None:
        e = m.run.energies()
        rows.append((m.t, signal(m), e.hourglass, e.internal, e.ratio))

    march.until(0.29 * period, probe, every=every)
    t, value, hourglass, internal, ratio = np.array(rows).T
    k = int(np.argmax(value))
    near = slice(k - 4, k + 5)
    c = np.polyfit(t[near] - t[k], value[near], 2)
    return float(4 * (t[k] - 0.5 * c[1] / c[0]) / period), float(hourglass[k] / internal[k]), float(ratio.min())


def twisted(across: int, method: str) -> tuple[float, float, float]:
    """Free-free square bar, c_t = c_s sqrt(J / I_p), J = 0.140577 a^4, I_p = a^4/6.

    The reference has the mesh's own lumped inertia (known exactly: 1 + 2/n^2), so that stiffness alone is judged.
    """
    a, length = 0.01, 0.04
    nodes, hexes = structured_block((4 * across, across, across), (length, a, a), (0.0, -a / 2, -a / 2))
    turning = 0.1 * np.cos(np.pi * nodes[:, 0] / length)
    velocity = np.stack([0 * turning, -turning * nodes[:, 2], turning * nodes[:, 1]], axis=1)
    settings = controls(1.0, hourglass_method=method)
    march = March(one_part(nodes, hexes, TISSUE, settings, initial_velocity=velocity))
    speed = np.sqrt(SHEAR / DENSITY * 0.140577 / ((1 + 2 / across**2) / 6))
    wave = np.pi / (8 * across)
    period = 2 * length / speed * wave / np.sin(wave)
    end = nodes[:, 0] == 0
    arm = nodes[end, 1:]
    return first_quarter(march, period, lambda m: (m.u[end, 2] * arm[:, 0] - m.u[end, 1] * arm[:, 1]).sum())


def bent(across: int, method: str) -> tuple[float, float, float]:
    """Half of a simply supported square bar in its first mode; Timoshenko's beam with the mesh's own rotary inertia."""
    a, length = 0.01, 0.08
    nodes, hexes = structured_block((4 * across, across, across), (length / 2, a, a), (0.0, -a / 2, -a / 2))
    k, nu, modulus = np.pi / length, 0.5, 3 * SHEAR
    stiff = SHEAR * 5 * (1 + nu) / (6 + 5 * nu)  # the effective shear modulus of the section
    rotary = a**2 / 12 * (1 + 2 / across**2)
    # EI k^4 - (1 + r^2 k^2 + E I k^2 / (G A)) rho A w^2 + rho^2 A r^2 / G w^4 = 0, over A
    first = DENSITY * (1 + rotary * k**2 + a**2 / 12 * k**2 * modulus / stiff)
    second = DENSITY**2 * rotary / stiff
    square = (first - np.sqrt(first**2 - 4 * second * modulus * a**2 / 12 * k**4)) / (2 * second)
    turn = k * (1 - DENSITY * square / (stiff * k**2))  # of the section, over the deflection
    x, y, z = nodes.T
    curve = nu * turn * k * np.cos(k * x)
    velocity = 1e-3 * np.stack(
        [turn * z * np.sin(k * x), -curve * y * z, np.cos(k * x) - 0.5 * curve * (z**2 - y**2)], axis=1
    )
    held = np.zeros(nodes.shape, bool)
    held[x == 0, 0] = True  # the middle of the span
    held[np.isclose(x, length / 2), 1:] = True
    velocity[held] = 0.0
    settings = controls(1.0, hourglass_method=method)
    march = March(one_part(nodes, hexes, TISSUE, settings, initial_velocity=velocity, fixed=held))
    middle = x == 0
    return first_quarter(march, 2 * np.pi / np.sqrt(square), lambda m: m.u[middle, 2].mean())


# Of a strain that varies linearly over n elements, 1/n^2 of the energy lies within them, where hourglass forces alone
# carry it: 1/15 of the rest at n = 4. A share beyond 5 % is what the stiffness form must show in twist; the selective
# form, calibrated for the right period, carries 0.71 of that share.
@pytest.mark.slow
@pytest.mark.parametrize(("method", "most"), [("stiffness", 0.08), ("selective", 0.05)])
def test_twisted_soft_bar_swings_at_its_torsional_frequency(
    report: Callable[..., None], method: str, most: float
) -> None:
    period, share, ratio = twisted(4, method)
    name = f"twisted soft bar, 4 elements across, K/mu 4e5, {method} form"
    report(name, "period over theory", 1.0, period, 0.02)
    report(name, "hourglass over internal energy", 0.0, share, most)
    report(name, "energy ratio at tiny strain", 1.0, ratio, 0.005)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["stiffness", "selective"])
def test_bent_soft_bar_swings_at_its_bending_frequency(report: Callable[..., None], method: str) -> None:
    period, share, ratio = bent(4, method)
    name = f"bent soft bar, 4 elements across, K/mu 4e5, {method} form"
    report(name, "period over theory", 1.0, period, 0.02)
    report(name, "hourglass over internal energy", 0.0, share, 0.05)
    report(name, "energy ratio at tiny strain", 1.0, ratio, 0.005)


@pytest.mark.slow
def test_share_of_hourglass_energy_falls_with_the_square_of_the_element(report: Callable[..., None]) -> None:
    shares = [twisted(n, "stiffness")[1] * (n**2 - 1) for n in (4, 6)]
    name = "twisted soft bar, K/mu 4e5, stiffness form, 6 elements across"
    report(name, "hourglass over internal energy times (n^2 - 1), over that at 4", 1.0, shares[1] / shares[0], 0.05)


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
