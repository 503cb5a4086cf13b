"""One play: where its motion comes from, what was worn, and how it is replayed."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator, model_validator

from replay.documents import Number, Setting, load_yaml, refuse
from replay.play.collision import Collision
from replay.play.controls import Shake, SolverSettings
from replay.play.fields import NotNegative
from replay.play.model import Helmet, ModelChoice
from replay.play.video import ClicksSource
from replay.play.wearable import WearableSource


class Window(Setting):
    """The time that is replayed."""

    before_t0_s: NotNegative = Field(default=0.010, description="Time before t0 at which the replay starts [s].")
    duration_s: Annotated[Number, Field(gt=0, le=1.0)] = Field(
        default=0.030, description="Length of the replay [s]; the article's is 30 ms."
    )


class NothingRecorded(Setting):
    """No motion was recorded: a test in a laboratory of computers, or a question what would happen."""

    kind: Literal["none"] = Field(default="none", description="Nothing was recorded; both starts are given.")

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files this source reads: none."""
        return ()


class ReconstructionChoice(Setting):
    """Which of the two reconstructions drives the replay; both are always made and shown."""

    mode: Literal["protocol", "posterior"] = Field(
        default="protocol",
        description="`protocol`: the article's method, comparable between laboratories; `posterior`: a motion from the "
        "middle of the batch estimate's posterior, which peaks between the frames.",
    )
    ensemble: Annotated[int, Field(ge=0, le=200)] = Field(
        default=0, description="Number of drivers drawn from the posterior, for an ensemble of replays; 0 for none."
    )
    draw: Annotated[int, Field(ge=0, le=200)] = Field(
        default=0,
        description="Which of these drivers drives the replay, not the mode's own motion; 0 for none.",
    )

    @field_validator("draw")
    @classmethod
    def _is_drawn(cls, value: int, info: ValidationInfo) -> int:
        if value > info.data.get("ensemble", value):
            count = info.data["ensemble"]
            refuse(f"driver {value} of {count}", f"at most {count}", "raise `reconstruction.ensemble`")
        return value


