"""Plays with a known truth: one head impact, seen by a camera or felt by a mouthguard.

The motion is written in closed form, so that position, velocity and acceleration of the truth agree
exactly; noise comes from a seed. The three shipped plays are made by `synthesise`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from replay.files import write_text
from replay.motion.camera import Lens, project, shift_of
from replay.motion.kinematics import KINEMATICS, STANDARD_GRAVITY, Kinematics
from replay.motion.settings import LEVEL_CAMERA

LANDMARKS: dict[str, tuple[float, float, float]] = {
    "LM1": (0.185, 0.000, -0.045),  # facemask centre
    "LM2": (0.135, 0.095, -0.050),  # facemask left
    "LM3": (0.135, -0.095, -0.050),  # facemask right
    "LM4": (0.145, 0.000, 0.085),  # front bumper
    "LM5": (0.010, 0.000, 0.165),  # crown
    "LM6": (0.095, 0.100, 0.045),  # left upper facemask screw
    "LM7": (0.095, -0.100, 0.045),  # right upper facemask screw
    "LM8": (0.000, 0.125, 0.000),  # left ear hole
}
"""Eight points of a helmet [m]; origin midway between the ear holes, head axes."""
HEAD_SIZED_OFFSET_M = (0.010, 0.0, 0.030)
"""Ear-hole midpoint to head CG: forward and up of the auditory canals [m]."""
ARTICLE_OFFSET_M = (-0.1, 0.4, 0.0)
"""helmet_to_com as the article prints it [m]."""


@dataclass(frozen=True)
class Impact:
    """A head impact in closed form.

    Rotation about a fixed axis takes a sin^2 pulse, then a slower sin^2 arrest by the neck, on top of
    a slow turn about a second axis; the CG takes a sin^2 pulse of linear acceleration on top of
    uniform motion.

    Parameters
    ----------
    peak_alpha_rad_per_s2, alpha_duration_s
        Angular pulse; its peak is at time 0.
    arrest_duration_s, arrest_share
        Arrest after the pulse, and the share of the gained angular velocity that it takes away.
    peak_acceleration_m_per_s2, acceleration_duration_s, acceleration_lead_s
        Linear pulse and how long its peak comes before the angular one.
    axis, background_axis, background_rad_per_s
        Global axis of the impact's rotation; slow turn before it.
    direction, velocity_m_per_s, position_m
        Global direction of the linear pulse; velocity and position at time 0 without it.
    heading_deg, nod_deg
        Orientation at time 0 without the impact: x anterior is turned from global x by heading about z.
    """

    peak_alpha_rad_per_s2: float = 4500.0
    alpha_duration_s: float = 0.015
    arrest_duration_s: float = 0.070
    arrest_share: float = 0.9
    peak_acceleration_m_per_s2: float = 72.0 * STANDARD_GRAVITY
    acceleration_duration_s: float = 0.013
    acceleration_lead_s: float = 0.0010
    axis: tuple[float, float, float] = (0.30, -0.35, 0.88)
    background_axis: tuple[float, float, float] = (0.6, 0.8, 0.0)
    background_rad_per_s: float = 1.0
    direction: tuple[float, float, float] = (0.94, 0.16, 0.30)
    velocity_m_per_s: tuple[float, float, float] = (-1.6, 0.1, 0.0)
    position_m: tuple[float, float, float] = (0.0, 1.6, 0.0)
    heading_deg: float = -118.0
    nod_deg: float = 8.0

    def at(self, time_s: np.ndarray) -> Kinematics:
        """True motion of the CG at any times [s]."""
        t = np.asarray(time_s, dtype=float)
        n, m = _unit(self.axis), _unit(self.background_axis)
        half = 0.5 * self.alpha_duration_s
        gain = 0.5 * self.peak_alpha_rad_per_s2 * self.alpha_duration_s
        brake = 2.0 * gain * self.arrest_share / self.arrest_duration_s
        alpha1, omega1, theta1 = _pulse(t, -half, self.alpha_duration_s, self.peak_alpha_rad_per_s2)
        alpha2, omega2, theta2 = _pulse(t, half, self.arrest_duration_s, -brake)
        alpha, omega, theta = alpha1 + alpha2, omega1 + omega2, theta1 + theta2

        impact = Rotation.from_rotvec(theta[:, None] * n)
        turn = Rotation.from_rotvec((self.background_rad_per_s * t)[:, None] * m)
        start = Rotation.from_euler("ZY", [self.heading_deg, self.nod_deg], degrees=True)
        carried = impact.apply(np.tile(m, (len(t), 1))) * self.background_rad_per_s

        d = _unit(self.direction)
        begin = -self.acceleration_lead_s - 0.5 * self.acceleration_duration_s
        a, v, x = _pulse(t, begin, self.acceleration_duration_s, self.peak_acceleration_m_per_s2)
        v0 = np.array(self.velocity_m_per_s)
        return Kinematics(
            time_s=t,
            position_m=np.array(self.position_m) + t[:, None] * v0 + x[:, None] * d,
            rotation=impact * turn * start,
            velocity_m_per_s=v0 + v[:, None] * d,
            acceleration_m_per_s2=a[:, None] * d,
            omega_rad_per_s=omega[:, None] * n + carried,
            alpha_rad_per_s2=alpha[:, None] * n + omega[:, None] * np.cross(n, carried),
        )


def _unit(vector: tuple[float, float, float]) -> np.ndarray:
    v = np.array(vector, dtype=float)
    return v / np.sqrt(v @ v)


def _pulse(t: np.ndarray, begin: float, duration: float, peak: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``peak sin^2(pi (t - begin)/duration)`` with its first and second integral from `begin`."""
    s = np.clip(t - begin, 0.0, duration)
    beyond = np.maximum(t - begin - duration, 0.0)
    k = 2.0 * np.pi / duration
    value = 0.5 * peak * (1.0 - np.cos(k * s))
    first = 0.5 * peak * (s - np.sin(k * s) / k)
    second = 0.5 * peak * (0.5 * s * s + (np.cos(k * s) - 1.0) / (k * k))
    return value, first, second + first * beyond


