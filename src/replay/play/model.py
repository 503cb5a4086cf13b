"""What was worn, and the finite-element model that stands for it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from replay.documents import Number, Setting, refuse
from replay.play.fields import Positive, Vector3, existing_file

HELMET_MASS_KG = 1.82
"""Target mass of a helmet, protocol step 1.3."""
HELMET_MASS_RANGE_KG = 0.5
"""Acceptance range around the target, protocol step 1.3."""


def _name_or_file(name: str, info: ValidationInfo) -> str:
    return existing_file(name, info) if name.endswith((".yaml", ".yml")) else name


HelmetPiece = Annotated[str, Field(min_length=1), AfterValidator(_name_or_file)]
"""A description of a helmet's piece: a name that ships, or a YAML file in the play's folder."""


class Helmet(Setting):
    """The physical helmet that was worn."""

    model: str = Field(default="classic", description="Name of the helmet model.", min_length=1)
    mass_kg: Number | None = Field(
        default=None,
        description="Mass as worn [kg]; 1.82 +- 0.5 is accepted (protocol 1.3). Without it the finite-element helmet "
        "keeps the mass of its description, and no gate compares the two.",
    )
    mass_tolerance_kg: Positive = Field(
        default=0.05, description="Agreement asked of the finite-element helmet's mass [kg]."
    )
    cg_tolerance_m: Positive = Field(
        default=0.010, description="Agreement asked of the finite-element helmet's CG [m]."
    )
    offset_m: Vector3 = Field(
        default=(0.0, 0.0, 0.0),
        description="Displacement of the helmet from its nominal seat, head axes [m]; for a helmet seated by contact.",
    )
    padding: str = Field(default="not recorded", description="Padding set and size (protocol 1.2).")
    chinstrap: str = Field(default="not recorded", description="Routing of the chin strap (protocol 1.2).")

    @field_validator("mass_kg")
    @classmethod
    def _plausible(cls, value: float | None) -> float | None:
        if value is not None and abs(value - HELMET_MASS_KG) > HELMET_MASS_RANGE_KG + 1e-12:
            refuse(
                "is no mass of a football helmet",
                f"{HELMET_MASS_KG} +- {HELMET_MASS_RANGE_KG} kg",
                "weigh the helmet with facemask and pads, in kilograms",
            )
        return value


class ModelChoice(Setting):
    """The finite-element model."""

    preset: Literal["anat", "nfl", "article"] = Field(
        default="nfl",
        description="Head: `anat` an average man, `nfl` a professional player, `article` the published volumes.",
    )
    resolution: Literal["tiny", "coarse", "medium", "fine"] = Field(default="coarse", description="Mesh resolution.")
    brain_material: Literal["brain_isv", "viscohyperelastic"] = Field(
        default="brain_isv",
        description="Law of the brain: `brain_isv` with its damage variable, or `viscohyperelastic` without.",
    )
    membranes: Literal["none", "cables"] = Field(
        default="none",
        description="Falx and tentorium: `none`, or `cables`, sheets of dura as nets of cables that only pull.",
    )
    outlet: Literal["closed", "open"] = Field(
        default="closed",
        description="Skull below the brainstem: `closed`, or `open` with fluid in the foramen magnum.",
    )
    helmet: HelmetPiece = Field(
        default="classic",
        description="Helmet: `classic` in the article's proportions, `modern` thicker and heavier, or a YAML file "
        "beside play.yaml.",
    )
    facemask: HelmetPiece | None = Field(
        default=None,
        description="Facemask: `classic`, `modern`, `open`, `none` to leave it off, or a YAML file; without a value "
        "that of the helmet.",
    )
    pads: HelmetPiece | None = Field(
        default=None,
        description="Pads: `classic`, `modern` or a YAML file; without a value those of the helmet.",
    )
    chinstrap: HelmetPiece | None = Field(
        default=None,
        description="Routing of the chin strap: `low`, `high`, `two_point` or a YAML file; without a value that of the "
        "helmet.",
    )
    helmet_structure: Literal["rigid", "deformable"] = Field(
        default="rigid",
        description="Shell and facemask: `rigid` as one body; `deformable` elastic, one hex across, whose bending the "
        "hourglass gate refuses at these resolutions.",
    )
    helmet_seat: Literal["shared_nodes", "contact"] = Field(
        default="shared_nodes",
        description="Pads and chin cup on the scalp: `shared_nodes` joins them to it; `contact` lets them slide and "
        "lift off, held by chin straps: contact does not pass the numerics gate on this helmet yet.",
    )

    @property
    def helmet_pieces(self) -> tuple[str, str | None, str | None, str | None]:
        """What describes helmet, facemask, pads and chin strap."""
        return self.helmet, self.facemask, self.pads, self.chinstrap

    @property
    def files(self) -> tuple[str, ...]:
        """Files that describe the helmet, in a fixed order, each once."""
        named = [name for name in self.helmet_pieces if name and name.endswith((".yaml", ".yml"))]
        return tuple(dict.fromkeys(named))
