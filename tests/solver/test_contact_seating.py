"""Initial penetration: small overlaps are projected away and told, large ones refused with parts and places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.contact_scenes import Block, Steps, elastic, rigid, scene

from replay.errors import InputError
from replay.solver import ContactControls, Problem
from replay.solver.contact.projection import PENETRATION_TABLE, penetration_table, seat, seated

SOFT = elastic(1e7, 0.3, 1000.0)


def overlapping(depth: float, lower: object = SOFT) -> Problem:
    """A block of 10 mm elements sunk into one of 12 mm elements."""
    blocks = [
        Block((3, 3, 3), (0.03, 0.03, 0.03), (0.002, 0.001, 0.015 - depth), SOFT, turn_deg=(0, 0, 15)),
        Block((5, 5, 3), (0.06, 0.06, 0.036), (0, 0, -0.018), lower),  # type: ignore[arg-type]
    ]
    return scene(blocks, ContactControls())


def test_one_millimetre_is_projected_away_and_reported(tmp_path: Path) -> None:
    problem = overlapping(1e-3)
    clear, found = seated(problem)
    assert found.deepest_before_m == pytest.approx(1e-3, rel=1e-6)
    assert found.deepest_m == 0.0
    assert 0.01 < found.share_moved < 0.3
    assert found.volume_ratio > 0.8
    # nothing moved but the nodes in the report, and they moved along the normal
    away = clear.nodes - problem.nodes
    assert np.flatnonzero(np.abs(away).max(axis=1)).tolist() == found.rows[found.moved_m > 0].tolist()
    assert np.abs(away[:, :2]).max() < 0.1 * np.abs(away[:, 2]).max()
    # momentum of the move: neither side is dragged along
    PENETRATION_TABLE.write(tmp_path / "penetrations.csv", penetration_table(found, problem))
    table = PENETRATION_TABLE.read(tmp_path / "penetrations.csv")
    assert set(table["part"]) == {"block 1", "block 2"}
    assert table["depth_m"].max() == pytest.approx(1e-3, rel=1e-6)
    assert set(table[table["depth_m"] > 0]["other_part"]) <= {"block 1", "block 2"}
    # and the solver starts from it without a push
    march = Steps(clear).until(2e-4)
    assert march.run.energies().kinetic < 1e-18


def test_ten_millimetres_are_refused_with_parts_and_places() -> None:
    with pytest.raises(InputError, match=r"block 1 .*mm inside block 2 at \(") as refusal:
        seated(overlapping(10e-3))
    assert "0.3 of a node's shortest edge" in str(refusal.value)
    assert "seat the parts apart" in str(refusal.value)


def test_a_rigid_part_does_not_give_way() -> None:
    problem = overlapping(1e-3, rigid(1000.0))
    clear, found = seated(problem)
    moved = np.abs(clear.nodes - problem.nodes).max(axis=1) > 0
    assert not moved[np.unique(problem.hexes[problem.element_part == 1])].any()
    assert found.deepest_m == 0.0


def test_two_rigid_parts_inside_each_other_are_refused() -> None:
    blocks = [Block((1, 1, 1), (0.02, 0.02, 0.02), (0.001, 0, z), rigid(1000.0)) for z in (0.0, 0.0195)]
    with pytest.raises(InputError, match="lie inside each other"):
        seated(scene(blocks, ContactControls()))


def test_parts_that_touch_or_stand_apart_are_left_alone() -> None:
    for gap in (0.0, 1e-3):
        problem = overlapping(-gap)
        clear, found = seated(problem)
        assert clear is problem
        assert not len(found.rows)
        assert found.sound


def test_parts_of_one_mesh_do_not_penetrate_each_other() -> None:
    problem = overlapping(-1e-3)
    assert seat(problem).deepest_before_m == 0.0


def test_a_run_that_starts_inside_is_refused() -> None:
    with pytest.raises(InputError, match="block 1 .*inside block 2"):
        Steps(overlapping(1e-3))
