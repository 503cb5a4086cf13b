"""Straps: they pull and never push, and what they pull with is kept account of."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from linked import STILL, momenta, two_bricks

from replay.errors import InputError
from replay.solver import Material, Problem, SolverPart, Strap
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator

RUBBER = Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3})


def strap(**changes: Any) -> Strap:
    # from the first brick's corner over one of the second's to another
    return Strap(**{"name": "chin", "nodes": np.array([26, 27 + 8, 27 + 18]), "stiffness_n_per_m": 2e4, **changes})


def march(run: Integrator, end: float, dt: float) -> tuple[list[Any], np.ndarray]:
    ledger, rows = [], []
    while run.time_s < end * (1 - 1e-12):
        assert run.forces().step_s >= dt
        rows.append(run.links.strap_rows[0].copy())
        run.kick(dt, drift=False)
        ledger.append(run.energies())
        run.drift(dt, run.time_s + dt)
    return ledger, np.array(rows)


def test_a_strap_between_bodies_keeps_momentum_angular_momentum_and_energy() -> None:
    run = Integrator(two_bricks(omega=((3.0, 20.0, -4.0), (-8.0, -30.0, 10.0)), straps=[strap(slack_m=1e-3)]), 1e9)
    start = momenta(run)
    ledger, rows = march(run, 0.05, 5e-6)
    assert np.abs(momenta(run) - start).max() < 1e-12 * np.abs(start).max()
    assert max(abs(e.closure) for e in ledger) < 1e-10
    tension = rows[:, 2]
    assert tension.min() == 0.0
    assert tension.max() > 5.0
    slack = rows[:, 0] <= rows[:, 1]
    assert (tension[slack] == 0).all()
    assert 0.2 < slack.mean() < 0.99
    stored = 0.5 * 2e4 * np.maximum(rows[-1, 0] - rows[-1, 1], 0.0) ** 2
    assert ledger[-1].strap == pytest.approx(stored, abs=1e-3 * ledger[0].initial)


def test_a_mass_on_a_strap_swings_at_its_frequency_and_loses_what_damping_takes() -> None:
    problem = two_bricks()
    # the strap runs along x through both centres of gravity: a spring of two masses
    velocity = np.where(problem.nodes[:, :1] > 0.045, 0.01, -0.01) * [1.0, 0.0, 0.0]
    for damping in (0.0, 20.0):
        straps = [Strap("s", np.array([22, 27 + 4]), 1e5, damping_n_s_per_m=damping)]
        run = Integrator(two_bricks(initial_velocity=velocity, straps=straps), 1e9)
        mass = run.bodies.mass[0] / 2
        omega, ratio = np.sqrt(1e5 / mass), damping / (2 * np.sqrt(1e5 * mass))
        # x = e^-at sin bt until the tension k x + c x' is zero: a strap does not push
        a, b = ratio * omega, omega * np.sqrt(1 - ratio**2)
        let_go = np.pi - np.arctan2(damping * b, 1e5 - damping * a)
        left = np.exp(-a * let_go / b) * (np.cos(let_go) - a / b * np.sin(let_go))
        ledger, rows = march(run, 1.05 * np.pi / b, np.pi / b / 1000)
        assert rows[:, 2].max() == pytest.approx(0.02 * np.sqrt(1e5 * mass), rel=0.01 + 2 * ratio)
        assert ledger[-1].kinetic / ledger[0].initial == pytest.approx(left**2, rel=0.01)


def test_a_strap_slides_over_its_inner_node_with_one_tension() -> None:
    # a V of strap over a free middle node: the pull on the middle is T (e1 + e2), on the ends -T e
    nodes, hexes = structured_block((1, 1, 1), (0.3, 0.4, 0.1))
    path = np.array([0, 4, 6])
    problem = Problem(
        nodes, hexes, np.zeros(1, int), (SolverPart(1, "block", RUBBER),), STILL,
        straps=[Strap("v", path, 1e3, pay_in_m=0.05)],
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    run.forces()
    tension = 1e3 * 0.05
    pull = run.user_order(run._external)[path]
    d1, d2 = np.diff(nodes[path], axis=0)
    e1, e2 = d1 / np.linalg.norm(d1), d2 / np.linalg.norm(d2)
    assert np.allclose(pull, tension * np.array([e1, e2 - e1, -e2]), atol=1e-12)
    assert run.links.strap_rows[0, 2] == pytest.approx(tension, rel=1e-14)


def test_paying_in_tightens_evenly_and_its_work_is_booked() -> None:
    nodes, hexes = structured_block((4, 2, 2), (0.2, 0.02, 0.02))
    ends = np.array([4, len(nodes) - 5])
    problem = Problem(
        nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "rod", RUBBER),), STILL,
        straps=[Strap("wire", ends, 5e3, damping_n_s_per_m=1.0, pay_in_m=2e-3, pay_in_time_s=0.02)],
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    start = momenta(run)
    ledger, rows = march(run, 0.03, 5e-6)
    assert rows[2000, 1] == pytest.approx(0.2 - 1e-3, abs=1e-9)
    assert rows[-1, 1] == pytest.approx(0.2 - 2e-3, abs=1e-12)
    assert ledger[-1].strap < -0.5 * ledger[-1].internal
    assert max(abs(e.closure) for e in ledger[100:]) < 1e-10
    assert np.abs(momenta(run) - start).max() < 1e-14
    assert abs(ledger[-1].total) < 2e-2 * ledger[-1].internal


def test_a_stiff_strap_shortens_the_step_to_what_is_stable() -> None:
    nodes, hexes = structured_block((2, 1, 1), (0.02, 0.01, 0.01))
    for over in ([0, 4, 8], [0, 8]):
        problem = Problem(
            nodes, hexes, np.zeros(2, int), (SolverPart(1, "rod", RUBBER),), STILL,
            initial_velocity=nodes * [0.5, 0, 0], straps=[Strap("wire", np.array(over), 1e6, 1.0, pay_in_m=1e-5)],
        )  # fmt: skip
        run = Integrator(problem, 1e9)
        dt = 0.9 * run.forces().step_s
        ledger = []
        for _ in range(3000):
            dt = 0.9 * run.forces().step_s
            run.kick(dt, drift=False)
            ledger.append(run.energies())
            run.drift(dt, run.time_s + dt)
        stored = 0.5 * 1e6 * 1e-10
        assert max(e.kinetic for e in ledger) < 2.0 * (ledger[0].initial + stored)


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"nodes": np.array([3])}, "has one node"),
        ({"nodes": np.array([3, 99])}, "row that does not exist"),
        ({"nodes": np.array([3, 5, 3])}, "names a node twice"),
        ({"stiffness_n_per_m": 0.0}, r"straps.chin.stiffness_n_per_m: it is 0.0\n.*> 0"),
        ({"slack_m": -1.0}, "straps.chin.slack_m"),
        ({"pay_in_m": 9.0}, "9 m are more than its length"),
        ({"damping_n_s_per_m": float("nan")}, "straps.chin.damping"),
    ],
)
def test_a_wrong_strap_is_refused(changes: dict, found: str) -> None:
    with pytest.raises(InputError, match=found):
        two_bricks(straps=[strap(**changes)])


def test_two_straps_need_two_names() -> None:
    with pytest.raises(InputError, match="'chin' is empty or occurs twice"):
        two_bricks(straps=[strap(), strap()])
