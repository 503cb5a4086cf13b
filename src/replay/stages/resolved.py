"""The play as its settings stage resolved it, for every later stage."""

from __future__ import annotations

from pathlib import Path

from replay.files import read_json
from replay.play import ADDRESS, Play
from replay.play.ensemble import ENDING
from replay.stages.frame import Finished, Workspace

FILE = "play.json"
"""File of stage ``settings`` with every default and override spelled out."""


def read_settings(stage: Finished) -> Play:
    """Settings of the play for a later stage; the tracks it names lie in the folder of stage ``inputs``."""
    play = Play.model_validate(read_json(stage.read("settings", FILE)))
    return play.lying_in(stage.workspace.folder("inputs"))


def ensemble_file(workspace: Workspace) -> Path:
    """Description of the ensemble that the workspace's address names: beside the play it is of."""
    match = ADDRESS.fullmatch(workspace.play)
    assert match
    return workspace.plays / match["play"] / f"{match['ensemble']}{ENDING}"
