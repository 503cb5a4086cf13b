"""First contact: known distances of boxes, a dumb reference for triangles, and players who pass each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.models.first_contact import first_contact, skin_of, triangle_distances

CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float
) - 0.5  # fmt: skip
HEX = np.arange(8)[None]
X = np.array([1.0, 0.0, 0.0])


def box(rotation: Rotation, centre: tuple[float, float, float]):
    return skin_of(rotation.apply(0.1 * CUBE) + centre, HEX)


def test_two_boxes_face_to_face_are_left_the_gap_apart() -> None:
    still = box(Rotation.identity(), (0, 0, 0))
    found = first_contact(still, box(Rotation.identity(), (-0.4, 0.01, 0.02)), X, 1e-3)
    assert found.travel_m == pytest.approx(0.4 - 0.1 - 1e-3, abs=1e-8)
    assert found.gap_m == pytest.approx(1e-3, abs=1e-8)


def test_a_corner_meets_a_face() -> None:
    tip = Rotation.align_vectors([X], [np.ones(3)])[0]  # the diagonal along the motion
    found = first_contact(box(Rotation.identity(), (0, 0, 0)), box(tip, (-0.5, 0.012, 0.007)), X, 1e-3)
    assert found.travel_m == pytest.approx(0.5 - 0.05 - 0.05 * np.sqrt(3) - 1e-3, abs=1e-8)


def test_two_edges_that_cross_meet_where_no_corner_is() -> None:
    upright = Rotation.from_euler("z", 45, degrees=True)
    lying = Rotation.from_euler("y", 45, degrees=True)
    found = first_contact(box(upright, (0, 0, 0)), box(lying, (-0.5, 0.011, -0.013)), X, 1e-3)
    assert found.travel_m == pytest.approx(0.5 - 0.1 * np.sqrt(2) - 1e-3, abs=1e-8)
    np.testing.assert_allclose(found.point_m[1:], [0.0, -0.013], atol=1e-8)


def test_a_slanted_approach_leaves_the_gap_and_not_more() -> None:
    slanted = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    start = box(Rotation.identity(), (-0.4, -0.38, 0.0))
    found = first_contact(box(Rotation.identity(), (0, 0, 0)), start, slanted, 1e-3)
    assert found.gap_m == pytest.approx(1e-3, abs=1e-8)
    assert found.travel_m == pytest.approx((0.4 - 0.1 - 1e-3) * np.sqrt(2), abs=1e-7)


def test_players_who_pass_each_other_are_refused_with_their_closest_distance() -> None:
    start = box(Rotation.identity(), (-0.4, 0.12, 0.0))
    with pytest.raises(InputError, match="pass each other at 20 mm"):
        first_contact(box(Rotation.identity(), (0, 0, 0)), start, X, 1e-3)


def test_players_who_begin_too_near_are_refused() -> None:
    with pytest.raises(InputError, match="begin 0.5 mm apart"):
        first_contact(box(Rotation.identity(), (0, 0, 0)), box(Rotation.identity(), (-0.1005, 0, 0)), X, 1e-3)


def test_distance_of_triangles_is_that_of_their_densest_points() -> None:
    rng = np.random.default_rng(3)
    first = rng.normal(size=(40, 3, 3))
    second = rng.normal(size=(40, 3, 3)) + np.array([0, 0, 6.0])
    u, v = np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60))
    inside = u + v <= 1 + 1e-12
    weights = np.stack([1 - u - v, u, v], axis=-1)[inside]
    found, middle = triangle_distances(first, second)
    for k in range(40):
        a, b = weights @ first[k], weights @ second[k]
        sampled = np.sqrt(((a[:, None] - b) ** 2).sum(axis=2)).min()
        assert found[k] <= sampled + 1e-12
        assert found[k] == pytest.approx(sampled, rel=0.03)
    assert middle.shape == (40, 3)
