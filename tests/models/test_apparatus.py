"""The laboratory's apparatus: its volumes and masses, its mesh at every resolution, its numbers."""

from __future__ import annotations

import numpy as np
import pytest

from replay.errors import InputError
from replay.models import (
    apparatus_inspection,
    apparatus_names,
    assembly_mass,
    build_apparatus,
    build_model,
    load_apparatus,
    read_model,
    together,
    write_model,
)
from replay.models.apparatus import DIVISIONS
from replay.models.numbering import APPARATUS
from replay.models.quality import aspect_ratios, hex_volumes, scaled_jacobians


@pytest.mark.parametrize("resolution", DIVISIONS)
@pytest.mark.parametrize("name", apparatus_names())
def test_every_apparatus_is_a_good_mesh_at_every_resolution(name: str, resolution: str) -> None:
    model = build_apparatus(name, resolution)
    assert scaled_jacobians(model.nodes, model.hexes).min() > 0.6
    assert aspect_ratios(model.nodes, model.hexes).max() < 8.0
    assert hex_volumes(model.nodes, model.hexes).min() > 0.0
    assert len(np.unique(model.hexes)) == len(model.nodes)
    told = apparatus_inspection(model)
    assert told["unconnected_parts"] == told["parts_outside_block"] == told["duplicate_part_ids"] == 0


def test_foam_and_cap_of_the_linear_impactor_are_those_of_the_articles_table_1() -> None:
    """Beside the article's volumes the cap has a rim 3 mm thick: 38 mL, for a feather edge is no hex."""
    model = build_apparatus("linear_impactor", "fine")
    volume = hex_volumes(model.nodes, model.hexes)
    cap, foam, _ = (volume[model.element_part == k].sum() for k in range(3))
    rim = np.pi * 0.0635**2 * 0.003
    assert foam == pytest.approx(4.43e-4, rel=0.005)
    assert cap - rim == pytest.approx(1.10e-4, rel=0.01)
    assert foam * model.materials["vn_600"]["density_kg_per_m3"] == pytest.approx(0.04, abs=0.005)


def test_the_dome_converges_to_the_spherical_segment() -> None:
    radius, face = 0.0635, 0.127
    height = face - np.sqrt(face**2 - radius**2)
    exact = np.pi * height / 6 * (3 * radius**2 + height**2) + np.pi * radius**2 * 0.003
    errors = []
    for resolution in DIVISIONS:
        model = build_apparatus("linear_impactor", resolution)
        errors.append(abs(hex_volumes(model.nodes, model.hexes)[model.element_part == 0].sum() / exact - 1))
    rate = np.log(errors[0] / errors[-1]) / np.log(DIVISIONS["fine"] / DIVISIONS["tiny"])
    assert rate == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("resolution", ["tiny", "fine"])
def test_the_ram_has_its_mass_on_its_axis(resolution: str) -> None:
    found = assembly_mass(build_apparatus("linear_impactor", resolution))
    assert found.mass_kg == pytest.approx(load_apparatus("linear_impactor").mass_kg, rel=1e-12)
    assert np.abs(found.cg_m[1:]).max() < 1e-12
    assert found.inertia_kg_m2[1, 1] == pytest.approx(found.inertia_kg_m2[2, 2], rel=1e-9)


def test_an_apparatus_stands_beside_a_player_under_numbers_of_its_own(tmp_path) -> None:
    ram = build_apparatus("linear_impactor", "tiny")
    scene = together([build_model("nfl", "tiny"), ram])
    assert {part.player for part in scene.parts if part.assembly == "apparatus"} == {2}
    assert min(scene.part_sets["apparatus"]) > APPARATUS
    write_model(tmp_path / "ram.h5", ram)
    again = read_model(tmp_path / "ram.h5")
    np.testing.assert_array_equal(again.nodes, ram.nodes)
    assert again.materials == ram.materials


@pytest.mark.parametrize("name", apparatus_names())
def test_a_place_points_from_where_the_apparatus_comes_to_the_head(name: str) -> None:
    for place in load_apparatus(name).places.values():
        azimuth, elevation = np.radians(place.from_deg)
        outward = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        np.testing.assert_allclose(place.rotation.apply([1.0, 0.0, 0.0]), -np.array(outward), atol=1e-12)


def test_an_unknown_apparatus_or_place_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(InputError, match="drop_anvil, linear_impactor"):
        load_apparatus("pendulum")
    with pytest.raises(InputError, match=r"(?s)no place 'chin'.*rear_oblique"):
        load_apparatus("linear_impactor").place("chin")
