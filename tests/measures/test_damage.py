"""The damage recorder: volumes, onsets, resume, and pores integrated beside the run with other constants."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replay.measures import DamageRecorder, damage_summary

CONSTANTS = {
    "triaxiality_cap": 3.0, "pore_growth_exponent": 1.5, "pore_shear_sensitivity": 1e-6, "initial_porosity": 1e-6,
}  # fmt: skip
COUNT = 6
ROWS = np.arange(2, 2 + COUNT)


class View:
    """Elements pulled with triaxiality one, whose plastic strain grows at a different rate in each."""

    def __init__(self, k: int) -> None:
        self.time_s = 1e-3 * k
        share = np.linspace(0, 1, COUNT + 4)
        self.stress = np.tile([5 / 3, 2 / 3, 2 / 3, 0.0, 0.0, 0.0], (COUNT + 4, 1))
        self.volumes = 1e-6 * (1 + share)
        plastic = 0.01 * k * share
        self.variables = {
            "equivalent_plastic_strain": plastic,
            "phi": np.minimum(1e-6 * np.exp(60 * plastic), 0.9),
        }

    def variable(self, name: str) -> np.ndarray:
        return self.variables[name]

    def deformation_gradient(self) -> np.ndarray:
        return np.tile(np.eye(3), (COUNT + 4, 1, 1))


def recorder() -> DamageRecorder:
    return DamageRecorder(ROWS, ROWS + 100, {"left": [0, 1, 2], "right": [3, 4, 5], "nowhere": []}, CONSTANTS)


def test_volumes_and_onsets_are_those_of_the_elements(tmp_path: Path) -> None:
    gathered = recorder()
    for k in range(41):
        gathered.sample(View(k))
    gathered.write(tmp_path)
    table = pd.read_csv(tmp_path / "brain_damage.csv")
    assert set(table["region"]) == {"brain", "left", "right"}
    last = View(40)
    phi, volume = last.variables["phi"][ROWS], last.volumes[ROWS]
    final = damage_summary(table)
    for level in (0.001, 0.34):
        assert final["brain"][f"volume_phi_{level:g}_m3"] == pytest.approx(volume[phi >= level].sum(), rel=1e-12)
        assert (phi >= level).any()
    assert final["left"]["volume_phi_0.34_m3"] <= final["right"]["volume_phi_0.34_m3"]
    elements = pd.read_csv(tmp_path / "element_damage.csv").set_index("element_id")
    for row in ROWS:
        reached = [k for k in range(41) if View(k).variables["phi"][row] >= 0.001]
        told = elements.loc[row + 100, "onset_phi_0.001_s"]
        assert np.isnan(told) if not reached else told == pytest.approx(1e-3 * reached[0])


def test_pores_beside_the_run_follow_the_closed_form_of_each_constant(tmp_path: Path) -> None:
    gathered = recorder()
    for k in range(41):
        gathered.sample(View(k))
    gathered.write(tmp_path)
    table = pd.read_csv(tmp_path / "damage_sensitivity.csv")
    plastic = View(40).variables["equivalent_plastic_strain"][ROWS].max()
    for row in table[table["constant"] != "run"].to_dict("records"):
        own = {**CONSTANTS, **({row["constant"]: row["value"]} if row["constant"] in CONSTANTS else {})}
        m = own["pore_growth_exponent"]
        argument = min(2 * (2 * m - 1) / (2 * m + 1), own["triaxiality_cap"])
        w = -np.expm1((m + 1) * np.log1p(-1e-6)) * np.exp((m + 1) * np.sinh(argument) * plastic)
        assert row["phi_max"] == pytest.approx(-np.expm1(np.log1p(-w) / (m + 1)), rel=1e-9), row["constant"]


def test_a_resumed_recorder_writes_the_same_bytes(tmp_path: Path) -> None:
    whole, first, second = recorder(), recorder(), recorder()
    for k in range(21):
        whole.sample(View(k))
        (first if k < 9 else second).sample(View(k)) if k != 9 else None
        if k == 8:
            second.restore(first.state())
        if k == 9:
            second.sample(View(k))
    for name, gathered in (("a", whole), ("b", second)):
        (tmp_path / name).mkdir()
        gathered.write(tmp_path / name)
    for file in ("brain_damage.csv", "element_damage.csv", "damage_sensitivity.csv"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
