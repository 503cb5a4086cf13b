"""Patch test, free flight and fall, objectivity: what must be exact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from marching import March, controls, elastic, one_part

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
