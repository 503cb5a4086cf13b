"""Clips of known truth for the calibration of the bands and for the accuracy suite: one clip from one seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from replay.motion.focal import ClipFocal
from replay.motion.pose import Poses
from replay.motion.posterior import PosteriorMotion, reconstruct_posterior
from replay.motion.protocol import ProtocolMotion, reconstruct_clicks
from replay.motion.settings import CameraSettings
from replay.motion.synthetic import TEN, Flaws, Footage, Motion, SyntheticCamera, film
from replay.motion.synthetic.families import draw

RECORDS = Path(__file__).parents[2] / "shared" / "real" / "mouthguard"
CHOSEN = {
    3: TEN[:3],
    4: ("LM1", "LM2", "LM3", "LM5"),
    6: ("LM1", "LM2", "LM3", "LM4", "LM5", "LM8"),
    8: TEN[:8],
    10: TEN,
}
"""Landmarks by their number."""


@dataclass(frozen=True)
class View:
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
    sigma_px: float = 1.0
    px_per_m: float = 300.0
    distance_m: float = 30.0
    occluded: float = 0.0
    outliers: float = 0.0
    zoom_per_s: float = 0.0


@dataclass(frozen=True)
class Clip:
    """A motion, what was filmed of it, and the camera file: the distance is known to 2 %."""

    motion: Motion
    footage: Footage
    settings: CameraSettings

    @property
    def times(self) -> np.ndarray:
        """True times of the frames [s]; the clip's own clock begins at the first."""
        return self.footage.camera.times


def clip_of(view: View, family: str, seed: int, *, quiet: bool = False) -> Clip:
    """Film one motion of a family; `quiet` leaves its impact out."""
    rng = np.random.default_rng([seed, *family.encode()])
    half = max(12, round(0.15 * view.fps))
    camera = SyntheticCamera(
        view.fps,
        -half,
        half,
        (3840, 2160),
        view.px_per_m * view.distance_m,
        view.sigma_px,
        phase=float(rng.random()),
        landmarks=CHOSEN[view.landmarks],
        zoom_per_s=view.zoom_per_s,
    )
    position = np.array([rng.uniform(-1, 1), view.distance_m, rng.uniform(-0.5, 0.5)])
    span = (float(camera.times[0]), float(camera.times[-1]))
    motion = draw(family, rng, span, position, records=RECORDS, quiet=quiet)
    flaws = Flaws(outlier_share=view.outliers, outlier_px=15.0 * view.sigma_px, occluded_share=view.occluded)
    footage = film(motion, camera, seed=seed, flaws=flaws)
    return Clip(motion, footage, footage.settings(distance_sigma=0.02))


def both_modes(clip: Clip) -> tuple[ProtocolMotion, PosteriorMotion]:
    """Protocol mode and posterior mode of a clip.

    Protocol mode is spared the search for the clip's focal length (half its time) and given the true one: an
    advantage, if any, over what the distance known to 2 % would tell it. Posterior mode takes the distance.
    """
    none = np.zeros(0)
    log_f = float(np.log(clip.footage.camera.focal_length_px))
    focal = ClipFocal(log_f, 0.02, 1.0, Poses(none, none, none, none, none))
    tracks, template = clip.footage.tracks, clip.footage.template
    protocol = reconstruct_clicks(tracks, template, clip.settings, clip=focal)
    return protocol, reconstruct_posterior(tracks, template, clip.settings, protocol)
