"""Two players, from the play's description to the solver: what closes, what is kept, and what is refused."""

from __future__ import annotations

import dataclasses
import signal
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import replay.solver.run as run_module
from replay.errors import InputError
from replay.measures import Motion, impulse_on, mount_impulse
from replay.models import Model, assembly_mass, build_model, second_player
from replay.play import Play, load_play
from replay.solver import RunSummary, solve
from replay.stages.collision import collision_problem
from replay.stages.impact import pad_recorder
from replay.stages.placement import _report, place
from replay.stages.players import ROLES, PlayerStart, start_of
from replay.stages.problem import controls_of

FLIGHT_S = 2e-3


@pytest.fixture(scope="module")
def play(repository: Path) -> Play:
    return load_play(repository / "config" / "plays" / "collision-demo")


@pytest.fixture(scope="module")
def models() -> dict[str, Model]:
    head = build_model("nfl", "tiny", brain="viscohyperelastic")
    return {"struck": head, "impactor": second_player(head)}


def starts_of(play: Play) -> dict[str, PlayerStart]:
    return {role: start_of(play.collision, role, None, 0.0) for role in ROLES}


@pytest.fixture(scope="module")
def scene(play: Play, models: dict[str, Model]) -> tuple[Model, dict]:
    starts = starts_of(play)
    scene, found, places = place(models, starts, play.collision)
    return scene, _report(scene, found, places, starts, play.collision)


@pytest.fixture(scope="module")
def run(
    play: Play, scene: tuple[Model, dict], tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, RunSummary, Model]:
    model, placement = scene
    folder = tmp_path_factory.mktemp("collision")
    problem = collision_problem(model, placement, controls_of(play, FLIGHT_S, checkpoint_every_s=0.0), play)
    return folder, solve(problem, folder, recorders=[pad_recorder(model)], threads=1, progress=None), model


def test_the_players_stand_a_millimetre_apart_and_close_at_the_plays_speed(scene: tuple[Model, dict]) -> None:
    _, placement = scene
    assert placement["gap_m"] == pytest.approx(1e-3, abs=1e-8)
    assert placement["closing_speed_m_per_s"] == pytest.approx(9.3, rel=1e-6)
    centre = np.array(placement["players"]["impactor"]["head_cg_m"])
    closing = np.array(placement["closing_velocity_m_per_s"])
    off = centre - (centre @ closing) / (closing @ closing) * closing
    assert np.linalg.norm(off) < 1e-9, "the line of the impactor's head passes through the struck head's CG"


def test_a_spin_about_p_q_moves_every_node_of_the_impactor_and_none_of_the_struck(
    play: Play, models: dict[str, Model]
) -> None:
    from replay.stages.players import scene_velocities

    starts = starts_of(play)
    starts["impactor"] = dataclasses.replace(starts["impactor"], omega_rad_per_s=45.0)
    model, _, places = place(models, starts, play.collision)
    velocity = scene_velocities(model, starts, places)
    of = {role: np.unique(model.hexes[model.elements_of(player=number)]) for role, number in ROLES.items()}
    assert not velocity[of["struck"]].any()
    spin = velocity[of["impactor"]] - starts["impactor"].velocity_m_per_s
    axis = starts["impactor"].rotation.apply(starts["impactor"].q_m)
    arm = model.nodes[of["impactor"]] - places["impactor"]
    np.testing.assert_allclose(spin, np.cross(45.0 * axis, arm), atol=1e-12)


def test_both_players_together_keep_momentum_and_energy(run: tuple[Path, RunSummary, Model]) -> None:
    folder, summary, _ = run
    energy = pd.read_csv(folder / "energy.csv")
    momentum = energy[[f"momentum_{axis}_N_s" for axis in "xyz"]].to_numpy()
    assert np.abs(momentum - momentum[0]).max() < 1e-10 * np.linalg.norm(momentum[0])
    assert energy["ratio"].between(0.999, 1.001).all()
    assert summary.contact["unconverged_share"] < 0.01
    assert energy["contact_normal_J"].iloc[-1] > 1.0, "they did strike"


