"""model.h5: the same bytes twice, everything comes back, a bad file says what is wrong."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from replay.errors import InputError
from replay.models import Model, build_model, read_model, write_model, write_parts_table, write_preview
from replay.models.parts_table import PARTS, summary_text


def test_the_same_model_has_the_same_bytes(tmp_path: Path, tiny: Model) -> None:
    write_model(tmp_path / "a.h5", tiny)
    write_model(tmp_path / "b.h5", build_model("nfl", "tiny"))
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_everything_comes_back(tmp_path: Path, model: Model) -> None:
    write_model(tmp_path / "model.h5", model)
    back = read_model(tmp_path / "model.h5")
    for name in ("nodes", "node_ids", "hexes", "element_ids", "element_part", "element_region"):
        np.testing.assert_array_equal(getattr(back, name), getattr(model, name))
    assert (back.parts, back.region_names) == (model.parts, model.region_names)
    assert (back.part_sets, back.part_set_ids) == (model.part_sets, model.part_set_ids)
    assert back.materials == model.materials
    assert back.info == model.info
    assert back.node_sets.keys() == model.node_sets.keys()
    for name, rows in model.node_sets.items():
        np.testing.assert_array_equal(back.node_sets[name], rows)


def test_a_bad_file_is_refused_by_name(tmp_path: Path, tiny: Model) -> None:
    path = tmp_path / "model.h5"
    with pytest.raises(InputError, match="does not exist"):
        read_model(path)
    path.write_bytes(b"not HDF5 at all")
    with pytest.raises(InputError, match="not a whole HDF5 file"):
        read_model(path)
    write_model(path, tiny)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="HDF5"):
        read_model(path)


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        (lambda f: f.__delitem__("elements/part"), "elements/part is missing"),
        (lambda f: f.__delitem__("document_json"), "document_json is missing"),
        (lambda f: f.attrs.__setitem__("schema_version", 99), "version 99"),
        (lambda f: f["elements/connectivity"].__setitem__((0, 0), 10**7), "hexes points to 10000000"),
        (lambda f: f["nodes/coordinates_m"].__setitem__((0, 0), np.nan), "not finite"),
        (lambda f: f["document_json"].__setitem__(slice(0, 5), 0), "document_json is damaged"),
    ],
)
def test_a_damaged_file_says_what_is_damaged(tmp_path: Path, tiny: Model, damage: object, match: str) -> None:
    path = tmp_path / "model.h5"
    write_model(path, tiny)
    with h5py.File(path, "r+") as file:
        damage(file)  # type: ignore[operator]
    with pytest.raises(InputError, match=match):
        read_model(path)


def test_the_table_of_parts_reads_back(tmp_path: Path, tiny: Model) -> None:
    write_parts_table(tmp_path / "parts.csv", tiny)
    table = PARTS.read(tmp_path / "parts.csv")
    assert table["pid"].tolist() == [part.pid for part in tiny.parts]
    assert table["mass_kg"].sum() == pytest.approx(4.90 + 1.83)
    assert table["elements"].sum() == len(tiny.hexes)
    rigid = table["law"] == "rigid"
    assert rigid.any()
    assert (table["stable_time_step_s"].isna() == rigid).all()
    assert "scalp" in summary_text(tiny)


def test_the_preview_is_a_picture_and_the_same_twice(tmp_path: Path, tiny: Model) -> None:
    write_preview(tmp_path / "a.png", tiny)
    write_preview(tmp_path / "b.png", tiny)
    content = (tmp_path / "a.png").read_bytes()
    assert content == (tmp_path / "b.png").read_bytes()
    assert content.startswith(b"\x89PNG")
    assert 20_000 < len(content) < 300_000
