"""The model that is replayed: one assembled head, or the scene of two players."""

from __future__ import annotations

from replay.models import Model, read_model
from replay.stages.frame import Stage

SCENE = "scene.h5"
"""Both players at first contact, of stage ``placement``."""


def replayed_model(stage: Stage) -> Model:
    """The assembled model, or the scene of two players where the play is a collision."""
    if stage.made("placement", SCENE):
        return read_model(stage.read("placement", SCENE))
    return read_model(stage.read("assembly", "model.h5"))
