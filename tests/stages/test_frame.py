"""What every stage promises: read what came before, refuse what changed, manifest last, one writer at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

from replay.errors import InputError, ReplayError
from replay.gates import Limits, helmet_gate
from replay.manifest import read_manifest
from replay.stages.frame import Stage, Workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace("demo", plays=tmp_path / "plays", results=tmp_path / "results")


def made(workspace: Workspace, text: str = "1") -> Stage:
    stage = Stage(workspace, "settings")
    stage.write("a.txt", "a file").write_text(text)
    stage.finish()
    return stage


def release(stage: Stage) -> None:
    stage._held.close()


def test_a_finished_stage_is_its_manifest(workspace: Workspace) -> None:
    release(made(workspace))
    manifest = read_manifest(workspace.folder("settings"))
    assert manifest.status == "done"
    assert [artifact.path for artifact in manifest.artifacts] == ["a.txt"]


def test_a_file_that_changed_is_refused_with_the_command_to_run(workspace: Workspace) -> None:
    release(made(workspace))
    (workspace.folder("settings") / "a.txt").write_text("2")
    with pytest.raises(InputError, match=r"a\.txt(.|\n)*replay settings"):
        Stage(workspace, "inputs", after=["settings"])


def test_a_stage_that_did_not_finish_is_named(workspace: Workspace) -> None:
    with pytest.raises(InputError, match="has not finished(.|\n)*replay settings"):
        Stage(workspace, "inputs", after=["settings"])


def test_a_second_writer_is_refused(workspace: Workspace) -> None:
    first = made(workspace)
    with pytest.raises(ReplayError, match="another process is writing this stage"):
        Stage(workspace, "settings")
    release(first)
    release(Stage(workspace, "settings"))


def test_old_files_go_only_when_the_first_new_one_comes(workspace: Workspace) -> None:
    release(made(workspace))
    (workspace.folder("settings") / "left-over.txt").write_text("old")
    stage = Stage(workspace, "settings")
    assert (workspace.folder("settings") / "manifest.json").exists()
    stage.write("b.txt", "a file").write_text("new")
    assert {p.name for p in workspace.folder("settings").iterdir()} == {"b.txt", ".lock"}


def test_a_checkpoint_survives_the_clearing(workspace: Workspace) -> None:
    folder = workspace.folder("replay") / "checkpoint"
    folder.mkdir(parents=True)
    stage = Stage(workspace, "replay", keep=("checkpoint",))
    stage.write("b.txt", "a file")
    assert folder.is_dir()


def test_a_gate_that_stops_the_play_stops_every_later_stage(
    workspace: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    good = {
        "mass_kg": 4.0,
        "cg_offset_m": 0.0,
        "length_m": 0.3,
        "width_m": 0.25,
        "height_m": 0.25,
        "wedge_share": 0.0,
        "removed_not_wedge": 0,
        "missing_interfaces": 0,
        "unusable_parts": 0,
        "colliding_ids": 0,
        "min_volume_m3": 1e-9,
        "min_scaled_jacobian": 0.5,
    }
    stage = Stage(workspace, "assembly")
    refusal = stage.finish([helmet_gate(good, Limits.load())])
    assert refusal is not None
    assert "mass_kg" in refusal
    assert "gate helmet: fail" in capsys.readouterr().out
    later = Stage(workspace, "shake", after=["assembly"])
    assert later.stopped_by == refusal
    assert later.skip().startswith("shake: not run")
    release(later)
    assert Stage(workspace, "replay", after=["shake"]).stopped_by == refusal


def test_a_file_that_was_never_made_is_an_input_error(workspace: Workspace) -> None:
    release(made(workspace))
    stage = Stage(workspace, "inputs", after=["settings"])
    with pytest.raises(InputError, match="made no such file"):
        stage.read("settings", "b.txt")
