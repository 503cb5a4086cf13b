"""A helmet is described in files: what they say is in the mesh, and what they say wrongly is named by line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.errors import InputError, InputErrors
from replay.models import Model, assembly_inspection, assembly_mass, build_model, load_design, second_player
from replay.models.cubed_sphere import cube_lattice
from replay.models.helmet_design import NO_FACEMASK, shipped
from replay.models.helmet_layout import helmet_layout
from replay.models.inspection import missing_interfaces
from replay.models.ogrid import RESOLUTIONS
from replay.models.quality import aspect_ratios, hex_volumes, scaled_jacobians

DATA = Path(__file__).parents[2] / "src" / "replay" / "models" / "data"
FACEMASKS = (*shipped("facemask"), NO_FACEMASK)


def own(folder: Path, kind: str, name: str, *changes: tuple[str, str]) -> str:
    """A shipped description, changed, as a file in a folder; its name."""
    text = (DATA / kind / f"{name}.yaml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "own.yaml").write_text(text, encoding="utf-8")
    return "own.yaml"


def refusal(folder: Path, **pieces: str) -> str:
    with pytest.raises((InputError, InputErrors)) as caught:
        load_design(**pieces, folder=folder)
    assert caught.value.exit_code == 2
    return str(caught.value)


def size(model: Model) -> np.ndarray:
    points = model.nodes[model.hexes[model.elements_of(role="shell")]].reshape(-1, 3)
    return np.asarray(np.ptp(points, axis=0))


@pytest.mark.parametrize("helmet", shipped("helmet"))
@pytest.mark.parametrize("facemask", FACEMASKS)
@pytest.mark.parametrize("resolution", ["tiny", "coarse"])
def test_every_helmet_meshes_with_every_facemask(helmet: str, facemask: str, resolution: str) -> None:
    design = load_design(helmet, facemask)
    model = build_model("nfl", resolution, design=design)
    quality = scaled_jacobians(model.nodes, model.hexes)
    assert quality.min() > 0.45
    assert np.percentile(quality, 1) > 0.60
    assert aspect_ratios(model.nodes, model.hexes).max() < (13 if resolution == "tiny" else 9)
    assert missing_interfaces(model) == []
    assert assembly_inspection(model)["unconnected_parts"] == 0
    assert assembly_mass(model, "helmet").mass_kg == pytest.approx(design.mass_kg, rel=1e-9)
    assert ("facemask" in {part.role for part in model.parts}) == (facemask != NO_FACEMASK)
    assert any(name.startswith("facemask_mount") for name in model.node_sets) == (facemask != NO_FACEMASK)


def test_the_modern_helmet_is_larger_and_heavier_by_what_its_file_says(coarse: Model) -> None:
    classic, modern = load_design("classic"), load_design("modern")
    model = build_model("nfl", "coarse", design=modern)
    grown = size(model) - size(coarse)
    new, old = modern.shell.standoff_m, classic.shell.standoff_m
    # the shell's ends do not lie straight ahead and behind, where the stand-off is all that of front or back
    assert 0.8 < grown[0] / (new.front + new.back - old.front - old.back) < 1
    assert grown[1] == pytest.approx(2 * (new.side - old.side), abs=3e-3)
    assert assembly_mass(model, "helmet").mass_kg == pytest.approx(2.20)
    assert assembly_mass(coarse, "helmet").mass_kg == pytest.approx(1.83)
    assert {model.materials[p.material]["law"] for p in model.parts if p.role == "energy_pad"} == {"crushable_foam"}
    assert "soft_energy_foam" in model.materials


def test_each_pad_is_as_thick_as_its_own_file_says(tmp_path: Path) -> None:
    file = own(tmp_path, "pads", "classic", ("face: front, comfort_m: 0.010", "face: front, comfort_m: 0.016"))
    thickness = {}
    for name, design in (("own", load_design(pads=file, folder=tmp_path)), ("classic", load_design())):
        model = build_model("nfl", "coarse", design=design)
        for pad in ("front", "back"):
            chosen = model.element_part == model.part_index(f"comfort_pad_{pad}")
            energy = model.element_part == model.part_index(f"energy_pad_{pad}")
            volume = hex_volumes(model.nodes, model.hexes)
            thickness[name, pad] = volume[chosen].sum(), volume[chosen | energy].sum()
    assert thickness["own", "back"] == thickness["classic", "back"]
    # 16 over 10 mm, and a little more area outside
    assert 1.6 < thickness["own", "front"][0] / thickness["classic", "front"][0] < 1.8
    assert thickness["own", "front"][1] == pytest.approx(thickness["classic", "front"][1], rel=1e-3)


@pytest.mark.parametrize("resolution", ["tiny", "coarse"])
def test_jaw_pads_go_on_from_the_side_pads_and_all_others_stand_apart(resolution: str) -> None:
    model = build_model("nfl", resolution)
    pads = [part.name for part in model.parts if part.role == "energy_pad"]
    nodes = {name: set(model.hexes[model.element_part == model.part_index(name)].ravel().tolist()) for name in pads}
    touching = {(a, b) for a in pads for b in pads if a < b and nodes[a] & nodes[b]}
    assert touching == {(f"energy_pad_jaw_{side}", f"energy_pad_side_{side}") for side in ("left", "right")}


def test_no_pad_lies_on_the_ear_or_under_it() -> None:
    ear = load_design().shell.ear
    assert ear is not None
    layout = helmet_layout(lattice := cube_lattice(RESOLUTIONS["coarse"].divisions), load_design())
    x, y, z = lattice.quad_centres.T
    under = (abs(y) == 1) & (x >= ear.x[0]) & (x <= ear.x[1]) & (z <= ear.z[1]) & layout.covered
    assert under.sum() == 8, "two columns of each side, of the opening and of the shell below it"
    assert (layout.pad[under] == -1).all()
    assert layout.shell[under].sum() == 4, "the shell closes below the opening"


def test_routings_move_the_anchors_of_the_chin_strap() -> None:
    height = {}
    for name in shipped("chinstrap"):
        model = build_model("nfl", "tiny", design=load_design(chinstrap=name), seat="contact")
        anchors = {k: rows for k, rows in model.node_sets.items() if k.startswith("strap_anchor")}
        assert len(anchors) == 2 * len(load_design(chinstrap=name).chinstrap.straps)
        assert missing_interfaces(model) == []
        for key, rows in anchors.items():
            height[name, key] = float(model.nodes[rows[0], 2])
    assert height["high", "strap_anchor_front_left"] > height["low", "strap_anchor_front_left"] + 0.02
    assert height["high", "strap_anchor_rear_left"] == height["low", "strap_anchor_rear_left"]
    assert ("two_point", "strap_anchor_front_left") not in height


def test_two_players_share_no_number(tiny: Model) -> None:
    second = second_player(build_model("nfl", "tiny", design=load_design("modern")))
    for name in ("node_ids", "element_ids"):
        assert not np.intersect1d(getattr(tiny, name), getattr(second, name)).size
    assert not {p.pid for p in tiny.parts} & {p.pid for p in second.parts}
    pids = {part.name: part.pid for part in second.parts}
    assert pids["scalp_2"] == 40009020  # the article's second skin
    assert pids["chin_cup_2"] == 20000181
    assert second.part_set_ids["H2_pads_set1"] == 20000099
    assert assembly_inspection(second)["parts_outside_block"] == 0


def test_a_model_records_its_whole_helmet(tiny: Model) -> None:
    record = tiny.info["helmet"]
    assert record["chosen"] == {"helmet": "classic", "facemask": "classic", "pads": "classic", "chinstrap": "low"}
    assert record["facemask"]["bar_m"] == 0.00635
    assert record["pads"]["pads"]["front"]["comfort_m"] == 0.010


@pytest.mark.parametrize("kind", ["helmet", "pads", "facemask", "chinstrap"])
def test_an_unknown_name_is_refused_with_those_there_are(tmp_path: Path, kind: str) -> None:
    text = refusal(tmp_path, **{kind: "wooden"})
    assert f"no {kind} of this name" in text
    assert all(name in text for name in shipped(kind))


@pytest.mark.parametrize(
    ("piece", "kind", "change", "expected"),
    [
        ("facemask", "facemasks", ("spans: [[chin, lip]]", "spans: [[lip, chin]]"), "no span from 'lip' up to 'chin'"),
        ("facemask", "facemasks", ("lip: {mount: side_low}", "lip: {elevation_deg: -30.0}"), "one row at each"),
        ("facemask", "facemasks", ("bar_m: 0.00635", "bar_m: 6.35"), "bar_m"),
        ("pads", "pads", ("comfort_m: 0.010", "comfort_m: 0.040"), "5 mm less than the helmet's stand-off of 38 mm"),
        ("pads", "pads", ("comfort_pid: 176", "comfort_pid: 175"), "part number 175 is given twice"),
        ("pads", "pads", ("face: back,", "face: back, energy_material: straw,"), "pad back is of 'straw'"),
        ("pads", "pads", ("continues: side_left", "continues: cheek"), "pad jaw_left continues 'cheek'"),
        ("pads", "pads", ("face: front, comfort_m", "face: front, continues: back, comfort_m"), "described before it"),
        ("helmet", "helmets", ("[62.0, 4.0], [64.0, -16.0]", "[61.0, 4.0], [64.0, -16.0]"), "the edge has a gap"),
        ("helmet", "helmets", ("shell_m: 0.005", "shell_thickness: 5"), "shell_thickness"),
        ("chinstrap", "chinstraps", ("stiffness_n_per_m: 40.0e+3", "stiffness_n_per_m: -1"), "out of range"),
    ],
)  # fmt: skip
def test_a_description_that_cannot_be_is_refused_in_its_file(
    tmp_path: Path, piece: str, kind: str, change: tuple[str, str], expected: str
) -> None:
    name = "low" if kind == "chinstraps" else "classic"
    file = own(tmp_path, kind, name, change)
    text = refusal(tmp_path, **{piece: file})
    assert expected in text
    assert "own.yaml" in text


def test_a_row_that_hangs_on_nothing_is_refused(tmp_path: Path) -> None:
    file = own(tmp_path, "facemasks", "classic", ("[chin, lip]", "[mouth, lip]"))
    assert "row chin hangs on nothing" in refusal(tmp_path, facemask=file)
