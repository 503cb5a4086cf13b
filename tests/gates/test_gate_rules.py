"""What the gates know beyond their limits: fluid parts, small parts, checks without power."""

from __future__ import annotations

import flawless_play as flawless
import numpy as np
import pandas as pd
import pytest

from replay.gates import (
    PartEnergy,
    assembly_gate,
    convergence_class,
    fidelity_gate,
    hourglass_sensitivity_gate,
    ledger_values,
    numerics_gate,
    package_gate,
    part_energies,
    shake_gate,
    video_reconstruction_gate,
)
from replay.gates.package import VIDEO_PACKAGE, WEARABLE_PACKAGE


def by_name(gate):
    return {check.name: check for check in gate.checks}


def numerics(limits, **changes):
    given = {
        "energy": flawless.good_ledger(),
        "parts": flawless.GOOD_PARTS,
        "run": flawless.GOOD["numerics"],
        **changes,
    }
    return numerics_gate(given.pop("energy"), given.pop("parts"), given.pop("run"), limits, **given)


def test_three_landmarks_have_no_residual_and_do_not_pass(limits):
    quality = flawless.GOOD["video"] | {"degrees_of_freedom_min": 0, "reprojection_rmse_median_px": 0.0}
    gate = video_reconstruction_gate(quality, limits)
    checks = by_name(gate)
    assert checks["reprojection_rmse_median_px"].verdict == "vacuous"
    assert checks["frames_above_8_px"].verdict == "vacuous"
    assert "no degrees of freedom" in checks["reprojection_rmse_median_px"].detail
    assert checks["degrees_of_freedom_min"].verdict == "fail"
    assert gate.verdict == "fail"


def test_unobservable_focal_length_hands_the_gate_to_the_scale(limits):
    quality = flawless.GOOD["video"] | {"focal_sigma_log": 13.0, "focal_drift_median_percent": 40.0}
    checks = by_name(video_reconstruction_gate(quality, limits))
    assert checks["focal_drift_median_percent"].verdict == "vacuous"
    assert "not observable" in checks["focal_drift_median_percent"].detail
    assert checks["scale_drift_percent"].verdict == "pass"
    failing = video_reconstruction_gate(quality | {"scale_drift_percent": 3.5}, limits)
    assert failing.verdict == "fail"


def test_articles_own_footage_is_refused_for_want_of_freedom_and_warned_about_its_cutoff(limits):
    quality = flawless.GOOD["video"] | {
        "degrees_of_freedom_min": 0,
        "angular_cutoff_over_nyquist": 40 / (59.94 / 2),
        "helmet_to_com_m": 0.412,
    }
    gate = video_reconstruction_gate(quality, limits)
    named = {check.name for check in gate.causes()}
    assert {"angular_cutoff_over_nyquist", "helmet_to_com_m", "degrees_of_freedom_min"} <= named
    assert gate.verdict == "fail"


def test_model_without_contact_says_so_and_does_not_pass(limits):
    gates = (
        assembly_gate(flawless.GOOD["assembly"], limits),
        shake_gate(flawless.GOOD["shake"], limits),
        numerics(limits),
    )
    for gate in gates:
        assert gate.verdict == "warn"
        assert {check.verdict for check in gate.causes()} == {"vacuous"}
        assert all("no contact in this model" in check.detail for check in gate.causes())


def test_run_without_energy_has_vacuous_energy_checks(limits):
    energy = {name: np.zeros(10) for name in flawless.good_ledger()} | {"ratio": np.ones(10)}
    gate = numerics(limits, energy=energy, contact=flawless.GOOD["numerics_contact"])
    assert {check.name for check in gate.causes()} == {
        "energy_ratio_min",
        "energy_ratio_max",
        "energy_jump",
        "hourglass_share",
    }
    assert {check.verdict for check in gate.causes()} == {"vacuous"}


def test_ledger_with_a_nan_fails(limits):
    energy = flawless.good_ledger()
    energy["total_J"][7] = np.nan
    check = by_name(numerics(limits, energy=energy))["energy_ratio_min"]
    assert check.verdict == "fail"
    assert "row 8" in check.detail


def test_ratio_of_the_first_rows_of_a_driven_run_is_not_judged(limits):
    """Before the driver has done work, ratio is rounding over rounding."""
    energy = flawless.good_ledger()
    for name in ("kinetic_J", "total_J"):
        energy[name] = energy[name] - 20.0
    energy["ratio"][0] = 7.0
    energy["total_J"][0] = 1e-9
    assert by_name(numerics(limits, energy=energy))["energy_ratio_max"].verdict == "pass"


def test_fluid_is_judged_by_its_share_of_the_whole(limits):
    """In a driven head the fluid's own ratio passes 10 % while the brain stays below 4 %."""
    parts = (PartEnergy("brain", 2.0, 0.07), PartEnergy("csf", 0.2, 0.06, fluid=True))
    checks = by_name(numerics(limits, parts=parts))
    assert checks["hourglass_share: csf"].verdict == "pass"
    assert checks["hourglass_share: csf"].value == pytest.approx(0.06 / 2.2)
    solid = (PartEnergy("brain", 2.0, 0.07), PartEnergy("csf", 0.2, 0.06))
    assert by_name(numerics(limits, parts=solid))["hourglass_share: csf"].verdict == "fail"


