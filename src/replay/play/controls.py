"""Controls of the solver and of the helmet's shake, protocol 1.6 and 3.3."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from replay.documents import Number, Setting
from replay.play.fields import NotNegative, Positive


class Hourglass(Setting):
    """Hourglass stabilisation, protocol 3.3.2."""

    method: Literal["stiffness", "selective", "viscous"] = Field(
        default="stiffness",
        description="Form of the stabilisation; `selective` is a stiffness form that tells bending from twisting.",
    )
    coefficient: Annotated[Number, Field(ge=0, le=0.3)] = Field(default=0.10, description="Coefficient.")


class BulkViscosity(Setting):
    """Bulk viscosity, protocol 3.3.3."""

    quadratic: NotNegative = Field(default=1.2, description="Quadratic coefficient.")
    linear: NotNegative = Field(default=0.06, description="Linear coefficient.")


class FrictionPair(Setting):
    """Friction of two parts, or sets of parts."""

    first: str = Field(description="Part or part set of the model, by name.", examples=["scalp"])
    second: str = Field(description="Part or part set that it touches.", examples=["H1_pads_set1"])
    friction: NotNegative = Field(description="Coulomb's coefficient.", examples=[0.5])


class ContactSettings(Setting):
    """Global contact of all parts, protocol 3.3.5."""

    scheme: Literal["lagrange"] = Field(
        default="lagrange",
        description="Lagrange multipliers on velocities (the article's scheme 3, constraint type 0).",
    )
    most_iterations: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=200,
        description="Iterations of the multipliers in a step, at most; the article has 20, another solver's.",
    )
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = Field(
        default=1.0e-3, description="Convergence tolerance of the multipliers."
    )
    points: Literal["corners", "center_plus_corners"] = Field(
        default="center_plus_corners",
        description="What may not pass a face: nodes, or centres too of faces about which the surface turns.",
    )
    friction: NotNegative = Field(default=0.0, description="Coefficient between parts that no pair names.")
    pairs: tuple[FrictionPair, ...] = Field(default=(), description="Friction by pair; a later one wins.")
    self_contact: tuple[str, ...] = Field(default=(), description="Parts or part sets that may touch themselves.")


class Contact(ContactSettings):
    """Global contact of all parts, protocol 3.2 and 3.3.5."""

    pairs: tuple[FrictionPair, ...] = Field(
        default=(
            FrictionPair(first="scalp", second="H1_pads_set1", friction=0.5),
            FrictionPair(first="scalp", second="H1_pads_set2", friction=0.5),
            FrictionPair(first="face", second="H1_pads_set1", friction=0.5),
            FrictionPair(first="face", second="H1_pads_set2", friction=0.5),
            FrictionPair(first="face", second="chin_cup", friction=0.5),
        ),
        description="Friction by pair; a later one wins. Pads and chin cup on skin as in protocol 3.2.",
    )


class SolverSettings(Setting):
    """Controls of the solver, protocol 3.3."""

    time_step_factor: Annotated[Number, Field(gt=0, le=1)] = Field(
        default=0.9, description="Factor on the stable time step."
    )
    hourglass: Hourglass = Field(default_factory=lambda: Hourglass(), description="Hourglass stabilisation.")
    bulk_viscosity: BulkViscosity = Field(default_factory=lambda: BulkViscosity(), description="Bulk viscosity.")
    contact: Contact = Field(
        default_factory=lambda: Contact(), description="Contact, of a helmet that is seated by it."
    )
    mass_scaling_time_step_s: NotNegative = Field(
        default=1.92e-7, description="Time step that mass scaling holds; 0 turns it off [s]."
    )
    plot_interval_s: Positive = Field(default=1.0e-3, description="Time between stored states [s].")
    history_interval_s: Positive = Field(
        default=1.0e-4, description="Time between history samples (the article: 1e-3) [s]."
    )


class Shake(Setting):
    """Stability check of the helmet alone, protocol 1.6."""

    duration_s: Annotated[Number, Field(gt=0, le=2.0e-3)] = Field(default=1.0e-3, description="Length [s].")
    speed_m_per_s: Positive = Field(default=0.4, description="Initial speed along x [m/s].")
