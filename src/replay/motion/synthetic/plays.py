"""Synthetic plays as files: the three shipped ones, and one of any footage.

Noise comes from a seed. The three shipped plays are made by `synthesise`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from replay.files import write_text
from replay.motion.kinematics import KINEMATICS, STANDARD_GRAVITY
from replay.motion.settings import CameraSettings
from replay.motion.synthetic.footage import ARTICLE_OFFSET_M, HEAD_SIZED_OFFSET_M, Footage, SyntheticCamera
from replay.motion.synthetic.motions import Impact, Motion
from replay.motion.tracks import CLICKS


@dataclass(frozen=True)
class SyntheticPlay:
    """What `synthesise` makes: names of files and their texts, and the truth behind them."""

    impact: Motion
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
        impact = replace(impact, position_m=far)
        camera = SyntheticCamera(59.94, -18, 18, (1280, 720), 6000.0, landmarks=("LM1", "LM2", "LM3"))
        config = _article_config()
    return SyntheticPlay(
        impact,
        {
            "kinovea_clicks.csv": _clicks(camera, impact, rng),
            "helmet_landmarks.csv": _template(camera.landmarks, camera.points_m),
            "Config.json": config,
            "truth.csv": _truth(impact, shift_s=(-camera.first_frame - camera.phase) / camera.fps),
        },
    )


def footage_play(motion: Motion, footage: Footage, settings: CameraSettings, name: str) -> SyntheticPlay:
    """Files of a play that a footage would be: clicks, template, camera file, truth and ``play.yaml``.

    Parameters
    ----------
    motion, footage, settings
        What was filmed, its clicks, and what the camera file says (`Footage.settings`).
    name
        Name of the play.
    """
    camera = footage.camera
    static = list(camera.static_points_m)
    names = [*footage.template.names, *static]
    pixels = np.concatenate([footage.tracks.pixels, footage.static_px], axis=1)
    rows = [",".join(CLICKS.names)]
    for frame, row in zip(footage.tracks.frames, pixels):
        rows += [f"{frame},{n},{u:.2f},{v:.2f}" for n, (u, v) in zip(names, row) if np.isfinite(u)]
    source = ["source:", "  kind: clicks"]
    if static:
        source.append(f"  static_points: [{', '.join(static)}]")
    if camera.row_time_s:
        source.append(f"  row_time_s: {camera.row_time_s:g}")
    play = ["# Made by `replay synth footage`.", f"name: {name}", "title: A synthetic impact", *source]
    first_time = camera.times[0]
    return SyntheticPlay(
        motion,
        {
            "kinovea_clicks.csv": "\n".join(rows) + "\n",
            "helmet_landmarks.csv": _template(footage.template.names, footage.template.points_m),
            "Config.json": _json(settings.model_dump(mode="json", exclude_defaults=True)),
            "truth.csv": _truth(motion, shift_s=-float(first_time)),
            "play.yaml": "\n".join(play) + "\n",
        },
    )


def _clicks(camera: SyntheticCamera, impact: Impact, rng: np.random.Generator) -> str:
    pixels = camera.see(impact.at(camera.times), camera.points_m, np.array(HEAD_SIZED_OFFSET_M))
    pixels = pixels + rng.normal(0.0, camera.click_sigma_px, pixels.shape)
    rows = ["frame,landmark_id,u_px,v_px"]
    for frame, row in enumerate(pixels):
        rows += [f"{frame},{name},{u:.2f},{v:.2f}" for name, (u, v) in zip(camera.landmarks, row)]
    return "\n".join(rows) + "\n"


def _template(names: tuple[str, ...], points_m: np.ndarray) -> str:
    rows = [f"{name},{x:.3f},{y:.3f},{z:.3f}" for name, (x, y, z) in zip(names, points_m)]
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


def _truth(impact: Motion, shift_s: float = 0.080) -> str:
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
