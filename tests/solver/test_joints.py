"""Joints: what they keep, how they swing, and what they refuse."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from linked import BONE, STILL, momenta, two_bricks
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

from replay.errors import InputError, InstabilityError
from replay.solver import Controls, Joint, Material, Problem, SolverPart, solve
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.rigid import rotation

SPRINGS = np.array([[30.0, 30.0], [50.0, 20.0], [8.0, 8.0]])


def joined(**changes: Any) -> Joint:
    values: dict[str, Any] = {
        "name": "neck", "first": 1, "second": 2, "centre": (0.05, 0.02, 0.02), "stiffness": SPRINGS,
        "centre_stiffness": 1e6,
    }  # fmt: skip
    return Joint(**{**values, **changes})


def stored(angle: np.ndarray, gap: float, joint: Joint) -> float:
    """Potential of a joint's springs."""
    stiffness = np.where(angle >= 0, joint.stiffness[:, 0], joint.stiffness[:, 1])
    return 0.5 * float((stiffness * angle**2).sum() + joint.centre_stiffness * gap**2)


def march(run: Integrator, end: float, dt: float) -> list[Any]:
    """Step to the end; the ledger at every step."""
    ledger = []
    while run.time_s < end:
        assert run.forces().step_s >= dt
        run.kick(dt, drift=False)
        ledger.append(run.energies())
        run.drift(dt, run.time_s + dt)
    return ledger


def test_two_jointed_bodies_keep_momentum_angular_momentum_and_energy() -> None:
    tilt = Rotation.from_rotvec([0.2, -0.5, 0.3]).as_matrix()
    run = Integrator(two_bricks(omega=((3.0, 20.0, -4.0), (-8.0, -30.0, 10.0)), joints=[joined(axes=tilt)]), 1e9)
    start = momenta(run)
    ledger = march(run, 0.1, 1e-5)
    scale = np.abs(start).max()
    assert np.abs(momenta(run) - start)[:3].max() < 1e-12 * scale
    assert np.abs(momenta(run) - start)[3:].max() < 1e-12 * scale
    assert max(abs(e.closure) for e in ledger) < 1e-10
    # the springs work hard, and give back what they take
    assert max(e.joint_spring for e in ledger) > 0.2 * ledger[0].kinetic
    angle, gap = run.links.joint_rows[0, :3], run.links.joint_rows[0, 15]
    assert ledger[-1].joint_spring == pytest.approx(stored(angle, gap, joined()), abs=2e-3 * ledger[0].kinetic)
    assert ledger[-1].joint_damper == 0.0


