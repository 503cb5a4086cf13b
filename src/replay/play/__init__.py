"""The validated description of one play: ``config/plays/<play>/play.yaml``.

Every setting has a description, a unit in its name and, where one is sensible, a default. The JSON
schema of ``workflow/schemas/play.schema.json`` is generated from these models.
"""

from replay.play.collision import Collision, GivenStart, Player, ReconstructedStart
from replay.play.controls import (
    BulkViscosity,
    Contact,
    FrictionPair,
    Hourglass,
    Shake,
    SolverSettings,
)
from replay.play.description import Play, ReconstructionChoice, Window, load_play, play_schema, play_schema_text
from replay.play.fields import InputFile, NotNegative, Positive, Quaternion, Vector3
from replay.play.model import HELMET_MASS_KG, HELMET_MASS_RANGE_KG, Helmet, ModelChoice
from replay.play.video import ClicksSource
from replay.play.wearable import (
    AccelerationColumns,
    AngularAccelerationColumns,
    AngularVelocityColumns,
    AxisMap,
    ButterworthFilter,
    CfcFilter,
    Filter,
    NoFilter,
    TimeColumn,
    WearableColumns,
    WearableSource,
)

__all__ = [
    "HELMET_MASS_KG",
    "HELMET_MASS_RANGE_KG",
    "AccelerationColumns",
    "AngularAccelerationColumns",
    "AngularVelocityColumns",
    "AxisMap",
    "BulkViscosity",
    "ButterworthFilter",
    "CfcFilter",
    "ClicksSource",
    "Collision",
    "Contact",
    "Filter",
    "FrictionPair",
    "GivenStart",
    "Helmet",
    "Hourglass",
    "InputFile",
    "ModelChoice",
    "NoFilter",
    "NotNegative",
    "Play",
    "Player",
    "Positive",
    "Quaternion",
    "ReconstructedStart",
    "ReconstructionChoice",
    "Shake",
    "SolverSettings",
    "TimeColumn",
    "Vector3",
    "WearableColumns",
    "WearableSource",
    "Window",
    "load_play",
    "play_schema",
    "play_schema_text",
]
