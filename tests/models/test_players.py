"""Two players in one model: numbers, names and masses of both, and nothing shared but materials."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.models import Model, assembly_mass, parts_outside_block
from replay.models.players import as_impactor, joined, placed


@pytest.fixture(scope="module")
def pair(tiny: Model) -> Model:
    return joined(tiny, placed(as_impactor(tiny), Rotation.from_euler("y", 90, degrees=True), np.array([0.7, 0, 0])))


def test_both_players_have_the_articles_numbers(pair: Model) -> None:
    assert parts_outside_block(pair) == []
    for numbers in (pair.node_ids, pair.element_ids, np.array([part.pid for part in pair.parts])):
        assert len(np.unique(numbers)) == len(numbers)
    pids = {part.name: part.pid for part in pair.parts}
    assert (pids["scalp"], pids["impactor_scalp"]) == (60009020, 40009020)
    assert (pids["shell"], pids["impactor_shell"]) == (10000001, 20000001)


def test_a_part_outside_its_players_block_is_named(tiny: Model) -> None:
    from dataclasses import replace

    strayed = replace(tiny, parts=tuple(replace(part, player="impactor") for part in tiny.parts[:1]) + tiny.parts[1:])
    assert parts_outside_block(strayed) == [tiny.parts[0].name]


def test_sets_of_the_second_player_are_the_articles_number_two(pair: Model) -> None:
    assert set(pair.part_sets["H2_pads_set1"]) == {pid + 10_000_000 for pid in pair.part_sets["H1_pads_set1"]}
    assert pair.part_set_ids["H2_pads_set1"] == 20000099
    assert set(pair.part_sets["all_parts"]) == {part.pid for part in pair.parts}
    assert len(set(pair.part_set_ids.values())) == len(pair.part_set_ids)


def test_the_impactor_is_the_struck_player_turned_and_moved(pair: Model, tiny: Model) -> None:
    struck, impactor = (assembly_mass(pair, player=player) for player in ("struck", "impactor"))
    assert impactor.mass_kg == pytest.approx(struck.mass_kg, rel=1e-12)
    turned = Rotation.from_euler("y", 90, degrees=True).apply(struck.cg_m) + np.array([0.7, 0, 0])
    np.testing.assert_allclose(impactor.cg_m, turned, atol=1e-9)
    np.testing.assert_allclose(impactor.principal_kg_m2, struck.principal_kg_m2, rtol=1e-6)
    np.testing.assert_array_equal(pair.nodes[: len(tiny.nodes)], tiny.nodes)


def test_materials_that_differ_stay_apart(tiny: Model) -> None:
    from dataclasses import replace

    soft = {name: {**facts} for name, facts in tiny.materials.items()}
    soft["energy_foam"] = {**soft["energy_foam"], "density_kg_per_m3": 50.0}
    both = joined(tiny, as_impactor(replace(tiny, materials=soft)))
    assert both.materials["impactor_energy_foam"]["density_kg_per_m3"] == 50.0
    assert both.materials["energy_foam"] == tiny.materials["energy_foam"]
    used = {part.material for part in both.parts if part.player == "impactor"}
    assert {name for name in used if name.startswith("impactor_")} == {"impactor_energy_foam"}
