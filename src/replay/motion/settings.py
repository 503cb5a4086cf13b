"""``Config.json``: the camera, the filters, and where the head CG lies in the landmark template."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from replay.documents import Number, Setting, load_json, refuse
from replay.play import Positive, Quaternion, Vector3

LEVEL_CAMERA = (-float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5)))
"""Camera to global of a level camera: global x to the right, y forward, z up."""
OFFSET_WARNING_M = 0.15
"""A CG further than this from the landmark template's origin is outside any helmet's reference points."""


class Cutoffs(Setting):
    """Cutoffs of the zero-phase moving averages, -3 dB."""

    linear: Positive = Field(default=15.0, description="Position [Hz].")
    angular: Positive = Field(default=40.0, description="Orientation [Hz].")
    focal: Positive = Field(default=5.0, description="Focal length [Hz].")


class CameraSettings(Setting):
    """The article's Config.json, with what single-view footage needs beyond it as optional keys."""

    fps: Positive = Field(description="Frame rate [Hz].", examples=[59.94])
    principal_point: tuple[Positive, Positive] = Field(
        description="Principal point [px]; the article takes the image centre.", examples=[[640, 360]]
    )
    cutoffs: Cutoffs = Field(default_factory=lambda: Cutoffs(), description="Filter cutoffs [Hz].")
    helmet_to_com: Vector3 = Field(
        description="From the template's origin to the skull CG, template axes [m].", examples=[[0.01, 0.0, 0.03]]
    )
    image_size: tuple[Annotated[int, Field(gt=0)], Annotated[int, Field(gt=0)]] | None = Field(
        default=None, description="Width and height [px]; default twice the principal point."
    )
    distortion: tuple[Number, Number, Number, Number, Number] | None = Field(
        default=None, description="k1, k2, p1, p2, k3 of the Brown model; default none, as in the article."
    )
    camera_distance_m: Positive | None = Field(
        default=None, description="Distance from the camera to the head in the middle of the clip [m]."
    )
    camera_distance_sigma_m: Positive | None = Field(
        default=None, description="Standard deviation of camera_distance_m [m]."
    )
    focal_length_px: Positive | None = Field(default=None, description="Focal length known from the lens [px].")
    focal_length_sigma_px: Positive | None = Field(
        default=None, description="Standard deviation of focal_length_px [px]."
    )
    lens: Literal["zoom", "fixed"] = Field(
        default="zoom",
        description="`fixed`: the focal length does not change in the clip, so that a reference holds for its mean; "
        "`zoom`: it may, and a reference holds for each frame alone.",
    )
    click_sigma_px: Positive = Field(
        default=2.7, description="Standard deviation of one click coordinate [px], where residuals cannot tell."
    )
    camera_to_global: Quaternion = Field(
        default=LEVEL_CAMERA,
        description="Rotation camera (x right, y down, z forward) to global (z up), quaternion (x, y, z, w).",
    )
    template_to_head: Quaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0),
        description="Rotation from template axes to head axes, quaternion (x, y, z, w); default parallel.",
    )

    @model_validator(mode="after")
    def _references_are_whole(self) -> CameraSettings:
        for name, sigma in (
            ("camera_distance_m", "camera_distance_sigma_m"),
            ("focal_length_px", "focal_length_sigma_px"),
        ):
            if (getattr(self, name) is None) != (getattr(self, sigma) is None):
                refuse(f"{name} and {sigma} belong together", "both or neither", "add the missing one")
        width, height = self.size
        cx, cy = self.principal_point
        if not (0 < cx < width and 0 < cy < height):
            refuse(
                f"principal_point {cx:g}, {cy:g} lies outside the image of {width:g} x {height:g} px",
                "a point inside the image",
                "correct principal_point or image_size",
            )
        return self

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the image [px]."""
        if self.image_size is not None:
            return float(self.image_size[0]), float(self.image_size[1])
        return 2.0 * self.principal_point[0], 2.0 * self.principal_point[1]

    @property
    def offset_m(self) -> float:
        """Length of helmet_to_com [m]."""
        return float(np.linalg.norm(self.helmet_to_com))

    @property
    def rotation_to_global(self) -> Rotation:
        """Camera axes to global axes."""
        return Rotation.from_quat(self.camera_to_global)

    @property
    def has_reference(self) -> bool:
        """Whether anything but the clicks says how long the focal length is."""
        return self.camera_distance_m is not None or self.focal_length_px is not None

    def warnings(self) -> list[str]:
        """What is accepted but deserves a word."""
        out = []
        if self.offset_m > OFFSET_WARNING_M:
            out.append(
                f"helmet_to_com is {self.offset_m:.3f} m long, more than {OFFSET_WARNING_M} m: outside a head; "
                "its rotation term is added to every CG acceleration"
            )
        nyquist = 0.5 * self.fps
        for name in ("linear", "angular", "focal"):
            cutoff = getattr(self.cutoffs, name)
            if cutoff >= nyquist:
                out.append(
                    f"the {name} cutoff of {cutoff:g} Hz is at or above the Nyquist frequency {nyquist:.2f} Hz: "
                    "that filter does nothing"
                )
        return out


def load_camera(path: Path) -> CameraSettings:
    """Read and check Config.json.

    Raises
    ------
    InputError, InputErrors
        All problems at once.
    """
    return load_json(path, CameraSettings)