def test_peak_energies_are_taken_part_by_part():
    table = pd.DataFrame(
        {
            "pid": [1, 2, 1, 2],
            "part": ["brain", "csf", "brain", "csf"],
            "internal_J": [0.0, 0.1, 2.0, 0.05],
            "hourglass_J": [0.0, 0.0, 0.02, 0.03],
        }
    )
    assert part_energies(table, fluid_pids=[2]) == [
        PartEnergy("brain", 2.0, 0.02),
        PartEnergy("csf", 0.1, 0.03, fluid=True),
    ]


def test_part_with_less_than_a_thousandth_of_the_energy_has_no_say(limits):
    parts = (PartEnergy("brain", 2.0, 0.02), PartEnergy("strap", 0.0008, 0.0008))
    assert "hourglass_share: strap" not in by_name(numerics(limits, parts=parts))
    heavy = (PartEnergy("brain", 2.0, 0.02), PartEnergy("strap", 0.002, 0.002))
    assert by_name(numerics(limits, parts=heavy))["hourglass_share: strap"].verdict == "fail"


def test_part_with_only_hourglass_energy_fails(limits):
    """A part that moves in nothing but hourglass modes has no internal energy to divide by."""
    parts = (PartEnergy("brain", 2.0, 0.02), PartEnergy("pad", 0.0, 1.0))
    assert by_name(numerics(limits, parts=parts))["hourglass_share: pad"].verdict == "fail"


def test_slow_drift_is_no_jump_but_the_same_change_within_100_steps_is(limits):
    energy = flawless.good_ledger(400)
    error = np.linspace(0, 0.3, 400)
    energy["ratio"] = 1 + error / energy["total_J"]
    energy["total_J"] = energy["total_J"] + error
    slow = numerics(limits, energy=energy, steps=np.arange(400) * 50)
    assert by_name(slow)["energy_jump"].verdict == "pass"
    fast = numerics(limits, energy=energy, steps=np.arange(400) * 0.25)
    assert by_name(fast)["energy_jump"].verdict == "fail"


def test_momentum_is_judged_only_where_nothing_acts_from_outside(limits):
    assert "momentum_drift" not in by_name(numerics(limits))
    assert "momentum_drift" in by_name(numerics(limits, free=True))


def test_locked_brain_is_seen_by_the_sensitivity(limits):
    regions = {"brain": {"mps": 6e-4, "mps_half": 1.1e-3, "pressure_Pa": 1e4, "pressure_half_Pa": 1.0e4}}
    gate = hourglass_sensitivity_gate(regions, limits)
    assert gate.verdict == "fail"
    assert convergence_class(gate) == "C"


@pytest.mark.parametrize(("half", "expected"), [(0.204, "A"), (0.22, "B"), (0.24, "C")])
def test_convergence_class_follows_the_sensitivity(limits, half, expected):
    regions = {"brain": {"mps": 0.2, "mps_half": half, "pressure_Pa": 1e4, "pressure_half_Pa": 1e4}}
    assert convergence_class(hourglass_sensitivity_gate(regions, limits)) == expected


def test_sensitivity_that_was_never_run_is_unknown_and_does_not_pass(limits):
    gate = hourglass_sensitivity_gate(None, limits)
    assert gate.verdict == "warn"
    assert convergence_class(gate) == "unknown"


def test_free_skull_has_no_residual_checks(limits):
    names = set(by_name(fidelity_gate(flawless.GOOD_FIDELITY, limits, prescribed=False)))
    assert not names & {"position_residual_mm", "rotation_residual_deg"}


def test_peak_of_zero_has_no_percentage(limits):
    fidelity = flawless.GOOD_FIDELITY | {
        "angular_velocity": {
            "rmse_percent_of_peak": None,
            "delta_peak_percent": "the target does not rotate",
            "delta_time_to_peak_ms": None,
        }
    }
    check = by_name(fidelity_gate(fidelity, limits))["delta_peak_percent: angular_velocity"]
    assert (check.verdict, check.value, check.detail) == ("vacuous", None, "the target does not rotate")


def test_package_that_lacks_an_item_names_it(limits):
    items = dict.fromkeys(VIDEO_PACKAGE, (True, True))
    del items["qc_summary.txt"]
    gate = package_gate(items, limits)
    assert gate.causes()[0].name == "present: qc_summary.txt"
    assert gate.stops


def test_wearable_package_asks_for_no_clicks(limits):
    assert (
        package_gate(dict.fromkeys(WEARABLE_PACKAGE, (True, True)), limits, required=WEARABLE_PACKAGE).verdict == "pass"
    )
    assert "kinovea_clicks.csv" not in WEARABLE_PACKAGE


def test_shake_takes_its_worst_ratio_and_step_from_the_ledger():
    energy = flawless.good_ledger() | {"ratio": np.array([1.0, 1.004, 0.97, 1.02])}
    energy["momentum_y_N_s"] = np.linspace(0, 3e-9, 50)
    found = ledger_values(energy, [0.0, 4e-7, 3e-7])
    assert found == {"energy_ratio": 0.97, "momentum_drift": pytest.approx(5e-10), "min_time_step_s": 3e-7}


def test_shake_that_never_moved_says_so(limits):
    energy = {name: np.zeros(3) for name in flawless.good_ledger()} | {"ratio": np.array([1.0, np.nan, 1.0])}
    found = ledger_values(energy, [0.0])
    gate = shake_gate(flawless.GOOD["shake"] | found, limits, contact_blow_up=False)
    checks = by_name(gate)
    assert checks["energy_ratio"].verdict == "fail"
    assert checks["momentum_drift"].detail == "the system starts without momentum"
    assert checks["min_time_step_s"].verdict == "vacuous"
