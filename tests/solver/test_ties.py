"""Tied interfaces: two meshes that do not match, and no one can tell."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from linked import BONE, MODULUS, RUBBER, STILL, momenta, stacked

from replay.errors import InputError
from replay.solver import Material, Problem, SolverPart, Tie
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.mortar import outer_faces, tie_surfaces
from replay.solver.problem import gradients

STRESS = np.array([2.0e3, -1.0e3, 3.0e3, 4.0e2, -6.0e2, 8.0e2])


def surface_loads(problem: Problem) -> np.ndarray:
    """Forces (n, 3) of a constant stress on the outer faces, the seam apart: a quarter of every rectangle's share."""
    xx, yy, zz, xy, yz, zx = STRESS
    sigma = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    loads = np.zeros_like(problem.nodes)
    for part in (0, 1):
        for face in outer_faces(problem.hexes[problem.element_part == part]):
            corner = problem.nodes[face]
            if (abs(corner[:, 2] - 0.01) < 1e-9).all():
                continue
            area = 0.5 * np.cross(corner[2] - corner[0], corner[3] - corner[1])
            loads[face] += sigma @ area / 4
    return loads


@pytest.mark.parametrize("tied", ["above", "below"])
@pytest.mark.parametrize(
    ("below", "above", "crooked"),
    [
        ((1, 1), (2, 2), 0.0),
        ((2, 3), (3, 4), 0.0),
        ((4, 2), (2, 5), 0.0),
        ((3, 2), (2, 5), 0.0),
        ((3, 4), (4, 3), 4e-4),
    ],
)
def test_the_patch_test_is_exact_across_a_tied_plane(
    below: tuple[int, int], above: tuple[int, int], crooked: float, tied: str
) -> None:
    # a constant stress with its surface loads is at rest: not a node may feel a force
    plain = stacked(below, above, tied=tied, crooked=crooked)
    stress = np.tile(STRESS, (len(plain.hexes), 1))
    loads = surface_loads(plain)
    problem = stacked(below, above, tied=tied, crooked=crooked, initial_stress=stress, nodal_forces=loads)
    run = Integrator(problem, 1e9)
    run.forces()
    run.kick(1e-6, drift=False)
    felt = np.abs(run.mass[:, None] * run.nodal[:, 4:7]).max() / 0.5e-6
    assert felt < 1e-11 * np.abs(loads).max()


def test_a_linear_motion_crosses_the_seam_unchanged() -> None:
    gradient = np.array([[1.0, 0.4, 0.3], [0.2, -0.5, 0.6], [0.1, 0.7, 0.8]])
    nodes = stacked(crooked=4e-4).nodes
    run = Integrator(stacked(crooked=4e-4, initial_velocity=nodes @ gradient.T), 1e9)
    assert np.abs(run.user_order(run.nodal)[:, 4:7] - nodes @ gradient.T).max() < 1e-16
    run.forces()
    run.kick(1e-6, drift=False)
    run.drift(1e-6, 1e-6)
    run.forces()
    stress = run.element_values("stress", 6)
    assert np.abs(stress - stress[0]).max() < 1e-9 * np.abs(stress).max()


@pytest.mark.parametrize("offset", [0.0, 3e-3])
def test_a_tie_keeps_momentum_angular_momentum_and_takes_no_work(offset: float) -> None:
    omega = np.array([60.0, -100.0, 160.0])

    def spin(nodes: np.ndarray) -> np.ndarray:
        return np.cross(omega, nodes) + 0.3 * np.sin(400.0 * nodes[:, ::-1]) + np.array([5.0, 0.0, 0.0])

    run = Integrator(stacked(offset=offset, initial_velocity=spin(stacked(offset=offset).nodes)), 1e9)
    start = momenta(run)
    for _ in range(600):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=False)
        energies = run.energies()
        assert abs(energies.closure) < 1e-11
        assert abs(energies.tie) < 1e-12 * energies.initial
        run.drift(dt, run.time_s + dt)
    assert np.abs(momenta(run) - start)[:3].max() < 1e-12 * np.abs(start[:3]).max()
    assert np.abs(momenta(run) - start)[3:].max() < 1e-11 * np.abs(start[3:]).max()
    assert energies.ratio == pytest.approx(1.0, abs=0.01)
    tie = run.problem.ties[0]
    x = run.user_order(run.nodal)[:, :3]
    assert np.abs(np.einsum("kw,kwi->ki", tie.weights, x[tie.masters]) - x[tie.nodes]).max() < 1e-16


