"""Stage ``settings``: the play's description, checked and resolved, as an artifact of the run."""

from __future__ import annotations

from pathlib import Path

from replay.files import read_json, write_json
from replay.gates import Limits
from replay.models import load_design
from replay.play import ModelChoice, Play, load_play
from replay.stages.frame import Stage, Workspace

FILE = "play.json"


def run(workspace: Workspace, *, resolution: str | None = None) -> str | None:
    """Check ``play.yaml`` and write it with every default and override spelled out.

    Parameters
    ----------
    workspace
        Where the play's files are.
    resolution
        Replaces the play's own ``model.resolution``.
    """
    play = load_play(workspace.description)
    Limits.load(play.gates, file=workspace.description)
    if resolution:
        choice = ModelChoice.model_validate({**play.model.model_dump(), "resolution": resolution})
        play = play.model_copy(update={"model": choice})
    load_design(*play.model.helmet_pieces, folder=play.folder)
    stage = Stage(workspace, "settings")
    stage.read_file("play.yaml", workspace.description)
    source = {
        key: Path(value).name if value in play.source.files else value
        for key, value in play.source.model_dump(mode="json").items()
    }
    model = {
        key: Path(value).name if value in play.model.files else value
        for key, value in play.model.model_dump(mode="json").items()
    }
    resolved = {**play.model_dump(mode="json"), "source": source, "model": model}
    write_json(stage.write(FILE, "the play with every default spelled out"), resolved)
    print(f"{play.name}: {play.title or 'no title'} ({play.source.kind}, {play.model.resolution})")
    return stage.finish()


def read_settings(stage: Stage) -> Play:
    """Settings of the play for a later stage; the tracks it names lie in the folder of stage ``inputs``."""
    play = Play.model_validate(read_json(stage.read("settings", FILE)))
    return play.lying_in(stage.workspace.folder("inputs"))
