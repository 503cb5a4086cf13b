"""The validated description of one play: ``config/plays/<play>/play.yaml``.

Every setting has a description, a unit in its name and, where one is sensible, a default. The JSON
schema of ``workflow/schemas/play.schema.json`` is generated from these models.
"""

from replay.play.collision import ApparatusChoice, Collision, GivenStart, Player, ReconstructedStart
from replay.play.controls import (
    BulkViscosity,
    Contact,
    ContactSettings,
    FrictionPair,
    Hourglass,
    Shake,
    SolverSettings,
)
from replay.play.cost import Estimate, estimate
from replay.play.description import Play, ReconstructionChoice, Window, load_play, play_schema, play_schema_text
from replay.play.ensemble import ADDRESS, EnsembleSettings, Member, members_of, read_ensemble
from replay.play.fields import InputFile, NotNegative, Positive, Quaternion, Vector3
from replay.play.model import HELMET_MASS_KG, HELMET_MASS_RANGE_KG, Helmet, ModelChoice
from replay.play.overrides import overridden
from replay.play.table import Row, read_plays_table, write_out
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
    "ADDRESS",
    "HELMET_MASS_KG",
    "HELMET_MASS_RANGE_KG",
    "AccelerationColumns",
    "AngularAccelerationColumns",
    "AngularVelocityColumns",
    "ApparatusChoice",
    "AxisMap",
    "BulkViscosity",
    "ButterworthFilter",
    "CfcFilter",
    "ClicksSource",
    "Collision",
    "Contact",
    "ContactSettings",
    "EnsembleSettings",
    "Estimate",
    "Filter",
    "FrictionPair",
    "GivenStart",
    "Helmet",
    "Hourglass",
    "InputFile",
    "Member",
    "ModelChoice",
    "NoFilter",
    "NotNegative",
    "Play",
    "Player",
    "Positive",
    "Quaternion",
    "ReconstructedStart",
    "ReconstructionChoice",
    "Row",
    "Shake",
    "SolverSettings",
    "TimeColumn",
    "Vector3",
    "WearableColumns",
    "WearableSource",
    "Window",
    "estimate",
    "load_play",
    "members_of",
    "overridden",
    "play_schema",
    "play_schema_text",
    "read_ensemble",
    "read_plays_table",
    "write_out",
]