def test_a_matching_tie_is_a_shared_node() -> None:
    nodes, hexes = structured_block((2, 2, 4), (0.02, 0.02, 0.02))
    velocity = np.sin(300.0 * nodes[:, ::-1])
    whole = Integrator(
        Problem(nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "one", RUBBER),), STILL,
                initial_velocity=velocity),
        1e9,
    )  # fmt: skip
    plain = stacked((2, 2), (2, 2))
    halves = Integrator(stacked((2, 2), (2, 2), initial_velocity=np.sin(300.0 * plain.nodes[:, ::-1])), 1e9)
    for run in (whole, halves):
        for _ in range(200):
            dt = 1e-5
            run.forces()
            run.kick(dt, drift=False)
            run.drift(dt, run.time_s + dt)
    there = {tuple(np.round(x, 9)): k for k, x in enumerate(nodes)}
    match = [there[tuple(np.round(x, 9))] for x in plain.nodes]
    difference = halves.user_order(halves.nodal)[:, :3] - whole.user_order(whole.nodal)[match, :3]
    assert np.abs(difference).max() < 1e-9 * 0.02


def test_a_plane_wave_crosses_the_seam_as_if_there_were_none() -> None:
    # without lateral contraction a bar moves in planes: other meshes across the seam change nothing
    bar = Material("bar", "elastic", 1000.0, {"youngs_modulus_pa": MODULUS, "poisson_ratio": 0.0})

    def pulse(nodes: np.ndarray) -> np.ndarray:
        return np.exp(-(((nodes[:, 2:] - 0.004) / 2e-3) ** 2)) * [0.0, 0.0, 0.1]

    plain = stacked(layers=10)
    parts = (SolverPart(1, "below", bar), SolverPart(2, "above", bar))
    tied = Integrator(dataclasses.replace(plain, parts=parts, initial_velocity=pulse(plain.nodes)), 1e9)
    nodes, hexes = structured_block((1, 1, 20), (0.02, 0.02, 0.02))
    whole = Integrator(
        Problem(nodes, hexes, np.zeros(20, int), (SolverPart(1, "bar", bar),), STILL, initial_velocity=pulse(nodes)),
        1e9,
    )  # fmt: skip
    for run in (tied, whole):
        while run.time_s < 5e-4:
            run.forces()
            run.kick(1e-5, drift=False)
            run.drift(1e-5, run.time_s + 1e-5)
    layer = np.round(plain.nodes[:, 2] / 1e-3).astype(int)
    exact = whole.user_order(whole.nodal)[::, 6].reshape(4, 21)[0]
    assert np.abs(exact[:8]).max() < 0.3 * np.abs(exact[11:]).max()
    assert np.abs(tied.user_order(tied.nodal)[:, 6] - exact[layer]).max() < 1e-12


def test_a_force_crosses_the_seam_whole() -> None:
    # the lower block rests on a support, gravity pulls: the seam carries the upper block's weight on average
    plain = stacked()
    fixed = np.zeros((len(plain.nodes), 3), bool)
    fixed[plain.nodes[:, 2] < 1e-9] = True
    run = Integrator(stacked(fixed=fixed, initial_velocity=np.zeros_like(plain.nodes), nodal_forces=loads(plain)), 1e9)
    forces = []
    while run.time_s < 0.04:
        dt = 0.9 * run.forces().step_s
        forces.append(run.tied.resultants()[0, 2] * dt)
        run.kick(dt, drift=False)
        run.drift(dt, run.time_s + dt)
    assert sum(forces) / run.time_s == pytest.approx(loads(plain)[:, 2].sum(), rel=0.06)


def loads(problem: Problem) -> np.ndarray:
    force = np.zeros_like(problem.nodes)
    top = problem.nodes[:, 2] > 0.02 - 1e-9
    force[top, 2] = -0.5 / top.sum()
    return force


def test_a_soft_block_tied_to_a_rigid_one_moves_with_it() -> None:
    velocity = np.cross([0.0, 30.0, 10.0], stacked().nodes)
    run = Integrator(stacked(material=BONE, initial_velocity=velocity), 1e9)
    start = momenta(run)
    assert run.bodies.count == 1
    for _ in range(300):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=False)
        assert abs(run.energies().closure) < 1e-11
        run.drift(dt, run.time_s + dt)
    assert np.abs(momenta(run) - start).max() < 1e-11 * np.abs(start).max()


