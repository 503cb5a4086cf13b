"""A stage's manifest: written last, equal for equal runs, and quick to notice a changed file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from replay.errors import InputError
from replay.manifest import Artifact, StageManifest, check_manifest, read_manifest, write_manifest


def stage(folder: Path, log: str = "took 3 s\n") -> StageManifest:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "decks").mkdir(exist_ok=True)
    (folder / "driver.csv").write_text("time_s\n0.0\n")
    (folder / "decks/velodyne.card").write_text("*END\n")
    (folder / "run.log").write_text(log)
    return write_manifest(
        folder,
        stage="driver",
        play="demo",
        artifacts=[
            Artifact.volatile("run.log", "what the stage printed"),
            Artifact.exact("driver.csv", "motion for the solver"),
            Artifact.tolerance("decks/velodyne.card", "deck", rtol=1e-9, atol=1e-12, unit="m"),
        ],
        inputs={"inputs/clicks.csv": folder / "driver.csv"},
        parameters={"step_s": 5e-5},
        versions={"replay": "0.1.0", "numpy": "2"},
    )


def test_what_was_written_is_read_back(tmp_path):
    written = stage(tmp_path)
    assert read_manifest(tmp_path) == written == check_manifest(tmp_path)
    assert [a.path for a in written.artifacts] == ["decks/velodyne.card", "driver.csv", "run.log"]
    assert written.artifact("run.log").sha256 is None
    assert written.artifact("run.log").bytes is None
    assert written.artifact("driver.csv").bytes == 11
    assert written.artifact("nothing") is None


def test_equal_runs_write_equal_manifests_whatever_their_logs(tmp_path):
    stage(tmp_path / "a")
    stage(tmp_path / "b", log="took 30 s\n")
    text = (tmp_path / "a/manifest.json").read_bytes()
    assert text == (tmp_path / "b/manifest.json").read_bytes()
    assert str(tmp_path).encode() not in text


def test_a_stopped_stage_says_by_what(tmp_path):
    write_manifest(tmp_path, stage="replay", play="demo", artifacts=[], status="stopped", stopped_by="helmet gate")
    assert read_manifest(tmp_path).stopped_by == "helmet gate"
    with pytest.raises(ValueError, match="status 'stopped' with stopped_by None"):
        write_manifest(tmp_path, stage="replay", play="demo", artifacts=[], status="stopped")


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        (lambda f: (f / "driver.csv").unlink(), "driver.csv: listed by .* but missing"),
        (lambda f: (f / "driver.csv").write_text("time_s\n0.0\n1.0\n"), "driver.csv: changed: 15 bytes"),
        (lambda f: (f / "driver.csv").write_text("time_s\n0.1\n"), "driver.csv: changed since"),
        (lambda f: (f / "run.log").unlink(), "run.log: listed by .* but missing"),
        (lambda f: (f / "manifest.json").unlink(), "manifest.json: the stage has not finished"),
        (lambda f: (f / "manifest.json").write_text("{}"), "manifest.json: is not a stage manifest"),
        (lambda f: (f / "manifest.json").write_text("{"), "manifest.json:1: is not JSON"),
    ],
)
def test_the_first_bad_file_is_named_with_the_mend(tmp_path, damage, complaint):
    stage(tmp_path)
    damage(tmp_path)
    with pytest.raises(InputError, match=complaint):
        check_manifest(tmp_path)


def test_a_changed_log_is_no_complaint(tmp_path):
    stage(tmp_path)
    (tmp_path / "run.log").write_text("another")
    check_manifest(tmp_path)


@pytest.mark.parametrize("path", ["/etc/passwd", "../clicks.csv", "a\\b", "a//b", "", "./a"])
def test_paths_out_of_the_folder_are_refused(tmp_path, path):
    with pytest.raises(ValueError, match="not a plain relative path"):
        Artifact.exact(path, "x")
    stage(tmp_path)
    value = json.loads((tmp_path / "manifest.json").read_text())
    value["artifacts"][0]["path"] = path
    (tmp_path / "manifest.json").write_text(json.dumps(value))
    with pytest.raises(InputError, match="not a stage manifest"):
        read_manifest(tmp_path)


def test_listing_what_is_not_there_or_twice_is_our_own_mistake(tmp_path):
    stage(tmp_path)
    one = Artifact.exact("driver.csv", "motion")
    with pytest.raises(ValueError, match=r"listed twice \['driver.csv'\]"):
        write_manifest(tmp_path, stage="driver", play="demo", artifacts=[one, one])
    with pytest.raises(ValueError, match=r"missing \['none.csv'\]"):
        write_manifest(tmp_path, stage="driver", play="demo", artifacts=[Artifact.exact("none.csv", "x")])
    with pytest.raises(ValueError, match="not plain"):
        write_manifest(tmp_path, stage="d", play="p", artifacts=[], inputs={"/a": tmp_path / "driver.csv"})


def test_tolerances_belong_to_class_tolerance():
    with pytest.raises(ValueError, match="rtol and atol"):
        Artifact("a.csv", "exact", rtol=1e-3, atol=0.0)
    with pytest.raises(ValueError, match="rtol and atol"):
        Artifact("a.csv", "tolerance")
    with pytest.raises(ValueError, match="not one of the classes"):
        Artifact("a.csv", "roughly")
