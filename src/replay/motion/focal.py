"""Focal length: one for the clip, one for each frame, and how well either is known.

From a helmet at broadcast distance the clicks see only the scale f/Z. A focal length therefore needs a
reference: the camera's distance, or the lens. Without one, a weak prior (twice the image's width, within
a factor e) keeps the arithmetic finite, and the standard deviation that is reported says what it is worth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from replay.motion.camera import Lens
from replay.motion.pose import Loss, Poses, Prior, refine
from replay.motion.settings import CameraSettings

WEAK_SIGMA_LOG_F = 1.0
"""Standard deviation of log f where nothing but the clicks is known."""


@dataclass(frozen=True)
class ClipFocal:
    """Focal length of the clip.

    Parameters
    ----------
    log_f, sigma_log_f
        Estimate and standard deviation, reference included.
    sigma_clicks_log_f
        Standard deviation that the clicks alone would give.
    poses
        Poses at that focal length.
    """

    log_f: float
    sigma_log_f: float
    sigma_clicks_log_f: float
    poses: Poses


def guess(camera: CameraSettings, scale_px_per_m: float | None = None) -> float:
    """Log focal length to start from: the lens, the distance times the scale, or twice the width."""
    if camera.focal_length_px is not None:
        return float(np.log(camera.focal_length_px))
    if camera.camera_distance_m is not None and scale_px_per_m is not None:
        return float(np.log(camera.camera_distance_m * scale_px_per_m))
    return float(np.log(2.0 * camera.size[0]))


def clip_focal(
    points: np.ndarray,
    pixels: np.ndarray,
    poses: Poses,
    lens: Lens,
    camera: CameraSettings,
    *,
    sigma_px: float | np.ndarray,
    loss: Loss = "student",
) -> ClipFocal:
    """One focal length for all frames: the cost of the best poses, minimised over log f.

    A distance reference holds for the mean log distance of the clip.

    Parameters
    ----------
    points, pixels, lens, sigma_px, loss
        As in `replay.motion.pose.refine`.
    poses
        Chosen poses near the answer.
    camera
        References.
    """
    current = poses

    def at(log_f: float) -> Poses:
        shift = current.shift.copy()
        shift[:, 2] += log_f - current.log_f
        start = replace(current, shift=shift, log_f=np.full(len(shift), log_f))
        return refine(points, pixels, start, lens, sigma_px=sigma_px, loss=loss, iterations=40)

    def knowledge(log_f: float, found: Poses) -> float:
        if camera.focal_length_px is not None and camera.focal_length_sigma_px is not None:
            return (
                (log_f - np.log(camera.focal_length_px)) * camera.focal_length_px / camera.focal_length_sigma_px
            ) ** 2
        if camera.camera_distance_m is not None and camera.camera_distance_sigma_m is not None:
            share = camera.camera_distance_sigma_m / camera.camera_distance_m
            off = np.log(camera.camera_distance_m) - float(np.mean(found.shift[:, 2]))
            return (off / share) ** 2
        return ((log_f - guess(camera)) / WEAK_SIGMA_LOG_F) ** 2

    def cost(log_f: float) -> float:
        found = at(log_f)
        return float(np.sum(found.cost)) + knowledge(log_f, found)

    middle = float(np.median(poses.log_f))
    grid = middle + np.array([-1.5, -0.9, -0.5, -0.25, 0.0, 0.25, 0.5, 0.9, 1.5])
    costs = [cost(value) for value in grid]
    best = int(np.argmin(costs))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    answer = float(minimize_scalar(cost, bounds=(low, high), method="bounded", options={"xatol": 1e-7}).x)
    found = at(answer)
    # curvature of the profile by a wide central difference: the profile is nearly a parabola
    h = 0.01
    centre, left, right = at(answer), at(answer - h), at(answer + h)
    clicks = (float(np.sum(left.cost + right.cost - 2.0 * centre.cost))) / h**2
    known = (knowledge(answer - h, left) + knowledge(answer + h, right) - 2.0 * knowledge(answer, centre)) / h**2
    return ClipFocal(
        log_f=answer,
        sigma_log_f=float(np.sqrt(2.0 / max(clicks + known, 1e-12))),
        sigma_clicks_log_f=float(np.sqrt(2.0 / max(clicks, 1e-12))),
        poses=found,
    )


def frame_prior(camera: CameraSettings, clip: ClipFocal) -> Prior:
    """What each frame knows of its own focal length before its clicks are looked at.

    A fixed lens knows the clip's; a zooming one knows the reference, frame by frame; without a reference only
    the weak prior about the clip's value is left.
    """
    if not camera.has_reference:
        return Prior(log_f=clip.log_f, log_f_sigma=WEAK_SIGMA_LOG_F)
    if camera.lens == "fixed":
        return Prior(log_f=clip.log_f, log_f_sigma=clip.sigma_log_f)
    if camera.focal_length_px is not None and camera.focal_length_sigma_px is not None:
        return Prior(
            log_f=np.log(camera.focal_length_px), log_f_sigma=camera.focal_length_sigma_px / camera.focal_length_px
        )
    assert camera.camera_distance_m is not None
    assert camera.camera_distance_sigma_m is not None
    return Prior(
        log_z=np.log(camera.camera_distance_m), log_z_sigma=camera.camera_distance_sigma_m / camera.camera_distance_m
    )


def frame_focal(
    points: np.ndarray,
    pixels: np.ndarray,
    clip: ClipFocal,
    lens: Lens,
    prior: Prior,
    *,
    sigma_px: float | np.ndarray,
    loss: Loss = "student",
) -> tuple[Poses, np.ndarray, np.ndarray]:
    """Pose and focal length of each frame.

    Frames with three landmarks have six equations for seven unknowns: they take the clip's focal length.

    Returns
    -------
    poses
        With log f of each frame.
    sigma_log_f
        ``(k,)`` standard deviations, what is known beforehand included.
    own
        ``(k,)`` whether the focal length is the frame's own.
    """
    own = np.isfinite(pixels[..., 0]).sum(axis=1) >= 4
    found = refine(points, pixels, clip.poses, lens, sigma_px=sigma_px, free_focal=True, prior=prior, loss=loss)
    mixed = Poses(
        **{
            name: np.where(
                own.reshape(-1, *[1] * (getattr(found, name).ndim - 1)), getattr(found, name), getattr(clip.poses, name)
            )
            for name in ("rotation", "shift", "log_f", "cost", "information")
        }
    )
    sigma = np.full(len(own), clip.sigma_log_f)
    for k in np.flatnonzero(own):
        h = found.information[k]
        schur = h[6, 6] - h[6, :6] @ np.linalg.lstsq(h[:6, :6], h[:6, 6], rcond=None)[0]
        sigma[k] = 1.0 / np.sqrt(max(schur, 1e-12))
    return mixed, sigma, own
