"""Synthetic footage for the calibration of the bands and for the accuracy suite: one clip from one seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from replay.motion.families import Truth, draw
from replay.motion.focal import ClipFocal
from replay.motion.pose import Poses
from replay.motion.posterior import PosteriorMotion, reconstruct_posterior
from replay.motion.protocol import ProtocolMotion, reconstruct_clicks
from replay.motion.settings import CameraSettings, Cutoffs
from replay.motion.synthetic import HEAD_SIZED_OFFSET_M, LANDMARKS, SyntheticCamera
from replay.motion.tracks import Template, Tracks

RECORDS = Path(__file__).parents[2] / "shared" / "real" / "mouthguard"
POINTS = {**LANDMARKS, "LM9": (0.165, 0.060, -0.010), "LM10": (0.165, -0.060, -0.010)}
"""Ten points of a helmet [m]."""
CHOSEN = {
    3: ("LM1", "LM2", "LM3"),
    4: ("LM1", "LM2", "LM3", "LM5"),
    6: ("LM1", "LM2", "LM3", "LM4", "LM5", "LM8"),
    8: tuple(LANDMARKS),
    10: tuple(POINTS),
}


@dataclass(frozen=True)
class Footage:
    """What a clip is filmed with.

    Parameters
    ----------
    fps, landmarks, sigma_px, px_per_m, distance_m
        Frame rate, number of landmarks, click noise, scale and distance.
    occluded, outliers
        Share of clicks that are missing in runs of frames, and that lie far off.
    zoom_per_s
        Rate of log f; the camera file then says `zoom`.
    """

    fps: float = 59.94
    landmarks: int = 6
    sigma_px: float = 2.7
    px_per_m: float = 150.0
    distance_m: float = 45.0
    occluded: float = 0.0
    outliers: float = 0.0
    zoom_per_s: float = 0.0


@dataclass(frozen=True)
class Clip:
    """One clip with its truth; `times` are the true times of the frames."""

    truth: Truth
    times: np.ndarray
    tracks: Tracks
    template: Template
    camera: CameraSettings
    focal_px: float


def film(footage: Footage, family: str, seed: int, *, quiet: bool = False) -> Clip:
    """Film one motion of a family."""
    rng = np.random.default_rng([seed, *family.encode()])
    half = max(12, round(0.15 * footage.fps))
    names = CHOSEN[footage.landmarks]
    focal = footage.px_per_m * footage.distance_m
    seen_by = SyntheticCamera(
        footage.fps, -half, half, (3840, 2160), focal, footage.sigma_px, float(rng.random()), names
    )
    position = np.array([rng.uniform(-1, 1), footage.distance_m, rng.uniform(-0.5, 0.5)])
    span = (float(seen_by.times[0]), float(seen_by.times[-1]))
    truth = draw(family, rng, span, position, records=RECORDS, quiet=quiet)
    points = np.array([POINTS[name] for name in names])
    pixels = seen_by.see(truth.at(seen_by.times), points, np.array(HEAD_SIZED_OFFSET_M))
    if footage.zoom_per_s:
        middle = np.array([1920.0, 1080.0])
        pixels = middle + (pixels - middle) * np.exp(footage.zoom_per_s * seen_by.times)[:, None, None]
    pixels = pixels + rng.normal(0.0, footage.sigma_px, pixels.shape)
    wild = rng.random(pixels.shape[:2]) < footage.outliers
    pixels[wild] += (
        rng.uniform(8.0, 25.0, (wild.sum(), 1)) * footage.sigma_px * _unit(rng.standard_normal((wild.sum(), 2)))
    )
    if footage.occluded:
        pixels[_hidden(rng, pixels.shape[:2], footage.occluded)] = np.nan
    camera = CameraSettings(
        fps=footage.fps,
        principal_point=(1920.0, 1080.0),
        cutoffs=Cutoffs(),
        helmet_to_com=HEAD_SIZED_OFFSET_M,
        camera_distance_m=footage.distance_m,
        camera_distance_sigma_m=0.02 * footage.distance_m,
        lens="zoom" if footage.zoom_per_s else "fixed",
        click_sigma_px=footage.sigma_px,
    )
    return Clip(truth, seen_by.times, Tracks(np.arange(len(pixels)), pixels), Template(names, points), camera, focal)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _hidden(rng: np.random.Generator, shape: tuple[int, int], share: float) -> np.ndarray:
    """Runs of three to eight frames in which a landmark is behind something; three are left in every frame."""
    hidden = np.zeros(shape, dtype=bool)
    for _ in range(1000):
        if hidden.mean() >= share:
            break
        first, landmark = rng.integers(shape[0]), rng.integers(shape[1])
        tried = hidden.copy()
        tried[first : first + rng.integers(3, 9), landmark] = True
        if (~tried).sum(axis=1).min() >= 3:
            hidden = tried
    return hidden


def both_modes(clip: Clip) -> tuple[ProtocolMotion, PosteriorMotion]:
    """Protocol mode and posterior mode of a clip.

    Protocol mode is spared the search for the clip's focal length (half its time) and given the true one: an
    advantage, if any, over what the distance known to 2 % would tell it. Posterior mode takes the distance.
    """
    none = np.zeros(0)
    focal = ClipFocal(float(np.log(clip.focal_px)), 0.02, 1.0, Poses(none, none, none, none, none))
    protocol = reconstruct_clicks(clip.tracks, clip.template, clip.camera, clip=focal)
    return protocol, reconstruct_posterior(clip.tracks, clip.template, clip.camera, protocol)


def true_peaks(clip: Clip, posterior: PosteriorMotion) -> tuple[dict[str, float], np.ndarray]:
    """Peaks of the continuous motion within the clip, t0 on the clip's clock, and the grid in true time."""
    draws = posterior.draws
    shift = float(clip.times[0]) - float(clip.tracks.frames[0]) / clip.camera.fps
    margin = 1.0 / clip.camera.fps
    time = np.clip(draws.time_s + shift, clip.times[0], clip.times[-1])
    inner = time[(draws.time_s >= draws.time_s[0] + margin) & (draws.time_s <= draws.time_s[-1] - margin)]
    k = clip.truth.at(inner)
    along = k.acceleration_m_per_s2 @ draws.ray
    across = np.linalg.norm(k.acceleration_m_per_s2 - along[:, None] * draws.ray, axis=1)
    return {
        "omega_rad_per_s": float(k.omega_resultant.max()),
        "alpha_rad_per_s2": float(k.alpha_resultant.max()),
        "a_m_per_s2": float(k.linear_resultant.max()),
        "a_across_m_per_s2": float(across.max()),
        "a_along_m_per_s2": float(np.abs(along).max()),
        "t0_s": float(inner[np.argmax(k.alpha_resultant)] - shift),
    }, time
