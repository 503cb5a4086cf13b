"""The brain's law: against a dumb witness, under any step, and what it promises of pores and dissipation."""

from __future__ import annotations

import dataclasses
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dumb_brain import DumbBrain, dev, random_path
from material_point import PARAMETERS, Point
from numba.core import config
from scipy.spatial.transform import Rotation
from test_plain_python import CHILD, march

from replay.solver import Material, Problem, SolverPart
from replay.solver.run import state_hash

LAW = "brain_isv"
#: Soft enough in volume that the shape and the pressure of a path are of one size.
BRAIN = {**PARAMETERS[LAW], "bulk_modulus_pa": 2e6}
SHEAR = BRAIN["shear_modulus_pa"]


def inverse_of(point: Point) -> np.ndarray:
    """Fp^-1 as the point keeps it."""
    return np.reshape(point.state[:9], (3, 3))


def plastic_increment(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Dp dt of a step: the logarithm of the symmetric ``Fp_after Fp_before^-1``."""
    size, axes = np.linalg.eigh(np.linalg.solve(after, before))
    return (axes * np.log(size)) @ axes.T


def value(point: Point, name: str) -> float:
    return float(point.state[point.module.STATE.index(name)])


def elastic_part(point: Point) -> np.ndarray:
    return np.linalg.det(point.f) ** (-1 / 3) * point.f @ inverse_of(point)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("end", [0.004, 0.2])
def test_a_dumb_integrator_of_fp_gives_the_same_stress_and_state(seed: int, end: float) -> None:
    changes: dict[str, Any] = {"pressure_sensitivity": 0.3} if seed == 3 else {}
    if seed == 2:
        changes = {"rate_exponent": 1.7, "back_stress_modulus_pa": 800.0, "network_modulus_pa": 3e3}
    path = random_path(np.random.default_rng(seed), end)
    dumb = DumbBrain(Point(LAW, **{**BRAIN, **changes}).parameters)
    exact = dumb.along(path, end, 1200)
    scale = np.abs(dev(exact)).max()
    names = ("xi1", "xi_star", "xi2", "equivalent_plastic_strain", "phi")
    errors, states = [], []
    for steps in (400, 800):
        point = Point(LAW, **{**BRAIN, **changes})
        for k in range(1, steps + 1):
            stress = point.to(path(end * k / steps), end / steps)
        errors.append(stress - exact)
        states.append([value(point, name) for name in names])
    # first order in the step: extrapolation takes the error away
    assert np.abs(errors[1]).max() < 5e-3 * scale
    assert np.abs(2 * errors[1] - errors[0]).max() < 2e-4 * scale
    for name, once, twice, told in zip(names, *states, dumb.y[18:]):
        assert twice == pytest.approx(told, rel=2e-2, abs=1e-12), name
        assert 2 * twice - once == pytest.approx(told, rel=1e-3, abs=1e-9), name


def random_gradient(rng: np.random.Generator) -> np.ndarray:
    """Any rotation, stretches 0.3 to 3, any axes."""
    a, b = Rotation.from_quat(rng.normal(size=(2, 4))).as_matrix()
    return a @ np.diag(np.exp(rng.uniform(np.log(0.3), np.log(3.0), 3))) @ b


@pytest.mark.parametrize("exponent", [1.0, 0.5, 2.0])
def test_twenty_thousand_random_steps_keep_every_promise(exponent: float) -> None:
    rng = np.random.default_rng(11)
    porosity = BRAIN["initial_porosity"]
    point = Point(LAW, **{**BRAIN, "rate_exponent": exponent})
    flowed, least_porosity, worst = 0, 1.0, 0.0
    for step in range(20_000 if exponent == 1.0 else 4_000):
        if step % 40 == 0:
            point = Point(LAW, **{**BRAIN, "rate_exponent": exponent})
        before = inverse_of(point)
        told = value(point, "phi")
        # half of the steps are jumps, half are small as in a run
        f = random_gradient(rng) if rng.random() < 0.5 else (np.eye(3) + 1e-3 * rng.normal(size=(3, 3))) @ point.f
        stress = point.to(f, 10.0 ** rng.uniform(-9, 0))
        assert np.isfinite(stress).all()
        assert np.isfinite(point.state).all()
        assert np.isfinite(point.moduli).all()
        fe = elastic_part(point)
        assert abs(np.linalg.det(fe @ fe.T) - 1) < 1e-10
        # Dp dt from the plastic deformation itself, and the stress that drives it at the end of the step
        after = inverse_of(point)
        growth = plastic_increment(before, after)
        bp = np.linalg.inv(after.T @ after)
        share = min(np.trace(bp) / 3 / BRAIN["locking_stretch"] ** 2, 0.9)
        network = BRAIN["network_modulus_pa"] / 3 * (3 - share) / (1 - share)
        xx, yy, zz, xy, yz, zx = point.state[9:15]
        driving = SHEAR * dev(fe.T @ fe) - network * dev(bp) - np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
        assert (driving * growth).sum() >= -1e-9 * np.abs(driving).max()
        flowed += np.abs(growth).max() > 1e-6
        assert told <= value(point, "phi") < 1
        least_porosity = min(least_porosity, value(point, "phi"))
        worst = max(worst, value(point, "flow_residual"))
    assert flowed > 0.2 * step
    assert least_porosity == pytest.approx(porosity, rel=1e-12)
    # the residual before the last of five Newton steps: kept, and small enough that one more step leaves rounding
    assert 1e-16 < worst < 1e-4


def test_the_kept_residual_bounds_what_is_left_of_the_flow_equation() -> None:
    rng = np.random.default_rng(7)
    for _ in range(300):
        point = Point(LAW, **BRAIN)
        dt = 10.0 ** rng.uniform(-9, 0)
        before = value(point, "equivalent_plastic_strain")
        point.to(random_gradient(rng), dt)
        dgamma = np.sqrt(3) * (value(point, "equivalent_plastic_strain") - before)
        if dgamma < 1e-9:
            continue
        fe, fp = elastic_part(point), np.linalg.inv(inverse_of(point))
        share = min(np.trace(fp @ fp.T) / 3 / BRAIN["locking_stretch"] ** 2, 0.9)
        network = BRAIN["network_modulus_pa"] / 3 * (3 - share) / (1 - share)
        xx, yy, zz, xy, yz, zx = point.state[9:15]
        driving = SHEAR * dev(fe.T @ fe) - network * dev(fp @ fp.T)
        driving -= np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
        # from rest Fp = exp(b N), which gives N
        n = plastic_increment(np.eye(3), inverse_of(point))
        n /= np.linalg.norm(n)
        viscous = BRAIN["yield_stress_pa"] * np.arcsinh(
            (dgamma / (BRAIN["reference_rate_per_s"] * dt)) ** (1 / BRAIN["rate_exponent"])
        )
        kappa = SHEAR * (
            BRAIN["softening_factor"] * value(point, "xi1") + BRAIN["hardening_factor"] * value(point, "xi2")
        )
        left = (driving * n).sum() / np.sqrt(2) - kappa - viscous
        trial = np.abs(driving).max() + BRAIN["yield_stress_pa"]
        assert abs(left) < (value(point, "flow_residual") + 1e-6) * 20 * trial


def test_a_long_small_stepped_path_keeps_the_plastic_volume() -> None:
    path = random_path(np.random.default_rng(5), 0.03)
    point = Point(LAW, **BRAIN)
    for k in range(1, 20_001):
        point.to(path(0.03 * k / 20_000), 0.03 / 20_000)
    assert abs(np.linalg.det(inverse_of(point)) - 1) < 1e-13
    assert value(point, "flow_residual") < 1e-12


def test_stress_relaxes_to_the_resistance_and_strain_stays() -> None:
    point = Point(LAW, **BRAIN)
    f = np.diag([0.7, 0.7**-0.5, 0.7**-0.5])
    stress = [point.to(f, dt) for dt in [1e-6, *[1e-3] * 400]]
    history = [abs(s[0, 0] - s[1, 1]) for s in stress]
    assert (np.diff(history) <= 1e-9).all()
    assert history[-1] < 0.5 * history[0]


def test_pores_grow_in_tension_not_in_compression() -> None:
    pulled, pressed = Point(LAW, **BRAIN), Point(LAW, **BRAIN)
    for k in range(1, 201):
        e = 0.2 * k / 200
        pulled.to(np.diag([1 + e, 1.0, 1.0]), 1e-4)
        pressed.to(np.diag([1 - e, 1.0, 1.0]), 1e-4)
    porosity = BRAIN["initial_porosity"]
    assert value(pulled, "phi") > 1.2 * porosity
    assert value(pressed, "phi") == pytest.approx(porosity, rel=1e-6)


def brain_column(layered: Callable[..., Problem], **options: Any) -> Problem:
    """The column of all laws with its tissue turned into brain."""
    problem = layered(**options)
    tissue = Material("brain", LAW, 1040.0, BRAIN)
    parts = tuple(
        SolverPart(p.pid, p.name, tissue) if p.material.law == "viscohyperelastic" else p for p in problem.parts
    )
    return dataclasses.replace(problem, parts=parts)


@pytest.mark.slow
@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="there is nothing to compare without the compiler")
def test_one_thread_two_threads_and_plain_python_give_the_same_bits(
    layered: Callable[..., Problem], tmp_path: Path
) -> None:
    import numba

    problem = brain_column(layered, end=1e-3, counts=(12, 1, 1))
    hashes = set()
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        hashes.add(state_hash(march(problem)))
    pickled = tmp_path / "problem.pickle"
    pickled.write_bytes(pickle.dumps(problem))
    child = subprocess.run(
        [sys.executable, "-c", CHILD, str(pickled)], env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    assert hashes == {child.stdout.strip()}
