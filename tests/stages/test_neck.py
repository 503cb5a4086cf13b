"""The neck: head and neck on a chest that is held, against the small oscillations of two rigid bodies on springs."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from replay.models import BodyPlan, Model, build_model, with_body
from replay.solver import Controls, Joint, Material, PrescribedMotion, Problem, solve
from replay.solver.integrator import Integrator
from replay.stages.problem import body_links, solver_parts

BODY = range(60_000_100, 60_000_300)
SKULL, NECK, CHEST = 60000003, 60000104, 60000103
FREE = Controls(1.0, mass_scaling_time_step_s=0.0, bulk_viscosity_linear=0.0, bulk_viscosity_quadratic=0.0)


PLAN = BodyPlan(posture="standing", step_m=0.030)


@pytest.fixture(scope="module")
def player() -> Model:
    return with_body(build_model("nfl", "tiny"), PLAN)


def at_rest(pid: int, end_s: float) -> PrescribedMotion:
    none, still = np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
    return PrescribedMotion((pid,), np.array([0.0, end_s]), none, still, none, none)


def held(model: Model, *, damped: bool = False, **fields: Any) -> Problem:
    """Head, neck and upper trunk; the head rigid, the trunk's bone at rest."""
    chosen = model.elements_of(assembly="head") | model.elements_of(assembly="helmet")
    names = [part.name for part in model.parts]
    for name in ("bone_neck", "flesh_neck", "bone_upper_trunk", "flesh_upper_trunk"):
        chosen |= model.element_part == (names.index(name) if name in names else -1)
    used, row = np.unique(model.hexes[chosen], return_inverse=True)
    parts = []
    for part, solver_part in zip(model.parts, solver_parts(model)):
        material = solver_part.material
        if part.assembly != "body":
            material = Material(part.name, "rigid", material.density_kg_per_m3, {})
        parts.append(dataclasses.replace(solver_part, material=material))
    sets, joints = body_links(model)
    sets = tuple(dataclasses.replace(s, nodes=np.searchsorted(used, s.nodes)) for s in sets)
    kept: list[Joint] = []
    for joint in joints:
        if joint.name in ("neck", "skull_base"):
            ratio = joint.damping_ratio if damped else 0.0
            kept.append(dataclasses.replace(joint, damping_ratio=ratio, centre_damping_ratio=ratio))
    motions = (at_rest(CHEST, FREE.termination_time_s), *fields.pop("prescribed", ()))
    return Problem(
        model.nodes[used], row.reshape(-1, 8), model.element_part[chosen], tuple(parts), FREE, rigid_sets=sets,
        joints=tuple(kept), prescribed=motions, **fields,
    )  # fmt: skip


def turned(arm: np.ndarray) -> np.ndarray:
    """Matrix that makes of a small turn the displacement at the end of an arm."""
    return np.cross(np.eye(3), arm).T


def lateral_mode(problem: Problem) -> tuple[float, np.ndarray]:
    """Frequency [rad/s] and turns (neck, head) about x and z of the slowest lateral oscillation.

    Two bodies on spherical joints with springs, small angles: ``M q'' + K q = 0`` for the turns q of both.
    """
    run = Integrator(problem, 1e9)
    body = {name: run.layout.body_named(problem, name) for name in (NECK, SKULL)}
    joint = {j.name: j for j in problem.joints}
    base, condyles = joint["neck"].centre, joint["skull_base"].centre
    centre = {name: run.bodies.centre[body[name]] for name in body}
    # displacement of each centre of gravity for unit turns of neck and head
    moves = {
        NECK: np.hstack([turned(centre[NECK] - base), np.zeros((3, 3))]),
        SKULL: np.hstack([turned(condyles - base), turned(centre[SKULL] - condyles)]),
    }
    mass, stiff = np.zeros((6, 6)), np.zeros((6, 6))
    for k, name in enumerate((NECK, SKULL)):
        mass += run.bodies.mass[body[name]] * moves[name].T @ moves[name]
        turn = slice(3 * k, 3 * k + 3)
        mass[turn, turn] += np.linalg.inv(run.bodies.inverse_inertia[body[name]])
    for name, select in (("neck", np.eye(3, 6)), ("skull_base", np.hstack([-np.eye(3), np.eye(3)]))):
        along = joint[name].axes @ select
        stiff += along.T @ np.diag(joint[name].stiffness.mean(axis=1)) @ along
    side = [0, 2, 3, 5]  # a symmetric head: flexion is a motion of its own
    values, modes = eigh(stiff[np.ix_(side, side)], mass[np.ix_(side, side)])
    turns = np.zeros(6)
    turns[side] = modes[:, 0]
    return float(np.sqrt(values[0])), turns.reshape(2, 3)


