"""The laboratory: closed forms of one element, tables that must say their units, fits that find what made the data."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from replay.errors import InputError, ReplayError
from replay.laboratory import (
    MODES,
    Free,
    Specimen,
    answer,
    calibrate,
    curve_answer,
    left_out,
    programme,
    read_tests,
    rms,
    squeeze,
)  # fmt: skip
from replay.laboratory.hopkinson import ENDS, quarter_cylinder
from replay.laboratory.records import Curve
from replay.models import brain_material, brain_parameters, brain_sets
from replay.solver import Material
from replay.stages.laboratory import shipped_tests

RUBBER = Material("rubber", "viscohyperelastic", 1000.0, {"bulk_modulus_pa": 2.19e9, "shear_modulus_pa": 6e3})
HEAD = "mode,rate_per_s,strain,stress_kPa,sd_kPa,status,source\n"


def brain(name: str = "compression") -> Material:
    return Material("brain", "brain_isv", 1000.0, brain_material(name)["parameters"])


def test_neo_hookean_in_every_test_is_the_closed_form() -> None:
    for mode in ("compression", "tension", "cyclic"):
        found = answer(RUBBER, programme(mode, 10.0, 0.3))
        stretch = found.programme.stretches
        nominal = 6e3 * np.abs(stretch - stretch**-2)
        assert found.nominal_pa == pytest.approx(nominal, rel=1e-4, abs=1e-2)
        assert found.lateral == pytest.approx(stretch**-0.5, rel=1e-4)
    sheared = answer(RUBBER, programme("simple_shear", 10.0, 0.5))
    assert sheared.nominal_pa == pytest.approx(6e3 * sheared.programme.strains, rel=1e-9, abs=1e-9)
    confined = answer(RUBBER, programme("confined", 10.0, 0.1))
    assert confined.nominal_pa[-1] == pytest.approx(0.5 * 2.19e9 * (1 / 0.9 - 0.9), rel=1e-3)


def test_brain_relaxes_in_a_held_test_and_loses_energy_in_a_cycle() -> None:
    held = answer(brain(), programme("relaxation", 30.0, 0.3))
    assert held.nominal_pa[-1] < 0.5 * held.nominal_pa.max()
    cycled = answer(brain(), programme("cyclic", 30.0, 0.3))
    assert np.trapezoid(cycled.nominal_pa, cycled.programme.strains) > 0.2 * cycled.nominal_pa.max() * 0.3
    assert set(held.fields) >= {"HV57", "equivalent_plastic_strain", "xi1", "xi_star", "xi2", "flow_residual"}


@pytest.mark.parametrize("mode", MODES)
def test_halving_the_steps_changes_little(mode: str) -> None:
    once, twice = (answer(brain(), programme(mode, 30.0, 0.3, steps)).nominal_pa[-1] for steps in (300, 600))
    assert once == pytest.approx(twice, rel=1e-2, abs=20.0)


@pytest.mark.parametrize(
    ("mode", "rate", "strain"), [("bending", 1, 0.1), ("tension", 0, 0.1), ("compression", 1, 1.0)]
)
def test_a_test_that_cannot_be_is_refused(mode: str, rate: float, strain: float) -> None:
    with pytest.raises(InputError):
        programme(mode, rate, strain)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("mode,rate_per_s,strain,stress,sd_kPa,status,source\n", "'stress' does not have the unit of 'stress_kPa'"),
        ("mode,rate_per_s,strain,stress_Pa,sd_kPa,status,source\n", "'stress_Pa' does not have the unit"),
        (HEAD + "compression_nominal,30,0.3,8.8,,guessed,me\n", ":2: status: 'guessed' is not known"),
        (HEAD + "compression_nominal,30,0.3,8.8,,measured and derived,me\n", "is not known"),
        (HEAD + "bending,30,0.3,8.8,,measured,me\n", ":2: mode: 'bending' is not known"),
        (HEAD + "compression_nominal,30,0.3,-8.8,,measured,me\n", "stress_kPa: it is -8.8"),
        (HEAD + "initial_modulus,30,0,8.8,,measured,me\n", "no row can be fitted"),
    ],
)
def test_data_without_units_or_of_unknown_status_are_refused(tmp_path: Path, text: str, found: str) -> None:
    (tmp_path / "data.csv").write_text(
        text + ("tension_nominal,1,0.1,1,,measured,me\n" if text.count("\n") < 2 else "")
    )
    with pytest.raises(ReplayError) as caught:
        read_tests(tmp_path / "data.csv")
    assert found in str(caught.value)


def test_a_fit_finds_the_parameters_that_made_the_data() -> None:
    truth = brain()
    curves = []
    for rate in (0.1, 30.0, 90.0):
        found = answer(truth, programme("compression", rate, 0.3))
        strains = np.array([0.1, 0.2, 0.3])
        stresses = np.interp(strains, found.programme.strains, found.nominal_pa)
        curves.append(Curve("compression", rate, strains, stresses, np.full(3, np.nan), ("measured",) * 3, ("made",)))
    start = Material(
        "brain", "brain_isv", 1000.0, {**truth.parameters, "shear_modulus_pa": 1e4, "yield_stress_pa": 3e4}
    )
    free = [Free("shear_modulus_pa", 1e3, 1e5), Free("yield_stress_pa", 1e3, 1e5)]
    fit = calibrate(start, free, curves, starts=2, profiles=3)
    for f in free:
        assert fit.value(f.name) == pytest.approx(truth.parameters[f.name], rel=0.02)
        values, costs = fit.profile[f.name]
        assert costs[1] < costs[0]
        assert costs[1] < costs[2]
        assert values[0] < fit.value(f.name) < values[2]
    assert fit.on_a_bound() == []
    assert abs(fit.correlation[0, 1]) < 1
    assert np.diag(fit.correlation) == pytest.approx(1.0)


def test_what_no_datum_sees_is_said_to_be_unseen() -> None:
    fast = curve_of(brain(), "simple_shear", 60.0)
    fit = calibrate(
        brain(), [Free("yield_stress_pa", 1e3, 1e5), Free("softening_rate", 0.1, 1e3)], [fast], starts=1, profiles=0
    )
    assert fit.spread[0] < 0.5
    assert fit.spread[1] > 10


def test_a_test_left_out_is_foretold_where_the_tests_agree_and_betrayed_where_one_does_not() -> None:
    free = [Free("shear_modulus_pa", 1e3, 1e5), Free("yield_stress_pa", 1e3, 1e5)]
    curves = [curve_of(brain(), "simple_shear", rate) for rate in (1.0, 30.0, 90.0)]
    for curve, error in zip(curves, left_out(brain(), free, curves).values(), strict=True):
        assert error < 0.02 * curve.stresses_pa.max()
    odd = dataclasses.replace(curves[1], stresses_pa=1.5 * curves[1].stresses_pa)
    among = [curves[0], odd, curves[2]]
    foretold = left_out(brain(), free, among)[odd.name]
    # the others do not know of the odd one, whose fit to itself bends towards it
    assert foretold == pytest.approx(np.sqrt(((0.5 * curves[1].stresses_pa) ** 2).mean()), rel=0.05)
    assert foretold > 1.5 * rms(calibrate(brain(), free, among, starts=1, profiles=0).material, [odd])[odd.name]
    assert left_out(brain(), free, [odd]) == {}


def curve_of(material: Material, mode: str, rate: float) -> Curve:
    found = answer(material, programme(mode, rate, 1.0))
    strains = np.array([0.25, 0.5, 1.0])
    stresses = np.interp(strains, found.programme.strains, found.nominal_pa)
    return Curve(mode, rate, strains, stresses, np.full(3, np.nan), ("measured",) * 3, ("made",))


@pytest.mark.parametrize("name", brain_sets())
def test_shipped_sets_have_the_errors_that_the_documentation_states(name: str, repository: Path) -> None:
    page = (repository / "docs" / "physics.md").read_text(encoding="utf-8")
    errors = rms(brain(name), read_tests(shipped_tests()))
    row = next(line for line in page.splitlines() if line.startswith(f"| `{name}` |"))
    told = [float(cell) for cell in row.split("|")[2:-1]]
    assert [1e-3 * e for e in errors.values()] == pytest.approx(told, abs=6e-3)
    facts = brain_parameters()
    for key, value in brain(name).parameters.items():
        low, high = facts[key]["bounds"]
        assert low <= value <= high, key
        if facts[key]["certainty"] == "calibrated":
            assert low * 1.01 < value < high / 1.01, f"{key} lies on a bound"


def test_shipped_tests_are_those_of_the_reference(shared: Path) -> None:
    assert shipped_tests().read_text() == (shared / "reference" / "brain-data.csv").read_text()
    for curve in read_tests(shipped_tests()):
        assert curve_answer(brain(), curve).nominal_pa.max() > 0


@pytest.mark.slow
def test_the_specimen_keeps_its_volume_and_barrels_only_where_it_is_held(tmp_path: Path) -> None:
    specimen = Specimen(divisions=4)
    _, hexes = quarter_cylinder(specimen)
    assert 4 * len(hexes) == specimen.hexes_of_the_whole
    assert Specimen().hexes_of_the_whole >= 12_400
    barrel = {}
    for ends in ENDS:
        found = squeeze(brain(), ends, tmp_path / ends, specimen=specimen, strain=0.3, threads=1)
        strain, diameter = found.strains[-1], found.diameters[-1]
        assert diameter == pytest.approx((1 - strain) ** -0.5, rel=5e-3)
        radius = found.shapes[0.29][:, 1]
        barrel[ends] = radius.max() / radius[0]
    assert barrel["lubricated"] == pytest.approx(1.0, abs=1e-3)
    assert barrel["glued"] > 1.15
    assert 1.01 < barrel["frictional"] < 1.05


def test_platens_without_friction_press_like_a_constraint_and_sticky_ones_like_glue(tmp_path: Path) -> None:
    specimen, keep = Specimen(divisions=2), {"strain": 0.3, "threads": 1}
    held = {
        ends: squeeze(brain(), ends, tmp_path / ends, specimen=specimen, **keep) for ends in ("lubricated", "glued")
    }
    free, stuck = (
        squeeze(brain(), "frictional", tmp_path / str(mu), specimen=specimen, friction=mu, **keep) for mu in (0.0, 20.0)
    )
    np.testing.assert_allclose(free.shapes[0.29], held["lubricated"].shapes[0.29], atol=1e-6)
    ends = [0, -1]
    np.testing.assert_allclose(stuck.shapes[0.29][ends], held["glued"].shapes[0.29][ends], atol=0.02)
