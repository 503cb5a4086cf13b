"""A table says where it is wrong: file, line, column, what was found, how to mend it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.errors import InputError, InputErrors
from replay.tables import Column, TableFormat

CLICKS = TableFormat(
    "table of clicks",
    (
        Column("frame", "frame number", "int"),
        Column("landmark_id", "name", "text", aliases=("landmark",)),
        Column("u_px", "image x", aliases=("u",)),
        Column("weight", "confidence", may_be_empty=True),
    ),
)
GOOD = "frame,landmark_id,u_px,weight\n1,LM1,100.5,\n2,LM1,101.25,0.5\n"


def written(tmp_path: Path, text: str, encoding: str = "utf-8") -> Path:
    path = tmp_path / "clicks.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("plain", GOOD),
        ("byte-order mark", "\ufeff" + GOOD),
        ("CRLF", GOOD.replace("\n", "\r\n")),
        ("blank lines", GOOD.replace("\n", "\n\n")),
        ("aliases", GOOD.replace("landmark_id", "landmark").replace("u_px", "u")),
        ("padding", GOOD.replace(",", " , ")),
    ],
)
def test_the_same_table_in_every_dialect(tmp_path: Path, name: str, text: str) -> None:
    frame = CLICKS.read(written(tmp_path, text))
    assert frame["frame"].tolist() == [1, 2], name
    assert frame["u_px"].tolist() == [100.5, 101.25]
    assert np.isnan(frame["weight"].iloc[0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("frame,landmark_id,u_px,weight\n", "no row"),
        (GOOD.replace("u_px", "x_px"), r"clicks.csv:1: column u_px is missing"),
        (GOOD.replace("101.25", "nan"), r"clicks.csv:3: u_px: the cell is nan"),
        (GOOD.replace("101.25", ""), r"clicks.csv:3: u_px: the cell is empty"),
        (GOOD.replace("101.25", "1o1"), r"clicks.csv:3: u_px: '1o1' is not a number"),
        (GOOD.replace("101.25", '"101,25"'), "decimal comma"),
        (GOOD.replace("101.25", "101,25"), r"clicks.csv:3: 5 cells where the heading has 4(.|\n)*decimal commas"),
        (GOOD.replace(",", ";").replace(".", ","), "separated by semicolons"),
        (GOOD.replace("2,LM1", "2.5,LM1"), r"clicks.csv:3: frame: '2.5' is not a whole number"),
        (GOOD.replace("101.25", "inf"), "not finite"),
        (GOOD.replace("weight", "u_px"), "'u_px' occurs twice"),
    ],
)
def test_a_bad_table_names_line_column_and_mend(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        CLICKS.read(written(tmp_path, text))
    assert caught.value.exit_code == 2
    assert caught.value.mend


def test_all_errors_come_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputErrors, match="2 problems") as caught:
        CLICKS.read(written(tmp_path, "frame,landmark_id,u_px,weight\n1,,1,\n2,LM1,x,\n"))
    assert [error.line for error in caught.value.errors] == [2, 3]


def test_one_mistake_on_many_lines_is_one_problem(tmp_path: Path) -> None:
    rows = "".join(f"{k},LM1,{k}.5,\n" for k in range(1, 15)).replace(".5", ",5")
    with pytest.raises(
        InputErrors, match=r"clicks.csv:2: 5 cells(.|\n)*decimal commas(.|\n)*also: line 3, 4,"
    ) as caught:
        CLICKS.read(written(tmp_path, "frame,landmark_id,u_px,weight\n" + rows))
    assert str(caught.value).count("mend:") == 1


def test_a_latin_1_file_is_refused_with_the_mend(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not UTF-8"):
        CLICKS.read(written(tmp_path, GOOD.replace("LM1", "LMé"), "latin-1"))


def test_numbers_survive_the_file_bit_for_bit(tmp_path: Path) -> None:
    values = np.random.default_rng(1).normal(size=50) * 10.0 ** np.arange(-25, 25)
    table = TableFormat("numbers", (Column("x_m", "a number"),))
    table.write(tmp_path / "x.csv", {"x_m": values})
    assert np.array_equal(table.read(tmp_path / "x.csv")["x_m"].to_numpy(), values)
    first = (tmp_path / "x.csv").read_bytes()
    table.write(tmp_path / "x.csv", {"x_m": values})
    assert (tmp_path / "x.csv").read_bytes() == first


def test_a_wrong_set_of_columns_is_our_own_mistake(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="missing or unknown"):
        CLICKS.write(tmp_path / "x.csv", {"frame": [1]})
    assert not (tmp_path / "x.csv").exists()


def test_a_quotation_mark_that_never_closes_and_a_table_of_nothing_are_named(tmp_path):
    with pytest.raises(InputError, match="no table of cells"):
        CLICKS.read(written(tmp_path, 'frame,landmark_id,u_px,weight\n1,"LM1,2,3\n' + "1,LM1,2,3\n" * 20000))
    with pytest.raises(InputError, match="every cell is empty"):
        CLICKS.read(written(tmp_path, '""\n" "\n'))
