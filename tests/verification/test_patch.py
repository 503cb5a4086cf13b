"""Patch test, free flight and fall, objectivity: what must be exact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from marching import March, controls, elastic, one_part
from scipy.spatial.transform import Rotation

from replay.solver import Material
from replay.solver.blocks import structured_block
from replay.solver.problem import gradients

INNER = np.array(
    [
        [0.249, 0.342, 0.192], [0.826, 0.288, 0.288], [0.850, 0.649, 0.263], [0.273, 0.750, 0.230],
        [0.320, 0.186, 0.643], [0.677, 0.305, 0.683], [0.788, 0.693, 0.644], [0.165, 0.745, 0.702],
    ]
)  # fmt: skip
OUTER = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)
# six elements between a face of the unit cube and the same face of the inner one, and the inner one
HEXES = np.array(
    [
        [0, 1, 2, 3, 8, 9, 10, 11],
        [12, 13, 14, 15, 4, 5, 6, 7],
        [0, 1, 9, 8, 4, 5, 13, 12],
        [3, 11, 10, 2, 7, 15, 14, 6],
        [0, 8, 11, 3, 4, 12, 15, 7],
        [1, 2, 10, 9, 5, 6, 14, 13],
        [8, 9, 10, 11, 12, 13, 14, 15],
    ]
)
VOLUMES = np.array([0.09856, 0.13697, 0.18950, 0.15277, 0.11015, 0.17018, 0.14187])


def test_patch_test_is_exact(report: Callable[..., None]) -> None:
    nodes = np.vstack([OUTER, INNER])
    _, volume = gradients(nodes, HEXES)
    assert np.abs(np.sort(volume) - np.sort(VOLUMES)).max() < 6e-6
    # the linear answer: displacements small enough that their squares are below the last bit
    small = 1e-10
    u = 1e-3 * small * 0.5 * np.stack([nodes @ [2, 1, 1], nodes @ [1, 2, 1], nodes @ [1, 1, 2]], axis=1)
    held = np.vstack([np.ones((8, 3), bool), np.zeros((8, 3), bool)])
    step = 1e-2
    problem = one_part(nodes, HEXES, elastic(1e6, 0.25, 1.0), controls(1.0), initial_velocity=u / step, fixed=held)
    march = March(problem)
    # the inner nodes are free: they must go along by themselves
    march.until(step)
    stress = march.stress / small
    assert march.run.step > 1
    for k, (name, exact) in enumerate(zip(("xx", "yy", "zz", "xy", "yz", "zx"), (2000.0,) * 3 + (400.0,) * 3)):
        worst = stress[np.argmax(np.abs(stress[:, k] - exact)), k]
        report("patch test, 7 distorted elements", f"stress {name}, worst element [Pa]", exact, worst, 1e-10)
    hourglass = np.abs(march.run.element_values("hourglass", 12)).max() / small / 2000.0
    report("patch test, 7 distorted elements", "hourglass force over stress [m^2]", 0.0, hourglass, 1e-10)


def test_free_fall_is_the_parabola(report: Callable[..., None]) -> None:
    nodes, hexes = structured_block((3, 2, 2), (0.3, 0.2, 0.2))
    g, v = np.array([0.0, 1.0, -9.81]), np.array([3.0, -2.0, 5.0])
    settings = controls(1.0, gravity_m_per_s2=tuple(g))
    march = March(
        one_part(nodes, hexes, elastic(1e6, 0.3, 1000.0), settings, initial_velocity=np.tile(v, (len(nodes), 1)))
    )
    march.until(0.2)
    exact = v * 0.2 + 0.5 * g * 0.04
    for k, name in enumerate("xyz"):
        worst = march.u[np.argmax(np.abs(march.u[:, k] - exact[k])), k]
        report("free fall, 0.2 s", f"displacement {name}, worst node [m]", exact[k], worst, 1e-11)
    assert np.abs(march.stress).max() < 1e-4  # rounding of 1e6 Pa


def test_free_flight_keeps_momentum_and_angular_momentum(report: Callable[..., None]) -> None:
    nodes, hexes = structured_block((4, 2, 2), (0.4, 0.2, 0.2))
    rng = np.random.default_rng(0)
    velocity = np.cross([1.0, -2.0, 3.0], nodes) + rng.normal(size=nodes.shape) * 0.3
    march = March(one_part(nodes, hexes, elastic(1e6, 0.3, 1000.0), controls(1.0), initial_velocity=velocity))
    mass = march.run.user_order(march.run.mass[:, None])

    def momenta() -> np.ndarray:
        x = march.u + nodes
        return np.concatenate([(mass * march.v).sum(axis=0), (mass * np.cross(x, march.v)).sum(axis=0)])

    start = momenta()
    march.until(0.1)
    assert march.run.step > 50
    assert np.abs(march.stress).max() > 1e3
    drift = np.abs(momenta() - start) / np.linalg.norm(start[:3])
    report("free flight of a vibrating block", "change of momentum, relative", 0.0, drift[:3].max(), 1e-13)
    drift = np.abs(momenta() - start) / np.linalg.norm(start[3:])
    report("free flight of a vibrating block", "change of angular momentum, relative", 0.0, drift[3:].max(), 1e-13)


@pytest.mark.parametrize("method", ["stiffness", "viscous"])
def test_energy_identity_closes_step_by_step(report: Callable[..., None], method: str) -> None:
    nodes, hexes = structured_block((4, 3, 3), (0.4, 0.3, 0.3))
    rng = np.random.default_rng(1)
    force = rng.normal(size=nodes.shape) * 5.0
    held = np.zeros(nodes.shape, bool)
    held[nodes[:, 0] == 0] = True
    velocity = rng.normal(size=nodes.shape)
    velocity[held[:, 0]] = [0.5, 0.0, 0.0]  # a support that moves does work
    settings = controls(1.0, gravity_m_per_s2=(0.0, 0.0, -9.81), hourglass_method=method)
    problem = one_part(
        nodes, hexes, elastic(1e6, 0.3, 1000.0), settings, initial_velocity=velocity, nodal_forces=force, fixed=held
    )
    march, closure = March(problem), []
    march.until(0.05, lambda m: closure.append(abs(m.run.energies().closure)))
    energies = march.run.energies()
    assert abs(energies.hourglass) > 1e-3 * energies.initial
    assert abs(energies.bulk_viscosity) > 1e-3 * energies.initial
    assert abs(energies.external_work) > 1e-3 * energies.initial
    report(f"energy ledger, {method} hourglass control", "worst residual of a step, relative", 0.0, max(closure), 1e-10)


def test_energy_identity_closes_with_every_account_at_work(report: Callable[..., None]) -> None:
    nodes, hexes = structured_block((5, 3, 3), (0.5, 0.3, 0.3))
    nodes = nodes + 0.012 * np.sin(nodes @ [9.0, 7.0, 5.0])[:, None] * [1.0, -0.7, 0.4]
    rng = np.random.default_rng(2)
    velocity = rng.normal(size=nodes.shape)
    metal = Material(
        "metal", "elastic_plastic", 1000.0,
        {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3, "yield_stress_pa": 5e3, "hardening_modulus_pa": 1e5},
    )  # fmt: skip
    plain = March(one_part(nodes, hexes, metal, controls(1.0)))
    # the shortest third of the elements gets mass
    steps = np.zeros(len(hexes))
    plain.run.forces()
    plain.run.groups[0].scatter(plain.run.groups[0].step, steps)
    target = 0.9 * float(np.quantile(steps, 0.33))
    settings = controls(1.0, mass_scaling_time_step_s=target, gravity_m_per_s2=(0.0, 0.0, -9.81))
    march, closure = March(one_part(nodes, hexes, metal, settings, initial_velocity=velocity)), []
    march.until(0.02, lambda m: closure.append(abs(m.run.energies().closure)))
    energies = march.run.energies(march.run.velocities())
    for account in ("internal", "plastic", "hourglass", "bulk_viscosity", "added_mass_kinetic", "external_work"):
        assert abs(getattr(energies, account)) > 1e-3 * energies.initial, account
    assert energies.plastic < energies.internal
    report("energy ledger, plasticity and added mass", "worst residual of a step, relative", 0.0, max(closure), 1e-10)


@pytest.mark.parametrize("steps", [60, 10_000])
def test_a_prestressed_hex_spun_about_a_diagonal_comes_round(report: Callable[..., None], steps: int) -> None:
    rng = np.random.default_rng(6)
    nodes = OUTER + 0.2 * rng.uniform(-1, 1, (8, 3))
    stress = rng.normal(size=(1, 6)) * 1e3
    march = March(one_part(nodes, np.arange(8)[None], elastic(1e6, 0.3, 1e3), controls(1.0), initial_stress=stress))
    volume = gradients(nodes, np.arange(8)[None])[1][0]
    group = march.run.groups[0]
    group.hourglass[:] = rng.normal(size=(12, 1))
    start = march.run.element_values("hourglass", 12).reshape(4, 3)
    first, work, worst = march.run.nodal[:, :3].copy(), 0.0, [0.0, 0.0, 0.0]
    xx, yy, zz, xy, yz, zx = stress[0]
    given = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    for k in range(1, steps + 1):
        turn = Rotation.from_rotvec(2 * np.pi * k / steps * np.ones(3) / np.sqrt(3)).as_matrix()
        place = first @ turn.T
        march.run.nodal[:, 4:7] = (place - march.run.nodal[:, :3]) / 1e-3
        march.run.nodal[:, :3] = place
        group.forces(march.run.nodal, 1e-3)
        work += np.abs(group.work).sum()
        if k % (steps // 20) == 0:
            xx, yy, zz, xy, yz, zx = march.stress[0]
            now = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
            hourglass = march.run.element_values("hourglass", 12).reshape(4, 3)
            worst[0] = max(worst[0], np.abs(now - turn @ given @ turn.T).max() / np.abs(given).max())
            worst[1] = max(worst[1], np.abs(hourglass - start @ turn.T).max() / np.abs(start).max())
            worst[2] = max(worst[2], abs(gradients(march.u + nodes, np.arange(8)[None])[1][0] / volume - 1))
    name = f"prestressed crooked hex, a turn about (1, 1, 1) in {steps} steps"
    report(name, "stress against R s R^T, relative", 0.0, worst[0], 1e-10)
    report(name, "hourglass forces against R q, relative", 0.0, worst[1], 1e-10)
    report(name, "volume ratio", 1.0, 1.0 + worst[2], 1e-10)
    report(name, "work, over stress and volume", 0.0, work / np.abs(given).max(), 1e-10)