@dataclass(frozen=True)
class SyntheticCamera:
    """A level camera at the global origin looking along global y.

    Parameters
    ----------
    fps, first_frame, last_frame
        Frame rate [Hz] and frames, numbered so that time 0 is frame 0 plus `phase`.
    phase
        Share of a frame between time 0 and frame 0: impacts do not wait for the shutter.
    image_size, focal_length_px
        Width, height and focal length [px].
    click_sigma_px
        Standard deviation of each click coordinate [px].
    landmarks
        Names of the points that are clicked, of `LANDMARKS`.
    """

    fps: float
    first_frame: int
    last_frame: int
    image_size: tuple[int, int]
    focal_length_px: float
    click_sigma_px: float = 1.0
    phase: float = 0.37
    landmarks: tuple[str, ...] = tuple(LANDMARKS)

    @property
    def times(self) -> np.ndarray:
        """``(n,)`` true times of the frames [s]."""
        return (np.arange(self.first_frame, self.last_frame + 1) + self.phase) / self.fps

    def see(self, motion: Kinematics, landmarks: np.ndarray, offset_m: np.ndarray) -> np.ndarray:
        """Exact pixels ``(frames, landmarks, 2)`` of helmet points ``(n, 3)`` [m], `offset_m` from template to CG."""
        to_camera = Rotation.from_quat(LEVEL_CAMERA).inv()
        rotation = (to_camera * motion.rotation).as_matrix()
        origin = to_camera.apply(motion.position_m - motion.rotation.apply(offset_m))
        lens = Lens((self.image_size[0] / 2, self.image_size[1] / 2))
        log_f = np.full(len(rotation), np.log(self.focal_length_px))
        return project(landmarks, rotation, shift_of(origin), log_f, lens)[0]


@dataclass(frozen=True)
class SyntheticPlay:
    """What `synthesise` makes: names of files and their texts, and the truth behind them."""

    impact: Impact
    files: dict[str, str] = field(default_factory=dict)

    def write(self, folder: Path) -> None:
        """Write every file into `folder`."""
        for name, text in self.files.items():
            write_text(folder / name, text)


Preset = Literal["demo", "broadcast", "wearable"]
SEEDS: dict[str, int] = {"demo": 20240908, "broadcast": 20240909, "wearable": 20240910}
"""Seeds of the shipped plays."""


def synthesise(preset: Preset, seed: int | None = None, impact: Impact | None = None) -> SyntheticPlay:
    """Make the raw files of a synthetic play.

    Parameters
    ----------
    preset
        ``demo``: eight landmarks, 239.76 fps, 3840 x 2160 px, 1.6 m, 2400 px/m. ``broadcast``: the same impact, three
        landmarks, 59.94 fps, 45 m, under the article's own Config. ``wearable``: a mouthguard at 1 kHz.
    seed
        Seed of the noise; default that of the shipped play.
    impact
        The motion; default `Impact`.

    Returns
    -------
    SyntheticPlay
        Texts of ``kinovea_clicks.csv``, ``helmet_landmarks.csv``, ``Config.json`` (or ``wearable.csv``) and
        ``truth.csv``; write them with `SyntheticPlay.write`.
    """
    rng = np.random.default_rng(SEEDS[preset] if seed is None else seed)
    impact = impact or Impact()
    if preset == "wearable":
        return SyntheticPlay(impact, {"wearable.csv": _mouthguard(impact, rng), "truth.csv": _truth(impact)})
    if preset == "demo":
        camera = SyntheticCamera(239.76, -24, 26, (3840, 2160), 3840.0)
        config = _demo_config(camera, impact)
    else:
        far = (impact.position_m[0], 45.0, impact.position_m[2])
        impact = Impact(**{**vars(impact), "position_m": far})
        camera = SyntheticCamera(59.94, -18, 18, (1280, 720), 6000.0, landmarks=("LM1", "LM2", "LM3"))
        config = _article_config()
    return SyntheticPlay(
        impact,
        {
            "kinovea_clicks.csv": _clicks(camera, impact, rng),
            "helmet_landmarks.csv": _template(camera.landmarks),
            "Config.json": config,
            "truth.csv": _truth(impact, shift_s=(-camera.first_frame - camera.phase) / camera.fps),
        },
    )


