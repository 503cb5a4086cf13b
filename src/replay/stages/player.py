"""``replay model --body``: a player with a body in a posture, by himself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pydantic import Field

from replay import models
from replay.documents import Number, Setting, load_yaml
from replay.errors import InputError
from replay.models import BodyPlan, Model, Posture


class PostureFile(Setting):
    """A posture as a YAML file."""

    title: str = Field(default="", description="One sentence on the posture.")
    angles: dict[str, dict[str, Number]] = Field(
        description="Joint to angle to degrees: `knee_left: {flexion: 40}`; `knee` means both sides."
    )


def read_posture(name: str) -> Posture | str:
    """Take the name of a posture of the model's, or read a file of joint angles.

    Raises
    ------
    InputError, InputErrors
        When it is neither, or the file has a mistake.
    """
    if name in models.posture_names():
        return name
    path = Path(name)
    if not path.is_file():
        raise InputError(
            name, "is no posture and no file", expected=", ".join(models.posture_names()),
            mend="take one of these, or name a YAML file of joint angles (docs/model.md)",
        )  # fmt: skip
    return Posture(path.stem, load_yaml(path, PostureFile).angles)


def add_body(model: Model, posture: str, plan: BodyPlan) -> Model:
    """Give a head its body.

    Parameters
    ----------
    model
        Head and helmet.
    posture
        Name of a posture, or of a file of joint angles.
    plan
        Everything else of the body.

    Raises
    ------
    InputError, InputErrors
        For a posture, stature or mass that cannot be.
    """
    chosen = read_posture(posture)
    try:
        return models.with_body(model, replace(plan, posture=chosen))
    except ValueError as error:
        where = posture if isinstance(chosen, Posture) else "replay model --body"
        raise InputError(where, str(error), mend="docs/model.md has the joints and their limits") from None
