"""The table of plays: a line a play, overrides by column, and every mistake with its line and column."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from replay.errors import InputError, InputErrors
from replay.play import load_play, overridden, read_plays_table, write_out


def table(folder: Path, *lines: str) -> Path:
    path = folder / "plays.tsv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_line_is_a_play_of_its_own_with_what_its_cells_replace(repository: Path, tmp_path: Path) -> None:
    plays = repository / "config" / "plays"
    head = "play\tbase\twindow.duration_s\thelmet.offset_m\tmodel.helmet_seat\tgates.fidelity.rmse_percent_of_peak"
    path = table(tmp_path, "# a season", head, "", "short\twearable\t0.005\t[0, 0, 0.001]\tcontact\t9", "wearable")
    rows = read_plays_table(path)
    assert list(rows) == ["short", "wearable"]
    assert rows["wearable"].is_a_folder
    written = load_play(write_out(rows["short"], plays, tmp_path / "out"))
    base = load_play(plays / "wearable")
    assert (written.name, written.window.duration_s, written.helmet.offset_m) == ("short", 0.005, (0.0, 0.0, 0.001))
    assert written.gates == {"fidelity.rmse_percent_of_peak": 9.0}
    assert written.source == base.source
    assert [p.read_bytes() for p in written.files] == [p.read_bytes() for p in base.files]


def test_the_same_row_is_written_to_the_same_bytes_wherever_it_stands(repository: Path, tmp_path: Path) -> None:
    plays, row = repository / "config" / "plays", "light\twearable\t1.7"
    written = []
    for name, lines in (("one", [row]), ("two", ["other\tdemo\t", row])):
        (tmp_path / name).mkdir()
        rows = read_plays_table(table(tmp_path / name, "play\tbase\thelmet.mass_kg", *lines))
        written.append(write_out(rows["light"], plays, tmp_path / name).read_bytes())
    assert written[0] == written[1]


def test_a_track_has_a_second_name_and_not_a_second_copy(repository: Path, tmp_path: Path) -> None:
    import shutil

    shutil.copytree(repository / "config/plays/wearable", tmp_path / "plays/wearable")
    rows = read_plays_table(table(tmp_path, "play\tbase", "again\twearable"))
    write_out(rows["again"], tmp_path / "plays", tmp_path / "out")
    track = tmp_path / "plays/wearable/wearable.csv"
    assert track.samefile(tmp_path / "out/again/wearable.csv")


@pytest.mark.parametrize(
    ("head", "row", "line", "column", "said"),
    [
        ("name\tbase", "a\tb", 1, None, "has no column `play`"),
        ("play,base", "a,b", 1, None, "put tabs between the columns"),
        ("play\thelmet.mas_kg", "a\t2", 1, "helmet.mas_kg", "did you mean `helmet.mass_kg`"),
        ("play\tt0.x", "a\t2", 1, "t0.x", "one value"),
        ("play\tname", "a\tb", 1, "name", "not a column's to set"),
        ("play\tt0\tt0", "a\tlinear\tangular", 1, "t0", "comes twice"),
        ("play\tbase", "Week 1\tdemo", 2, "play", "is no name of a play"),
        ("play\tbase", "a\t../demo", 2, "base", "is no name of a play"),
        ("play\tt0", "a\tlinear\textra", 2, None, "3 cells where the heading has 2"),
        ("play\thelmet.offset_m", "a\t[0, 0", 2, "helmet.offset_m", "is no value"),
    ],
)
def test_a_table_that_cannot_be_read_names_line_and_column(
    tmp_path: Path, head: str, row: str, line: int, column: str | None, said: str
) -> None:
    with pytest.raises(InputError) as caught:
        read_plays_table(table(tmp_path, head, row))
    assert (caught.value.line, caught.value.column) == (line, column)
    assert said in str(caught.value)


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputErrors, match="stands in line 2 too") as caught:
        read_plays_table(table(tmp_path, "play\tbase", "a\tdemo", "a\tdemo", "B\tdemo"))
    assert [error.line for error in caught.value.errors] == [3, 4]


@pytest.mark.parametrize(
    ("row", "column", "said"),
    [
        ("heavy\tdemo\theavy\t", "helmet.mass_kg", "not a number"),
        ("heavy\tdemo\t9\t", "helmet.mass_kg", "no mass of a football helmet"),
        ("draw\tdemo\t\t3", "reconstruction.draw", "driver 3 of 0"),
        ("lost\tnowhere\t\t", "base", "no play is described in"),
    ],
)
def test_a_value_that_does_not_suit_its_setting_names_line_and_column(
    repository: Path, tmp_path: Path, row: str, column: str, said: str
) -> None:
    path = table(tmp_path, "play\tbase\thelmet.mass_kg\treconstruction.draw", row)
    (play,) = read_plays_table(path).values()
    with pytest.raises(InputError, match=said) as caught:
        write_out(play, repository / "config" / "plays", tmp_path / "out")
    assert (caught.value.file, caught.value.line, caught.value.column) == (str(path), 2, column)
    assert not (tmp_path / "out").exists()


def test_a_broken_base_names_its_own_file(tmp_path: Path) -> None:
    (tmp_path / "plays/base").mkdir(parents=True)
    (tmp_path / "plays/base/play.yaml").write_text("name: base\nsource: {kind: wearables}\n")
    (row,) = read_plays_table(table(tmp_path, "play\tbase", "a\tbase")).values()
    with pytest.raises(InputError, match="play.yaml:2"):
        write_out(row, tmp_path / "plays", tmp_path / "out")


def test_the_shipped_table_describes_plays_that_can_be_written_out(repository: Path, tmp_path: Path) -> None:
    rows = read_plays_table(repository / "config" / "plays.tsv")
    for row in rows.values():
        assert load_play(write_out(row, repository / "config" / "plays", tmp_path)).name == row.play


def test_an_override_leaves_what_it_was_made_of_alone() -> None:
    data = {"window": {"duration_s": 0.03}}
    changed = overridden(data, {"window.duration_s": 0.01, "solver.contact.friction": 0.2, "gates.a.b": 1})
    assert data == {"window": {"duration_s": 0.03}}
    assert yaml.safe_load(yaml.safe_dump(changed)) == {
        "window": {"duration_s": 0.01},
        "solver": {"contact": {"friction": 0.2}},
        "gates": {"a.b": 1},
    }