def test_the_contact_force_is_what_takes_the_impactors_momentum(run: tuple[Path, RunSummary, Model]) -> None:
    folder, _, model = run
    time, impulse = impulse_on(
        pd.read_csv(folder / "contact.csv"), {part.pid for part in model.parts if part.player == 1}
    )
    start = assembly_mass(model, player=2).mass_kg * np.array([-6.576093, -6.576093, 0.0])
    energy = pd.read_csv(folder / "energy.csv")
    np.testing.assert_allclose(
        energy[[f"momentum_{axis}_N_s" for axis in "xyz"]].to_numpy()[0], start, rtol=1e-5, atol=1e-6
    )
    assert time[-1] == pytest.approx(FLIGHT_S)
    assert impulse[-1] @ start > 0
    assert 0.1 < np.linalg.norm(impulse[-1]) / np.linalg.norm(start) < 1.0


def test_mounts_carry_what_contact_does_not(run: tuple[Path, RunSummary, Model]) -> None:
    """Facemask and shell are one rigid body: the mounts' impulse and contact's make the facemask's momentum."""
    folder, _, model = run
    mask = next(part for part in model.parts if part.role == "facemask" and part.player == 1)
    own = assembly_mass(model, name=mask.name)
    motion = Motion.from_history(pd.read_csv(folder / "histories.csv"), mask.pid).of_point(own.cg_m)
    _, given = impulse_on(pd.read_csv(folder / "contact.csv"), {mask.pid})
    mounts = mount_impulse(motion, own.mass_kg, given)
    momentum = own.mass_kg * motion.velocity_m_per_s
    np.testing.assert_allclose(mounts + given, momentum - momentum[0], atol=1e-12)
    assert np.linalg.norm(mounts, axis=1).max() > 0.1 * np.linalg.norm(momentum, axis=1).max()


def test_pads_are_compressed_between_shell_and_head(run: tuple[Path, RunSummary, Model]) -> None:
    folder, _, model = run
    pads = pd.read_csv(folder / "pads.csv")
    assert set(pads["part"]) == {p.name for p in model.parts if p.role in ("comfort_pad", "energy_pad", "chin_cup")}
    assert (pads[pads["time_s"] == 0][["compression_mean", "compression_max"]] == 0).all().all()
    assert 0.02 < pads["compression_mean"].max() < pads["compression_max"].max() < 0.95


def test_players_who_do_not_close_are_refused(play: Play, models: dict[str, Model]) -> None:
    starts = starts_of(play)
    starts["struck"] = dataclasses.replace(starts["struck"], velocity_m_per_s=starts["impactor"].velocity_m_per_s)
    with pytest.raises(InputError, match="the players do not close"):
        place(models, starts, play.collision)


def test_threads_and_a_restart_change_no_byte_of_a_collision(
    play: Play, scene: tuple[Model, dict], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, placement = scene
    problem = collision_problem(model, placement, controls_of(play, 5e-4, checkpoint_every_s=0.0), play)
    whole = solve(problem, tmp_path / "whole", threads=1, progress=None)
    two = solve(problem, tmp_path / "two", threads=2, progress=None)

    class HalfWay(run_module.Signals):
        count = 0

        def take(self) -> signal.Signals | None:
            HalfWay.count += 1
            return signal.SIGTERM if HalfWay.count == whole.steps // 2 else None

    with monkeypatch.context() as patch, pytest.raises(SystemExit):
        patch.setattr(run_module, "Signals", HalfWay)
        solve(problem, tmp_path / "halves", threads=1, progress=None)
    halves = solve(problem, tmp_path / "halves", threads=1, progress=None)
    assert whole.energies["contact_normal_J"] > 1.0, "they did strike"
    assert whole.state_hash == two.state_hash == halves.state_hash
    for name in ("contact.csv", "histories.csv", "energy.csv"):
        assert len({(tmp_path / run / name).read_bytes() for run in ("whole", "two", "halves")}) == 1