def test_a_potential_of_the_rotation_vector_is_paid_back_at_large_angles() -> None:
    joint, errors = joined(stiffness=0.02 * SPRINGS), []
    for dt in (4e-5, 2e-5, 1e-5):
        run = Integrator(two_bricks(omega=((0.0, 0.0, 0.0), (150.0, 200.0, 100.0)), joints=[joint]), 1e9)
        largest = worst = 0.0
        while run.time_s < 0.02:
            ledger = march(run, run.time_s + dt / 2, dt)
            angle, gap = run.links.joint_rows[0, :3], run.links.joint_rows[0, 15]
            largest = max(largest, np.linalg.norm(angle))
            worst = max(worst, abs(ledger[-1].joint_spring - stored(angle, gap, joint)))
        assert largest > 1.0
        errors.append(worst / ledger[0].initial)
    # the work of the moments and the potential differ by the error of the time integration, of the second order
    assert errors[-1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize(("axis", "column"), [(0, 0), (1, 0), (1, 1), (2, 0)])
def test_a_head_on_a_neck_swings_at_its_frequency(axis: int, column: int) -> None:
    # a brick pinned at its own centre turns as k theta says; extension is softer than flexion
    nodes, hexes = structured_block((2, 2, 2), (0.05, 0.04, 0.03))
    omega = 1e-3 * np.eye(3)[axis] * (1 if column == 0 else -1)
    problem = Problem(
        nodes, hexes, np.zeros(8, int), (SolverPart(2, "head", BONE),), STILL,
        initial_velocity=np.cross(omega, nodes - nodes.mean(axis=0)),
        joints=[joined(first=None, centre=nodes.mean(axis=0), centre_stiffness=0.0)],
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    inertia = 1.0 / run.bodies.inverse_inertia[0][axis, axis]
    half = np.pi * np.sqrt(inertia / SPRINGS[axis, column])
    rows = []
    dt = half / 400
    for _ in range(401):
        run.forces()
        rows.append(run.links.joint_rows[0, axis])
        run.kick(dt, drift=False)
        run.drift(dt, run.time_s + dt)
    k = int(np.argmax(np.sign(rows[1:]) != np.sign(rows[1])))
    crossing = dt * (k + 1 - rows[k + 1] / (rows[k + 1] - rows[k]))
    assert crossing == pytest.approx(half, rel=2e-4)


@pytest.mark.parametrize("amplitude", [0.1, 1.2])
def test_a_pendulum_swings_with_its_elliptic_period(amplitude: float) -> None:
    # a brick hung by the middle of its top; gravity is aslant, so that it starts at rest off its equilibrium
    nodes, hexes = structured_block((2, 2, 2), (0.05, 0.04, 0.03))
    pivot = np.array([0.025, 0.02, 0.03])
    g = 9.81 * np.array([np.sin(amplitude), 0.0, -np.cos(amplitude)])
    problem = Problem(
        nodes, hexes, np.zeros(8, int), (SolverPart(2, "bob", BONE),),
        dataclasses.replace(STILL, gravity_m_per_s2=tuple(g)),
        joints=[joined(first=None, centre=pivot, stiffness=np.zeros((3, 2)), centre_stiffness=1e6)],
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    arm = 0.015
    inertia = 1.0 / run.bodies.inverse_inertia[0][1, 1] + run.bodies.mass[0] * arm**2
    quarter = np.sqrt(inertia / (run.bodies.mass[0] * 9.81 * arm)) * ellipk(np.sin(amplitude / 2) ** 2)
    dt = quarter / 4000
    swing = []
    for _ in range(8400):
        run.forces()
        swing.append(run.links.joint_rows[0, 1])
        run.kick(dt, drift=False)
        energies = run.energies()
        run.drift(dt, run.time_s + dt)
    # from rest to rest at the other side: half a period
    assert abs(energies.closure) < 1e-10
    assert dt * int(np.argmax(np.abs(swing))) == pytest.approx(2 * quarter, rel=2e-3)
    assert np.abs(swing).max() == pytest.approx(2 * amplitude, rel=1e-3)


@pytest.mark.parametrize("ratio", [0.1, 0.5])
def test_a_damped_neck_loses_what_its_damping_ratio_says(ratio: float) -> None:
    nodes, hexes = structured_block((2, 2, 2), (0.05, 0.04, 0.03))
    problem = Problem(
        nodes, hexes, np.zeros(8, int), (SolverPart(2, "head", BONE),), STILL,
        initial_velocity=np.cross([0.0, 1e-2, 0.0], nodes - nodes.mean(axis=0)),
        joints=[
            joined(first=None, centre=nodes.mean(axis=0), centre_stiffness=0.0, damping_ratio=ratio,
                   stiffness=np.full((3, 2), 20.0))
        ],
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    omega = np.sqrt(20.0 * run.bodies.inverse_inertia[0][1, 1])
    end = 0.5 * 2 * np.pi / (omega * np.sqrt(1 - ratio**2))
    ledger = march(run, end * (1 - 1e-9), end / 2000)
    assert ledger[-1].kinetic / ledger[0].initial == pytest.approx(np.exp(-2 * ratio * omega * end), rel=0.02)
    assert ledger[-1].joint_damper + ledger[-1].joint_spring + ledger[-1].kinetic == pytest.approx(
        ledger[0].initial, rel=1e-3
    )
    assert all(b.joint_damper >= a.joint_damper - 1e-15 for a, b in pairwise(ledger))


def test_a_stiff_joint_shortens_the_step_to_what_is_stable() -> None:
    for hold, springs in ((1e8, 0.0), (0.0, 5e4), (1e8, 5e4)):
        joint = joined(centre_stiffness=hold, stiffness=np.full((3, 2), springs), centre_damping_ratio=0.2)
        problem = two_bricks(omega=((3.0, 2.0, -4.0), (-8.0, -3.0, 1.0)), joints=[joint])
        run = Integrator(problem, 1e9)
        dt = 0.9 * run.forces().step_s
        assert dt < 1e-4
        ledger = [run.energies()]
        for _ in range(2000):
            run.forces()
            run.kick(dt, drift=False)
            ledger.append(run.energies())
            run.drift(dt, run.time_s + dt)
        assert max(e.kinetic for e in ledger) < 1.5 * ledger[0].initial


def test_two_drivers_move_two_bodies_and_a_neck_between_bodies_is_paid_by_them() -> None:
    from test_rigid import curved_motion

    first, second = curved_motion(0.02, 41), curved_motion(0.02, 41, pids=(2,))
    joint = joined(first=2, second=3, centre=(0.1, 0.02, 0.02), damping_ratio=0.1)
    problem = two_bricks(count=3, prescribed=(first, second), joints=[joint])
    run = Integrator(problem, 1e9)
    assert run.bodies.driven.tolist() == [True, True, False]
    ledger = march(run, 0.02, 1e-5)
    assert max(abs(e.closure) for e in ledger) < 1e-10
    assert ledger[-1].joint_damper > 0
    assert np.abs(run.bodies.velocity[2]).max() > 0.1
    for body, motion in enumerate((first, second)):
        told = np.abs(run.bodies.centre[body] - motion.positions[-1]).max()
        assert told < 1e-2


def test_a_joint_turned_too_far_stops_the_run(tmp_path: Any) -> None:
    problem = two_bricks(omega=((0.0, 0.0, 0.0), (0.0, 0.0, 900.0)), joints=[joined(stiffness=np.zeros((3, 2)))],
                         controls=Controls(0.02, speed_limit_m_per_s=1e3))  # fmt: skip
    with pytest.raises(InstabilityError, match="joint neck has turned by 1[67]"):
        solve(problem, tmp_path, progress=None)


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"second": 9}, "9 is no rigid part and no rigid set"),
        ({"second": None}, "None is no rigid part"),
        ({"second": 1}, "both ends are one body"),
        ({"stiffness": -SPRINGS}, "a stiffness is negative"),
        ({"stiffness": np.ones(3)}, r"shape is \(3,\)"),
        ({"damping_ratio": -1.0}, "joints.neck.damping_ratio"),
        ({"axes": np.ones((3, 3))}, "not orthonormal"),
        ({"name": ""}, "is empty"),
    ],
)
def test_a_wrong_joint_is_refused(changes: dict, found: str) -> None:
    with pytest.raises(InputError, match=found):
        Integrator(two_bricks(joints=[joined(**changes)]), 1e9)


