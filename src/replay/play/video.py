"""Where the motion comes from when it was filmed: clicked or tracked landmarks."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from replay.documents import Number, Setting
from replay.play.fields import InputFile


class ClicksSource(Setting):
    """Motion from clicked landmarks of one video."""

    kind: Literal["clicks"] = Field(
        default="clicks", description="Source of the motion: clicked landmarks of one video."
    )
    clicks: InputFile = Field(
        default="kinovea_clicks.csv",
        description="Tracks of the landmarks: the article's table (frame, landmark_id, u_px, v_px; protocol 2.2), or a "
        "file of Kinovea, DeepLabCut or SLEAP.",
        validate_default=True,
    )
    format: Literal["auto", "clicks", "kva", "kinovea_xml", "kinovea_txt", "kinovea_csv", "deeplabcut", "sleap"] = (
        Field(default="auto", description="Format of the tracks; `auto` tells it by the file's first lines.")
    )
    names: dict[str, str] = Field(
        default_factory=dict,
        description="Landmark of each track whose name in the file is another, `name in the file: landmark`.",
        examples=[{"mask centre": "LM1"}],
    )
    ignore: tuple[str, ...] = Field(default=(), description="Tracks of the file that are no landmarks of this head.")
    individual: str | None = Field(
        default=None, description="Which individual (DeepLabCut) or track (SLEAP), where the file has several."
    )
    least_likelihood: Annotated[Number, Field(ge=0, le=1)] = Field(
        default=0.6, description="Predictions of DeepLabCut and SLEAP below this likelihood are left out."
    )
    origin_px: tuple[Number, Number] | None = Field(
        default=None,
        description="Where a Kinovea export (not a .kva) has its origin in the image [px]; default the image's centre.",
    )
    static_points: tuple[str, ...] = Field(
        default=(),
        description="Tracks of points that stand still in the scene: the camera's pan, tilt, roll and zoom are "
        "estimated from them and removed.",
    )
    row_time_s: Annotated[Number, Field(ge=0, le=1e-4)] = Field(
        default=0.0, description="Rolling shutter: time between the exposures of two image rows [s]; 0 is none."
    )
    landmarks: InputFile = Field(
        default="helmet_landmarks.csv",
        description="Landmark template: landmark, X, Y, Z in metres (protocol 2.3).",
        validate_default=True,
    )
    camera: InputFile = Field(
        default="Config.json",
        description="Camera and filters: fps, principal point, cutoffs, helmet_to_com (protocol 2.3).",
        validate_default=True,
    )
    video: InputFile | None = Field(default=None, description="The video itself, logged with its hash; optional.")

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files this source reads."""
        return tuple(n for n in (self.clicks, self.landmarks, self.camera, self.video) if n)
