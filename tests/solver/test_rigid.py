"""Rigid bodies: what a free one keeps, and how well a driven one follows."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.solver import Controls, Material, PrescribedMotion, Problem, SolverPart, pose_at
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.rigid import fit_pose, rotation

BONE = Material("bone", "rigid", 2000.0, {})
RUBBER = Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": 1e5, "poisson_ratio": 0.3})


def brick(**fields: object) -> Problem:
    nodes, hexes = structured_block((2, 2, 1), (0.06, 0.04, 0.01))
    return Problem(nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "brick", BONE),), Controls(1.0), **fields)  # type: ignore[arg-type]


def spinning(omega: np.ndarray) -> Integrator:
    nodes, _ = structured_block((2, 2, 1), (0.06, 0.04, 0.01))
    centre = nodes.mean(axis=0)
    return Integrator(brick(initial_velocity=np.cross(omega, nodes - centre) + np.array([3.0, 0.0, 0.0])), 1e9)


def test_mass_and_inertia_are_those_of_a_brick() -> None:
    body = spinning(np.zeros(3)).bodies
    a, b, c = 0.06, 0.04, 0.01
    mass = 2000.0 * a * b * c
    assert body.mass[0] == pytest.approx(mass, rel=1e-12)
    exact = np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * mass / 12
    assert np.allclose(np.linalg.inv(body.inverse_inertia[0]), exact, rtol=1e-12, atol=1e-15 * mass)


def test_a_body_spun_about_its_middle_axis_keeps_momentum_and_energy_over_1e5_steps() -> None:
    # the unstable axis: the body tumbles over and over
    run = spinning(np.array([0.5, 60.0, 0.3]))
    bodies, dt = run.bodies, 1e-4

    def invariants() -> np.ndarray:
        spin = rotation(bodies.quaternion[0]) @ bodies.spin[0]
        energy = 0.5 * bodies.spin[0] @ bodies.inverse_inertia[0] @ bodies.spin[0]
        return np.array([*spin, energy])

    start, tumbled = invariants(), False
    for k in range(100_000):
        bodies.kick(run.nodal, k * dt, dt, dt)
        bodies.drift()
        tumbled |= bool((rotation(bodies.quaternion[0]) @ [0.0, 1.0, 0.0])[1] < 0)
    assert tumbled
    assert np.abs(invariants() - start).max() < 1e-10 * np.abs(start).max()
    assert abs(np.linalg.norm(bodies.quaternion[0]) - 1) < 1e-14


def test_a_free_top_turns_as_euler_says() -> None:
    # two equal moments: the axis of symmetry precesses at L / I_1
    nodes, hexes = structured_block((2, 2, 2), (0.02, 0.02, 0.05))
    omega = np.array([10.0, 0.0, 80.0])
    field = np.cross(omega, nodes - nodes.mean(axis=0))
    problem = Problem(nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "top", BONE),), Controls(1.0),
                      initial_velocity=field)  # fmt: skip
    errors = []
    for n in (250, 500, 1000):
        run = Integrator(problem, 1e9)
        bodies = run.bodies
        spin = bodies.spin[0].copy()
        inertia = np.linalg.inv(bodies.inverse_inertia[0])
        end = 0.05
        for _ in range(n):
            bodies.kick(run.nodal, 0.0, end / n, end / n)
            bodies.drift()
        rate = np.linalg.norm(spin) / inertia[0, 0]
        exact = Rotation.from_rotvec(rate * end * spin / np.linalg.norm(spin)).apply([0.0, 0.0, 1.0])
        errors.append(np.abs(rotation(bodies.quaternion[0])[:, 2] - exact).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 1e-3


def curved_motion(end: float, count: int, pids: tuple[int, ...] = (1,)) -> PrescribedMotion:
    t = np.linspace(0.0, end, count)
    x = np.stack([0.05 * np.sin(40 * t), 0.02 * np.cos(30 * t), t], axis=1)
    v = np.stack([2.0 * np.cos(40 * t), -0.6 * np.sin(30 * t), np.ones_like(t)], axis=1)
    axis = np.array([1.0, 2.0, 2.0]) / 3
    angle, rate = 0.8 * np.sin(50 * t), 40.0 * np.cos(50 * t)
    start = Rotation.from_rotvec([0.3, -0.2, 0.5])
    q = (Rotation.from_rotvec(angle[:, None] * axis) * start).as_quat()
    q[::3] *= -1  # a sign is no rotation
    return PrescribedMotion(pids, t, x, q, v, rate[:, None] * axis)


def test_driver_is_met_at_its_samples_and_between_them_to_the_fourth_order() -> None:
    errors = []
    for count in (11, 21, 41):
        motion = curved_motion(0.05, count)
        for t in (0.0, 0.025, 0.05):
            row = int(np.argmin(abs(motion.times - t)))
            pose = pose_at(motion, motion.times[row])
            assert np.allclose(pose.position, motion.positions[row], atol=1e-15)
            assert np.allclose(pose.angular_velocity, motion.angular_velocities[row], atol=1e-10)
        exact = curved_motion(0.05, 1001)
        worst = 0.0
        for k in range(0, 1001, 7):
            pose = pose_at(motion, exact.times[k])
            turn = rotation(pose.quaternion) @ rotation(exact.quaternions[k]).T
            worst = max(worst, np.abs(turn - np.eye(3)).max(), np.abs(pose.position - exact.positions[k]).max())
        errors.append(worst)
    assert np.log2(errors[0] / errors[1]) > 3.5
    assert np.log2(errors[1] / errors[2]) > 3.5


def test_driven_block_follows_its_driver_and_carries_what_is_tied_to_it() -> None:
    nodes, hexes = structured_block((4, 2, 2), (0.04, 0.02, 0.02))
    part = (nodes[hexes].mean(axis=1)[:, 0] > 0.02).astype(int)
    motion = curved_motion(0.02, 101)
    problem = Problem(
        nodes, hexes, part, (SolverPart(1, "bone", BONE), SolverPart(2, "soft", RUBBER)),
        Controls(0.02, mass_scaling_time_step_s=0.0), prescribed=motion,
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    tied = run.layout.node_order[run.layout.n_free :]
    first = pose_at(motion, 0.0)
    for k in range(400):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=False)
        assert abs(run.energies().closure) < 1e-12
        run.drift(dt, run.time_s + dt)
        pose = pose_at(motion, run.time_s)
        turn = rotation(pose.quaternion) @ rotation(first.quaternion).T
        exact = pose.position + (nodes[tied] - first.position) @ turn.T
        place = run.nodal[run.layout.n_free :, :3]
        assert np.abs(place - exact).max() < 1e-12, k
    free = run.nodal[: run.layout.n_free, :3] - nodes[run.layout.node_order[: run.layout.n_free]]
    assert np.linalg.norm(free, axis=1).min() > 1e-3


def test_free_body_with_soft_parts_keeps_momentum_angular_momentum_and_energy() -> None:
    nodes, hexes = structured_block((4, 2, 2), (0.04, 0.02, 0.02))
    part = (nodes[hexes].mean(axis=1)[:, 0] > 0.02).astype(int)
    omega = np.array([6.0, -10.0, 16.0])
    problem = Problem(
        nodes, hexes, part, (SolverPart(1, "bone", BONE), SolverPart(2, "soft", RUBBER)),
        Controls(0.02, mass_scaling_time_step_s=0.0),
        initial_velocity=np.cross(omega, nodes) + np.array([5.0, 0.0, 0.0]),
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    bodies, free = run.bodies, slice(0, run.layout.n_free)

    def momenta() -> np.ndarray:
        m, x, v = run.mass[free, None], run.nodal[free, :3], run.nodal[free, 4:7]
        body = bodies.mass[0] * bodies.velocity[0]
        spin = rotation(bodies.quaternion[0]) @ bodies.spin[0]
        return np.concatenate(
            [(m * v).sum(axis=0) + body, (m * np.cross(x, v)).sum(axis=0) + np.cross(bodies.centre[0], body) + spin]
        )

    start = momenta()
    tie = 0.0
    for _ in range(1000):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=False)
        energies = run.energies()
        assert abs(energies.closure) < 1e-12
        tie = max(tie, abs(energies.tie))
        run.drift(dt, run.time_s + dt)
    drift = np.abs(momenta() - start)
    assert drift[:3].max() < 1e-12 * np.abs(start[:3]).max()
    assert drift[3:].max() < 1e-12 * np.abs(start[3:]).max()
    # a rigid tie does no work but for the bend of a step's path
    assert tie < 1e-7 * energies.initial
    assert 0.9999 < energies.ratio < 1.0001


def test_a_spinning_body_falls_freely_and_its_weight_does_the_work() -> None:
    nodes, hexes = structured_block((2, 2, 1), (0.06, 0.04, 0.01))
    g = np.array([0.5, -1.0, -9.81])
    omega, start = np.array([5.0, 60.0, -20.0]), np.array([1.0, 2.0, 3.0])
    problem = Problem(
        nodes, hexes, np.zeros(4, int), (SolverPart(1, "brick", BONE),), Controls(1.0, gravity_m_per_s2=tuple(g)),
        initial_velocity=start + np.cross(omega, nodes - nodes.mean(axis=0)),
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    for _ in range(1000):
        run.kick(1e-4, drift=False)
        energies = run.energies()
        run.drift(1e-4, run.time_s + 1e-4)
    t = run.time_s
    fall = run.bodies.centre[0] - nodes.mean(axis=0)
    assert np.allclose(fall, start * t + 0.5 * g * t * t, rtol=1e-12)
    assert abs(energies.closure) < 1e-12
    assert energies.external_work == pytest.approx(
        run.bodies.mass[0] * g @ (fall - run.bodies.velocity[0] * 1e-4), rel=1e-3
    )


def test_pose_is_read_off_the_nodes() -> None:
    rng = np.random.default_rng(1)
    lever, mass = rng.normal(size=(20, 3)), rng.uniform(1, 2, 20)
    turn = Rotation.from_rotvec([0.4, -2.0, 1.0])
    position, quaternion = fit_pose(turn.apply(lever) + np.array([1.0, 2.0, 3.0]), lever, mass)
    assert np.allclose(position, [1.0, 2.0, 3.0], atol=1e-13)
    assert np.abs(rotation(quaternion) - turn.as_matrix()).max() < 1e-13


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"pids": (7,)}, "part 7 does not exist"),
        ({"pids": ()}, "no part is driven"),
        ({"times": [0.0, 0.0]}, "the times do not increase"),
        ({"times": [0.0, 0.4]}, "the run lasts from 0 to 1 s"),
        ({"quaternions": np.full((2, 4), 0.3)}, "has length 0.6"),
        ({"positions": np.zeros((3, 3))}, r"shape is \(3, 3\)"),
        ({"velocities": np.full((2, 3), np.nan)}, "holds nan"),
    ],
)
def test_a_wrong_driver_is_refused(changes: dict, found: str) -> None:
    values = {
        "pids": (1,), "times": np.array([0.0, 1.0]), "positions": np.zeros((2, 3)),
        "quaternions": np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)), "velocities": np.zeros((2, 3)),
        "angular_velocities": np.zeros((2, 3)),
    }  # fmt: skip
    with pytest.raises(InputError, match=found):
        brick(prescribed=PrescribedMotion(**{**values, **changes}))


def test_only_rigid_parts_are_driven_and_no_rigid_node_is_fixed() -> None:
    nodes, hexes = structured_block((1, 1, 1), (1.0, 1.0, 1.0))
    motion = curved_motion(1.0, 11)
    with pytest.raises(InputError, match="deforms"):
        Problem(nodes, hexes, np.zeros(1, int), (SolverPart(1, "soft", RUBBER),), Controls(1.0), prescribed=motion)
    with pytest.raises(InputError, match="fixed and belongs to a rigid body"):
        Integrator(brick(fixed=np.ones((18, 3), bool)), 1.0)
