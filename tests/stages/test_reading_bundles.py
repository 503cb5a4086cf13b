"""Reading bundles as others do: one screen, one table, two laboratories that agree and one that must not."""

from __future__ import annotations

import csv
import html.parser
import json
import shutil
from pathlib import Path

import pytest
from tests.bundle.conftest import fabricate, fabricate_source

from replay.bundle import seal
from replay.cli import main
from replay.errors import BundleError
from replay.files import write_json
from replay.manifest import Artifact, read_manifest, write_manifest


@pytest.fixture(scope="module")
def laboratories(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three digitisations of one synthetic video, each with its own clicks; the third's template is 2 % too large."""
    root = tmp_path_factory.mktemp("laboratories")
    options = ["--plays", str(root / "plays"), "--results", str(root / "results")]
    for name, seed in (("north", 11), ("south", 12), ("west", 13)):
        play = root / "plays" / name
        assert main(["synth", "demo", "--into", str(play), "--seed", str(seed)]) == 0
        if name == "west":
            rows = list(csv.reader((play / "helmet_landmarks.csv").open()))
            scaled = [[row[0], *(repr(1.02 * float(cell)) for cell in row[1:])] for row in rows[1:]]
            (play / "helmet_landmarks.csv").write_text("\n".join(",".join(row) for row in [rows[0], *scaled]) + "\n")
        for stage in ("settings", "inputs", "reconstruct", "drive"):
            assert main([stage, name, *options]) == 0
    return root / "results"


def test_two_digitisations_of_one_video_agree(laboratories, capsys):
    capsys.readouterr()
    assert main(["agree", str(laboratories / "north"), str(laboratories / "south")]) == 0
    said = capsys.readouterr().out
    assert "south against north: accepted" in said
    assert "2 laboratories recover one driver" in said
    assert "fail" not in said
    for fact in ("t0 [ms]", "v at its start", "peak omega", "gate reconstruction", "ISO/TS 18571", "RMSE"):
        assert fact in said, fact


def test_a_third_with_a_template_2_percent_too_large_is_refused_for_that_reason(laboratories, tmp_path, capsys):
    capsys.readouterr()
    paths = [str(laboratories / name) for name in ("north", "south", "west")]
    assert main(["agree", *paths, "--out", str(tmp_path / "agreement.json")]) == 3
    said = capsys.readouterr().out
    assert "south against north: accepted" in said
    assert "the landmark template of west is 2.00 % larger than that of north" in said
    assert "refused: west against north, west against south; all of them with west" in said
    result = json.loads((tmp_path / "agreement.json").read_text())
    assert result["accepted"] is False
    assert [pair["verdict"] == "fail" for pair in result["pairs"]] == [False, True, True]
    for pair in result["pairs"][1:]:
        failed = {check["name"] for check in pair["checks"] if check["verdict"] == "fail"}
        assert "template_scale_percent" in failed


def change_json(stage: Path, file: str, change) -> None:
    """Change a file of a finished stage and let its manifest promise the new bytes, as a forger would."""
    value = json.loads((stage / file).read_text())
    value = change(value) or value
    write_json(stage / file, value)
    old = read_manifest(stage)
    artifacts = [Artifact(a.path, a.class_, a.rtol, a.atol, a.unit, a.meaning) for a in old.artifacts]
    write_manifest(stage, stage=old.stage, play=old.play, artifacts=artifacts)


def test_a_laboratory_that_loosened_a_limit_or_failed_a_gate_is_refused(laboratories, tmp_path, capsys):
    for name, stage, file, change, wanted in (
        (
            "south",
            "settings",
            "play.json",
            lambda v: v["gates"].update({"reconstruction.frames_above_8_px": 5}),
            "limits_as_shipped: south no",
        ),
        (
            "west",
            "reconstruction",
            "gate.json",
            lambda v: (v["checks"][0].update(verdict="fail"), v.update(verdict="fail"))[2:],
            "own_gates_passed: west no (limit yes): failed: reconstruction",
        ),
    ):
        shutil.copytree(laboratories / name, tmp_path / name)
        change_json(tmp_path / name / stage, file, change)
        capsys.readouterr()
        assert main(["agree", str(laboratories / "north"), str(tmp_path / name)]) == 3
        assert wanted in capsys.readouterr().out


def test_a_play_without_a_driver_or_a_lone_bundle_cannot_agree(laboratories, tmp_path, capsys):
    shutil.copytree(laboratories / "south", tmp_path / "south")
    shutil.rmtree(tmp_path / "south" / "driver")
    assert main(["agree", str(laboratories / "north"), str(tmp_path / "south")]) == 2
    assert "has no driver to compare: the run ended before it" in capsys.readouterr().err
    assert main(["agree", str(laboratories / "north")]) == 2
    assert "is one bundle alone" in capsys.readouterr().err


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Fabricated plays: accepted, rejected, and one whose run ended early."""
    source = fabricate_source(tmp_path_factory.mktemp("source"))
    made = {}
    for name in ("accepted", "rejected", "interrupted"):
        folder = tmp_path_factory.mktemp(name)
        results = fabricate(folder, rejected=name == "rejected")
        if name == "interrupted":
            shutil.rmtree(results / "verdict")
        made[name] = folder / "demo.zip"
        seal(results, made[name], source_root=source)
    return made


@pytest.mark.parametrize(
    ("kind", "wanted"),
    [
        ("accepted", "demo: ACCEPTED\n"),
        ("rejected", "demo: REJECTED\n"),
        ("interrupted", "demo: NOT JUDGED\n  the run ended before its verdict\n"),
    ],
)
def test_show_says_play_verdict_gates_and_versions_on_one_screen(bundles, capsys, kind, wanted):
    assert main(["show", str(bundles[kind])]) == 0
    said = capsys.readouterr().out
    assert said.startswith(wanted)
    assert "replay 0.1.0, python 3.11" in said
    assert len(said.splitlines()) <= 24
    if kind == "interrupted":
        assert "pass  reconstruction" in said


def test_show_and_table_show_nothing_that_was_changed(bundles, tmp_path, capsys):
    data = bundles["accepted"].read_bytes()
    at = data.index(b'"status": "accepted"')
    (tmp_path / "forged.zip").write_bytes(data[:at] + b'"status": "accEpted"' + data[at + 20 :])
    assert main(["show", str(tmp_path / "forged.zip")]) == 1
    assert "results/verdict/verdict.json: changed since it was sealed" in capsys.readouterr().err
    assert main(["table", str(tmp_path / "forged.zip"), "--out", str(tmp_path / "t")]) == 1
    assert "changed since it was sealed" in (tmp_path / "t.csv").read_text()


def test_a_file_of_another_kind_is_one_message_and_no_traceback(tmp_path, capsys):
    results = fabricate(tmp_path)
    change_json(results / "verdict", "verdict.json", lambda value: ["not", "a", "verdict"])
    assert main(["show", str(results)]) == BundleError.exit_code
    said = capsys.readouterr().err
    assert "its files are not those of a run of this kind" in said
    assert "Traceback" not in said


class _Cells(html.parser.HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data):
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


def test_a_table_over_many_bundles_has_a_row_for_each_and_names_the_bad_one(bundles, laboratories, tmp_path, capsys):
    (tmp_path / "text<b>.zip").write_text("hello")
    paths = [*bundles.values(), laboratories / "north", tmp_path / "text<b>.zip"]
    assert main(["table", *map(str, paths), "--out", str(tmp_path / "plays")]) == 1
    rows = list(csv.DictReader((tmp_path / "plays.csv").open()))
    assert [row["verdict"] for row in rows] == ["ACCEPTED", "REJECTED", "NOT JUDGED", "NOT JUDGED", "UNREADABLE"]
    assert rows[2]["reason"] == "the run ended before its verdict"
    assert "no end-of-archive record" in rows[4]["reason"]
    assert float(rows[3]["target_omega_rad_per_s"]) == pytest.approx(33.4, rel=0.05)
    assert float(rows[3]["rate_hz"]) == 239.76
    page = (tmp_path / "plays.html").read_text()
    cells = _Cells()
    cells.feed(page)
    assert len(cells.rows) == 1 + len(paths)
    assert rows[1]["reason"] == "shake.hourglass_ratio 0.2 (limit 0.1)"
    assert [("accepted" in row[1], "rejected" in row[1]) for row in cells.rows[1:3]] == [(True, False), (False, True)]
    assert not cells.tags & {"script", "link", "img"}
    assert "text<b>.zip" not in page
    assert "5 plays: 1" not in capsys.readouterr().out
