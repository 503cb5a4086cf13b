"""Limits: every one has a source, every one can be crossed, and a play that loosens one is told so."""

from __future__ import annotations

import math

import pytest

from replay.errors import InputError, InputErrors
from replay.gates import Limits

ALL = Limits.load()
BOUNDED = [name for name in ALL if ALL[name].parameter is None]


@pytest.mark.parametrize("name", list(ALL))
def test_limit_has_a_gate_a_source_and_a_bound(name):
    limit = ALL[name]
    assert name.split(".")[0] in ALL.gates
    assert len(limit.source) > 10
    assert (limit.parameter is not None) != bool(limit.bounds)


@pytest.mark.parametrize(
    ("name", "inside", "outside", "verdict"),
    [
        ("helmet.mass_kg", 1.32, 1.3199, "fail"),
        ("helmet.mass_kg", 2.32, 2.3201, "fail"),
        ("helmet.min_volume_m3", 1e-30, 0.0, "fail"),
        ("reconstruction.reprojection_rmse_median_px", 8.0, 8.01, "fail"),
        ("reconstruction.angular_cutoff_over_nyquist", 0.999, 1.0, "warn"),
        ("numerics.hourglass_share", 0.05, 0.0501, "warn"),
        ("numerics.hourglass_share", 0.05, 0.1001, "fail"),
        ("numerics.min_volume_ratio", 0.1, 0.05, "fail"),
        ("numerics.energy_ratio_min", 0.99, 0.98, "warn"),
        ("numerics.energy_ratio_min", 0.99, 0.94, "fail"),
        ("numerics.min_time_step_s", 1e-7, 9.9e-8, "fail"),
        ("fidelity.delta_peak_percent", -10.0, -10.1, "fail"),
        ("shake.ran_to_end", True, False, "fail"),
        ("shake.contact_blow_up", False, True, "fail"),
    ],
)
def test_value_on_the_limit_passes_and_beyond_it_does_not(name, inside, outside, verdict):
    assert ALL[name].judge(inside) == "pass"
    assert ALL[name].judge(outside) == verdict


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_value_that_is_no_number_fails_every_limit(value):
    assert {ALL[name].judge(value) for name in BOUNDED} == {"fail"}


def test_text_of_a_limit_reads_as_a_person_says_it():
    assert ALL["helmet.mass_kg"].text() == "1.32 to 2.32"
    assert ALL["numerics.hourglass_share"].text() == "<= 0.05 (fails unless <= 0.1)"
    assert ALL["reconstruction.pixels_per_metre"].text() == ">= 150 (warns)"
    assert ALL["shake.ran_to_end"].text() == "yes"
    assert ALL["numerics.energy_jump_steps"].text() == "100"


def test_loosened_limit_is_applied_and_marked():
    limits = Limits.load({"reconstruction.reprojection_rmse_median_px": 12})
    limit = limits["reconstruction.reprojection_rmse_median_px"]
    assert limit.judge(11.0) == "pass"
    assert limit.loosened_from == {"fail_above": 8.0}
    assert limits.loosened == (limit,)


def test_tightened_limit_is_applied_and_not_marked():
    limits = Limits.load({"helmet.mass_kg": {"fail_below": 1.7, "fail_above": 2.0}})
    assert limits["helmet.mass_kg"].judge(2.1) == "fail"
    assert limits.loosened == ()


def test_lowering_a_lower_bound_is_loosening():
    assert Limits.load({"reconstruction.pixels_per_metre": 50}).loosened
    assert not Limits.load({"reconstruction.pixels_per_metre": 500}).loosened


def test_setting_of_a_gate_can_be_changed():
    assert Limits.load({"numerics.energy_jump_steps": 50})["numerics.energy_jump_steps"].parameter == 50.0


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"helmet.mas_kg": 3}, "there is no such limit\n    mend: did you mean helmet.mass_kg?"),
        ({"helmet.mass_kg": 3}, "does not say which bound"),
        ({"helmet.mass_kg": {"warn_above": 3}}, "'warn_above' is not a bound of this limit\n    expected: fail_below"),
        ({"helmet.mass_kg": {"fail_above": "3 kg"}}, "gates.helmet.mass_kg.fail_above: '3 kg' is not a number"),
        ({"helmet.cg_offset_m": math.nan}, "nan is not a number"),
        ({"helmet.cg_offset_m": True}, "True is not a number"),
        ({"shake.ran_to_end": {"fail_unless": False}}, "a yes-or-no check cannot be set"),
    ],
)
def test_setting_that_cannot_be_used_is_one_message(setting, message):
    with pytest.raises(InputError, match=r"^play.yaml: gates\.") as caught:
        Limits.load(setting)
    assert message in str(caught.value)


def test_all_bad_settings_are_told_at_once():
    with pytest.raises(InputErrors, match="2 problems") as caught:
        Limits.load({"nothing.at_all": 1, "helmet.mass_kg": 3}, file="plays/demo/play.yaml")
    assert "plays/demo/play.yaml" in str(caught.value)


def test_the_play_and_the_gate_agree_on_what_a_helmet_weighs():
    from replay.play import HELMET_MASS_KG, HELMET_MASS_RANGE_KG

    bounds = Limits.load()["helmet.mass_kg"].bounds
    assert bounds["fail_below"] == pytest.approx(HELMET_MASS_KG - HELMET_MASS_RANGE_KG)
    assert bounds["fail_above"] == pytest.approx(HELMET_MASS_KG + HELMET_MASS_RANGE_KG)
