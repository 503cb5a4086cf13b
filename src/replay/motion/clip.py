"""The door for footage: tracks in any format, checked against the video, the camera's own doings taken out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from replay.errors import InputError
from replay.motion.camera import NO_DISTORTION, Lens
from replay.motion.corrections import at_one_time, steady
from replay.motion.focal import guess
from replay.motion.readers import Context, read_tracks
from replay.motion.settings import CameraSettings, load_camera
from replay.motion.tracks import Template, Tracks, read_template
from replay.motion.video import Video, examine_video
from replay.play import ClicksSource, Play


@dataclass(frozen=True)
class Clip:
    """Everything that a reconstruction from footage begins with.

    Parameters
    ----------
    camera, template, tracks
        Camera file, landmark template, and tracks with the camera's pan and rolling shutter taken out.
    facts
        What was read and corrected, for the record.
    warnings
        What is accepted but deserves a word; those of the camera file are its own (`CameraSettings.warnings`).
    """

    camera: CameraSettings
    template: Template
    tracks: Tracks
    facts: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def load_clip(play: Play, source: ClicksSource) -> Clip:
    """Read a play's footage.

    Raises
    ------
    InputError, InputErrors
        For tracks, template, camera file or video that cannot be used, or that do not belong together.
    """
    camera = load_camera(play.file(source.camera))
    template = read_template(play.file(source.landmarks))
    path = play.file(source.clicks)
    context = Context(
        fps=camera.fps,
        size=camera.size,
        origin_px=source.origin_px,
        individual=source.individual,
        least_likelihood=source.least_likelihood,
        names=source.names,
        ignore=source.ignore,
    )
    reading = read_tracks(path, template, context, format=source.format, static_points=source.static_points)
    tracks = reading.tracks
    facts: dict[str, Any] = {
        "format": reading.format,
        "fps": camera.fps,
        "image_size": [int(v) for v in camera.size],
        "frames": len(tracks.frames),
        "first_frame": int(tracks.frames[0]),
        "landmarks": list(template.names),
        "clicks": int(tracks.seen.sum()),
        "mean_weight": float(tracks.weight[tracks.seen].mean()),
    }
    warnings: list[str] = []
    static_px = reading.static_px
    if source.row_time_s:
        tracks, row = at_one_time(tracks, source.row_time_s, camera.fps)
        static_px = at_one_time(Tracks(tracks.frames, static_px), source.row_time_s, camera.fps, row)[0].pixels
        facts["rolling_shutter"] = {"row_time_s": source.row_time_s, "row_px": row, "late_s": row * source.row_time_s}
    if source.static_points:
        focal_px = float(np.exp(guess(camera, _scale_px_per_m(tracks, template))))
        tracks, facts["pan"] = _steadied(path, tracks, static_px, focal_px, camera, source)
    if source.video:
        window = int(tracks.frames[0]), int(tracks.frames[-1])
        video = examine_video(play.file(source.video), window)
        warnings += _belongs(play.file(source.video), video, camera)
        facts["video"] = {
            "fps": video.fps,
            "image_size": list(video.image_size),
            "frames": video.frames,
            "sha256": video.sha256,
            "cuts_in_the_clip": list(video.cuts),
        }
    return Clip(camera, template, tracks, facts, tuple(warnings))


def _steadied(
    path: Path, tracks: Tracks, static_px: np.ndarray, focal_px: float, camera: CameraSettings, source: ClicksSource
) -> tuple[Tracks, dict[str, Any]]:
    blind = ~np.isfinite(static_px[..., 0]).any(axis=1)
    if blind.any():
        raise InputError(
            path,
            f"frame {tracks.frames[int(np.argmax(blind))]} shows no static point",
            column="frame",
            expected=f"one of {', '.join(source.static_points)} in every frame of the clip",
            mend="track one more point of the background",
        )
    lens = Lens(camera.principal_point, camera.distortion or NO_DISTORTION)
    found = steady(tracks, static_px, focal_px, lens)
    return found.tracks, {
        "static_points": list(source.static_points),
        "reference_frame": int(tracks.frames[found.reference]),
        # in pixels it holds whatever the focal length is
        "moved_px": [float(v) for v in focal_px * np.radians(np.ptp(found.rotation_deg[:, 1::-1], axis=0))],
        "zoom_percent": float(np.ptp(found.zoom_percent)),
        "residual_px": found.residual_px,
    }


def _scale_px_per_m(tracks: Tracks, template: Template) -> float:
    """Pixels a metre at the head, from the pairs of landmarks that show nearly their whole length."""
    i, j = np.triu_indices(len(template.names), 1)
    shown = np.linalg.norm(tracks.pixels[:, i] - tracks.pixels[:, j], axis=2)
    return float(np.nanquantile(shown / np.linalg.norm(template.points_m[i] - template.points_m[j], axis=1), 0.9))


def _belongs(path: Path, video: Video, camera: CameraSettings) -> list[str]:
    if video.image_size != tuple(camera.size):
        raise InputError(
            path,
            f"the video is {video.image_size[0]} x {video.image_size[1]} px",
            expected=f"{camera.size[0]:g} x {camera.size[1]:g} px, as the camera file says",
            mend="correct image_size and principal_point in the camera file; pixels of a scaled copy are other pixels",
        )
    warnings = [
        f"the picture changes at once at frame {frame}: a cut inside the clip, which no rigid head survives"
        for frame in video.cuts
    ]
    if abs(video.fps / camera.fps - 1.0) > 0.002:
        warnings.append(
            f"the video plays at {video.fps:g} frames per second, the camera file says {camera.fps:g}: right only for "
            "slow motion that was recorded faster than it plays"
        )
    return warnings