class Play(Setting):
    """One play: where its motion comes from, what was worn, and how it is replayed."""

    name: str = Field(description="Name of the play, that of its folder.", examples=["demo"])
    title: str = Field(default="", description="One sentence on the play.")
    struck_player: str = Field(default="not recorded", description="The player whose head is replayed.")
    source: Annotated[ClicksSource | WearableSource | NothingRecorded, Field(discriminator="kind")] = Field(
        description="Where the motion comes from.", examples=[{"kind": "clicks"}]
    )
    t0: Literal["angular", "linear"] = Field(
        default="angular", description="Impact reference: peak angular or linear acceleration (protocol 2.4)."
    )
    window: Window = Field(default_factory=lambda: Window(), description="The time that is replayed.")
    reconstruction: ReconstructionChoice = Field(
        default_factory=lambda: ReconstructionChoice(), description="Which reconstruction drives the replay."
    )
    helmet: Helmet = Field(default_factory=lambda: Helmet(), description="The physical helmet.")
    model: ModelChoice = Field(default_factory=lambda: ModelChoice(), description="The finite-element model.")
    solver: SolverSettings = Field(default_factory=lambda: SolverSettings(), description="Controls of the solver.")
    shake: Shake = Field(default_factory=lambda: Shake(), description="Stability check of the helmet.")
    collision: Collision | None = Field(
        default=None,
        description="Two players: with this block the play is a collision, free of any driver; without it one head is "
        "driven along its reconstructed motion.",
    )
    gates: dict[str, Number | dict[str, Number]] = Field(
        default_factory=dict,
        description="Limits this play sets itself, `gate.check: number` or `gate.check: {fail_above: number}`; "
        "a looser one is reported as loosened.",
    )
    withhold: dict[str, str] = Field(
        default_factory=dict,
        description="Files of the play's folder whose bytes may not be shared, `video.mp4: why`: the bundle has "
        "hash and reason instead.",
    )
    _folder: Path = PrivateAttr(default=Path())

    @model_validator(mode="after")
    def _only_a_helmet_that_touches_can_be_moved(self) -> Play:
        if any(self.helmet.offset_m) and self.model.helmet_seat != "contact":
            refuse(
                "helmet.offset_m moves a helmet that shares nodes with the head",
                "no offset, or `model.helmet_seat: contact`",
                "remove `offset_m`, or seat the helmet by contact",
            )
        return self

    @model_validator(mode="after")
    def _clicks_alone_have_a_posterior(self) -> Play:
        asked = self.reconstruction.mode == "posterior" or self.reconstruction.ensemble > 0
        if self.source.kind != "clicks" and asked:
            refuse(
                "reconstruction asks for the posterior of a wearable's record, or of none",
                "clicks: a wearable is read as it is",
                "remove the block `reconstruction`",
            )
        return self

    @model_validator(mode="after")
    def _without_a_record_starts_are_given(self) -> Play:
        if not self.recorded and (self.collision is None or not self.collision.given):
            refuse(
                "nothing was recorded, and nothing says how the head moves",
                "a block `collision` whose starts are given",
                "name a source of tracks, or describe the collision",
            )
        return self

    @property
    def mode(self) -> Literal["driver", "collision"]:
        """Whether one head is driven, or two players collide."""
        return "driver" if self.collision is None else "collision"

    @property
    def recorded(self) -> bool:
        """Whether there is a record of the head's motion, to be reconstructed and compared with."""
        return self.source.kind != "none"

    @property
    def folder(self) -> Path:
        """Folder of the play, where the files it names lie."""
        return self._folder

    def file(self, name: str) -> Path:
        """Path of a file that the play names."""
        return self._folder / name

    def lying_in(self, folder: Path) -> Play:
        """Return the same play with the files it names in another folder (the checked copies of a run)."""
        moved = self.model_copy()
        moved._folder = Path(folder)
        return moved

    @property
    def files(self) -> tuple[Path, ...]:
        """Every raw file the play names, in a fixed order."""
        return tuple(self.file(name) for name in (*self.source.files, *self.model.files))

    @field_validator("withhold")
    @classmethod
    def _are_there(cls, value: dict[str, str], info: ValidationInfo) -> dict[str, str]:
        folder = (info.context or {}).get("folder")
        for name, reason in value.items():
            if not reason.strip():
                refuse(
                    f"{name} is withheld for no reason", "one clause that says why", "write the reason after the name"
                )
            if name == "play.yaml" or (folder is not None and not (Path(folder) / name).is_file()):
                refuse(f"{name!r} cannot be withheld", "a file beside play.yaml", "correct the name")
        return value

    @field_validator("name")
    @classmethod
    def _is_folder(cls, value: str, info: ValidationInfo) -> str:
        if not re.fullmatch(r"[a-z0-9_-]+", value):
            refuse("is no name of a play", "small letters, digits, - and _", "rename the play and its folder")
        folder = (info.context or {}).get("folder")
        if folder is not None and Path(folder).resolve().name != value:
            refuse(f"the folder is called {Path(folder).resolve().name!r}", "one name for both", "rename one")
        return value


def load_play(path: Path) -> Play:
    """Read and check a play.

    Parameters
    ----------
    path
        ``play.yaml``, or the folder it lies in.

    Raises
    ------
    InputError, InputErrors
        All problems at once: file, line, dotted path, value, unit, what was expected, how to mend it.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "play.yaml"
    play = load_yaml(path, Play, context={"folder": path.parent})
    play._folder = path.parent
    return play


def play_schema() -> dict[str, Any]:
    """JSON schema of ``play.yaml``, for editors and for the workflow."""
    schema = Play.model_json_schema()
    for model, block in ((Play, schema), (SolverSettings, schema["$defs"]["SolverSettings"])):
        for name, info in model.model_fields.items():
            # pydantic leaves these two out where a block of settings is its own default
            block["properties"][name].setdefault("description", info.description)
            if info.default_factory is not None:
                value = info.get_default(call_default_factory=True, validated_data={})
                block["properties"][name]["default"] = (
                    value.model_dump(mode="json") if isinstance(value, Setting) else value
                )
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def play_schema_text() -> str:
    """Exact text of ``workflow/schemas/play.schema.json``."""
    return json.dumps(play_schema(), indent=2, ensure_ascii=False) + "\n"