@pytest.mark.parametrize(("below", "above"), [((2, 3), (3, 4)), ((2, 3), (4, 5)), ((4, 4), (1, 2))])
def test_negative_weights_shorten_the_step_as_far_as_the_masses_ask(
    below: tuple[int, int], above: tuple[int, int]
) -> None:
    # against the dense matrix: the step may be shorter than need be, never longer
    problem = stacked(below, above)
    run, tie = Integrator(problem, 1e9), problem.ties[0]
    n = len(problem.nodes)
    element = 1000.0 * gradients(problem.nodes, problem.hexes)[1]
    mass = np.bincount(problem.hexes.ravel(), np.repeat(element / 8, 8), n)
    weights = np.eye(n)
    weights[tie.nodes] = 0.0
    np.add.at(weights, (tie.nodes[:, None], tie.masters), tie.weights)
    weights = weights[:, np.setdiff1d(np.arange(n), tie.nodes)]
    lumped = weights.T @ mass
    assert np.allclose(np.sort(lumped), np.sort(run.mass[run.mass > 0]), rtol=1e-12)
    root = np.sqrt(lumped)
    exact = 1.0 / np.sqrt(np.linalg.eigvalsh(weights.T @ (mass[:, None] * weights) / root / root[:, None])[-1])
    assert 0.9 * exact <= run.tied.step_scale <= exact + 1e-12


def test_a_matching_tie_costs_no_step() -> None:
    assert Integrator(stacked((2, 2), (2, 2)), 1e9).tied.step_scale == 1.0


def tie(problem: Problem, **changes: Any) -> Problem:
    old = problem.ties[0]
    values = {"name": "seam", "nodes": old.nodes, "masters": old.masters, "weights": old.weights, **changes}
    return Problem(problem.nodes, problem.hexes, problem.element_part, problem.parts, STILL, ties=[Tie(**values)])


def test_a_wrong_tie_is_refused() -> None:
    good = stacked()
    old = good.ties[0]
    with pytest.raises(InputError, match="weights whose sum is not 1"):
        tie(good, weights=2 * old.weights)
    with pytest.raises(InputError, match="is not where its masters put it"):
        tie(good, masters=np.roll(old.masters, 1, axis=0))
    with pytest.raises(InputError, match="is tied twice"):
        tie(good, nodes=np.where(old.nodes == old.nodes[1], old.nodes[0], old.nodes))
    with pytest.raises(InputError, match=r"its shape is \(2, "):
        tie(good, masters=old.masters[:2])
    chained = old.masters.copy(), np.zeros_like(old.weights)
    chained[0][1:, 0], chained[1][:, 0] = old.nodes[1:], 1.0
    chained[0][0], chained[1][0] = old.masters[0], old.weights[0]
    with pytest.raises(InputError, match="follows a node that is tied itself"):
        tie(good, masters=chained[0], weights=chained[1])
    fixed = np.zeros((len(good.nodes), 3), bool)
    fixed[old.nodes[0], 1] = True
    with pytest.raises(InputError, match="is tied and has a support"):
        stacked(fixed=fixed)
    with pytest.raises(InputError, match="no node is within 1e-06 m"):
        far = good.nodes + np.where(np.arange(len(good.nodes))[:, None] >= 36, [0.0, 0.0, 1e-3], 0.0)
        faces = outer_faces(good.hexes)
        above = (faces >= 36).all(axis=1)
        tie_surfaces("far", far, faces[above], faces[~above], 1e-6)


def test_tied_faces_carry_the_area_of_their_masters() -> None:
    # with the mortar weights a unit pressure on the tied side gives every master its own share of the plane
    problem = stacked((3, 2), (2, 5))
    seam, nodes = problem.ties[0], problem.nodes
    volume = gradients(nodes, problem.hexes)[1]
    assert volume.sum() == pytest.approx(0.02**3, rel=1e-12)
    x, y = nodes[seam.nodes, 0], nodes[seam.nodes, 1]
    area = (1e-2 * np.where((x < 1e-9) | (x > 0.0199), 0.5, 1.0)) * (4e-3 * np.where((y < 1e-9) | (y > 0.0199), 0.5, 1))
    got = np.bincount(seam.masters.ravel(), (seam.weights * area[:, None]).ravel(), len(nodes))
    rows = np.unique(seam.masters)
    x, y = nodes[rows, 0], nodes[rows, 1]
    own = (0.02 / 3 * np.where((x < 1e-9) | (x > 0.0199), 0.5, 1)) * (
        1e-2 * np.where((y < 1e-9) | (y > 0.0199), 0.5, 1)
    )
    assert np.allclose(got[rows], own, rtol=1e-12)
