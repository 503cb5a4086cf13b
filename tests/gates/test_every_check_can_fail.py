"""No gate is a formality: each limit of limits.yaml is crossed once, on its way through its own gate."""

from __future__ import annotations

import copy
import dataclasses
from pathlib import Path

import flawless_play as flawless
import numpy as np
import pytest

from replay.errors import InputError
from replay.gates import (
    Gate,
    Limits,
    PartEnergy,
    agreement_gate,
    assembly_gate,
    fidelity_gate,
    helmet_gate,
    hourglass_sensitivity_gate,
    numerics_gate,
    package_gate,
    placement_gate,
    read_gate,
    shake_gate,
    video_reconstruction_gate,
    wearable_reconstruction_gate,
)
from replay.gates.limits import Limit
from replay.gates.package import VIDEO_PACKAGE

LIMITS = Limits.load()
BOUNDS = [(name, bound) for name in LIMITS if LIMITS[name].parameter is None for bound in LIMITS[name].bounds]


def beyond(limit: Limit, bound: str) -> float | bool:
    """A value just beyond one bound."""
    at = limit.bounds[bound]
    kind = bound.split("_")[1]
    if kind == "unless":
        return not at
    step = 1e-3 * abs(float(at)) or 1e-3
    return {"above": at + step, "from": at, "below": at - step, "to": at}[kind]


def gate_with(name: str, value: float | bool, limits: Limits) -> Gate:
    """The flawless play's gate with one value replaced."""
    gate, check = name.split(".")
    good = copy.deepcopy(flawless.GOOD)
    if gate == "helmet":
        return helmet_gate(good["helmet"] | {check: value}, limits)
    if gate == "reconstruction":
        kind, build = (
            ("video", video_reconstruction_gate)
            if check in good["video"]
            else ("wearable", wearable_reconstruction_gate)
        )
        return build(good[kind] | {check: value}, limits)
    if gate == "assembly":
        facts, contact = good["assembly"], good["assembly_contact"]
        (facts if check in facts else contact)[check] = value
        return assembly_gate(facts, limits, contact=contact)
    if gate == "placement":
        return placement_gate(good["placement"] | {check: value}, limits)
    if gate == "shake":
        blow_up = value if check == "contact_blow_up" else False
        run = good["shake"] | ({check: value} if check != "contact_blow_up" else {})
        return shake_gate(run, limits, contact_blow_up=bool(blow_up))
    if gate == "numerics":
        return numerics_with(check, value, limits)
    if gate == "hourglass_sensitivity":
        key = "mps_half" if check.startswith("strain") else "pressure_half_Pa"
        regions = copy.deepcopy(flawless.GOOD_REGIONS)
        region = regions["right_occipital_lobe"]
        region[key] = region[key.replace("_half", "")] * (1 + value)
        return hourglass_sensitivity_gate(regions, limits)
    if gate == "fidelity":
        fidelity = copy.deepcopy(flawless.GOOD_FIDELITY)
        if check in fidelity:
            fidelity[check] = value
        else:
            fidelity["angular_velocity"][check] = value
        return fidelity_gate(fidelity, limits)
    if gate == "agreement":
        return agreement_with(check, value, limits)
    items = dict.fromkeys(VIDEO_PACKAGE, (True, True))
    items["kinematics.csv"] = (False, False) if check == "present" else (True, False)
    return package_gate(items, limits)


def agreement_with(check: str, value: float | bool, limits: Limits) -> Gate:
    values, quantities, laboratories = (
        copy.deepcopy(good) for good in (flawless.GOOD_AGREEMENT, flawless.GOOD_QUANTITIES, flawless.GOOD_LABORATORIES)
    )
    if check in values:
        values[check] = value
    elif check in quantities["angular velocity"]:
        quantities["angular velocity"][check] = value
    else:
        laboratories["north"][check] = value
    return agreement_gate(values, quantities, laboratories, limits)


