"""Where the motion comes from when it was worn: a mouthguard, a headform, a sensor on the helmet."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from replay.documents import Setting, refuse
from replay.play.fields import InputFile, Positive, Quaternion, Vector3


class TimeColumn(Setting):
    """The time column of a wearable's table."""

    name: str = Field(description="Heading of the column.", examples=["time_ms"])
    unit: Literal["s", "ms", "us"] = Field(description="Unit of the column.", examples=["ms"])


class AccelerationColumns(Setting):
    """The three columns of linear acceleration."""

    names: tuple[str, str, str] = Field(
        description="Headings along the sensor's x, y, z.", examples=[["ax_g", "ay_g", "az_g"]]
    )
    unit: Literal["g", "m/s^2"] = Field(description="Unit (g = 9.80665 m/s^2).", examples=["g"])


class AngularVelocityColumns(Setting):
    """The three columns of angular velocity."""

    names: tuple[str, str, str] = Field(
        description="Headings along the sensor's x, y, z.", examples=[["wx_deg_s", "wy_deg_s", "wz_deg_s"]]
    )
    unit: Literal["rad/s", "deg/s"] = Field(description="Unit.", examples=["deg/s"])


class AngularAccelerationColumns(Setting):
    """The three columns of angular acceleration."""

    names: tuple[str, str, str] = Field(
        description="Headings along the sensor's x, y, z.", examples=[["alx", "aly", "alz"]]
    )
    unit: Literal["rad/s^2", "deg/s^2"] = Field(description="Unit.", examples=["rad/s^2"])


class WearableColumns(Setting):
    """Which column of the table is what, in which unit."""

    time: TimeColumn = Field(description="Time.", examples=[{"name": "time_ms", "unit": "ms"}])
    acceleration: AccelerationColumns = Field(
        description="Linear acceleration at the sensor.", examples=[{"names": ["ax_g", "ay_g", "az_g"], "unit": "g"}]
    )
    angular_velocity: AngularVelocityColumns = Field(
        description="Angular velocity.", examples=[{"names": ["wx", "wy", "wz"], "unit": "rad/s"}]
    )
    angular_acceleration: AngularAccelerationColumns | None = Field(
        default=None, description="Angular acceleration; where absent it is the central difference of angular velocity."
    )


_SIGNED_AXIS = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
_NAMED_AXES = {
    "head": (("+x", "+y", "+z")),
    "sae_j211": (("+x", "-y", "-z")),
}


class AxisMap(Setting):
    """Head axes written as signed axes of the sensor."""

    x: _SIGNED_AXIS = Field(description="Sensor axis that points anterior.", examples=["+x"])
    y: _SIGNED_AXIS = Field(description="Sensor axis that points left.", examples=["-y"])
    z: _SIGNED_AXIS = Field(description="Sensor axis that points superior.", examples=["-z"])

    @model_validator(mode="after")
    def _right_handed(self) -> AxisMap:
        if round(float(np.linalg.det(_axis_matrix((self.x, self.y, self.z))))) != 1:
            refuse(
                "the axes are no rotation (a mirror, or an axis used twice)",
                "three different axes, right-handed",
                "turn the sign of one axis; SAE J211 (x forward, y right, z down) is {x: +x, y: -y, z: -z}",
            )
        return self


def _axis_matrix(axes: tuple[str, str, str]) -> np.ndarray:
    rows = []
    for axis in axes:
        row = np.zeros(3)
        row["xyz".index(axis[1])] = -1.0 if axis[0] == "-" else 1.0
        rows.append(row)
    return np.array(rows)


class NoFilter(Setting):
    """The table is used as it is."""

    kind: Literal["none"] = Field(default="none", description="No filter: the device has filtered already.")


class CfcFilter(Setting):
    """SAE J211 channel frequency class."""

    kind: Literal["cfc"] = Field(default="cfc", description="SAE J211 channel frequency class, phaseless.")
    channel_class: Positive = Field(default=180.0, description="Class (60, 180, 1000); -3 dB at 1.67 times it [Hz].")


class ButterworthFilter(Setting):
    """Zero-phase Butterworth."""

    kind: Literal["butterworth"] = Field(
        default="butterworth", description="Second-order Butterworth, forward and backward."
    )
    cutoff_hz: Positive = Field(default=200.0, description="Cutoff of the two passes together, -3 dB [Hz].")


Filter = Annotated[NoFilter | CfcFilter | ButterworthFilter, Field(discriminator="kind")]


class WearableSource(Setting):
    """Motion from a mouthguard, headform or other wearable."""

    kind: Literal["wearable"] = Field(default="wearable", description="Source of the motion: a wearable's table.")
    kinematics: InputFile = Field(
        default="wearable.csv", description="The wearable's table (CSV, evenly sampled).", validate_default=True
    )
    columns: WearableColumns = Field(
        description="Which column is what, in which unit.",
        examples=[
            {
                "time": {"name": "time_ms", "unit": "ms"},
                "acceleration": {"names": ["ax_g", "ay_g", "az_g"], "unit": "g"},
                "angular_velocity": {"names": ["wx", "wy", "wz"], "unit": "rad/s"},
            }
        ],
    )
    axes: Literal["head", "sae_j211"] | AxisMap = Field(
        description="Sensor axes: `head` (x anterior, y left, z superior), `sae_j211` (x forward, y right, z down), "
        "or head axes as signed sensor axes {x: +x, y: -y, z: -z}.",
        examples=["sae_j211"],
    )
    sensor_to_cg_m: Vector3 = Field(
        description="From the sensor to the head CG, head axes [m]; [0, 0, 0] where the device already moved it.",
        examples=[[-0.075, 0.0, 0.055]],
    )
    filter: Filter = Field(
        description="Filter for all channels: {kind: none}, {kind: cfc, channel_class: 180}, "
        "{kind: butterworth, cutoff_hz: 200}.",
        examples=[{"kind": "none"}],
    )
    acceleration_range_m_per_s2: Positive | None = Field(
        default=None, description="Full range of the accelerometer, each axis [m/s^2]; a peak at it is clipped."
    )
    angular_velocity_range_rad_per_s: Positive | None = Field(
        default=None, description="Full range of the gyroscope, each axis [rad/s]; a peak at it is clipped."
    )
    gravity: Literal["removed", "included"] = Field(
        default="removed", description="`included` where a head at rest reads 1 g upward; it is then taken out."
    )
    initial_velocity_m_per_s: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="Velocity of the head CG at the first sample, global axes [m/s]."
    )
    initial_orientation: Quaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0),
        description="Rotation head to global at the first sample, quaternion (x, y, z, w).",
    )

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files this source reads."""
        return (self.kinematics,)

    @property
    def axis_matrix(self) -> np.ndarray:
        """Rotation ``(3, 3)`` from sensor axes to head axes."""
        if isinstance(self.axes, AxisMap):
            return _axis_matrix((self.axes.x, self.axes.y, self.axes.z))
        a, b, c = _NAMED_AXES[self.axes]
        return _axis_matrix((a, b, c))
