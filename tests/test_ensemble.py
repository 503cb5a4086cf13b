"""Ensembles: which members there are, which stages they share, and the bands over them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from replay.errors import InputError
from replay.play import Play, members_of, overridden, read_ensemble
from replay.play.ensemble import EnsembleSettings
from replay.stages.bands import bands_of, measures_in


def described(**settings: object) -> EnsembleSettings:
    return EnsembleSettings.model_validate(settings)


def test_a_grid_has_every_combination_and_rows_go_side_by_side() -> None:
    vary = {"helmet.mass_kg": [1.7, 1.9], "reconstruction.draw": {"from": 1, "to": 2}}
    grid = members_of("demo", "x", described(vary=vary))
    assert [tuple(m.varied.values()) for m in grid.values()] == [(1.7, 1), (1.7, 2), (1.9, 1), (1.9, 2)]
    rows = members_of("demo", "x", described(vary=vary, combine="rows"))
    assert [tuple(m.varied.values()) for m in rows.values()] == [(1.7, 1), (1.9, 2)]
    assert list(rows) == ["001", "002"]
    assert rows["002"].address == "demo.x/002"


def test_sixteen_drivers_share_the_plays_model_and_one_reconstruction() -> None:
    settings = described(
        vary={"reconstruction.draw": {"from": 1, "to": 16}},
        set={"reconstruction.mode": "posterior", "reconstruction.ensemble": 16},
    )
    members = members_of("demo", "drivers", settings)
    for member in members.values():
        assert {member.owners[s] for s in ("inputs", "assembly", "shake", "sensitivity")} == {"demo"}
        assert "driver" not in member.owners, "a drawn driver is the member's own"
        assert "replay" not in member.owners
    assert {m.owners.get("reconstruction", m.address) for m in members.values()} == {"demo.drivers/001"}


def test_a_helmet_is_built_once_for_every_mass_and_a_solver_setting_builds_none() -> None:
    vary = {"helmet.mass_kg": [1.7, 1.9], "solver.hourglass.coefficient": [0.05, 0.1]}
    members = members_of("demo", "x", described(vary=vary))
    builders = [m.owners.get("assembly", m.address) for m in members.values()]
    assert builders == ["demo.x/001", "demo.x/001", "demo.x/003", "demo.x/003"]
    shakes = [m.owners.get("shake", m.address) for m in members.values()]
    assert shakes == [m.address for m in members.values()], "each flies another helmet or by other controls"
    friction = members_of("demo", "x", described(vary={"solver.contact.friction": [0.1, 0.3]}))
    assert {m.owners["assembly"] for m in friction.values()} == {"demo"}


@pytest.mark.parametrize(("path", "stages"), [
    ("window.duration_s", {"reconstruction", "driver", "placement"}),
    ("t0", {"reconstruction", "driver", "placement"}),
    ("model.brain_material", {"assembly", "placement", "shake"}),
    ("solver.contact.pairs", {"assembly", "placement", "shake"}),
    ("shake.speed_m_per_s", {"shake"}),
    ("collision.aim_m", {"assembly", "driver", "placement", "shake"}),
    ("gates.numerics.hourglass_share", {"reconstruction", "assembly", "driver", "placement", "shake"}),
])  # fmt: skip
def test_a_stage_is_a_members_own_where_it_stands_on_what_varies(path: str, stages: set[str]) -> None:
    (member,) = members_of("demo", "x", described(vary={path: ["value"]})).values()
    shared = {"inputs", "reconstruction", "assembly", "driver", "placement", "shake", "sensitivity"} - stages
    assert set(member.owners) == shared


@pytest.mark.parametrize(("text", "said"), [
    ("vary: {solver.contact.frction: [0.1]}", "did you mean `solver.contact.friction`"),
    ("vary: {source.clicks: [a.csv]}", "belongs to the play itself"),
    ("vary: {helmet.mass_kg: []}", "has no values"),
    ("vary: {}", "vary"),
    ("vary: {helmet.mass_kg: [1.8]}\nset: {helmet.mass_kg: 1.8}", "in `vary` and in `set`"),
    ("combine: rows\nvary: {helmet.mass_kg: [1.8, 1.9], t0: [linear]}", "different numbers of values"),
    ("vary: {reconstruction.draw: {from: 1, to: 2000}}", "2000 members"),
])  # fmt: skip
def test_a_wrong_description_names_its_file_and_what_to_mend(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "x.ensemble.yaml"
    path.write_text(text + "\n")
    with pytest.raises(InputError, match=said.replace("`", ".")) as caught:
        read_ensemble(path)
    assert caught.value.file == str(path)
    assert caught.value.line


def test_bands_are_the_percentiles_of_the_members_that_have_the_measure() -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(10.0, 2.0, 16)
    members = [{"HIC15": (v, "1")} | ({"BrIC": (v / 10, "1")} if k < 3 else {}) for k, v in enumerate(values)]
    bands = bands_of([*members, {}], {"HIC15": (9.0, "1")}).set_index("measure")
    hic = bands.loc["HIC15"]
    ordered = np.sort(values)
    place = 0.05 * 15
    fifth = ordered[0] + place * (ordered[1] - ordered[0])
    assert hic["members"] == 16
    assert hic["p05"] == pytest.approx(fifth, rel=1e-14)
    assert hic["median"] == pytest.approx((ordered[7] + ordered[8]) / 2, rel=1e-14)
    assert (hic["lowest"], hic["highest"], hic["of_play"]) == (ordered[0], ordered[-1], 9.0)
    assert hic["deviation"] == pytest.approx(np.sqrt(((values - values.mean()) ** 2).sum() / 15), rel=1e-14)
    assert bands.loc["BrIC", "members"] == 3


def test_every_number_of_the_measures_has_a_name_of_its_own_and_a_unit() -> None:
    found = measures_in(
        {
            "head": [{"name": "HIC15", "value": 68.0, "unit": "1"}],
            "brain": {"frontal": {"mps_log_p95": 0.2, "tensile_pressure_p95_Pa": 1.4e4, "peak": None}},
            "damage": {"frontal": {"volume_phi_0.34_m3": 1e-9, "onset_phi_0.34_s": 0.01}},
            "action": {"head": 0.7, "helmet": 0.4, "impactor": None, "crossover_time_s": None},
            "contact": {"pairs": [{"impulse_N_s": 9.0}], "blow": {"peak_force_N": 9e3, "impulse_N_s": 40.0}},
            "facemask_mounts": "the struck player wears no facemask",
        }
    )
    assert found == {
        "HIC15": (68.0, "1"),
        "frontal mps_log_p95": (0.2, "1"),
        "frontal tensile_pressure_p95_Pa": (1.4e4, "Pa"),
        "damage frontal volume_phi_0.34_m3": (1e-9, "m^3"),
        "damage frontal onset_phi_0.34_s": (0.01, "s"),
        "blow peak_force_N": (9e3, "N"),
        "blow impulse_N_s": (40.0, "N s"),
        "action head": (0.7, "J s"),
        "action helmet": (0.4, "J s"),
    }


@pytest.mark.parametrize("name", ["helmets", "sweep"])
def test_ensembles_of_the_collision_are_plays_that_can_be_run(name: str, repository: Path, tmp_path: Path) -> None:
    folder = repository / "config/plays/collision-demo"
    play = yaml.safe_load((folder / "play.yaml").read_text(encoding="utf-8"))
    members = members_of("collision-demo", name, read_ensemble(folder / f"{name}.ensemble.yaml"))
    asked = []
    for member in members.values():
        changed = overridden(play, member.overrides)
        asked.append(Play.model_validate(changed, context={"folder": folder}).model_dump_json())
        assert "replay" not in member.owners
        assert member.owners.keys() >= {"inputs", "sensitivity"}
    assert len(set(asked)) == len(members) >= 2, "no member is another"
