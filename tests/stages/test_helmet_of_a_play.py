"""What a play says of its helmet reaches the model, the inputs and the manifest."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from replay.errors import InputError
from replay.files import read_json
from replay.models import read_model
from replay.stages import assemble, inputs, settings
from replay.stages.frame import Workspace


@pytest.fixture
def workspace(repository: Path, tmp_path: Path) -> Workspace:
    shutil.copytree(repository / "config" / "plays" / "demo", tmp_path / "plays" / "demo")
    return Workspace("demo", tmp_path / "plays", tmp_path / "results")


def say(workspace: Workspace, line: str) -> None:
    text = workspace.description.read_text(encoding="utf-8")
    assert "  preset: nfl\n" in text
    workspace.description.write_text(text.replace("  preset: nfl\n", f"  preset: nfl\n  {line}\n"), encoding="utf-8")


def test_a_play_brings_its_own_facemask(repository: Path, workspace: Workspace) -> None:
    shipped = repository / "src" / "replay" / "models" / "data" / "facemasks" / "open.yaml"
    text = shipped.read_text(encoding="utf-8").replace("title: open", "title: the kicker's")
    (workspace.description.parent / "kicker.yaml").write_text(text, encoding="utf-8")
    say(workspace, "facemask: kicker.yaml")
    settings.run(workspace, resolution="tiny")
    inputs.run(workspace)
    assert assemble.run(workspace) is None
    folder = workspace.results / "demo"
    model = read_model(folder / "assembly" / "model.h5")
    assert model.info["helmet"]["facemask"]["title"] == "the kicker's"
    assert model.info["helmet"]["chosen"]["facemask"] == "kicker.yaml"
    assert "kicker.yaml" in {file["file"] for file in read_json(folder / "inputs" / "inputs.json")["files"]}
    assert "inputs/kicker.yaml" in str(read_json(folder / "assembly" / "manifest.json"))
    (folder / "inputs" / "kicker.yaml").write_text(text + "# changed\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"kicker\.yaml"):
        assemble.run(workspace)


def test_a_helmet_can_be_worn_without_facemask(workspace: Workspace) -> None:
    say(workspace, "facemask: none")
    settings.run(workspace, resolution="tiny")
    assert assemble.run(workspace) is None
    parts = {part.role for part in read_model(workspace.folder("assembly") / "model.h5").parts}
    assert "shell" in parts
    assert "facemask" not in parts


@pytest.mark.parametrize(
    ("line", "match"),
    [("helmet: leather", "no helmet of this name"), ("pads: mine.yaml", "mine.yaml.*does not exist")],
)
def test_a_helmet_that_is_not_there_is_refused_before_anything_runs(
    workspace: Workspace, line: str, match: str
) -> None:
    say(workspace, line)
    with pytest.raises(InputError, match=match):
        settings.run(workspace)
    assert not workspace.folder("settings").joinpath("play.json").exists()