def numerics_with(check: str, value: float | bool, limits: Limits) -> Gate:
    good = copy.deepcopy(flawless.GOOD)
    run, contact, energy, parts = (
        good["numerics"],
        good["numerics_contact"],
        flawless.good_ledger(),
        flawless.GOOD_PARTS,
    )
    if check in run:
        run[check] = value
    elif check in contact:
        contact[check] = value
    elif check == "hourglass_share":
        parts = (PartEnergy("brain", 2.0, 2.0 * value),)
    elif check == "momentum_drift":
        energy["momentum_y_N_s"][-1] = value * energy["momentum_x_N_s"][0]
    elif check == "energy_jump":
        reference = energy["total_J"][-1]
        energy["total_J"][30:] += value * reference
        energy["ratio"] = energy["total_J"] / (energy["total_J"] - value * reference * (np.arange(50) >= 30))
    else:
        reference = energy["total_J"].copy()
        ramp = np.linspace(1.0, value, 50)
        energy["ratio"], energy["total_J"] = ramp, reference * ramp
    return numerics_gate(energy, parts, run, limits, free=True, contact=contact)


@pytest.mark.parametrize("name", flawless.all_gates(LIMITS))
def test_flawless_play_passes(name):
    gate = flawless.all_gates(LIMITS)[name]
    assert gate.verdict == "pass", [c.sentence() for c in gate.causes()]
    assert gate.causes() == ()


def test_flawless_wearable_passes():
    assert flawless.wearable_gate(LIMITS).verdict == "pass"


@pytest.mark.parametrize(("name", "bound"), BOUNDS)
def test_gate_sees_each_bound_crossed(name, bound):
    severity = bound.split("_")[0]
    gate = gate_with(name, beyond(LIMITS[name], bound), LIMITS)
    caught = [check for check in gate.checks if check.name.split(":")[0] == name.split(".")[1]]
    assert severity in {check.verdict for check in caught}, [c.sentence() for c in gate.checks]
    assert gate.verdict == severity
    worst = next(check for check in gate.causes() if check.verdict == severity)
    assert worst in caught
    assert worst.sentence().startswith(worst.name)
    assert f"limit {LIMITS[name].text()}" in worst.sentence()


@pytest.mark.parametrize("name", sorted({name for name, bound in BOUNDS if not bound.endswith("unless")}))
def test_loosened_limit_is_printed_by_the_check_that_uses_it(name):
    limit = LIMITS[name]
    numbers = dict(limit.bounds)
    looser = {k: (v + 1 if k.split("_")[1] in ("above", "from") else v - 1) for k, v in numbers.items()}
    limits = Limits.load({name: looser})
    gate = gate_with(name, beyond(LIMITS[name], next(iter(numbers))), limits)
    marked = [check for check in gate.checks if check.loosened_from]
    assert marked
    assert {check.loosened_from for check in marked} == {limit.text()}


@pytest.mark.parametrize("name", flawless.all_gates(LIMITS))
def test_gate_file_reads_back_as_written(tmp_path: Path, name):
    gate = flawless.all_gates(LIMITS)[name]
    gate.write(tmp_path / "gate.json")
    first = (tmp_path / "gate.json").read_bytes()
    gate.write(tmp_path / "gate.json")
    assert (tmp_path / "gate.json").read_bytes() == first
    assert read_gate(tmp_path / "gate.json") == gate


def test_gate_file_with_an_edited_verdict_is_refused(tmp_path: Path):
    gate = helmet_gate(flawless.GOOD["helmet"] | {"mass_kg": 4.0}, LIMITS)
    path = tmp_path / "gate.json"
    gate.write(path)
    path.write_text(path.read_text().replace('"verdict": "fail",\n  "checks"', '"verdict": "pass",\n  "checks"'))
    with pytest.raises(InputError, match="says 'pass', but its checks say 'fail'"):
        read_gate(path)


@pytest.mark.parametrize("content", ["{}", "[]", '{"gate": "helmet", "checks": []}', '{"gate": "x", "checks": [1]}'])
def test_file_that_is_no_gate_is_refused(tmp_path: Path, content):
    (tmp_path / "gate.json").write_text(content)
    with pytest.raises(InputError, match="is not a gate file"):
        read_gate(tmp_path / "gate.json")


def test_gate_without_a_check_is_none():
    gate = flawless.all_gates(LIMITS)["helmet"]
    with pytest.raises(ValueError, match="a gate that cannot fail is none"):
        dataclasses.replace(gate, checks=())


def test_forgotten_or_misspelt_value_is_our_own_error():
    values = dict(flawless.GOOD["helmet"])
    del values["mass_kg"]
    with pytest.raises(ValueError, match="mass_kg, masskg missing or unknown"):
        helmet_gate(values | {"masskg": 1.8}, LIMITS)
