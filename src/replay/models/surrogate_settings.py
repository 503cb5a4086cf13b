"""``helmet.yaml``: what a user says beside the deck of a helmet: units, axes, datum, interfaces, the real helmet."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from replay.documents import Number, Setting, refuse

Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Triple = tuple[Number, Number, Number]
Point = Annotated[int, Field(gt=0)] | Triple
Role = Literal["shell", "energy_pad", "comfort_pad", "facemask", "chin_cup", "strap", "other"]
UnitName = Literal["m-kg-s", "mm-tonne-s", "mm-kg-ms", "mm-g-ms", "cm-g-us", "cm-g-s", "in-lbf-s"]


class Frame(Setting):
    """How the deck's axes lie on the head."""

    forward: Axis = Field(default="+x", description="axis of the deck that points to the face")
    up: Axis = Field(default="+z", description="axis of the deck that points to the crown")
    origin_m: Triple = Field(default=(0.0, 0.0, 0.0), description="the head's centre of gravity in the deck's axes [m]")

    @model_validator(mode="after")
    def _two_axes(self) -> Frame:
        if self.forward[1] == self.up[1]:
            refuse(f"forward {self.forward} and up {self.up} lie along one axis", "two different axes")
        return self


class DatumPoints(Setting):
    """The three points of the helmet's datum: nodes by number, or points in the deck's own unit and axes."""

    brow: Point = Field(description="middle of the front edge of the shell")
    left: Point = Field(description="outermost point of the left side")
    right: Point = Field(description="outermost point of the right side")


class PhysicalHelmet(Setting):
    """What was measured on the real helmet."""

    mass_kg: Number | None = Field(default=None, gt=0, description="mass on the scales")
    cg_in_datum_m: Triple | None = Field(default=None, description="centre of gravity in the three-point datum")


class Padding(Setting):
    """The padding that is fitted (protocol 1.2)."""

    set: str = Field(default="", description="name of the padding set")
    size: str = Field(default="", description="its size")
    set1: tuple[int, ...] = Field(default=(), description="parts of pad set 1 (against the head)")
    set2: tuple[int, ...] = Field(default=(), description="parts of pad set 2 (against the shell)")


class Chinstrap(Setting):
    """How the chin strap runs (protocol 1.2)."""

    routing: str = Field(default="", description="such as: four-point, low hook-up")


class PartRole(Setting):
    """What a part of the deck is."""

    role: Role = Field(description="what it is")
    name: str = Field(default="", description="another name for it")


class OwnMaterial(Setting):
    """One of our laws in place of a card that cannot be mapped."""

    law: str = Field(description="name of the law")
    density_kg_per_m3: Number = Field(gt=0, description="mass density")
    parameters: dict[str, Number | tuple[Number, ...]] = Field(default_factory=dict, description="constants of the law")
    source: str = Field(default="", description="where the numbers are from")


class HelmetSettings(Setting):
    """``helmet.yaml``: everything is optional and found in the deck where it can be."""

    units: UnitName | None = Field(default=None, description="consistent units of the deck: length, mass, time")
    frame: Frame = Field(default=Frame(), description="the deck's axes on the head")
    datum: DatumPoints | None = Field(default=None, description="three-point datum")
    physical: PhysicalHelmet = Field(default=PhysicalHelmet(), description="the real helmet")
    padding: Padding = Field(default=Padding(), description="pads that are fitted")
    chinstrap: Chinstrap = Field(default=Chinstrap(), description="the strap")
    parts: dict[int, PartRole] = Field(default_factory=dict, description="part number to its role")
    facemask_mounts: dict[str, int] = Field(
        default_factory=dict, description="place (brow_left, side_high_left...) to the number of a node set"
    )
    strap_anchors: dict[str, int] = Field(
        default_factory=dict, description="place (front_left, rear_left...) to the number of a node set"
    )
    materials: dict[int, OwnMaterial] = Field(
        default_factory=dict, description="number of a *MAT card to one of our laws"
    )