def _clicks(camera: SyntheticCamera, impact: Impact, rng: np.random.Generator) -> str:
    points = np.array([LANDMARKS[name] for name in camera.landmarks])
    pixels = camera.see(impact.at(camera.times), points, np.array(HEAD_SIZED_OFFSET_M))
    pixels = pixels + rng.normal(0.0, camera.click_sigma_px, pixels.shape)
    rows = ["frame,landmark_id,u_px,v_px"]
    for frame, row in enumerate(pixels):
        rows += [f"{frame},{name},{u:.2f},{v:.2f}" for name, (u, v) in zip(camera.landmarks, row)]
    return "\n".join(rows) + "\n"


def _template(names: tuple[str, ...]) -> str:
    rows = [f"{name},{x:.3f},{y:.3f},{z:.3f}" for name, (x, y, z) in ((n, LANDMARKS[n]) for n in names)]
    return "\n".join(["landmark,X,Y,Z", *rows]) + "\n"


def _demo_config(camera: SyntheticCamera, impact: Impact) -> str:
    return _json(
        {
            "fps": camera.fps,
            "image_size": list(camera.image_size),
            "principal_point": [camera.image_size[0] / 2, camera.image_size[1] / 2],
            "cutoffs": {"linear": 40.0, "angular": 40.0, "focal": 5.0},
            "helmet_to_com": list(HEAD_SIZED_OFFSET_M),
            "camera_distance_m": round(impact.position_m[1], 3),
            "camera_distance_sigma_m": 0.016,
            "lens": "fixed",
            "click_sigma_px": camera.click_sigma_px,
        }
    )


def _article_config() -> str:
    return _json(
        {
            "fps": 59.94,
            "principal_point": [640, 360],
            "cutoffs": {"linear": 15, "angular": 40, "focal": 5},
            "helmet_to_com": list(ARTICLE_OFFSET_M),
        }
    )


def _json(value: Any) -> str:
    return json.dumps(value, indent=2) + "\n"


MOUTHGUARD_TO_CG_M = (-0.075, 0.0, 0.055)
"""From the synthetic mouthguard to the head CG, head axes [m]."""


def _mouthguard(impact: Impact, rng: np.random.Generator) -> str:
    milliseconds = np.arange(0, 200)
    motion = impact.at((milliseconds - 80.0) / 1000.0)
    arm = motion.rotation.apply(-np.array(MOUTHGUARD_TO_CG_M))
    w, alpha = motion.omega_rad_per_s, motion.alpha_rad_per_s2
    at_sensor = motion.acceleration_m_per_s2 + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))
    sae = np.array([1.0, -1.0, -1.0])
    acceleration = motion.in_head_axes(at_sensor) * sae / STANDARD_GRAVITY + rng.normal(0.0, 0.3, (len(arm), 3))
    spin = np.degrees(motion.in_head_axes(w) * sae) + rng.normal(0.0, 3.0, (len(arm), 3))
    rows = ["time_ms,ax_g,ay_g,az_g,wx_deg_per_s,wy_deg_per_s,wz_deg_per_s"]
    for ms, a, o in zip(milliseconds, acceleration, spin):
        rows.append(",".join([str(ms), *(f"{v:.4f}" for v in a), *(f"{v:.3f}" for v in o)]))
    return "\n".join(rows) + "\n"


def _truth(impact: Impact, shift_s: float = 0.080) -> str:
    """True motion from 50 ms before to 60 ms after the angular peak, in the file's own time."""
    motion = impact.at(np.arange(-50, 61) / 1000.0)
    columns = motion.columns()
    columns["time_s"] = motion.time_s + shift_s
    rows = [",".join(KINEMATICS.names)]
    # nine digits: beyond what any reader needs, short of where two mathematical libraries differ
    for i in range(len(motion.time_s)):
        rows.append(",".join(f"{_settled(columns[name][i]):.9g}" for name in KINEMATICS.names))
    return "\n".join(rows) + "\n"


def _settled(value: float) -> float:
    """Zero for what is only rounding."""
    return 0.0 if abs(value) < 1e-9 else float(value)
