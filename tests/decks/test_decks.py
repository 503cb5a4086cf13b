"""Decks say what they were given, and a reader gets it back."""

from __future__ import annotations

import dataclasses
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replay.decks import (
    DeckControls,
    DeckInput,
    DeckPart,
    FrictionPair,
    KeywordDeck,
    PartSet,
    axis_through,
    deck_parts,
    read_keyword,
    read_velodyne,
    write_lsdyna,
    write_velodyne,
)
from replay.decks.lsdyna import foam_curve, one_decay
from replay.errors import InputError
from tests.decks.conftest import ELASTIC, FOAM, PARTS


def numbers_of(deck: KeywordDeck, keyword: str, row: int = 0) -> tuple[float, ...]:
    """What stands on one card of the only entry of a keyword."""
    (entry,) = deck.named(keyword)
    return tuple(v for v in entry.rows[row].values if isinstance(v, int | float))


def test_keyword_deck_reads_back_to_field_precision(tmp_path: Path, deck: DeckInput) -> None:
    write_lsdyna(tmp_path, deck)
    back = read_keyword(tmp_path / "main.k")
    assert back.node_ids.tolist() == deck.node_ids.tolist()
    np.testing.assert_allclose(back.nodes, deck.nodes, rtol=1e-11, atol=1e-12)
    assert back.solids.ids.tolist() == deck.element_ids.tolist()
    assert back.solids.parts.tolist() == [deck.parts[k].pid for k in deck.element_part.tolist()]
    np.testing.assert_array_equal(back.solids.nodes[:, :8], deck.node_ids[deck.hexes])
    parts, sets = back.of_kind("part"), back.of_kind("part_set")
    assert {pid: (e.title, e.whole("secid"), e.whole("mid")) for pid, e in parts.items()} == {
        p.pid: (p.name, p.pid, p.pid) for p in deck.parts
    }
    assert {sid: (e.title, e.members()) for sid, e in sets.items()} == {s.sid: (s.name, s.pids) for s in deck.part_sets}


def test_keyword_controls_are_the_articles(tmp_path: Path, deck: DeckInput) -> None:
    write_lsdyna(tmp_path, deck)
    back = read_keyword(tmp_path / "main.k")
    assert numbers_of(back, "CONTROL_TERMINATION") == (0.03,)
    assert numbers_of(back, "CONTROL_TIMESTEP") == (0.0, 0.9, 0, 0.0, -1.92e-7)
    assert numbers_of(back, "CONTROL_HOURGLASS") == (4, 0.1)
    assert numbers_of(back, "CONTROL_BULK_VISCOSITY") == (1.2, 0.06, 1)
    assert numbers_of(back, "DATABASE_BINARY_D3PLOT") == (1e-3,)


def test_materials_are_mapped_as_the_table_says(tmp_path: Path, deck: DeckInput) -> None:
    write_lsdyna(tmp_path, deck)
    back = read_keyword(tmp_path / "main.k")
    materials = back.of_kind("material")
    keywords = {pid: entry.keyword for pid, entry in materials.items()}
    assert keywords[60000001] == keywords[60000002] == "MAT_VISCOELASTIC"
    assert keywords[60000003] == "MAT_RIGID"
    assert keywords[60009020] == keywords[10000001] == "MAT_ELASTIC"
    assert keywords[10000174] == "MAT_CRUSHABLE_FOAM"
    density, bulk, short, long, rate = (materials[60000001].number(name) for name in ("ro", "bulk", "g0", "gi", "beta"))
    assert density == pytest.approx(1012.345678, rel=1e-6)
    assert (bulk, short, long) == (2.19e9, 6000, pytest.approx(1200))
    assert 1 / rate == pytest.approx((0.5 * 0.01 + 0.3 * 0.1) / 0.8, rel=1e-6)
    curve = back.curve(10000174)
    np.testing.assert_allclose(curve.T, foam_curve(FOAM), rtol=1e-12)
    assert curve[1, 1] / curve[1, 0] == pytest.approx(FOAM["youngs_modulus_pa"], rel=0.1)
    assert (np.diff(curve[:, 1]) >= 0).all()


def test_one_decay_keeps_both_moduli_and_the_area_of_relaxation() -> None:
    short, long, rate = one_decay(6000.0, [0.5, 0.3], [0.01, 0.1])
    t = np.linspace(0, 3, 300_001)
    prony = 6000 * (1 - 0.8 + 0.5 * np.exp(-t / 0.01) + 0.3 * np.exp(-t / 0.1))
    single = long + (short - long) * np.exp(-rate * t)
    assert prony[0] == pytest.approx(single[0])
    assert np.trapezoid(prony - single, t) == pytest.approx(0, abs=1e-4 * np.trapezoid(prony - long, t))
    assert one_decay(1000.0, [], []) == (1000.0, 1000.0, 0.0)


