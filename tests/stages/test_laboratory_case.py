"""A laboratory's test, from the play's description to the solver: a free ram, and a head that falls on an anvil."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replay.files import write_json
from replay.gates import Limits
from replay.measures import Motion, impulse_on
from replay.models import Model, assembly_mass, build_apparatus, build_model, load_apparatus
from replay.play import Play, load_play
from replay.solver import RunSummary, solve
from replay.stages.collision import collision_problem, contact_of_players
from replay.stages.decks import collision_deck
from replay.stages.frame import Workspace, stages_of
from replay.stages.impact import pad_recorder
from replay.stages.placement import _report, place
from replay.stages.players import ROLES, held_part, start_of
from replay.stages.problem import controls_of

FLIGHT_S = 2e-3
Case = tuple[Play, Model, dict, Path, RunSummary]


@pytest.fixture(scope="module")
def head() -> Model:
    return build_model("nfl", "tiny", brain="viscohyperelastic")


def scene_of(play: Play, head: Model) -> tuple[Model, dict]:
    assert play.collision is not None
    assert play.collision.apparatus is not None
    models = {"struck": head, "impactor": build_apparatus(play.collision.apparatus.name, "tiny")}
    starts = {role: start_of(play.collision, role, None, 0.0) for role in ROLES}
    scene, found, places = place(models, starts, play.collision)
    return scene, _report(scene, found, places, starts, play.collision)


@pytest.fixture(scope="module", params=["linear-impactor", "drop"])
def case(
    request: pytest.FixtureRequest, repository: Path, head: Model, tmp_path_factory: pytest.TempPathFactory
) -> Case:
    play = load_play(repository / "config" / "plays" / request.param)
    scene, placement = scene_of(play, head)
    folder = tmp_path_factory.mktemp(request.param)
    problem = collision_problem(scene, placement, controls_of(play, FLIGHT_S, checkpoint_every_s=0.0), play)
    summary = solve(problem, folder, recorders=[pad_recorder(scene)], threads=1, progress=None)
    return play, scene, placement, folder, summary


def test_the_axis_of_the_apparatus_meets_the_head_where_its_place_says(case: Case) -> None:
    play, _, placement, _, _ = case
    chosen = play.collision.apparatus
    way = load_apparatus(chosen.name).place(chosen.place).rotation.apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(placement["closing_velocity_m_per_s"], chosen.speed_m_per_s * way, atol=1e-12)
    tip = np.array(placement["players"]["impactor"]["head_cg_m"])
    np.testing.assert_allclose(np.cross(tip, way), 0.0, atol=1e-12)
    assert tip @ way < -0.1, "it stands outside the helmet, on the side from which it comes"
    assert placement["gap_m"] == pytest.approx(1e-3, abs=1e-8)
    assert placement["first_contact"]["impactor_part"] in ("cap", "pad")


def test_momentum_is_kept_unless_something_is_held(case: Case) -> None:
    play, scene, _, folder, summary = case
    energy = pd.read_csv(folder / "energy.csv")
    momentum = energy[[f"momentum_{axis}_N_s" for axis in "xyz"]].to_numpy()
    drift = np.abs(momentum - momentum[0]).max() / np.linalg.norm(momentum[0])
    held = held_part(scene)
    assert (held is None) == (play.collision.apparatus.name == "linear_impactor")
    assert (drift < 1e-10) if held is None else (drift > 0.05)
    assert energy["ratio"].between(0.999, 1.001).all()
    assert summary.contact["unconverged_share"] < 0.01


def test_what_is_held_does_not_move(case: Case) -> None:
    _, scene, _, folder, _ = case
    mount = next(part for part in scene.parts if part.role == "mount")
    motion = Motion.from_history(pd.read_csv(folder / "histories.csv"), mount.pid)
    moved = np.abs(motion.position_m - motion.position_m[0]).max()
    assert (moved < 1e-12) if held_part(scene) else (moved > 1e-2)


def test_the_blow_is_the_change_of_the_struck_players_momentum(case: Case) -> None:
    _, scene, placement, folder, _ = case
    own = {part.pid for part in scene.parts if part.player == 1}
    _, impulse = impulse_on(pd.read_csv(folder / "contact.csv"), own)
    closing = np.array(placement["closing_velocity_m_per_s"])
    assert impulse[-1] @ closing > 0, "it is pushed along"
    if held_part(scene):
        mass = assembly_mass(scene, player=1).mass_kg
        energy = pd.read_csv(folder / "energy.csv")
        start = -mass * closing
        np.testing.assert_allclose(energy[[f"momentum_{a}_N_s" for a in "xyz"]].to_numpy()[0], start, rtol=1e-9)
    assert np.linalg.norm(impulse[-1]) > 0.05 * assembly_mass(scene, player=1).mass_kg * np.linalg.norm(closing)


def test_the_foam_of_the_ram_is_recorded_and_crushed(case: Case) -> None:
    _, scene, _, folder, _ = case
    pads = pd.read_csv(folder / "pads.csv")
    foam = pads[pads["part"].isin([part.name for part in scene.parts if part.role == "cushion"])]
    assert len(foam) == 0 if held_part(scene) else foam["compression_mean"].max() > 0.2


def test_an_anvil_is_held_in_the_decks_too(case: Case) -> None:
    play, scene, placement, _, _ = case
    deck, held = collision_deck(play, scene, placement), held_part(scene)
    assert (deck.driver is None) == (held is None)
    if held is not None:
        assert deck.driver.pid == held.pid
        assert not deck.driver.velocity_m_per_s.any()
    number = scene.part_set_ids["apparatus"]
    assert [v.velocity_m_per_s for v in deck.initial_velocities if v.set_id == number] == [
        tuple(placement["players"]["impactor"]["velocity_m_per_s"])
    ]


def test_the_layers_of_an_apparatus_are_no_contact_even_of_a_helmet_seated_by_it(case: Case) -> None:
    play, scene, _, _, _ = case
    seated = dataclasses.replace(scene, info={**scene.info, "helmet_seat": "contact"})
    apart = [pair.name for pair in contact_of_players(seated, play).pairs if not pair.active]
    assert apart == ["within the impactor player"]


def test_a_play_without_a_record_has_no_stage_and_no_gate_that_reads_one(tmp_path: Path) -> None:
    for kind, present in (("none", False), ("wearable", True)):
        write_json(tmp_path / kind / "settings" / "play.json", {"source": {"kind": kind}, "collision": {"struck": {}}})
        here = stages_of(Workspace(kind, results=tmp_path))
        assert {"reconstruction", "fidelity"} & set(here) == ({"reconstruction", "fidelity"} if present else set())
        protocol = Limits.load(mode="collision", recorded=present).protocol
        assert {"reconstruction", "fidelity"} & set(protocol) == ({"reconstruction", "fidelity"} if present else set())
        assert {"placement", "numerics", "package"} <= set(protocol)
