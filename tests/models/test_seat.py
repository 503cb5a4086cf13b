"""The two seats of the helmet: on the scalp's nodes, or touching it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from replay.models import Model, assembly_inspection, build_model
from replay.models.quality import FACES


@pytest.fixture(scope="module")
def seated() -> Model:
    return build_model("nfl", "tiny", seat="contact")


def places(model: Model, **chosen: str) -> np.ndarray:
    """Corners of the hexes of an assembly or a role, to 0.1 um."""
    return np.round(model.nodes[model.hexes[model.elements_of(**chosen)]], 7)


def test_both_seats_are_the_same_bodies_with_and_without_common_nodes(tiny: Model, seated: Model) -> None:
    np.testing.assert_array_equal(places(seated), places(tiny))
    for model, common in ((tiny, True), (seated, False)):
        head, helmet = (np.unique(model.hexes[model.elements_of(assembly=name)]) for name in ("head", "helmet"))
        assert bool(len(np.intersect1d(head, helmet))) is common


@pytest.mark.parametrize("role", ["comfort_pad", "chin_cup"])
def test_pads_and_chin_cup_touch_the_scalp_with_nodes_of_their_own(seated: Model, role: str) -> None:
    skin = {tuple(p) for part in ("scalp", "face") for p in places(seated, role=part).reshape(-1, 3)}
    sole = np.unique(places(seated, role=role).reshape(-1, 8, 3)[:, :4].reshape(-1, 3), axis=0)
    assert sum(tuple(p) in skin for p in sole) > 8


def test_a_seated_helmet_has_no_doubled_node(seated: Model) -> None:
    for assembly in ("head", "helmet"):
        used = np.unique(seated.hexes[seated.elements_of(assembly=assembly)])
        assert len(np.unique(np.round(seated.nodes[used], 7), axis=0)) == len(used)


def test_head_helmet_and_chin_cup_are_one_piece_each(seated: Model) -> None:
    faces = np.sort(seated.hexes[:, FACES].reshape(-1, 4), axis=1)
    _, inverse = np.unique(faces, axis=0, return_inverse=True)
    owner = np.repeat(np.arange(len(seated.hexes)), 6)
    table = coo_array((np.ones(len(owner)), (owner, inverse.ravel()))).tocsr()
    count, piece = connected_components(table @ table.T, directed=False)
    cup, helmet = seated.elements_of(role="chin_cup"), seated.elements_of(assembly="helmet")
    assert count == 3
    assert [len(set(piece[chosen].tolist())) for chosen in (~helmet, helmet & ~cup, cup)] == [1, 1, 1]


def test_the_straps_hold_the_chin_cup(seated: Model) -> None:
    assert assembly_inspection(seated)["unconnected_parts"] == 0
    assert assembly_inspection(replace(seated, node_sets={}))["unconnected_parts_detail"] == "chin_cup"


def test_a_seat_that_nobody_built_is_refused() -> None:
    with pytest.raises(ValueError, match="no helmet seat 'glued'"):
        build_model("nfl", "tiny", seat="glued")