def test_a_joint_between_two_driven_bodies_is_refused() -> None:
    from test_rigid import curved_motion

    motions = (curved_motion(0.02, 11), curved_motion(0.02, 11, pids=(2,)))
    with pytest.raises(InputError, match="neither end is free"):
        Integrator(two_bricks(prescribed=motions, joints=[joined()]), 1e9)
    with pytest.raises(InputError, match="motions 1 and 2 drive one body"):
        Integrator(two_bricks(prescribed=(motions[0], motions[0])), 1e9)


def test_a_set_of_soft_nodes_is_a_body_with_their_mass() -> None:
    from replay.solver import RigidSet

    rubber = Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": 1e5, "poisson_ratio": 0.3})
    nodes, hexes = structured_block((4, 2, 2), (0.04, 0.02, 0.02))
    end = np.flatnonzero(nodes[:, 0] > 0.029)
    omega = np.array([6.0, -10.0, 16.0])
    problem = Problem(
        nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "soft", rubber),), STILL,
        initial_velocity=np.cross(omega, nodes) + np.array([5.0, 0.0, 0.0]), rigid_sets=[RigidSet("plate", end)],
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    assert run.bodies.mass[0] == pytest.approx(run.mass[run.bodies.tied_rows(0)].sum(), rel=1e-14)
    start, shape = momenta(run), run.user_order(run.nodal)[end, :3]
    for _ in range(500):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=False)
        assert abs(run.energies().closure) < 1e-12
        run.drift(dt, run.time_s + dt)
    assert np.abs(momenta(run) - start).max() < 1e-12 * np.abs(start).max()
    now = run.user_order(run.nodal)[end, :3]
    turn = rotation(run.bodies.quaternion[0])
    exact = (shape - shape[0]) @ turn.T
    assert np.abs(now - now[0] - exact).max() < 1e-13
    with pytest.raises(InputError, match="no inertia about some axis"):
        Integrator(
            Problem(nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "soft", rubber),), STILL,
                    rigid_sets=[RigidSet("line", np.array([0, 1, 2]))]),
            1.0,
        )  # fmt: skip
