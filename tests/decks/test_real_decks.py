"""Keyword files that other programs wrote: what is in them, against a dumb reader and against two other libraries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.decks.keyword import KeywordDeck, read_keyword
from replay.stages.foreign_deck import open_deck
from tests.decks.plain_keyword import hex_volume, quad_area, read_mesh

# Nodes, solids, shells, distinct keywords as `ansys-dyna-core` 0.12.1 and `lsdyna-mesh-reader` 0.2.1 count them.
COUNTS = {
    "bar_impact_mesh.k": (1411, 768, 256),
    "fixed_ground.k": (1071, 0, 1000),
    "frf_solid.k": (440, 252, 0),
    "taylor_bar_mesh.k": (1122, 768, 0),
    "test_elementary_transform.k": (24, 5, 0),
    "test_node_sets.k": (6724, 5680, 0),
}
# Densities on the *MAT cards, by part, read by eye [tonne/mm^3].
DENSITIES = {
    "fixed_ground.k": {10000001: 7.0e-9},
    "frf_solid.k": {4: 4.99e-7, 5: 4.99e-7},
    "test_elementary_transform.k": {1: 7.8e-9},
    "test_node_sets.k": {1: 7.85e-9},
}


@pytest.fixture(params=list(COUNTS))
def path(request: pytest.FixtureRequest, shared: Path) -> Path:
    return shared / "real" / "decks" / request.param


def test_every_node_and_element_is_that_of_a_dumb_reader(path: Path) -> None:
    deck = read_keyword(path)
    assert (len(deck.node_ids), len(deck.solids.ids), len(deck.shells.ids)) == COUNTS[path.name]
    nodes, solids, shells = read_mesh(path)
    assert deck.node_ids.tolist() == list(nodes)
    np.testing.assert_array_equal(deck.nodes, list(nodes.values()))
    for elements, plain, width in ((deck.solids, solids, 8), (deck.shells, shells, 4)):
        assert elements.ids.tolist() == list(plain)
        assert elements.parts.tolist() == [part for part, _ in plain.values()]
        assert elements.nodes[:, :width].tolist() == [corners[:width] for _, corners in plain.values()]


def test_nothing_of_a_file_is_lost(path: Path) -> None:
    """Every keyword of the file is a mesh, an entry, kept verbatim, or used up by reading."""
    deck = read_keyword(path)
    rows = path.read_text(encoding="latin-1").split("\n")
    keywords = [row.split()[0] for row in rows if row.startswith("*") and row.split()[0] != "*END"]
    assert deck.keywords == len(keywords)
    meshes = sum(word in ("*NODE", "*ELEMENT_SOLID", "*ELEMENT_SHELL") for word in keywords)
    headings = {(entry.file, entry.line) for entry in deck.entries}
    assert meshes + len(headings) + len(deck.kept) + deck.spent == len(keywords)
    for kept in deck.kept:
        block = "\n".join(rows[kept.line - 1 :])
        assert block.startswith(kept.text.rstrip("\n"))
        assert any(r.keyword == kept.keyword and r.line == kept.line and r.meaning for r in deck.remarks)


@pytest.mark.parametrize("name", list(DENSITIES))
def test_masses_are_those_of_a_dumb_sum(shared: Path, name: str) -> None:
    """Volumes by the divergence theorem over triangulated faces; the program integrates with Gauss points."""
    path = shared / "real" / "decks" / name
    nodes, solids, shells = read_mesh(path)
    expected = dict.fromkeys(DENSITIES[name], 0.0)
    for part, corners in solids.values():
        expected[part] += DENSITIES[name][part] * 1e3 * hex_volume([nodes[n] for n in corners])
    for part, corners in shells.values():
        expected[part] += DENSITIES[name][part] * 1e3 * 1.5 * quad_area([nodes[n] for n in corners])
    from replay.models.readiness import surrogate_inspection

    source = open_deck([path], units="mm-tonne-s")
    report = surrogate_inspection(source.helmet, source.settings)
    found = {row["pid"]: row["mass_kg"] for row in report["parts"]}
    assert found == {pid: pytest.approx(mass, rel=1e-10) for pid, mass in expected.items()}
    assert report["mass"]["mass_kg"] == pytest.approx(sum(expected.values()), rel=1e-10)


def test_the_wedges_of_a_real_mesh_are_found_by_number(shared: Path) -> None:
    path = shared / "real" / "decks" / "test_node_sets.k"
    _, solids, _ = read_mesh(path)
    six = [number for number, (_, corners) in solids.items() if len(set(corners)) == 6]
    source = open_deck([path], units="mm-tonne-s")
    from replay.models.census import element_kinds

    assert source.helmet.solid_ids[element_kinds(source.helmet.solids) == 1].tolist() == six
    assert len(six) == 80


def test_a_set_of_a_real_deck_has_its_members_and_no_filling_zeros(shared: Path) -> None:
    deck = read_keyword(shared / "real" / "decks" / "frf_solid.k")
    sets = deck.of_kind("node_set")
    assert sets[1].members()[:3] == (163, 166, 169)
    assert len(sets[1].members()) == 28
    assert sets[1].get("solver") == "MECH"
    steel: KeywordDeck = deck
    assert steel.of_kind("material")[1].number("sigy") == 0.0468
