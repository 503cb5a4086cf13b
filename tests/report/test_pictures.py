"""Pictures of the model: sections and surfaces are where geometry puts them."""

from __future__ import annotations

import dataclasses

import finished_play as example
import numpy as np
import pandas as pd
import pytest

from replay.report.damage import damage_section
from replay.report.figure import Picture
from replay.report.head_view import _spread, section, sections_picture, surface
from replay.report.markup import fixed, label, limit, number, scientific, unit
from replay.report.model import MeshView, Snapshots


def block(cells: int = 3, size_m: float = 0.06) -> MeshView:
    """A cube about the origin."""
    c = np.linspace(-size_m / 2, size_m / 2, cells + 1)
    nodes = np.stack(np.meshgrid(c, c, c, indexing="ij"), axis=-1).reshape(-1, 3)
    at = np.arange((cells + 1) ** 3).reshape((cells + 1,) * 3)
    i, j, k = (a.ravel() for a in np.meshgrid(*([np.arange(cells)] * 3), indexing="ij"))
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    hexes = np.stack([at[i + a, j + b, k + d] for a, b, d in corners], axis=1)
    return MeshView(nodes, hexes, np.full(len(hexes), "brain"))


def area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))


@pytest.mark.parametrize("plane", ["sagittal", "coronal", "axial"])
@pytest.mark.parametrize("cells", [3, 4])
def test_section_of_a_cube_is_a_square_even_along_faces(plane, cells):
    """With four cells the middle plane runs along faces that two elements share."""
    polygons, rows = section(block(cells), plane)
    assert len(rows) == cells**2
    assert sum(area(p) for p in polygons) == pytest.approx(60.0**2, rel=1e-9)


def test_slanted_section_of_a_turned_cube_has_the_area_of_the_hexagon():
    """A cube stood on a corner, cut through its middle: side a / sqrt 2, area 3 sqrt 3 / 4 a^2."""
    view = block(1, 0.1)
    z = np.array([1.0, 1.0, 1.0]) / np.sqrt(3)
    x = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    turned = MeshView(view.nodes @ np.stack([x, np.cross(z, x), z], axis=1), view.hexes, view.element_role)
    polygons, _ = section(turned, "axial")
    assert len(polygons[0]) == 6
    assert area(polygons[0]) == pytest.approx(3 * np.sqrt(3) / 4 * 100.0**2, rel=1e-6)


def test_section_beside_the_model_is_empty():
    polygons, rows = section(block(), "axial", 0.1)
    assert polygons == []
    assert rows.size == 0


def test_surface_of_a_block_is_its_outside_seen_from_outside():
    view = block()
    faces, elements = surface(view.hexes)
    assert len(faces) == 6 * 9
    corner = view.nodes[faces]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    assert ((normal * corner.mean(axis=1)).sum(axis=1) > 0).all()
    assert set(elements) <= set(range(27)) - {13}


def test_pictures_of_strain_include_the_moment_of_greatest_strain():
    view = example.mesh()
    found = example.snapshots(view)
    chosen = _spread(found, 4)
    assert len(chosen) == 4
    assert int(np.argmax(found.values.max(axis=1))) in chosen
    assert chosen[-1] == len(found.time_s) - 1


def test_few_snapshots_are_all_drawn():
    view = block()
    few = Snapshots(np.array([0.0, 1e-3]), np.arange(27), np.linspace(0, 0.2, 54).reshape(2, 27))
    picture = sections_picture(view, few, "strain")
    assert "0.0, 1.0 ms" in picture.alt
    assert "0.0981, 0.2" in picture.alt


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, "–"),
        (True, "yes"),
        (float("nan"), "–"),
        (0.0, "0"),
        (-0.2, "−0.2"),
        (12345.0, "12345"),
        (1.92e-7, "1.92 × 10⁻⁷"),
        (2.19e9, "2.19 × 10⁹"),
        (185858, "185\u202f858"),
        (np.float64(0.5), "0.5"),
        ("a<b", "a&lt;b"),
    ],
)
def test_number_is_printed_as_a_person_reads_it(value, shown):
    assert number(value) == shown


def test_powers_of_ten_units_and_labels():
    assert scientific(1.19e-3) == "1.19 × 10⁻³"
    assert unit("m/s^2") == "m/s²"
    assert unit("1") == ""
    assert label("reprojection_rmse_median_px", "px") == "reprojection rmse median"
    assert label("frames_above_8_px", "frames") == "frames above 8 px"
    assert label("hourglass_share: energy_pad", "1") == "hourglass share: energy pad"


def test_limits_and_differences_are_printed_as_in_a_book():
    assert limit(">= 1e-07") == "≥ 10⁻⁷"
    assert limit("<= 2.5e-10 (fails unless <= 0.1)") == "≤ 2.5 × 10⁻¹⁰ (fails unless ≤ 0.1)"
    assert limit("-10 to 10") == "−10 to 10"
    assert fixed(8.7e-16) == "+0.00"
    assert fixed(-7.25, 1) == "−7.2"
    assert fixed(None) == "–"


def test_damage_is_shown_in_space_where_states_hold_it() -> None:
    play = example.finished_play()
    assert play.mesh is not None
    volumes = {"volume_m3": 1e-3, "volume_phi_0.001_m3": [0.0, 2e-4], "volume_phi_0.34_m3": 0.0}
    damage = pd.DataFrame(
        {"time_s": [0.0, 0.01], "head_J_s": [0.0, 1.0], "region": "brain", **volumes, "phi_mean": 1e-4, "phi_max": 2e-3}
    )
    phi = dataclasses.replace(example.snapshots(play.mesh), name="damage variable φ")
    drawn: dict[bool, list[Picture]] = {False: [], True: []}
    for mapped, pictures in drawn.items():
        html = damage_section(
            dataclasses.replace(play, damage=damage, damage_snapshots=phi if mapped else None), pictures
        )
        assert ("the brain is coloured by damage variable φ" in html) is mapped
    assert [p.name for p in drawn[True] if p not in drawn[False]] == ["brain_damage_sections"]
