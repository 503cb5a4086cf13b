"""Laws of other people's cards as ours, ours as cards, and the cards that link parts."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from replay.decks import Cable, DeckInput, DeckPart, read_keyword, write_openradioss
from replay.decks.keyword.columns import card, curve_lines
from replay.decks.keyword.materials import Mapped, map_material
from replay.decks.keyword.renumber import dangling
from replay.decks.keyword.units import SYSTEMS, plausible_units
from replay.decks.lsdyna import foam_curve, material_lines, write_lsdyna

SI = "m-kg-s"
FOAM = {"youngs_modulus_pa": 10.5e6, "plateau_stress_pa": 0.35e6, "densification_strain": 0.65}


def mapped(folder: Path, lines: list[str], units: str = SI) -> Mapped:
    path = folder / "mat.k"
    path.write_text("*KEYWORD\n" + "\n".join(lines) + "\n*END\n")
    deck = read_keyword(path)
    (entry,) = deck.of_kind("material").values()
    return map_material(entry, deck, SYSTEMS[units])


BRAIN = {"bulk_modulus_pa": 2.19e9, "shear_modulus_pa": 6e3, "prony_ratios": (0.5,), "prony_times_s": (0.02,)}
COPPER = {"youngs_modulus_pa": 117e9, "poisson_ratio": 0.35, "yield_stress_pa": 400e6, "hardening_modulus_pa": 100e6}
CURVE = {"curve_strains": (0.1, 0.5), "curve_stresses_pa": (60e6, 61e6)}
PLASTIC = {"youngs_modulus_pa": 2.4e9, "poisson_ratio": 0.4, "yield_stress_pa": 40e6, **CURVE}


@pytest.mark.parametrize(
    ("law", "parameters"),
    [
        ("elastic", {"youngs_modulus_pa": 3.356e9, "poisson_ratio": 0.43}),
        ("rigid", {"youngs_modulus_pa": 12.04e9, "poisson_ratio": 0.22}),
        ("viscohyperelastic", BRAIN),
        ("elastic_plastic", COPPER),
        ("elastic_plastic", PLASTIC),
    ],
)
def test_our_law_as_a_card_is_our_law_again(tmp_path: Path, law: str, parameters: dict) -> None:
    back = mapped(tmp_path, material_lines(DeckPart(7, "part", law, 1234.5, parameters, "helmet")))
    assert (back.law, back.refused) == (law, "")
    assert back.density_kg_per_m3 == 1234.5
    for name, value in parameters.items():
        np.testing.assert_allclose(back.parameters[name], value, rtol=1e-5, err_msg=name)


def test_our_foam_as_a_card_has_the_same_curve(tmp_path: Path) -> None:
    back = mapped(tmp_path, material_lines(DeckPart(7, "pad", "crushable_foam", 84.3, FOAM, "helmet")))
    np.testing.assert_allclose(
        (back.parameters["curve_strains"], back.parameters["curve_stresses_pa"]), foam_curve(FOAM)
    )
    assert "no permanent set" in back.lost[0]


def test_a_card_in_mm_and_tonnes_is_converted_with_its_curve(tmp_path: Path) -> None:
    strain = np.linspace(0, 0.9, 40)
    stress = 0.2 * strain**0.3 + 3 * strain**8
    lines = ["*MAT_LOW_DENSITY_FOAM", card(3, 8.43e-11, 10.5, 4, 1e20, 0.1, 50.0, 0.0), *curve_lines(4, strain, stress)]
    foam = mapped(tmp_path, lines, "mm-tonne-s")
    assert foam.law == "crushable_foam"
    assert foam.density_kg_per_m3 == pytest.approx(84.3)
    assert foam.parameters["youngs_modulus_pa"] == pytest.approx(10.5e6)
    assert foam.parameters["unloading_factor"] == pytest.approx(0.1)
    assert len(foam.parameters["curve_strains"]) == 12
    assert "tension_cutoff_pa" not in foam.parameters
    assert [w.split(":")[0] for w in foam.lost] == ["beta = 50", "a curve of 40 points keeps 12"]
    ours = np.interp(strain, foam.parameters["curve_strains"], foam.parameters["curve_stresses_pa"])
    assert np.abs(ours - stress * 1e6).max() < 0.02 * 1e6 * stress.max()


def test_rubbers_have_the_moduli_of_their_constants(tmp_path: Path) -> None:
    """Ogden with exponent 2 and Mooney-Rivlin with C01 = 0 are one neo-Hookean: mu = mu1 = 2 C10."""
    head, relaxation = card(1, 1000.0, 0.49, 0), card(2e5, 100.0)
    ogden = mapped(tmp_path, ["*MAT_077_O", head, card(1e6, *[0.0] * 7), card(2.0, *[0.0] * 7), relaxation])
    mooney = mapped(tmp_path, ["*MAT_HYPERELASTIC_RUBBER", head, card(5e5), relaxation])
    assert ogden.parameters == mooney.parameters
    assert ogden.parameters["shear_modulus_pa"] == 1.2e6  # long-term plus what relaxes
    assert ogden.parameters["prony_ratios"] == pytest.approx((2e5 / 1.2e6,))
    assert ogden.parameters["prony_times_s"] == (0.01,)
    assert ogden.parameters["bulk_modulus_pa"] == pytest.approx(2e6 * 1.49 / (3 * 0.02))


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        (["*MAT_VISCOUS_FOAM", card(1, 100.0)], "none of our laws has its rate term"),
        (["*MAT_HONEYCOMB", card(1, 100.0)], r"\*MAT_HONEYCOMB 1: no law of ours"),
        (["*MAT_ELASTIC", card(1, 100.0, 1e9, 0.5)], "poisson_ratio is 0.5"),
        (["*MAT_ELASTIC", card(1, 0.0, 1e9, 0.3)], "the density is 0.0"),
        (["*MAT_CRUSHABLE_FOAM", card(1, 100.0, 1e6, 0.0, 9)], "lcid = 9: there is no such"),
        (["*MAT_OGDEN_RUBBER", card(1, 100.0, 0.49, 0), card(1e6), card(3.0)], "exponents other than 2"),
        (["*MAT_OGDEN_RUBBER", card(1, 100.0, 0.49, 2)], "fitted to a test curve"),
        (["*MAT_VISCOELASTIC", card(1, 100.0, 1e9, 1e3, 2e3, 1.0)], "long-term modulus must lie"),
        (["*MAT_PLASTIC_KINEMATIC", card(1, 100.0, 1e9, 0.3, 1e6, 2e9)], "etan"),
    ],
)
def test_what_no_law_of_ours_can_be_is_refused_by_name(tmp_path: Path, lines: list[str], why: str) -> None:
    material = mapped(tmp_path, lines)
    assert not material.law
    assert material.refused
    import re

    assert re.search(why, material.refused)


def test_units_are_told_from_density_and_size_together() -> None:
    def names(densities: list[float], extent: float) -> list[str]:
        return [u.name for u in plausible_units(densities, extent)]

    assert names([1.2e-9, 8.4e-11], 300) == ["mm-tonne-s"]
    assert names([1.2e-6], 300) == ["mm-kg-ms"]
    assert names([1.2e-3], 300) == ["mm-g-ms"]
    assert names([1200.0], 0.3) == ["m-kg-s"]
    assert names([1.2], 30) == ["cm-g-us", "cm-g-s"]
    assert names([], 300) == ["mm-tonne-s", "mm-kg-ms", "mm-g-ms"]
    assert names([1.2e-9], 0.3) == []
    assert SYSTEMS["mm-kg-ms"].factor("pressure") == pytest.approx(1e9)
    assert SYSTEMS["in-lbf-s"].factor("pressure") == pytest.approx(6894.757293)


@pytest.fixture
def linked(deck: DeckInput) -> DeckInput:
    cables = (Cable("chin strap left", 0, 20, 50e3, 0.002),)
    return dataclasses.replace(deck, contact=True, cables=cables)


def test_contacts_carry_the_friction_of_their_pairs(tmp_path: Path, linked: DeckInput) -> None:
    write_lsdyna(tmp_path, linked)
    back = read_keyword(tmp_path / "main.k")
    contacts = {e.title: e for e in back.named("CONTACT_AUTOMATIC_SURFACE_TO_SURFACE")}
    assert {
        name: (e.whole("ssid"), e.whole("msid"), e.number("fs"), e.number("fd")) for name, e in contacts.items()
    } == {pair.name: (pair.first, pair.second, 0.5, 0.5) for pair in linked.friction_pairs}
    kinds = [(e.whole("sstyp"), e.whole("mstyp")) for e in contacts.values()]
    assert kinds == [(3, 2), (3, 2), (3, 3)]  # part against set, set, part
    (single,) = back.named("CONTACT_AUTOMATIC_SINGLE_SURFACE")
    assert single.whole("sstyp") == 5
    assert dangling(back) == []
    assert "no *CONTACT" not in (tmp_path / "main.k").read_text()


def test_a_cable_pulls_beyond_its_slack_and_never_pushes(tmp_path: Path, linked: DeckInput) -> None:
    write_lsdyna(tmp_path, linked)
    back = read_keyword(tmp_path / "main.k")
    part = next(e for e in back.of_kind("part").values() if e.title == "chin strap left")
    curve = back.curve(back.of_kind("material")[part.whole("mid")].id)
    assert curve is not None
    assert np.interp([-0.5, 0.001, 0.002, 0.012], curve[:, 0], curve[:, 1]) == pytest.approx([0, 0, 0, 500.0])
    element = next(kept for kept in back.kept if kept.keyword == "*ELEMENT_DISCRETE")
    ends = [int(element.text.split("\n")[1][k : k + 8]) for k in (16, 24)]
    assert ends == linked.node_ids[[0, 20]].tolist()


def test_openradioss_reads_the_same_cards(tmp_path: Path, linked: DeckInput) -> None:
    """It wants its units declared, and numbers of sets that no other kind of set has."""
    write_lsdyna(tmp_path / "l", linked)
    write_openradioss(tmp_path / "o", linked)
    for name in ("main.k", "head_1.k", "helmet_H1.k"):
        assert (tmp_path / "o" / name).read_bytes() == (tmp_path / "l" / name).read_bytes()
    assert "*CONTROL_UNITS" in (tmp_path / "o" / "main.k").read_text()
    script = (tmp_path / "o" / "submit.slurm.sh").read_text()
    assert script.index("starter") < script.index("engine")
    back = read_keyword(tmp_path / "o" / "main.k")
    sets = [e.id for e in back.entries if e.kind.endswith("_set")]
    assert len(sets) == len(set(sets))
