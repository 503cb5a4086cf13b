"""The article's main experiment: an impactor with its velocities, a struck player who is free (protocol 3.4 to 3.6)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from replay.documents import Number, Setting, refuse
from replay.play.controls import FrictionPair
from replay.play.fields import Positive, Quaternion, Vector3

Shipped = Annotated[str, Field(pattern=r"^[a-z_]+$")]
"""Name of a piece of a helmet that ships with the models."""
_LEAST_AXIS_M = 1e-9


class GivenStart(Setting):
    """Posture and velocities at first contact, as the article's Table 3 states them."""

    kind: Literal["given"] = Field(default="given", description="Posture and velocities stand here.")
    orientation: Quaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0), description="Rotation head axes to global, quaternion (x, y, z, w)."
    )
    velocity_m_per_s: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="Velocity of the axis P-Q, global axes (protocol 3.6) [m/s]."
    )
    omega_rad_per_s: Number = Field(
        default=0.0, description="Angular velocity of the whole player, right-handed about P to Q [rad/s]."
    )
    p_m: Vector3 = Field(default=(0.0, 0.0, 0.0), description="Point P of the axis: from the head CG, head axes [m].")
    q_m: Vector3 = Field(default=(0.0, 0.0, 1.0), description="Point Q of the axis: from the head CG, head axes [m].")

    @model_validator(mode="after")
    def _an_axis(self) -> GivenStart:
        if not float(np.linalg.norm(np.subtract(self.q_m, self.p_m))) > _LEAST_AXIS_M:
            refuse("P and Q are one point", "two points that span the axis", "move Q along the angular velocity")
        return self


class ReconstructedStart(Setting):
    """Posture and velocities from the reconstruction of the player whom the tracks show."""

    kind: Literal["reconstruction"] = Field(
        default="reconstruction", description="Posture and velocities are fitted to the reconstruction."
    )
    fit_s: Positive = Field(
        default=0.020,
        description="Length of the record, ending where the window begins, to which a straight path and a steady turn "
        "are fitted: one frame alone would carry its noise into the whole run [s].",
    )


Start = Annotated[GivenStart | ReconstructedStart, Field(discriminator="kind")]


class Body(Setting):
    """The body below a player's head."""

    stature_m: Annotated[Number, Field(ge=1.6, le=2.1)] = Field(default=1.85, description="Stature [m].")
    mass_kg: Annotated[Number, Field(ge=60, le=180)] = Field(
        default=110.0, description="Mass without helmet, the head included [kg]."
    )
    muscle: Annotated[Number, Field(ge=0.5, le=1.0)] = Field(default=0.9, description="0.5 average, 1 most.")
    posture: Literal["standing", "striker", "struck"] = Field(
        default="standing", description="Posture of trunk and limbs; the head turns as its start says."
    )
    tissue: Literal["rigid", "deformable"] = Field(
        default="rigid",
        description="`rigid`: segments move as one but for flesh at the joints; `deformable`: flesh about bones.",
    )


class Worn(Setting):
    """What of the helmet is not as `model` says."""

    helmet: Shipped | None = Field(default=None, description="Helmet: `classic` or `modern`.")
    facemask: Shipped | None = Field(default=None, description="Facemask: `classic`, `modern`, `open`, or `none`.")
    pads: Shipped | None = Field(default=None, description="Pads: `classic` or `modern`.")
    chinstrap: Shipped | None = Field(default=None, description="Chin strap: `low`, `high` or `two_point`.")


class Player(Setting):
    """One of the two players."""

    name: str = Field(default="not recorded", description="Who it is.", min_length=1)
    wears: Worn = Field(
        default_factory=lambda: Worn(),
        description="What this player wears that `model` does not say of both.",
        examples=[{"facemask": "none"}],
    )
    body: Body | None = Field(
        default=None, description="The body; without it head and helmet are free, and the report says what that lacks."
    )
    start: Start = Field(
        default_factory=lambda: GivenStart(),
        description="Posture and velocities: `given`, or by `reconstruction`; at rest, facing along x, where absent.",
        examples=[{"kind": "given", "velocity_m_per_s": [9.3, 0.0, 0.0]}, {"kind": "reconstruction"}],
    )


