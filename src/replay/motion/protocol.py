"""Protocol mode: the article's section 2.3, frame by frame, from clicks to skull-CG motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from replay.motion.camera import NO_DISTORTION, Lens, project
from replay.motion.filters import moving_average, moving_average_length, smooth_rotations
from replay.motion.focal import ClipFocal, clip_focal, frame_focal, frame_prior, guess
from replay.motion.kinematics import Kinematics
from replay.motion.pose import Poses, choose, refine, residuals
from replay.motion.rates import angular_rates, carried, linear_rates
from replay.motion.settings import CameraSettings
from replay.motion.tracks import Template, Tracks


@dataclass(frozen=True)
class FilterLengths:
    """Samples of each moving average; 1 is no filter."""

    linear: int
    angular: int
    focal: int


@dataclass(frozen=True)
class ProtocolMotion:
    """What protocol mode finds in one clip.

    Parameters
    ----------
    kinematics
        Filtered motion of the skull CG, one sample a frame.
    frames
        ``(k,)`` frame numbers.
    used
        ``(k,)`` whether the frame had a pose of its own (else bridged between neighbours).
    poses
        Poses at the smoothed focal length, camera axes, not filtered in time; of the used frames.
    log_f, sigma_log_f, own_focal
        ``(k,)`` per-frame log focal length before smoothing, its standard deviation, and whether it is the
        frame's own (else the clip's).
    clip
        Focal length of the clip.
    flip_ratio, candidates
        Of `replay.motion.pose.Choice`, of the used frames.
    errors_px
        ``(used, n, 2)`` click minus projection.
    predicted_px
        ``(used, n, 2)`` projections.
    position_raw_m
        ``(k, 3)`` skull CG before filtering, global [m].
    acceleration_check_m_per_s2
        ``(k, 3)`` CG acceleration by a + alpha x r + omega x (omega x r) from the template's origin.
    lengths
        Filters.
    """

    kinematics: Kinematics
    frames: np.ndarray
    used: np.ndarray
    poses: Poses
    log_f: np.ndarray
    sigma_log_f: np.ndarray
    own_focal: np.ndarray
    clip: ClipFocal
    flip_ratio: np.ndarray
    candidates: np.ndarray
    errors_px: np.ndarray
    predicted_px: np.ndarray
    position_raw_m: np.ndarray
    acceleration_check_m_per_s2: np.ndarray
    lengths: FilterLengths


def lens_of(camera: CameraSettings) -> Lens:
    """Principal point and distortion of the camera file."""
    return Lens(camera.principal_point, camera.distortion or NO_DISTORTION)


def filter_lengths(camera: CameraSettings, frames: int) -> FilterLengths:
    """Moving averages of the stated cutoffs, none longer than the clip allows."""
    longest = max(1, 2 * ((frames - 1) // 2) - 1)

    def length(cutoff: float) -> int:
        return min(moving_average_length(cutoff, camera.fps), longest)

    return FilterLengths(length(camera.cutoffs.linear), length(camera.cutoffs.angular), length(camera.cutoffs.focal))


def reconstruct_clicks(
    tracks: Tracks, template: Template, camera: CameraSettings, *, clip: ClipFocal | None = None
) -> ProtocolMotion:
    """Six-degree-of-freedom motion from clicks.

    1. poses at one focal length, several starts, mirrored twins told apart;
    2. focal length of the clip, then of each frame with what the reference knows;
    3. log f smoothed at the focal cutoff, poses refined at it;
    4. orientation and CG position smoothed at their cutoffs; rates by central differences.

    Parameters
    ----------
    tracks, template, camera
        What the play names.
    clip
        Focal length of the clip where it is known already (null simulations); estimated otherwise.
    """
    lens, points = lens_of(camera), template.points_m
    used = tracks.seen.sum(axis=1) >= 3
    pixels, sigma = tracks.pixels[used], tracks.sigma_px(camera.click_sigma_px)[used]

    count = len(pixels)
    if clip is None:
        choice = choose(points, pixels, np.full(count, guess(camera)), lens, sigma_px=sigma)
        start = guess(camera, float(np.median(choice.poses.scale_px_per_m)))
        if abs(start - guess(camera)) > 0.05:
            choice = choose(points, pixels, np.full(count, start), lens, sigma_px=sigma)
        clip = clip_focal(points, pixels, choice.poses, lens, camera, sigma_px=sigma)
    choice = choose(points, pixels, np.full(count, clip.log_f), lens, sigma_px=sigma)
    clip = replace(clip, poses=choice.poses)
    free, sigma_f, own = frame_focal(points, pixels, clip, lens, frame_prior(camera, clip), sigma_px=sigma)

    every = np.arange(len(used))
    at = every[used]
    lengths = filter_lengths(camera, len(used))
    log_f = np.interp(every, at, free.log_f)
    smooth_f = moving_average(log_f, lengths.focal)[used]
    shift = free.shift.copy()
    shift[:, 2] += smooth_f - free.log_f
    poses = refine(points, pixels, replace(free, shift=shift, log_f=smooth_f), lens, sigma_px=sigma)

    to_global = camera.rotation_to_global
    to_head = Rotation.from_quat(camera.template_to_head)
    turned = to_global * Rotation.from_matrix(poses.rotation)
    origin = to_global.apply(poses.position_m)
    rotation = turned * to_head.inv()
    if not used.all():
        rotation = Slerp(at, rotation)(every)
        origin = np.stack([np.interp(every, at, origin[:, i]) for i in range(3)], axis=1)
    arm = to_head.apply(np.array(camera.helmet_to_com))
    position_raw = origin + rotation.apply(arm)

    smooth = smooth_rotations(rotation, lengths.angular)
    position = moving_average(position_raw, lengths.linear)
    omega, alpha = angular_rates(smooth, camera.fps)
    velocity, acceleration = linear_rates(position, camera.fps)
    _, acceleration_of_origin = linear_rates(moving_average(origin, lengths.linear), camera.fps)
    motion = Kinematics(tracks.frames / camera.fps, position, smooth, velocity, acceleration, omega, alpha)
    return ProtocolMotion(
        kinematics=motion,
        frames=tracks.frames,
        used=used,
        poses=poses,
        log_f=log_f,
        sigma_log_f=np.interp(every, at, sigma_f),
        own_focal=np.isin(every, at[own]),
        clip=clip,
        flip_ratio=choice.flip_ratio,
        candidates=choice.candidates,
        errors_px=residuals(points, pixels, poses, lens),
        predicted_px=project(points, poses.rotation, poses.shift, poses.log_f, lens)[0],
        position_raw_m=position_raw,
        acceleration_check_m_per_s2=carried(acceleration_of_origin, alpha, omega, smooth.apply(arm)),
        lengths=lengths,
    )


def along_ray(motion: Kinematics) -> tuple[np.ndarray, np.ndarray]:
    """CG acceleration along the line of sight ``(k,)`` and magnitude across it ``(k,)`` [m/s^2].

    The camera is at the global origin. What is across the ray is seen as pixels; what is along it only as
    a change of size, some ten times less surely.
    """
    ray = motion.position_m / np.linalg.norm(motion.position_m, axis=1, keepdims=True)
    along = np.einsum("ki,ki->k", motion.acceleration_m_per_s2, ray)
    across = motion.acceleration_m_per_s2 - along[:, None] * ray
    return along, np.linalg.norm(across, axis=1)


def peak_frame(values: np.ndarray) -> int:
    """Index of the greatest value, the end samples (whose differences are one-sided) left out."""
    return 1 + int(np.argmax(values[1:-1]))
