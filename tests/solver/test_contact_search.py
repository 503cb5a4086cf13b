"""The pieces of contact against slow witnesses: surface, closest point, search."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from tests.contact_scenes import Block, Steps, elastic, scene

from replay.solver import ContactControls
from replay.solver.contact.surface import extract_surface
from replay.solver.kernels.contact_geometry import bilinear, by_triangles, closest, face_point

SOFT = elastic(1e7, 0.3, 1000.0)


def block(counts: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    problem = scene([Block(counts, tuple(0.01 * c for c in counts), (0, 0, 0), SOFT)], None)  # type: ignore[arg-type]
    return problem.nodes, problem.hexes


def test_the_surface_is_closed_and_looks_outward() -> None:
    nodes, hexes = block((4, 3, 2))
    surface = extract_surface(hexes, np.arange(len(hexes)) % 3, len(nodes))
    assert len(surface.faces) == 2 * (12 + 8 + 6)
    corners = nodes[surface.faces]
    area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    assert np.abs(area.sum(axis=0)).max() < 1e-18
    volume = (corners.mean(axis=1) * area).sum() / 3
    assert volume == pytest.approx(24e-6, rel=1e-12)
    assert (surface.neighbours >= 0).all()
    assert (np.diff(surface.part) >= 0).all()
    for k, face in enumerate(surface.faces):
        assert set(face) <= set(hexes[surface.element[k]])


def test_faces_between_parts_that_share_nodes_are_inside() -> None:
    nodes, hexes = block((2, 1, 1))
    surface = extract_surface(hexes, np.array([0, 1]), len(nodes))
    assert len(surface.faces) == 10
    assert len(np.unique(surface.body)) == 1


def test_closest_point_of_warped_faces() -> None:
    rng = np.random.default_rng(7)
    flat = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    for _ in range(200):
        corners = flat + rng.uniform(-0.35, 0.35, (4, 3))
        point = rng.uniform(-2, 2, 3)
        face = bilinear(*(tuple(c) for c in corners))
        u, v = closest(face, tuple(point))
        assert abs(u) <= 1 >= abs(v)
        found = np.linalg.norm(point - face_point(face, u, v))
        starts = [(a, b) for a in (-0.7, 0.0, 0.7) for b in (-0.7, 0.0, 0.7)]
        best = min(
            minimize(lambda q, f=face, p=point: np.sum((p - face_point(f, *q)) ** 2), s, bounds=[(-1, 1)] * 2).fun
            for s in starts
        )
        # far off a strongly warped face there can be two minima; close to it there is one
        if np.sqrt(best) < 0.7:
            assert found == pytest.approx(np.sqrt(best), abs=1e-6)


def test_the_fallback_is_near_the_closest_point_of_a_flat_face() -> None:
    rng = np.random.default_rng(8)
    face = bilinear((-1.0, -1.0, 0.0), (1.2, -1.0, 0.0), (1.0, 1.1, 0.0), (-1.0, 1.0, 0.0))
    for point in rng.uniform(-2, 2, (100, 3)):
        a = np.array(face_point(face, *closest(face, tuple(point))))
        b = np.array(face_point(face, *by_triangles(face, tuple(point))))
        assert np.linalg.norm(point - b) <= np.linalg.norm(point - a) * 1.1 + 0.02


def test_the_search_finds_every_face_a_dumb_one_finds() -> None:
    rng = np.random.default_rng(3)
    blocks = [
        Block((2 + k % 3, 2, 3), (0.02 * (1 + k % 4), 0.02, 0.03), rng.uniform(-0.04, 0.04, 3), SOFT,
              velocity=rng.uniform(-1, 1, 3), turn_deg=rng.uniform(-90, 90, 3))
        for k in range(6)
    ]  # fmt: skip
    march = Steps(scene(blocks, ContactControls(friction=0.1, pairs=())), check=False)
    contact = march.run.contact
    assert contact is not None
    search, surface = contact._search, contact.surface
    march.run.forces()
    search.update(march.run.nodal, 1e-6, 1e-3)
    places = march.run.nodal[:, :3]
    margin = search._margin
    low = places[surface.faces].min(axis=1) - margin
    high = places[surface.faces].max(axis=1) + margin
    own = surface.point_bodies()
    for point in np.flatnonzero(search._awake):
        within = ((search.points[point] >= low) & (search.points[point] <= high)).all(axis=1)
        expected = np.flatnonzero(within & (surface.body != own[point]))
        found = search.candidates[search.first[point] : search.first[point + 1]]
        assert found.tolist() == expected.tolist()


def test_the_list_is_made_anew_before_anything_comes_close_unseen() -> None:
    blocks = [
        Block((2, 2, 2), (0.02, 0.02, 0.02), (0, 0, 0.05), SOFT, (0, 0, -20.0), turn_deg=(10, 5, 3)),
        Block((3, 3, 2), (0.03, 0.03, 0.02), (0, 0, 0), SOFT),
    ]
    march = Steps(scene(blocks, ContactControls())).until(3e-3)
    contact = march.run.contact
    assert contact is not None
    assert contact.counts[0] > 0
    assert contact.penetration_over_edge < 0.05
    assert 2 < contact._search.built < march.run.step
    # a common motion of both costs nothing
    together = [Block(b.counts, b.lengths, b.centre, SOFT, (300.0, 0, 0), turn_deg=b.turn_deg) for b in blocks]
    march = Steps(scene(together, ContactControls())).until(3e-3)
    assert march.run.contact is not None
    assert march.run.contact._search.built == 1