def swing(problem: Problem, seconds: float) -> float:
    """Frequency of the head's lateral angle, started in the mode's shape, from its first crossings of zero [rad/s]."""
    omega, (neck, head) = lateral_mode(problem)
    joint = {j.name: j for j in problem.joints}
    base, condyles = joint["neck"].centre, joint["skull_base"].centre
    scale = 0.02 * omega / np.abs(head[0])
    velocity = np.zeros_like(problem.nodes)
    of_neck = np.array([p.pid == NECK for p in problem.parts])
    of_head = np.array([p.pid not in BODY for p in problem.parts])
    for own, turn, point in ((of_neck, neck, base), (of_head, head, condyles)):
        rows = np.unique(problem.hexes[own[problem.element_part]])
        if own is of_head:
            rows = np.union1d(rows, [node for s in problem.rigid_sets for node in s.nodes]).astype(int)
        carried = np.cross(neck, condyles - base) if own is of_head else 0.0
        velocity[rows] = scale * (carried + np.cross(turn, problem.nodes[rows] - point))
    run = Integrator(dataclasses.replace(problem, initial_velocity=velocity), 1e9)
    times, angles = [], []
    names = [j.name for j in problem.joints]
    dt = 0.5 * run.forces().step_s
    while run.time_s < seconds:
        run.forces()
        run.kick(dt, drift=False)
        times.append(run.time_s)
        angles.append(run.links.joint_rows[[names.index("neck"), names.index("skull_base")], 0].sum())
        run.drift(dt, run.time_s + dt)
    t, a = np.array(times), np.array(angles)
    crossing = np.flatnonzero(np.sign(a[2:]) != np.sign(a[1:-1]))[:2] + 1
    at = t[crossing] - a[crossing] * (t[crossing + 1] - t[crossing]) / (a[crossing + 1] - a[crossing])
    return float(np.pi / (at[1] - at[0]))


def test_a_head_on_its_neck_swings_as_two_bodies_on_springs_do(player: Model) -> None:
    problem = held(player)
    expected, _ = lateral_mode(problem)
    assert 12.0 < expected < 30.0, "the period of a head on a neck is some third of a second"
    assert swing(problem, 1.8 * np.pi / expected + 0.1) == pytest.approx(expected, rel=0.02)


def test_flesh_and_springs_of_a_deformable_neck_are_of_one_order(player: Model) -> None:
    """Flesh stiffens the neck about its springs, by less than these are known."""
    expected, _ = lateral_mode(held(player))
    fleshed = held(with_body(build_model("nfl", "tiny"), dataclasses.replace(PLAN, tissue="deformable")))
    assert 0.9 < swing(fleshed, 1.8 * np.pi / expected + 0.1) / expected < 1.6


@pytest.mark.parametrize("angle", [0.1, -0.1])
def test_a_nodding_head_is_held_back_by_its_neck(tmp_path: Path, player: Model, angle: float) -> None:
    """The head is turned about the condyles and held: the two joints in series answer as their springs do."""
    end, rise = 0.5, 0.2
    times = np.linspace(0.0, 1.0, 101)
    share = np.clip(times / rise, 0, 1)
    turn = angle * (3 * share**2 - 2 * share**3)
    rate = np.where(share < 1, angle * 6 * (share - share**2) / rise, 0.0)
    condyles = np.array(next(j.centre_m for j in player.joints if j.name == "skull_base"))
    motion = PrescribedMotion(
        (SKULL,), times, np.tile(condyles, (101, 1)), Rotation.from_rotvec(turn[:, None] * [0, 1, 0]).as_quat(),
        np.zeros((101, 3)), rate[:, None] * np.array([0.0, 1.0, 0.0]),
    )  # fmt: skip
    problem = held(player, damped=True, prescribed=(motion,))
    solve(dataclasses.replace(problem, controls=dataclasses.replace(FREE, termination_time_s=end)), tmp_path)
    last = pd.read_csv(tmp_path / "joints.csv").groupby("joint").last()
    moment = last["moment_y_N_m"]
    assert np.sign(moment["skull_base"]) == -np.sign(angle), "it pulls back"
    # the neck stays where it is held by both: its turn is what the two springs and the held condyles leave it
    stiffness = 160.0 if angle > 0 else 80.0
    assert abs(moment["skull_base"]) == pytest.approx(stiffness * abs(last["angle_y_rad"]["skull_base"]), rel=0.01)
    assert last["angle_y_rad"].sum() == pytest.approx(angle, rel=0.01)