def test_the_axis_through_p_and_q_gives_back_the_angular_velocity(tmp_path: Path, deck: DeckInput) -> None:
    """Rigid velocity from the card equals v + omega x r of the original at any point."""
    omega, centre, v = np.array([2.0, 45.01, -0.7]), np.array([0.01, -0.02, 0.03]), np.array([0.2, 8.3232, 0.0])
    points = np.random.default_rng(1).normal(size=(20, 3))
    expected = v + np.cross(omega, points - centre)
    write_velodyne(tmp_path / "velodyne", deck)
    (card,) = read_velodyne(tmp_path / "velodyne" / "velodyne.card").initial_velocities
    p, q = np.array(card.p_m), np.array(card.q_m)
    axis = (q - p) / np.linalg.norm(q - p)
    ours = np.array(card.velocity_m_per_s) + card.omega_rad_per_s * np.cross(axis, points - p)
    np.testing.assert_allclose(ours, expected, atol=1e-12)
    write_lsdyna(tmp_path / "lsdyna", deck)
    back = read_keyword(tmp_path / "lsdyna" / "main.k")
    fields = (*numbers_of(back, "INITIAL_VELOCITY_GENERATION"), *numbers_of(back, "INITIAL_VELOCITY_GENERATION", 1))
    assert fields[:2] == (99, 1)
    other = np.array(fields[3:6]) + fields[2] * np.cross(fields[9:12], points - np.array(fields[6:9]))
    np.testing.assert_allclose(other, expected, atol=3e-4)  # ten-column fields


def test_a_body_at_rest_has_an_axis_too() -> None:
    speed, p, q = axis_through([1.0, 2.0, 3.0], [0.0, 0.0, 0.0])
    assert speed == 0
    assert q == (1.0, 2.0, 4.0)
    assert p == (1.0, 2.0, 3.0)


def test_the_driver_is_six_velocity_curves_of_the_skull(tmp_path: Path, deck: DeckInput) -> None:
    write_lsdyna(tmp_path, deck)
    back = read_keyword(tmp_path / "main.k")
    assert deck.driver is not None
    prescribed = list(back.named("BOUNDARY_PRESCRIBED_MOTION_RIGID"))
    assert [entry.rows[0].values[:3] for entry in prescribed] == [(60000003, dof, 0) for dof in (1, 2, 3, 5, 6, 7)]
    values = np.hstack([deck.driver.velocity_m_per_s, deck.driver.omega_rad_per_s])
    for k, entry in enumerate(prescribed):
        curve = back.curve(entry.whole("lcid"))
        np.testing.assert_allclose(curve[:, 0], deck.driver.time_s, rtol=1e-12)
        np.testing.assert_allclose(curve[:, 1], values[:, k], rtol=1e-12, atol=1e-14)


def test_the_card_says_section_3_of_the_protocol(tmp_path: Path, deck: DeckInput) -> None:
    write_velodyne(tmp_path, deck)
    card = read_velodyne(tmp_path / "velodyne.card")
    assert card.settings == {
        "Solution type": (0,),
        "Global memory size": (32,),
        "Termination time": (30.0e-3,),
        "Time step scale factor": (0.9,),
        "Plot state frequency": (1.0e-3, 0),
        "Time history frequency": (1.0e-3, 0),
        "Hourglass stabilization method": (4,),
        "Hourglass stabilization coefficient": (0.10,),
        "Bulk viscosity": (1,),
        "Quadratic bulk viscosity": (1.2,),
        "Linear bulk viscosity": (0.06,),
        "Mass scaling timestep": (1.92e-7,),
        "Mass scaling restart option": (1,),
        "Mass scaling part definition": (99, 1),
        "Contact scheme": (3,),
        "Curvature based adaptive contact option": (3,),
        "Contact constraint type": (0,),
        "Max number of contact iterations": (20,),
        "Contact convergence tolerance": (1.0e-3,),
    }
    assert card.part_sets[99] == (1, 899999999, "All_parts_in_range")
    assert card.part_sets[10000099] == (10000174, 10000180, "H1_pads_set1")
    assert card.friction_pairs == deck.friction_pairs
    assert card.friction_types == deck.friction_types
    assert card.initial_velocities == deck.initial_velocities
    text = (tmp_path / "velodyne.card").read_text()
    assert text.index("Include: helmet_H1.k") < text.index("Contact scheme") < text.index("Friction pair")


def test_other_controls_reach_both_decks(tmp_path: Path, deck: DeckInput) -> None:
    other = dataclasses.replace(deck, controls=DeckControls(termination_time_s=1e-3, hourglass_coefficient=0.05))
    write_velodyne(tmp_path / "v", other)
    write_lsdyna(tmp_path / "l", other)
    assert read_velodyne(tmp_path / "v" / "velodyne.card").settings["Termination time"] == (1e-3,)
    assert numbers_of(read_keyword(tmp_path / "l" / "main.k"), "CONTROL_HOURGLASS") == (4, 0.05)


