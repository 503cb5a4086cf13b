"""The peak that noise alone would show: the same clip without the impact.

The head stands still as it was before the impact (uniform motion would change nothing: it has no
acceleration); the same landmarks are clicked in the same frames with the same noise, and the same method is
applied. What it reports is the floor under
every peak of the play.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

import numpy as np

from replay.motion.camera import project
from replay.motion.protocol import ProtocolMotion, along_ray, lens_of, reconstruct_clicks
from replay.motion.settings import CameraSettings
from replay.motion.tracks import Template, Tracks

REPLICATES = 16
_SEED = 196202


@dataclass(frozen=True)
class NullPeaks:
    """Medians over the replicates of the peaks that noise alone shows, and the noise of one sample.

    Peaks are of the resultants; ``_noise`` are root-mean-square over frames and replicates of the resultant
    deviation, ``along`` and ``across`` the line of sight.
    """

    omega_rad_per_s: float
    alpha_rad_per_s2: float
    a_m_per_s2: float
    a_across_m_per_s2: float
    a_along_m_per_s2: float
    omega_noise_rad_per_s: float
    alpha_noise_rad_per_s2: float
    a_across_noise_m_per_s2: float
    a_along_noise_m_per_s2: float
    _: KW_ONLY
    click_sigma_px: float
    replicates: int


def click_noise(motion: ProtocolMotion, camera: CameraSettings, tracks: Tracks) -> tuple[float, bool]:
    """Standard deviation of a click coordinate of weight 1 [px], and whether the residuals told it.

    The median squared residual of a two-dimensional Gaussian is 2 ln 2 sigma^2; outliers do not move it.
    """
    seen, weight = tracks.seen[motion.used], tracks.weight[motion.used]
    freedom = 2.0 * seen.sum() - 6.0 * len(seen)
    if freedom < 20.0:
        return camera.click_sigma_px, False
    squared = (weight * np.sum(motion.errors_px**2, axis=2))[seen]
    spread = float(np.median(squared)) / (2.0 * np.log(2.0))
    return float(np.sqrt(spread * 2.0 * seen.sum() / freedom)), True


def null_peaks(
    motion: ProtocolMotion,
    tracks: Tracks,
    template: Template,
    camera: CameraSettings,
    before: np.ndarray,
    *,
    replicates: int = REPLICATES,
) -> NullPeaks:
    """Simulate the clip without an impact.

    Parameters
    ----------
    motion
        Reconstruction of the real clip.
    tracks, template, camera
        Its inputs: the same landmarks stay hidden in the same frames.
    before
        ``(k,)`` frames before the impact; where fewer than three, the first three stand for them.
    replicates
        Number of simulations; the seed is fixed.
    """
    used = motion.used
    before = before & used
    if before[used].sum() < 3:
        before = np.zeros_like(used)
        before[np.flatnonzero(used)[:3]] = True
    pre = before[used]
    shift = np.repeat(np.median(motion.poses.shift[pre], axis=0)[None], used.sum(), axis=0)
    rotation = np.repeat(motion.poses.rotation[np.flatnonzero(pre)[-1:]], used.sum(), axis=0)
    exact, _ = project(template.points_m, rotation, shift, motion.poses.log_f, lens_of(camera))
    seen = tracks.seen[used]
    sigma, _ = click_noise(motion, camera, tracks)
    spread_px = tracks.sigma_px(sigma)[used][..., None]

    rng = np.random.default_rng(_SEED)
    peaks, noise = [], []
    for _ in range(replicates):
        pixels = np.full_like(tracks.pixels, np.nan)
        pixels[used] = np.where(seen[..., None], exact + rng.normal(0.0, spread_px, exact.shape), np.nan)
        quiet = reconstruct_clicks(Tracks(tracks.frames, pixels, tracks.weight), template, camera, clip=motion.clip)
        k = quiet.kinematics
        along, across = along_ray(k)
        inner = slice(1, -1)
        curves = [k.omega_resultant, k.alpha_resultant, k.linear_resultant, across, np.abs(along)]
        peaks.append([curve[inner].max() for curve in curves])
        noise.append([np.sqrt(np.mean(curve[inner] ** 2)) for curve in (curves[0], curves[1], curves[3], curves[4])])
    middle = np.median(np.array(peaks), axis=0)
    spread = np.sqrt(np.mean(np.array(noise) ** 2, axis=0))
    return NullPeaks(*map(float, middle), *map(float, spread), click_sigma_px=sigma, replicates=replicates)
