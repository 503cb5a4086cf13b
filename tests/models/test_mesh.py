"""The mesh is conforming, symmetric, good, and converges to the surfaces it samples."""

from __future__ import annotations

import numpy as np
import pytest

from replay.models import Model, build_model
from replay.models.cubed_sphere import cube_lattice
from replay.models.guard import relocate_worst_nodes
from replay.models.head_shape import preset_names
from replay.models.ogrid import Resolution, head_mesh
from replay.models.preview import outer_faces
from replay.models.quality import FACES, aspect_ratios, characteristic_lengths, hex_volumes, scaled_jacobians
from replay.models.radial import Ellipsoid, RadialSurfaces

FLOORS = {
    # least scaled Jacobian, 1 %, mean, largest aspect ratio
    "tiny": (0.45, 0.60, 0.88, 10.5),
    "coarse": (0.40, 0.65, 0.90, 9.0),
    "medium": (0.35, 0.65, 0.90, 9.0),
}


@pytest.mark.parametrize("preset", preset_names())
@pytest.mark.parametrize("resolution", list(FLOORS))
def test_quality_is_above_its_floor_in_every_preset(preset: str, resolution: str) -> None:
    model = build_model(preset, resolution)
    quality = scaled_jacobians(model.nodes, model.hexes)
    least, one_percent, mean, aspect = FLOORS[resolution]
    assert quality.min() >= least
    assert np.percentile(quality, 1) >= one_percent
    assert quality.mean() >= mean
    assert aspect_ratios(model.nodes, model.hexes).max() <= aspect
    assert hex_volumes(model.nodes, model.hexes).min() > 0
    assert model.info["guard_moved_nodes"] == 0


@pytest.mark.slow
def test_the_fine_mesh_is_as_good_as_the_others() -> None:
    model = build_model("nfl", "fine")
    quality = scaled_jacobians(model.nodes, model.hexes)
    assert quality.min() >= 0.40
    assert np.percentile(quality, 1) >= 0.65
    assert quality.mean() >= 0.90
    assert aspect_ratios(model.nodes, model.hexes).max() <= 9.0
    assert model.info["guard_moved_nodes"] == 0


def test_every_inner_face_is_shared_by_exactly_two_hexes_and_seen_from_both_sides(model: Model) -> None:
    faces = model.hexes[:, FACES].reshape(-1, 4)
    key = np.sort(faces, axis=1)
    _, inverse, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    assert set(count.tolist()) == {1, 2}
    # Opposite senses: turned so that the smallest node comes first, one's second node is the other's last.
    first = faces.argmin(axis=1)
    second = np.take_along_axis(faces, ((first + 1) % 4)[:, None], axis=1)[:, 0]
    last = np.take_along_axis(faces, ((first + 3) % 4)[:, None], axis=1)[:, 0]
    order = np.argsort(inverse.ravel(), kind="stable")
    order = order[count[inverse.ravel()[order]] == 2].reshape(-1, 2)
    np.testing.assert_array_equal(second[order[:, 0]], last[order[:, 1]])


def test_there_is_no_unused_doubled_or_hanging_node(model: Model) -> None:
    assert set(np.unique(model.hexes).tolist()) == set(range(len(model.nodes)))
    rounded = np.round(model.nodes, 7)
    assert len(np.unique(rounded, axis=0)) == len(rounded)
    # A hanging node would lie on the middle of an edge or a face of the surface.
    faces, _ = outer_faces(model.hexes)
    corners = model.nodes[faces]
    middles = np.vstack([corners.mean(axis=1), *[(corners[:, k] + corners[:, k - 1]) / 2 for k in range(4)]])
    assert not {tuple(p) for p in np.round(middles, 7)} & {tuple(p) for p in rounded}


def test_the_head_has_one_closed_surface_and_is_whole(model: Model) -> None:
    faces, _ = outer_faces(model.hexes[model.elements_of(assembly="head")])
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count.tolist()) == {2}
    assert len(np.unique(faces)) - len(count) + len(faces) == 2  # Euler: a sphere


def test_all_elements_hang_together_by_faces(model: Model) -> None:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces = np.sort(model.hexes[:, FACES].reshape(-1, 4), axis=1)
    _, inverse = np.unique(faces, axis=0, return_inverse=True)
    owner = np.repeat(np.arange(len(model.hexes)), 6)
    table = coo_array((np.ones(len(owner)), (owner, inverse.ravel()))).tocsr()
    count, _ = connected_components(table @ table.T, directed=False)
    assert count == 1


def test_left_is_the_mirror_image_of_right(model: Model) -> None:
    ours = np.round(model.nodes, 9)
    image = np.round(model.nodes * [1, -1, 1], 9) + 0.0
    np.testing.assert_allclose(ours[np.lexsort(ours.T)], image[np.lexsort(image.T)], atol=2e-9)
    volume = hex_volumes(model.nodes, model.hexes)
    names = [part.name for part in model.parts]
    for k, name in enumerate(names):
        if name.endswith("_left"):
            other = names.index(name.replace("_left", "_right"))
            left, right = volume[model.element_part == k].sum(), volume[model.element_part == other].sum()
            assert left == pytest.approx(right, rel=1e-9)


