"""``replay helmet``: a foreign helmet gets the verdict it deserves, and what is prepared of it is all there."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from replay.cli import main
from replay.decks import Cable, DeckInput, PartSet, deck_parts, read_keyword
from replay.decks.keyword.columns import card, joined, set_lines
from replay.decks.keyword.renumber import dangling
from replay.decks.keyword.units import SYSTEMS
from replay.decks.lsdyna import mesh_text, write_lsdyna
from replay.errors import InputError, InputErrors
from replay.files import read_json
from replay.models import Model, assembly_mass, build_model, read_model, select_assembly, write_model
from replay.models.inspection import helmet_datum
from replay.stages.foreign_deck import read_deck_as_model
from replay.stages.own_deck import model_facts, node_sets, region_sets
from replay.stages.problem import chin_straps

TONNE = SYSTEMS["mm-tonne-s"]


@pytest.fixture(scope="module")
def model() -> Model:
    return build_model("nfl", "tiny")


@pytest.fixture(scope="module")
def helmet(model: Model) -> Model:
    return select_assembly(model, "helmet")


def deck_text(helmet: Model, *, length: float = 1.0, density: float = 1.0, pressure: float = 1.0) -> str:
    """The helmet as somebody else might have exported it: one file, numbers from 1, in any unit."""
    facts = {
        name: {
            **material,
            "density_kg_per_m3": material["density_kg_per_m3"] / density,
            "parameters": {
                n: (np.array(v) / pressure).tolist() if n.endswith("_pa") else v
                for n, v in material["parameters"].items()
            },
        }
        for name, material in helmet.materials.items()
    }
    parts = tuple(replace(part, pid=k) for k, part in enumerate(helmet.parts, 1))
    new = {old.pid: part.pid for old, part in zip(helmet.parts, parts)}
    deck = DeckInput(
        title="helmet",
        nodes=helmet.nodes / length,
        node_ids=np.arange(1, len(helmet.nodes) + 1),
        hexes=helmet.hexes,
        element_ids=np.arange(1, len(helmet.hexes) + 1),
        element_part=helmet.element_part,
        parts=deck_parts(parts, facts),
        part_sets=(),
    )
    lines = mesh_text(deck, "helmet").removesuffix("*END\n").split("\n")[1:-1]
    for number, (name, pids) in enumerate(helmet.part_sets.items(), 1):
        lines += set_lines("SET_PART_LIST", number, name, [new[pid] for pid in pids])
    for number, (name, rows) in enumerate(helmet.node_sets.items(), 101):
        lines += set_lines("SET_NODE_LIST", number, name, (rows + 1).tolist())
    return joined(lines)


def write(folder: Path, text: str, name: str = "helmet.k") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def verdicts(report: Path) -> dict[str, str]:
    return {check["name"]: check["verdict"] for check in read_json(report)["gate"]["checks"]}


def inspect(folder: Path, *arguments: object) -> tuple[int, dict[str, str], dict]:
    code = main(["helmet", "inspect", *map(str, arguments), "--json", str(folder / "report.json")])
    report = folder / "report.json"
    return code, verdicts(report), read_json(report)


def test_a_good_helmet_passes_with_the_numbers_that_our_own_model_has(tmp_path: Path, helmet: Model) -> None:
    """Mass, CG and datum of the deck against those computed from the model before it was written."""
    code, checks, report = inspect(tmp_path, write(tmp_path, deck_text(helmet)))
    assert code == 0
    assert set(checks.values()) <= {"pass", "vacuous"}
    mass = assembly_mass(helmet, "helmet")
    assert report["mass"]["mass_kg"] == pytest.approx(mass.mass_kg, rel=1e-6)
    np.testing.assert_allclose(report["mass"]["cg_m"], mass.cg_m, atol=1e-7)
    datum = helmet_datum(helmet)
    np.testing.assert_allclose(report["mass"]["datum"]["cg_m"], datum.relative(mass.cg_m), atol=1e-6)
    inertia = np.einsum("ij,jk,lk->il", datum.axes, mass.inertia_kg_m2, datum.axes)
    np.testing.assert_allclose(report["mass"]["datum"]["inertia_kg_m2"], inertia, atol=1e-7)
    assert {i["interface"]: i["status"] for i in report["interfaces"]} == {
        "pad set 1 (comfort pads)": "correct",
        "pad set 2 (energy pads)": "correct",
        "pad-pad": "correct",
        "facemask mounts": "correct",
        "strap anchors": "correct",
    }
    assert report["units"]["system"] == "m-kg-s"


def test_a_helmet_in_mm_and_tonnes_is_recognised_and_weighs_the_same(tmp_path: Path, helmet: Model) -> None:
    text = deck_text(helmet, length=1e-3, density=TONNE.factor("density"), pressure=TONNE.factor("pressure"))
    code, checks, report = inspect(tmp_path, write(tmp_path, text))
    assert code == 0
    assert checks["mass_kg"] == checks["length_m"] == "pass"
    assert report["units"]["system"] == "mm-tonne-s"
    assert report["mass"]["mass_kg"] == pytest.approx(assembly_mass(helmet, "helmet").mass_kg, rel=1e-4)


def test_a_helmet_in_mm_that_is_said_to_be_in_metres_is_refused(tmp_path: Path, helmet: Model) -> None:
    text = deck_text(helmet, length=1e-3, density=TONNE.factor("density"), pressure=TONNE.factor("pressure"))
    code, checks, _ = inspect(tmp_path, write(tmp_path, text), "--units", "m-kg-s")
    assert code == 3
    assert checks["length_m"] == checks["width_m"] == checks["height_m"] == checks["mass_kg"] == "fail"


def test_units_that_cannot_be_told_are_asked_for(tmp_path: Path, shared: Path) -> None:
    with pytest.raises(
        InputError, match=r"taylor_bar_mesh.k:1: units: its units are not known.*densities are not given"
    ):
        from replay.stages.foreign_deck import open_deck

        open_deck([shared / "real" / "decks" / "taylor_bar_mesh.k"])


def collapsed(helmet: Model, count: int) -> tuple[Model, list[int]]:
    """A helmet in which hexes of the shell have become wedges; their numbers in the deck."""
    shell = next(k for k, part in enumerate(helmet.parts) if part.role == "shell")
    rows = np.flatnonzero(helmet.element_part == shell)[:count]
    hexes = helmet.hexes.copy()
    hexes[rows, 3], hexes[rows, 7] = hexes[rows, 2], hexes[rows, 6]
    return replace(helmet, hexes=hexes), (rows + 1).tolist()


def test_wedges_are_listed_by_number_and_too_many_are_refused(tmp_path: Path, helmet: Model) -> None:
    count = len(helmet.hexes) // 18  # more than one in twenty
    many, ids = collapsed(helmet, count)
    code, checks, report = inspect(tmp_path, write(tmp_path, deck_text(many)))
    assert code == 3
    assert checks["wedge_share"] == "fail"
    assert report["census"]["ids"] == {"wedge": ids}
    assert report["census"]["kinds"]["hexahedron"] == len(helmet.hexes) - count


def test_preparing_removes_the_wedges_and_nothing_else(tmp_path: Path, helmet: Model) -> None:
    few, ids = collapsed(helmet, 5)
    out = tmp_path / "out"
    code = main(["helmet", "prepare", str(write(tmp_path, deck_text(few))), "--as", "1", "--out", str(out)])
    assert code == 0
    manifest, back = read_json(out / "prepared.json"), read_model(out / "model.h5")
    assert manifest["removed_wedges"] == ids
    assert len(back.hexes) == len(helmet.hexes) - 5
    gate = {check["name"]: check for check in read_json(out / "gate_helmet.json")["checks"]}
    assert gate["removed_not_wedge"]["value"] == 0
    assert gate["wedge_share"]["verdict"] == "pass"


def test_a_mirrored_helmet_is_refused(tmp_path: Path, helmet: Model) -> None:
    mirrored = replace(helmet, nodes=helmet.nodes * np.array([1.0, -1.0, 1.0]))
    code, checks, report = inspect(tmp_path, write(tmp_path, deck_text(mirrored)))
    assert code == 3
    assert checks["min_volume_m3"] == checks["min_scaled_jacobian"] == "fail"
    assert len(report["quality"]["not_positive_volumes"]) == len(helmet.hexes)


def test_a_refused_helmet_leaves_no_model(tmp_path: Path, helmet: Model) -> None:
    good = ["helmet", "prepare", str(write(tmp_path, deck_text(helmet))), "--as", "1", "--out", str(tmp_path / "out")]
    assert main(good) == 0
    assert (tmp_path / "out" / "model.h5").is_file()
    mirrored = replace(helmet, nodes=helmet.nodes * np.array([1.0, -1.0, 1.0]))
    write(tmp_path, deck_text(mirrored))
    assert main(good) == 3
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["gate_helmet.json", "inspection.json"]


def test_two_helmets_with_the_same_numbers_collide_until_they_are_prepared(tmp_path: Path, helmet: Model) -> None:
    first, second = (write(tmp_path, deck_text(helmet), name) for name in ("one.k", "two.k"))
    code, checks, report = inspect(tmp_path, first, second)
    assert code == 3
    assert checks["colliding_ids"] == "fail"
    assert {c["kind"] for c in report["colliding_ids"]} >= {"node"}
    for number, path in ((1, first), (2, second)):
        assert main(["helmet", "prepare", str(path), "--as", str(number), "--out", str(tmp_path / str(number))]) == 0
    together = read_keyword(tmp_path / "1" / "helmet_H1.k", tmp_path / "2" / "helmet_H2.k")
    assert together.collisions == []
    assert len(together.node_ids) == 2 * len(helmet.nodes)


def test_a_part_without_material_is_refused_by_number(tmp_path: Path, helmet: Model) -> None:
    text = deck_text(helmet)
    pid = next(k for k, part in enumerate(helmet.parts, 1) if part.role == "shell")
    broken = text.replace("\n" + card(pid, pid, pid) + "\n", "\n" + card(pid, pid, 0) + "\n")
    assert broken != text
    code, checks, report = inspect(tmp_path, write(tmp_path, broken))
    assert code == 3
    assert checks["unusable_parts"] == "fail"
    (bad,) = [part for part in report["parts"] if part["problem"]]
    assert (bad["pid"], bad["problem"]) == (pid, "no material is named")


def test_a_law_that_is_not_ours_is_refused_by_name_until_the_settings_give_one(tmp_path: Path, helmet: Model) -> None:
    pid = next(k for k, part in enumerate(helmet.parts, 1) if part.role == "shell")
    text = deck_text(helmet).replace("*MAT_RIGID", "*MAT_VISCOUS_FOAM", 1)
    path = write(tmp_path, text)
    code, checks, report = inspect(tmp_path, path)
    assert (code, checks["unusable_parts"]) == (3, "fail")
    assert "*MAT_VISCOUS_FOAM" in next(p["problem"] for p in report["parts"] if p["pid"] == pid)
    settings = tmp_path / "helmet.yaml"
    settings.write_text(
        f"materials:\n  {pid}:\n    law: elastic\n    density_kg_per_m3: 1500\n"
        "    parameters: {youngs_modulus_pa: 3.356e9, poisson_ratio: 0.43}\n    source: coupon test\n"
        "padding: {set: A, size: L}\nchinstrap: {routing: four-point low hook-up}\n"
    )
    code, checks, report = inspect(tmp_path, path, "--settings", settings)
    assert checks["unusable_parts"] == "pass"
    assert (report["padding"]["set"], report["chinstrap"]["routing"]) == ("A", "four-point low hook-up")
    out = tmp_path / "out"
    assert main(["helmet", "prepare", str(path), "--settings", str(settings), "--as", "1", "--out", str(out)]) == code
    if code == 0:
        assert "coupon test" in {m["source"] for m in read_model(out / "model.h5").materials.values()}


def test_what_is_prepared_dangles_nowhere_and_lies_in_its_block(tmp_path: Path, helmet: Model) -> None:
    text = deck_text(helmet, length=1e-3, density=TONNE.factor("density"), pressure=TONNE.factor("pressure"))
    extra = (
        "*SET_NODE_LIST_TITLE\nwith a stranger\n       500\n         1         2    999999\n"
        "*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_ID\n         7pads on shell\n         1         2         2         3\n"
        "       0.5       0.4\n       1.0       1.0\n*LOAD_BODY_Z\n         3      9.81\n*END\n"
    )
    out = tmp_path / "out"
    assert (
        main(["helmet", "prepare", str(write(tmp_path, text.replace("*END\n", extra))), "--as", "2", "--out", str(out)])
        == 0
    )
    deck = read_keyword(out / "helmet_H2.k")
    assert dangling(deck) == []
    numbers = [*deck.node_ids.tolist(), *deck.solids.ids.tolist(), *(e.id for e in deck.entries if e.kind)]
    assert min(numbers) > 20_000_000
    assert max(numbers) < 30_000_000
    assert deck.of_kind("part_set")[20000099].title == "H1_pads_set1"
    contact = deck.of_kind("contact")[20000001]
    assert contact.whole("ssid") == 20000099
    strangers = next(e for e in deck.of_kind("node_set").values() if e.title == "with a stranger")
    assert len(strangers.members()) == 2
    assert any("not there were taken out" in change for change in read_json(out / "prepared.json")["changes"])
    assert "*LOAD_BODY_Z" in (out / "left_out.k").read_text()
    table = (out / "renumbering.csv").read_text().splitlines()
    assert table[0] == "kind,old,new"
    assert sum(row.startswith("node,") for row in table) == len(deck.node_ids)


def test_the_include_file_and_the_model_say_the_same(tmp_path: Path, helmet: Model) -> None:
    """Nodes, elements, parts and masses of helmet_H1.k against model.h5, and both against the model before."""
    text = deck_text(helmet, length=1e-3, density=TONNE.factor("density"), pressure=TONNE.factor("pressure"))
    out = tmp_path / "out"
    assert main(["helmet", "prepare", str(write(tmp_path, text)), "--as", "1", "--out", str(out)]) == 0
    deck, back = read_keyword(out / "helmet_H1.k"), read_model(out / "model.h5")
    assert deck.node_ids.tolist() == back.node_ids.tolist()
    np.testing.assert_array_equal(deck.nodes, back.nodes)
    np.testing.assert_array_equal(deck.solids.nodes[:, :8], back.node_ids[back.hexes])
    assert deck.solids.ids.tolist() == back.element_ids.tolist()
    np.testing.assert_allclose(back.nodes, helmet.nodes, atol=1.1e-9)
    assert {p.pid for p in back.parts} == {p.pid for p in helmet.parts}  # pads and cup at the article's places
    assert assembly_mass(back).mass_kg == pytest.approx(assembly_mass(helmet).mass_kg, rel=1e-4)
    assert set(back.node_sets) == set(helmet.node_sets)
    shell, cards = back.part_index("shell"), deck.of_kind("material")
    mid = deck.of_kind("part")[back.parts[shell].pid].whole("mid")
    law = back.materials[back.parts[shell].material]
    assert cards[mid].number("e") == pytest.approx(law["parameters"]["youngs_modulus_pa"], rel=1e-5)


def test_axes_of_the_deck_are_turned_to_those_of_the_head(tmp_path: Path, helmet: Model) -> None:
    """A deck with y to the face and x to the right gives the same helmet."""
    turned = replace(helmet, nodes=np.column_stack([-helmet.nodes[:, 1], helmet.nodes[:, 0], helmet.nodes[:, 2]]))
    settings = tmp_path / "helmet.yaml"
    settings.write_text("frame: {forward: +y, up: +z}\n")
    _, _, report = inspect(tmp_path, write(tmp_path, deck_text(turned)), "--settings", settings)
    np.testing.assert_allclose(report["mass"]["cg_m"], assembly_mass(helmet).cg_m, atol=1e-7)


def test_all_mistakes_of_the_settings_come_at_once(tmp_path: Path, helmet: Model) -> None:
    settings = tmp_path / "helmet.yaml"
    settings.write_text("units: mm-tons-s\nframe: {forward: +x, up: -x}\nphysical: {mass_kg: -1}\nroutng: 3\n")
    with pytest.raises(InputErrors) as caught:
        from replay.stages.foreign_deck import open_deck

        open_deck([write(tmp_path, deck_text(helmet))], settings_file=settings)
    assert [error.line for error in caught.value.errors] == [1, 2, 3, 4]


def test_the_settings_of_the_page_are_settings(repository: Path, tmp_path: Path) -> None:
    import re

    from replay.documents import load_yaml
    from replay.models.surrogate_settings import HelmetSettings

    (example,) = re.findall(r"```yaml\n(.*?)```", (repository / "docs" / "decks.md").read_text(), flags=re.DOTALL)
    (tmp_path / "helmet.yaml").write_text(example)
    settings = load_yaml(tmp_path / "helmet.yaml", HelmetSettings)
    assert settings.materials[7].parameters["youngs_modulus_pa"] == 3.356e9
    assert settings.padding.set1 == (174, 175)


def own_deck(model: Model) -> DeckInput:
    from scipy.spatial.transform import Rotation

    position, rotation = np.array([12.3456789, -45.678, 1.8321]), Rotation.from_euler("xyz", [0.3, -1.1, 2.2])
    return DeckInput(
        title="round trip",
        nodes=position + rotation.apply(model.nodes),
        node_ids=model.node_ids,
        hexes=model.hexes,
        element_ids=model.element_ids,
        element_part=model.element_part,
        parts=deck_parts(model.parts, model.materials),
        part_sets=tuple(PartSet(model.part_set_ids[n], n, pids) for n, pids in model.part_sets.items()),
        node_sets=node_sets(model),
        element_sets=region_sets(model),
        facts=model_facts(model, position, rotation),
    )


def model_hash(folder: Path, model: Model) -> str:
    write_model(folder / "m.h5", model)
    return hashlib.sha256((folder / "m.h5").read_bytes()).hexdigest()


def test_our_assembly_comes_back_from_keyword_to_the_last_bit(tmp_path: Path, model: Model) -> None:
    write_lsdyna(tmp_path, own_deck(model))
    back = read_deck_as_model([tmp_path / "main.k"])
    assert model_hash(tmp_path, back) == model_hash(tmp_path, model)


def test_a_helmet_seated_by_contact_comes_back_too_with_contacts_and_straps_beside_it(tmp_path: Path) -> None:
    seated = build_model("nfl", "tiny", seat="contact")
    cables = tuple(
        Cable(s.name, int(s.nodes[0]), int(s.nodes[-1]), s.stiffness_n_per_m) for s in chin_straps(seated)[1]
    )
    write_lsdyna(tmp_path, replace(own_deck(seated), contact=True, cables=cables))
    text = (tmp_path / "main.k").read_text(encoding="utf-8")
    assert (text.count("*CONTACT_AUTOMATIC"), text.count("*ELEMENT_DISCRETE")) == (4, 4)
    back = read_deck_as_model([tmp_path / "main.k"])
    assert model_hash(tmp_path, back) == model_hash(tmp_path, seated)


def test_an_edited_card_holds_against_the_facts(tmp_path: Path, model: Model) -> None:
    write_lsdyna(tmp_path, own_deck(model))
    head = tmp_path / "head_1.k"
    scalp = next(part for part in model.parts if part.role == "scalp")
    young = model.materials[scalp.material]["parameters"]["youngs_modulus_pa"]
    text = head.read_text()
    assert text.count(card(float(young))) == 2, "scalp and face have one stiffness"
    first = text.index(card(float(young)), text.index(str(scalp.pid)))
    head.write_text(text[:first] + text[first:].replace(card(float(young)), card(2.0 * young), 1))
    back = read_deck_as_model([tmp_path / "main.k"])
    part = next(p for p in back.parts if p.role == "scalp")
    assert back.materials[part.material]["parameters"]["youngs_modulus_pa"] == pytest.approx(2 * young)
    assert back.materials[part.material]["source"].endswith("edited")


def test_a_deck_whose_facts_are_damaged_is_read_as_anybodys(tmp_path: Path, model: Model) -> None:
    write_lsdyna(tmp_path, own_deck(model))
    main_k = tmp_path / "main.k"
    main_k.write_text("\n".join(row for row in main_k.read_text().split("\n") if "$replay {" not in row))
    back = read_deck_as_model([main_k])
    assert len(back.hexes) == len(model.hexes)
    assert back.info["preset"] == "foreign deck"


def test_tetrahedra_and_pyramids_keep_their_volume() -> None:
    from replay.models.census import KINDS, as_hexes, element_kinds
    from replay.models.quality import hex_volumes

    nodes = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float
    )
    solids = np.full((6, 10), -1)
    solids[:, :8] = [
        [0, 1, 2, 3, 4, 5, 6, 7],
        [0, 1, 2, 3, 4, 4, 7, 7],  # a wedge: half the cube
        [0, 1, 2, 3, 4, 4, 4, 4],  # a pyramid: a third
        [0, 1, 2, 2, 4, 4, 4, 4],  # a tetrahedron: a sixth
        [0, 1, 3, 4, 4, 4, 4, 4],  # the same kind, its fourth node repeated
        [0, 1, 1, 0, 4, 5, 5, 4],  # flat
    ]
    kinds = element_kinds(solids)
    assert [KINDS[k] for k in kinds] == ["hexahedron", "wedge", "pyramid", "tetrahedron", "tetrahedron", "tetrahedron"]
    np.testing.assert_allclose(
        hex_volumes(nodes, as_hexes(solids, kinds)), [1, 1 / 2, 1 / 3, 1 / 6, 1 / 6, 0], atol=1e-15
    )