class ApparatusChoice(Setting):
    """A laboratory's apparatus in the striking player's place."""

    name: Shipped = Field(
        description="`linear_impactor`, a free ram with foam and cap; `drop_anvil`, on which the head falls.",
        examples=["linear_impactor"],
    )
    place: Shipped = Field(
        description="Where it meets the helmet: a place of its description, docs/collision.md.", examples=["side"]
    )
    speed_m_per_s: Positive = Field(
        description="Closing speed: of the ram, or of the head that falls on the anvil [m/s].", examples=[7.4]
    )


class Collision(Setting):
    """Two players, the impactor with its initial velocities, the struck one unconstrained."""

    impactor: Player | None = Field(
        default=None,
        description="Who strikes; protocol 3.6 gives the velocities to this player.",
        examples=[{"start": {"kind": "given", "velocity_m_per_s": [9.3, 0.0, 0.0]}}],
    )
    apparatus: ApparatusChoice | None = Field(
        default=None,
        description="What strikes in a laboratory, in place of an impactor.",
        examples=[{"name": "linear_impactor", "place": "side", "speed_m_per_s": 7.4}],
    )
    struck: Player = Field(
        default_factory=lambda: Player(),
        description="Who is struck; at rest unless the start says otherwise.",
        examples=[{"name": "number 12"}],
    )
    tracked: Literal["struck", "impactor"] = Field(
        default="struck", description="Whose head the tracks show: fidelity compares this head's motion."
    )
    aim_m: Vector3 = Field(
        default=(0.0, 0.0, 0.0),
        description="Point through which the impactor's head CG would pass, from the struck head's CG, its axes [m].",
    )
    gap_m: Annotated[Number, Field(gt=0, le=0.01)] = Field(
        default=1.0e-3, description="Gap left by the search for first contact along the closing velocity [m]."
    )
    pairs: tuple[FrictionPair, ...] = Field(
        default=(FrictionPair(first="helmet_1", second="helmet_2", friction=0.3),),
        description="Friction between the players, by pair of parts or part sets: helmet_1 is the struck "
        "player's, helmet_2 the impactor's, which is apparatus by default where one strikes; 0.3 of painted "
        "polycarbonate is assumed.",
    )

    @model_validator(mode="before")
    @classmethod
    def _friction_with_what_strikes(cls, told: Any) -> Any:
        if isinstance(told, dict) and told.get("apparatus") is not None and "pairs" not in told:
            return {**told, "pairs": [{"first": "helmet_1", "second": "apparatus", "friction": 0.3}]}
        return told

    @model_validator(mode="after")
    def _one_strikes(self) -> Collision:
        if (self.impactor is None) == (self.apparatus is None):
            refuse("not one strikes", "an `impactor`, or an `apparatus` of a laboratory", "keep one of the two blocks")
        start = self.struck.start
        if self.apparatus is not None and (start.kind != "given" or any(start.velocity_m_per_s)):
            refuse(
                "the struck player has a velocity of their own", "the apparatus's `speed_m_per_s` alone",
                "leave the struck player's velocity out",
            )  # fmt: skip
        if self.apparatus is not None and self.tracked != "struck":
            refuse("an apparatus has no head to be tracked", "`tracked: struck`", "leave `tracked` out")
        return self

    @model_validator(mode="after")
    def _starts_are_known(self) -> Collision:
        for role in ("impactor", "struck"):
            player = self.player(role)
            if player is not None and player.start.kind == "reconstruction" and role != self.tracked:
                refuse(
                    f"the start of the {role} is to be reconstructed, but the tracks show the other player",
                    f"`tracked: {role}`, or a given start",
                    "one set of tracks shows one head",
                )
        return self

    def player(self, role: str) -> Player | None:
        """The ``struck`` player or the ``impactor``; None where an apparatus strikes."""
        return self.struck if role == "struck" else self.impactor

    @property
    def given(self) -> bool:
        """Whether both starts stand in the play, and none is reconstructed."""
        players = (self.player(role) for role in ("impactor", "struck"))
        return all(player.start.kind == "given" for player in players if player is not None)