def test_the_mid_sagittal_plane_cuts_no_head_element(model: Model) -> None:
    side = model.nodes[model.hexes[model.elements_of(assembly="head")], 1]
    assert not ((side.min(axis=1) < -1e-9) & (side.max(axis=1) > 1e-9)).any()


def test_volume_of_layers_converges_with_second_order() -> None:
    shapes = [Ellipsoid((a, b, c)) for a, b, c in ((0.082, 0.061, 0.057), (0.087, 0.065, 0.061), (0.10, 0.08, 0.07))]
    surfaces = RadialSurfaces(*shapes, Ellipsoid((0.11, 0.09, 0.08)), (0, 0, 0), (0, 0, 0), 1.0, 0.0)
    exact = np.array([shapes[0].volume_m3, shapes[1].volume_m3 - shapes[0].volume_m3])
    errors = []
    for divisions in (6, 12, 24):
        lattice = cube_lattice(divisions)
        setting = Resolution(divisions, 2, 1, 1, 1, 1, 1, 0.02)
        mesh = head_mesh(lattice, surfaces, setting, lattice.directions, {"csf": 0.0, "skull": 0.0, "scalp": 0.0})
        volume = np.bincount(mesh.tissue, weights=hex_volumes(mesh.nodes, mesh.hexes))[:2]
        errors.append(np.abs(volume - exact) / exact)
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (rates > 1.9).all(), rates
    assert (errors[-1] < 3e-3).all()


def test_the_lower_edge_of_the_shell_has_no_stair_steps(coarse: Model) -> None:
    """Turning angles along the edge: below 35 degrees but for the corners that the coverage curve has itself."""
    edge = max(edges_of_shell(coarse), key=len)
    assert (
        turning_deg(coarse.nodes[edge]) > 35
    ).sum() == 4  # two concave corners at the brow, two convex under the flaps


@pytest.mark.parametrize(("resolution", "sharpest_deg"), [("coarse", 86), ("medium", 68)])
def test_the_shell_is_open_over_each_ear_with_round_corners(resolution: str, sharpest_deg: float) -> None:
    model = build_model("nfl", resolution)
    loops = sorted(edges_of_shell(model), key=len)
    assert len(loops) == 3
    for loop in loops[:2]:
        points = model.nodes[loop]
        size = np.ptp(points, axis=0)
        assert 0.015 < size[0] < 0.045
        assert 0.015 < size[2] < 0.045
        assert turning_deg(points).max() < sharpest_deg  # a square's is 90
        # over the ear point, as seen from the side
        assert np.abs(points.mean(axis=0) - model.info["tragion_m"])[[0, 2]].max() < 0.025
    np.testing.assert_allclose(*(np.abs(model.nodes[loop].mean(axis=0)) for loop in loops[:2]), atol=1e-8)


def edges_of_shell(model: Model) -> list[list[int]]:
    """Loops of nodes around the outer surface of the shell."""
    from replay.models.helmet_layout import boundary_edges

    edges = boundary_edges(model.hexes[model.elements_of(role="shell")][:, 4:])
    follow = {int(a): int(b) for a, b in edges}
    loops = []
    while follow:
        loop = [next(iter(follow))]
        while (node := follow.pop(loop[-1])) != loop[0]:
            loop.append(node)
        loops.append(loop)
    return loops


def turning_deg(points: np.ndarray) -> np.ndarray:
    """Angle by which a closed line turns at each of its points [degrees]."""
    step = np.roll(points, -1, axis=0) - points
    step /= np.linalg.norm(step, axis=1)[:, None]
    return np.degrees(np.arccos(np.clip(np.sum(step * np.roll(step, 1, axis=0), axis=1), -1, 1)))


def test_facemask_bars_keep_the_time_step_above_the_floor(model: Model) -> None:
    mask = model.hexes[model.elements_of(role="facemask")]
    assert characteristic_lengths(model.nodes, mask).min() > 0.005


def test_guard_mends_a_spoiled_mesh_and_leaves_a_good_one_alone() -> None:
    lattice = cube_lattice(4)
    same, moved = relocate_worst_nodes(lattice.cube, lattice.cells)
    assert moved == 0
    assert same is lattice.cube
    spoiled = lattice.cube.copy()
    centre = int(np.flatnonzero((lattice.cube == 0).all(axis=1))[0])
    spoiled[centre] += [0.45, 0.3, 0.2]
    assert scaled_jacobians(spoiled, lattice.cells).min() < 0.3
    mended, moved = relocate_worst_nodes(spoiled, lattice.cells)
    assert scaled_jacobians(mended, lattice.cells).min() >= 0.3
    assert 1 <= moved <= 27


def test_an_odd_lattice_is_refused() -> None:
    with pytest.raises(ValueError, match="even number"):
        cube_lattice(5)
