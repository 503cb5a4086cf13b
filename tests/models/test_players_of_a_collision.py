"""The impactor's parts are known by their numbers, and one in a wrong block is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.models import Model, assembly_mass, placed, second_player, together
from replay.models.inspection import parts_outside_block


@pytest.fixture(scope="module")
def pair(tiny: Model) -> Model:
    turn = Rotation.from_euler("y", 90, degrees=True)
    return together([tiny, placed(second_player(tiny), np.array([0.7, 0.0, 0.0]), turn)])


def test_each_players_elements_are_found_by_number(pair: Model, tiny: Model) -> None:
    struck, impactor = (pair.elements_of(role="brain", player=player) for player in (1, 2))
    assert struck.sum() == impactor.sum() == tiny.elements_of(role="brain").sum()
    assert not (struck & impactor).any()
    masses = [assembly_mass(pair, player=player).mass_kg for player in (1, 2)]
    assert masses[0] == pytest.approx(masses[1], rel=1e-12)


def test_parts_lie_in_their_players_block_and_one_that_does_not_is_named(pair: Model) -> None:
    assert parts_outside_block(pair) == []
    first = pair.parts[0]
    strayed = replace(pair, parts=(replace(first, assembly="helmet"), *pair.parts[1:]))
    assert parts_outside_block(strayed) == [first.name]
