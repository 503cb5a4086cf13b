"""A posed player in the solver: what he keeps in free flight, and how his neck carries his head."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from replay.models import BodyPlan, Model, build_model, placed, second_player, together, with_body
from replay.solver import Controls, Problem, solve
from replay.solver.integrator import Integrator
from replay.stages.problem import body_links, solver_parts

STILL = Controls(4e-3, mass_scaling_time_step_s=0.0, history_interval_s=1e-4)


@pytest.fixture(scope="module")
def player() -> Model:
    return with_body(build_model("nfl", "tiny"), BodyPlan(posture="struck", step_m=0.030))


def problem_of(model: Model, velocity: np.ndarray) -> Problem:
    sets, joints = body_links(model)
    return Problem(
        model.nodes, model.hexes, model.element_part, solver_parts(model), STILL, initial_velocity=velocity,
        node_ids=model.node_ids, element_ids=model.element_ids, rigid_sets=sets, joints=joints,
    )  # fmt: skip


def tackled(model: Model, speed: float) -> np.ndarray:
    """Velocity of a player whose body below the skull has just got `speed` backwards, (n, 3)."""
    velocity = np.tile([5.0, 1.0, 0.0], (len(model.nodes), 1))
    body = np.unique(model.hexes[model.elements_of(assembly="body")])
    velocity[np.setdiff1d(body, model.node_sets.get("skull_base", ()))] -= [speed, 0.0, 0.0]
    return velocity


def test_a_tackled_player_keeps_energy_and_momentum_in_free_flight(tmp_path: Path, player: Model) -> None:
    run = solve(problem_of(player, tackled(player, 3.0)), tmp_path)
    assert run.ran_to_end
    energy = pd.read_csv(tmp_path / "energy.csv")
    assert abs(energy["ratio"] - 1.0).max() < 1e-5
    assert abs(energy["closure"]).max() < 1e-12
    momentum = energy[[f"momentum_{axis}_N_s" for axis in "xyz"]].to_numpy()
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * np.linalg.norm(momentum[0])
    assert energy["joint_spring_J"].iloc[-1] > 0.1, "the neck is bent"
    steps = pd.read_csv(tmp_path / "timestep.csv")
    assert set(steps["pid"]) <= {60000001, 60000002}, "brain or fluid of the head own the step, not the body"


def test_the_body_costs_the_head_no_step(player: Model) -> None:
    def step(model: Model) -> float:
        return Integrator(problem_of(model, np.zeros_like(model.nodes)), 1e9).forces().step_s

    assert step(player) > 0.95 * step(build_model("nfl", "tiny"))


def test_two_players_stand_in_one_assembly(player: Model) -> None:
    other = placed(second_player(player), np.array([1.5, 0.0, 0.1]), Rotation.from_euler("z", 180, degrees=True))
    both = together([player, other])
    assert len(np.unique(both.node_ids)) == 2 * len(player.nodes)
    assert len(np.unique(both.element_ids)) == 2 * len(player.hexes)
    pids = {part.pid for part in both.parts}
    assert {60009020, 40009020, 10000001, 20000001} <= pids
    assert len(pids) == 2 * len(player.parts)
    assert both.part_set_ids["H2_pads_set1"] == 20000099
    assert set(both.part_sets["all_parts"]) == pids
    run = Integrator(problem_of(both, np.zeros_like(both.nodes)), 1e9)
    mass = run.mass[: run.layout.n_free].sum() + run.bodies.mass.sum()
    alone = Integrator(problem_of(player, np.zeros_like(player.nodes)), 1e9)
    assert mass == pytest.approx(2 * (alone.mass[: alone.layout.n_free].sum() + alone.bodies.mass.sum()), rel=1e-12)
    # each has his own skull, neck and joints
    assert len(run.layout.body_parts) == 2 * len(alone.layout.body_parts)
    # the second stands where it was put: his left is to the other side
    left = both.joints[[j.name for j in both.joints].index("shoulder_left_2")].centre_m
    assert left[1] < 0 < player.joints[[j.name for j in player.joints].index("shoulder_left")].centre_m[1]


def test_players_with_the_same_numbers_are_refused(player: Model) -> None:
    with pytest.raises(ValueError, match=r"node number 60000001 occurs twice; give a player"):
        together([player, player])
    with pytest.raises(ValueError, match="lies in no block of player 1"):
        second_player(second_player(player))
