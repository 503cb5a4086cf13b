"""J2 plasticity: the yield curve on every path, closed forms, what it dissipates, and hourglass forces that yield."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from material_point import Point, turned

from replay.solver import LAWS, Controls, Material, Problem, SolverPart, solve
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.vtkhdf import read_states

MODULUS, POISSON, YIELD = 70e9, 0.3, 300e6
SHEAR = MODULUS / 2.6
BULK = MODULUS / 1.2
CURVE: dict[str, Any] = {
    "curve_strains": (0.01, 0.03, 0.1, 0.3), "curve_stresses_pa": (320e6, 400e6, 410e6, 500e6),
    "hardening_modulus_pa": 50e6,
}  # fmt: skip


def metal(**changes: Any) -> Point:
    parameters = {"youngs_modulus_pa": MODULUS, "poisson_ratio": POISSON, "yield_stress_pa": YIELD, **changes}
    return Point("elastic_plastic", **parameters)


def von_mises(stress: np.ndarray) -> float:
    s = stress - np.trace(stress) / 3 * np.eye(3)
    return float(np.sqrt(1.5 * (s * s).sum()))


def flow(e: float) -> float:
    """The curve of the tests, beyond its last point by the modulus."""
    return float(np.interp(e, (0.0, *CURVE["curve_strains"]), (YIELD, *CURVE["curve_stresses_pa"]))) + 50e6 * max(
        e - 0.3, 0.0
    )


def test_below_yield_it_is_the_elastic_law_bit_for_bit() -> None:
    rng = np.random.default_rng(0)
    plastic, elastic = metal(), Point("elastic", youngs_modulus_pa=MODULUS, poisson_ratio=POISSON)
    target = np.eye(3) + 1e-3 * rng.uniform(-1, 1, (3, 3))
    for k in range(50):
        f = turned(0.02 * k) @ (np.eye(3) + (target - np.eye(3)) * k / 50)
        assert (plastic.to(f) == elastic.to(f)).all()
    assert plastic.state == (0.0, 0.0)


def test_uniaxial_strain_is_the_closed_form() -> None:
    # q = 2 mu (eps - 3/2 e) = sigma_y + H e, mean stress K eps
    hardening = 2e9
    point = metal(hardening_modulus_pa=hardening)
    for strain in np.linspace(0, 0.2, 2001)[1:]:
        s = point.to(np.diag([np.exp(strain), 1.0, 1.0]))
    e = (2 * SHEAR * 0.2 - YIELD) / (3 * SHEAR + hardening)
    assert point.state[0] == pytest.approx(e, rel=1e-7)
    assert s[0, 0] == pytest.approx(BULK * 0.2 + 2 / 3 * (YIELD + hardening * e), rel=1e-7)
    assert s[1, 1] == pytest.approx(BULK * 0.2 - 1 / 3 * (YIELD + hardening * e), rel=1e-7)
    assert point.state[1] == pytest.approx((YIELD * e + 0.5 * hardening * e**2) * np.exp(0.1), rel=0.03)


def test_stress_stands_on_the_yield_curve_on_any_path_and_for_any_step() -> None:
    rng = np.random.default_rng(1)
    for size in (0.02, 0.1, 0.8):
        point, grown = metal(**CURVE), 0
        f = np.eye(3)
        for _ in range(60):
            before = point.state[0]
            f = f + size * rng.uniform(-0.5, 0.5, (3, 3)) * 0.5
            if np.linalg.det(f) < 0.2:
                f = np.eye(3)
            q = von_mises(point.to(f))
            assert q <= flow(point.state[0]) * (1 + 1e-9)
            if point.state[0] > before:
                grown += 1
                assert q == pytest.approx(flow(point.state[0]), rel=1e-8)
        assert grown > 20


def test_reversed_loading_yields_at_the_hardened_stress() -> None:
    point = metal(hardening_modulus_pa=1e9)
    shear = np.concatenate([np.linspace(0, 0.03, 301), np.linspace(0.03, -0.03, 601)])
    seen = []
    for gamma in shear[1:]:
        f = np.eye(3)
        f[0, 1] = gamma
        tau = point.to(f)[0, 1]
        seen.append((tau, point.state[0]))
    top, hardened = seen[299]
    assert top == pytest.approx((YIELD + 1e9 * hardened) / np.sqrt(3), rel=1e-3)
    # elastic until the shear stress is the same on the other side
    first = next(k for k in range(300, len(seen)) if seen[k][1] > hardened)
    assert seen[first][0] == pytest.approx(-top, rel=0.02)


def test_plastic_work_never_falls_and_with_the_stored_energy_is_all_the_work() -> None:
    rng = np.random.default_rng(2)
    point = metal(**CURVE)
    corners = [np.eye(3) + 0.03 * rng.uniform(-1, 1, (3, 3)) for _ in range(5)]
    corners = [f / np.cbrt(np.linalg.det(f)) for f in corners]
    last = np.eye(3)
    for corner in corners:
        for k in range(1, 1001):
            before = point.state[1]
            s = point.to(last + (corner - last) * k / 1000)
            assert point.state[1] >= before
        last = corner
    mean = np.trace(s) / 3
    stored = von_mises(s) ** 2 / (6 * SHEAR) + mean**2 / (2 * BULK)
    assert point.work == pytest.approx(point.state[1] + stored, rel=2e-3)


def test_rate_laws_are_objective_along_the_way_to_the_second_order() -> None:
    target = np.eye(3) + 0.1 * np.random.default_rng(3).uniform(-1, 1, (3, 3))
    for law, extra in (("elastic", {}), ("elastic_plastic", {"yield_stress_pa": YIELD, **CURVE})):
        errors = []
        for steps in (100, 200, 400):
            plain = Point(law, youngs_modulus_pa=MODULUS, poisson_ratio=POISSON, **extra)
            spun = Point(law, youngs_modulus_pa=MODULUS, poisson_ratio=POISSON, **extra)
            for k in range(1, steps + 1):
                f = np.eye(3) + (target - np.eye(3)) * k / steps
                r = turned(2.0 * k / steps)
                a, b = plain.to(f), spun.to(r @ f)
            errors.append(np.abs(b - r @ a @ r.T).max() / np.abs(a).max())
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1), law
        assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1), law
        assert errors[-1] < 1e-4


def bent_plate(yield_stress: float) -> tuple[float, np.ndarray]:
    """Largest hourglass force [N], and kinetic energy over the first, of one element that swings in a bending mode."""
    nodes, hexes = structured_block((1, 1, 1), (1e-3, 1e-3, 1e-3), (-5e-4, -5e-4, -5e-4))
    material = Material(
        "metal", "elastic_plastic", 2700.0,
        {"youngs_modulus_pa": MODULUS, "poisson_ratio": POISSON, "yield_stress_pa": yield_stress},
    )  # fmt: skip
    velocity = np.zeros_like(nodes)
    velocity[:, 0] = 60.0 * np.sign(nodes[:, 0] * nodes[:, 2])
    controls = Controls(1.0, mass_scaling_time_step_s=0.0)
    parts = (SolverPart(1, "plate", material),)
    run = Integrator(Problem(nodes, hexes, np.zeros(1, int), parts, controls, initial_velocity=velocity), 1e9)
    largest, kinetic = 0.0, []
    for _ in range(200):
        dt = 0.5 * run.forces().step_s
        largest = max(largest, np.linalg.norm(run.groups[0].hourglass[0, :, 0].reshape(4, 3), axis=1).max())
        run.kick(dt, drift=True)
        kinetic.append(run.energies().kinetic / run.energies().initial)
        run.drift(dt, run.time_s + dt)
    return float(largest), np.array(kinetic)


def test_hourglass_forces_yield_with_the_material_and_only_lose_energy() -> None:
    # a plate one element thick has nothing but hourglass forces against bending
    swinging, swing = bent_plate(1e12)
    held, loss = bent_plate(YIELD)
    most = YIELD * 1e-6 / 12  # sigma_y A / 12
    assert swinging > 2 * most
    assert held == pytest.approx(most, rel=0.05)  # the element changes its shape a little
    turned_back = int(np.argmin(swing))
    assert swing[turned_back] < 0.02
    assert swing[turned_back:].max() > 0.95
    assert loss[int(np.argmin(loss)) :].max() < 0.25


def test_unused_points_of_the_curve_change_nothing() -> None:
    kind = LAWS["elastic_plastic"].Parameters
    few = kind(MODULUS, POISSON, YIELD, 1e9)
    # the same straight line with points on it
    many = kind(MODULUS, POISSON, YIELD, 1e9, (0.1, 0.2), (YIELD + 1e8, YIELD + 2e8))
    assert few.constants()[10] == pytest.approx(1 / (3 * SHEAR + 1e9))
    assert many.constants()[11:] == pytest.approx((0.0,) * 7, abs=1e-20)


def test_plastic_strain_and_work_are_in_the_files_of_a_run(tmp_path: Path) -> None:
    nodes, hexes = structured_block((4, 2, 2), (0.02, 0.01, 0.01))
    metal = {"youngs_modulus_pa": MODULUS, "poisson_ratio": POISSON, "yield_stress_pa": YIELD}
    parts = (
        SolverPart(1, "metal", Material("metal", "elastic_plastic", 2700.0, metal)),
        SolverPart(
            2, "hard", Material("hard", "elastic", 2700.0, {"youngs_modulus_pa": MODULUS, "poisson_ratio": 0.3})
        ),
    )
    part = (nodes[hexes].mean(axis=1)[:, 0] > 0.01).astype(int)
    velocity = np.where(nodes[:, :1] > 0.01, -80.0, 80.0) * [1.0, 0.0, 0.0]
    controls = Controls(
        1e-5, history_interval_s=2e-6, plot_interval_s=5e-6, mass_scaling_time_step_s=0.0, time_step_floor_s=0.0
    )
    solve(Problem(nodes, hexes, part, parts, controls, initial_velocity=velocity), tmp_path, progress=None)
    energy = pd.read_csv(tmp_path / "energy.csv")
    assert energy["plastic_J"].iloc[0] == 0
    assert (energy["plastic_J"].diff().dropna() >= 0).all()
    assert 0 < energy["plastic_J"].iloc[-1] < energy["internal_J"].iloc[-1]
    with read_states(tmp_path / "states.vtkhdf") as states:
        strain = states.field("equivalent_plastic_strain", len(states) - 1)
    assert strain[part == 0].max() > 1e-3
    assert (strain[part == 1] == 0).all()
