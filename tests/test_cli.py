"""The command line: one message for a user's mistake, the right exit code, never a traceback."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from replay import cli
from replay.cli import main
from replay.doctor import lock_finding
from replay.motion.synthetic import PULSES


@pytest.fixture
def plays(repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of plays of its own, in a working folder of its own."""
    shutil.copytree(repository / "config" / "plays", tmp_path / "plays")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "plays"


def said(capsys: pytest.CaptureFixture[str]) -> str:
    captured = capsys.readouterr()
    assert "Traceback" not in captured.out + captured.err
    return captured.out + captured.err


def test_a_play_that_does_not_exist_is_named(plays: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["settings", "nobody", "--plays", "plays"]) == 2
    assert "plays/nobody/play.yaml: the file does not exist" in said(capsys)


def test_a_stage_before_its_time_says_which_command_comes_first(
    plays: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["settings", "demo", "--plays", "plays"]) == 0
    assert main(["reconstruct", "demo"]) == 2
    assert "replay inputs" in said(capsys)


def test_a_bad_track_leaves_nothing_behind(plays: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clicks = plays / "demo" / "kinovea_clicks.csv"
    clicks.write_text(clicks.read_text().replace("u_px", "u_pixels"))
    assert main(["settings", "demo", "--plays", "plays"]) == 0
    assert main(["inputs", "demo", "--plays", "plays"]) == 2
    assert "kinovea_clicks.csv:1: column u_px is missing" in said(capsys)
    assert not Path("results/demo/inputs").exists()


def test_a_bad_track_costs_no_earlier_result(plays: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["settings", "demo", "--plays", "plays"]) == 0
    assert main(["inputs", "demo", "--plays", "plays"]) == 0
    before = Path("results/demo/inputs/manifest.json").read_bytes()
    (plays / "demo" / "kinovea_clicks.csv").write_text("")
    assert main(["inputs", "demo", "--plays", "plays"]) == 2
    assert Path("results/demo/inputs/manifest.json").read_bytes() == before
    assert "the file is empty" in said(capsys)


def test_footage_that_cannot_carry_it_exits_3_and_later_stages_say_why(
    plays: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in ("settings", "inputs"):
        assert main([command, "broadcast", "--plays", "plays"]) == 0
    assert main(["reconstruct", "broadcast"]) == 3
    assert main(["drive", "broadcast"]) == 3
    assert "driver: not run, stopped by gate reconstruction" in said(capsys)
    assert main(["drive", "broadcast", "--carry-on"]) == 0


def test_a_verdict_that_is_not_there_says_how_to_make_it(plays: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verdict", "results/demo"]) == 2
    assert "make run PLAY=demo" in said(capsys)


@pytest.mark.parametrize("kind", ["demo", "broadcast", "wearable"])
def test_a_synthetic_play_can_be_made_and_checked(plays: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["synth", kind, "--into", "plays/mine", "--seed", "7"]) == 0
    assert main(["settings", "mine", "--plays", "plays"]) == 0
    assert main(["inputs", "mine", "--plays", "plays"]) == 0
    assert main(["synth", kind, "--into", "plays/mine"]) == 2
    assert "the folder is not empty" in said(capsys)


@pytest.mark.parametrize(
    "options",
    [
        [
            "--family",
            "double",
            "--draw",
            "--landmarks",
            "10",
            "--occlusion",
            "0.1",
            "--outliers",
            "0.04",
            "--blur",
            "0.3",
        ],
        ["--motion", "plays/demo/truth.csv", "--fps", "240", "--zoom", "0.1"],
        ["--pan", "0.1", "--row-time", "1e-5"],
    ],
)
def test_any_footage_can_be_made_and_its_tracks_pass_the_door(
    plays: Path, options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["synth", "footage", "--into", "plays/mine", "--seed", "7", *options]) == 0
    assert main(["settings", "mine", "--plays", "plays"]) == 0
    assert main(["inputs", "mine", "--plays", "plays"]) == 0
    facts = json.loads(Path("results/mine/inputs/inputs.json").read_text())["facts"]
    assert facts["frames"] > 15
    assert ("pan" in facts) == ("--pan" in options)
    assert ("rolling_shutter" in facts) == ("--row-time" in options)
    first = Path("plays/mine/kinovea_clicks.csv").read_bytes()
    assert main(["synth", "footage", "--into", "plays/again", "--seed", "7", *options]) == 0
    assert Path("plays/again/kinovea_clicks.csv").read_bytes() == first


def test_the_command_line_offers_the_generators_pulses() -> None:
    assert set(cli._PULSES) == set(PULSES)


def test_a_record_that_is_none_is_named(plays: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = str(plays / "demo" / "helmet_landmarks.csv")
    assert main(["synth", "footage", "--into", "plays/mine", "--motion", record]) == 2
    assert "time_s" in said(capsys)
    assert not Path("plays/mine").exists()


def test_a_model_can_be_built_by_itself(plays: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["model", "--resolution", "tiny", "--out", "model.h5", "--preview", "model.png"]) == 0
    assert "brain" in said(capsys)
    assert Path("model.h5").stat().st_size > 10_000
    assert Path("model.png").read_bytes().startswith(b"\x89PNG")


def test_a_player_can_be_built_by_himself(
    plays: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("lean.yaml").write_text("angles: {waist: {flexion: 20}, knee_left: {flexion: 30}}\n", encoding="utf-8")
    assert main(["model", "--resolution", "tiny", "--body", "lean.yaml", "--mass", "90", "--out", "player.h5"]) == 0
    told = capsys.readouterr().out
    assert "body 1.85 m, 90 kg, lean, rigid segments, voxels of 40 mm" in told
    assert "neck and head" in told
    assert "90.000" in told.splitlines()[-1]
    for arguments, message in (
        (["--body", "lying"], "lying: is no posture and no file"),
        (["--body", "standing", "--stature", "2.5"], "a stature [m] of 2.5; between 1.5 and 2.1 is possible"),
        (["--body", "standing", "--voxel", "0.001"], "voxels of 0.001 m; between 0.015 and 0.045 m is possible"),
        (["--body", "bent.yaml"], "bent.yaml: posture bent: knee_left flexion is 150 degrees"),
        (["--body", "odd.yaml"], "odd.yaml"),
    ):
        Path("bent.yaml").write_text("angles: {knee: {flexion: 150}}\n", encoding="utf-8")
        Path("odd.yaml").write_text("angel: {knee: {flexion: 150}}\n", encoding="utf-8")
        assert main(["model", "--resolution", "tiny", *arguments, "--out", "other.h5"]) == 2
        assert message in capsys.readouterr().err
        assert not Path("other.h5").exists()


def test_the_schema_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert '"$schema"' in capsys.readouterr().out


def test_the_doctor_says_one_line_for_each_thing(
    repository: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(repository)
    monkeypatch.setattr("replay.doctor.shutil.which", lambda _: None)  # what Slurm there is, is tests/workflow's
    assert main(["doctor"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {line.split()[1] for line in lines} >= {"python", "environment", "threads", "memory", "disk", "gpu"}


def test_the_doctor_finds_an_environment_that_drifted(tmp_path: Path) -> None:
    lock = tmp_path / "environment.lock"
    lock.write_text("numpy==1.0.0 \\\n    --hash=sha256:0\nno-such-package==2.0 ; python_version >= '3.8' \\\n")
    finding = lock_finding(lock)
    assert not finding.ok
    assert "instead of 1.0.0" in finding.found
    assert "no-such-package nothing instead of 2.0" in finding.found


def test_a_full_disk_is_one_message(
    plays: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import errno
    import os

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    assert main(["settings", "demo", "--plays", "plays"]) == 1
    assert "No space left on device" in said(capsys)
    assert not [p for p in Path("results").rglob("*") if p.is_file() and p.name != ".lock"]