def test_every_field_keeps_to_its_columns(tmp_path: Path, deck: DeckInput) -> None:
    write_lsdyna(tmp_path, deck)
    for path in tmp_path.glob("*.k"):
        keyword = ""
        for line in path.read_text().splitlines():
            assert line.isascii()
            if line.startswith("*"):
                keyword = line
            elif not line.startswith("$") and keyword == "*NODE":
                assert len(line) == 8 + 3 * 16 + 2 * 8
                assert line[8] == line[24] == line[40] == " " or "-" in line
            elif not line.startswith("$") and keyword not in ("*TITLE", "*PART", "*INCLUDE"):
                assert len(line) <= 80


def test_the_batch_script_is_a_script(tmp_path: Path, deck: DeckInput) -> None:
    for folder, write in (("l", write_lsdyna), ("v", write_velodyne)):
        assert tmp_path / folder / "submit.slurm.sh" in write(tmp_path / folder, deck)
        script = tmp_path / folder / "submit.slurm.sh"
        assert script.read_text().startswith("#!/bin/bash\n#SBATCH")
        assert subprocess.run(["bash", "-n", str(script)], check=False).returncode == 0


def test_the_same_deck_has_the_same_bytes(tmp_path: Path, deck: DeckInput) -> None:
    for folder in ("a", "b"):
        write_lsdyna(tmp_path / folder, deck)
        write_velodyne(tmp_path / folder, deck)
    for path in sorted((tmp_path / "a").iterdir()):
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"node_ids": np.full(40, 7)}, "node numbers occur twice"),
        ({"element_ids": 10**9 + np.arange(9)}, "eight-column"),
        ({"nodes": np.full((40, 3), np.nan)}, "cannot stand in a deck"),
        ({"part_sets": (PartSet(5, "odd", (10000001, 10000184)),)}, "would also hold"),
    ],
)
def test_what_does_not_fit_is_refused(
    tmp_path: Path, deck: DeckInput, change: dict[str, Any], match: str
) -> None:  # fmt: skip
    with pytest.raises(ValueError, match=match):
        write_velodyne(tmp_path, dataclasses.replace(deck, **change))


def test_an_unknown_law_is_refused(tmp_path: Path, deck: DeckInput) -> None:
    jelly = (dataclasses.replace(PARTS[0], law="jelly"), *PARTS[1:])
    with pytest.raises(ValueError, match="law 'jelly' has no keyword"):
        write_lsdyna(tmp_path, dataclasses.replace(deck, parts=jelly))


def test_a_damaged_deck_names_its_line(tmp_path: Path, deck: DeckInput) -> None:
    write_velodyne(tmp_path, deck)
    card = tmp_path / "velodyne.card"
    lines = card.read_text().splitlines()
    row = next(k for k, line in enumerate(lines) if line.startswith("Friction pair"))
    lines[row] = "Friction pair definition: 60009020 scalp 1 exteriorfric"
    card.write_text("\n".join(lines))
    with pytest.raises(InputError, match=rf"velodyne.card:{row + 1}: .*scalp"):
        read_velodyne(card)
    write_lsdyna(tmp_path, deck)
    (tmp_path / "main.k").write_text("*KEYWORD\n*CONTROL_TERMINATION\n    thirty\n*END\n")
    with pytest.raises(InputError, match=r"main.k:3: endtim: 'thirty' is no number"):
        read_keyword(tmp_path / "main.k")


def test_deck_parts_take_whatever_has_the_attributes_of_a_part() -> None:
    @dataclasses.dataclass
    class Anything:
        pid: int = 7
        name: str = "bit"
        material: str = "stuff"
        assembly: str = "head"

    (part,) = deck_parts([Anything()], {"stuff": {"law": "elastic", "density_kg_per_m3": 1, "parameters": ELASTIC}})
    assert part == DeckPart(7, "bit", "elastic", 1.0, ELASTIC, "head")


def test_friction_pairs_can_be_replaced(tmp_path: Path, deck: DeckInput) -> None:
    pairs = (FrictionPair(60009020, 10000181, 2, "only_the_cup"),)
    write_velodyne(tmp_path, dataclasses.replace(deck, friction_pairs=pairs))
    assert read_velodyne(tmp_path / "velodyne.card").friction_pairs == pairs


def test_rigid_parts_that_share_nodes_are_merged_and_others_are_not(tmp_path: Path, deck: DeckInput) -> None:
    write_lsdyna(tmp_path / "one", deck)
    assert not list(read_keyword(tmp_path / "one" / "main.k").named("CONSTRAINED_RIGID_BODIES"))  # the skull alone
    rigid = {"law": "rigid", "parameters": ELASTIC}
    # Cups 6, 7 and shell 8 lie on each other and are one body; the skull (2) touches none of them.
    parts = (*PARTS[:6], *(dataclasses.replace(part, **rigid) for part in PARTS[6:]))
    write_lsdyna(tmp_path / "two", dataclasses.replace(deck, parts=parts))
    back = read_keyword(tmp_path / "two" / "main.k")
    merged = [entry.rows[0].values[:2] for entry in back.named("CONSTRAINED_RIGID_BODIES")]
    assert merged == [(PARTS[6].pid, PARTS[7].pid), (PARTS[6].pid, PARTS[8].pid)]
