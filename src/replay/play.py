"""The validated description of one play: ``config/plays/<play>/play.yaml``.

Every setting has a description, a unit in its name and, where one is sensible, a default. The JSON
schema of ``workflow/schemas/play.schema.json`` is generated from these models.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, PrivateAttr, ValidationInfo, field_validator, model_validator

from replay.documents import Number, Setting, load_yaml, refuse

HELMET_MASS_KG = 1.82
"""Target mass of a helmet, protocol step 1.3."""
HELMET_MASS_RANGE_KG = 0.5
"""Acceptance range around the target, protocol step 1.3."""

Vector3 = tuple[Number, Number, Number]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]


def _existing(name: str, info: ValidationInfo) -> str:
    folder = (info.context or {}).get("folder")
    if folder is None or (Path(folder) / name).is_file():
        return name
    refuse(
        "the file does not exist",
        f"a file in {Path(folder).resolve().name}/",
        "correct the name, or put the file there",
    )


InputFile = Annotated[str, Field(min_length=1), AfterValidator(_existing)]


def _unit_quaternion(value: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    length = float(np.linalg.norm(value))
    if abs(length - 1.0) > 1e-3:
        refuse(f"has length {length:.4g}", "a unit quaternion (x, y, z, w)", "divide by its length, scalar part last")
    x, y, z, w = (float(v) / length for v in value)
    return x, y, z, w


Quaternion = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_unit_quaternion)]


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


class Window(Setting):
    """The time that is replayed."""

    before_t0_s: NotNegative = Field(default=0.010, description="Time before t0 at which the replay starts [s].")
    duration_s: Annotated[Number, Field(gt=0, le=1.0)] = Field(
        default=0.030, description="Length of the replay [s]; the article's is 30 ms."
    )


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


class Helmet(Setting):
    """The physical helmet that was worn."""

    model: str = Field(default="classic", description="Name of the helmet model.", min_length=1)
    mass_kg: Number = Field(default=1.83, description="Mass as worn [kg]; 1.82 +- 0.5 is accepted (protocol 1.3).")
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
    def _plausible(cls, value: float) -> float:
        if abs(value - HELMET_MASS_KG) > HELMET_MASS_RANGE_KG + 1e-12:
            refuse(
                "is no mass of a football helmet",
                f"{HELMET_MASS_KG} +- {HELMET_MASS_RANGE_KG} kg",
                "weigh the helmet with facemask and pads, in kilograms",
            )
        return value


class ModelChoice(Setting):
    """The finite-element model."""

    preset: Literal["nfl"] = Field(default="nfl", description="Family of head and helmet.")
    resolution: Literal["tiny", "coarse", "medium", "fine"] = Field(default="coarse", description="Mesh resolution.")
    brain_material: Literal["brain_isv", "viscohyperelastic"] = Field(
        default="brain_isv",
        description="Law of the brain: `brain_isv` with its damage variable, or `viscohyperelastic` without.",
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


class Contact(Setting):
    """Global contact of all parts, protocol 3.2 and 3.3.5."""

    scheme: Literal["lagrange"] = Field(
        default="lagrange",
        description="Lagrange multipliers on velocities (the article's scheme 3, constraint type 0).",
    )
    most_iterations: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=20, description="Iterations of the multipliers in a step, at most."
    )
    tolerance: Annotated[Number, Field(gt=0, lt=1)] = Field(
        default=1.0e-3, description="Convergence tolerance of the multipliers."
    )
    points: Literal["corners", "center_plus_corners"] = Field(
        default="center_plus_corners",
        description="What may not pass a face: nodes, or centres too of faces about which the surface turns.",
    )
    friction: NotNegative = Field(default=0.0, description="Coefficient between parts that no pair names.")
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
    self_contact: tuple[str, ...] = Field(default=(), description="Parts or part sets that may touch themselves.")


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


class Play(Setting):
    """One play: where its motion comes from, what was worn, and how it is replayed."""

    name: str = Field(description="Name of the play, that of its folder.", examples=["demo"])
    title: str = Field(default="", description="One sentence on the play.")
    struck_player: str = Field(default="not recorded", description="The player whose head is replayed.")
    source: Annotated[ClicksSource | WearableSource, Field(discriminator="kind")] = Field(
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
    def _a_wearable_has_no_posterior(self) -> Play:
        asked = self.reconstruction.mode == "posterior" or self.reconstruction.ensemble > 0
        if self.source.kind == "wearable" and asked:
            refuse(
                "reconstruction asks for the posterior of a wearable's record",
                "clicks: a wearable is read as it is",
                "remove the block `reconstruction`",
            )
        return self

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
        return tuple(self.file(name) for name in self.source.files)

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
