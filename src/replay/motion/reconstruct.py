"""One door for both kinds of source: a play in, the reconstruction's files out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.files import write_text
from replay.motion.clip import load_clip
from replay.motion.driver import Driver, build_driver
from replay.motion.initial_conditions import INITIAL_CONDITIONS, condition, velocity_bands
from replay.motion.kinematics import KINEMATICS, Kinematics
from replay.motion.null import null_peaks
from replay.motion.posterior import PosteriorMotion, reconstruct_posterior
from replay.motion.protocol import ProtocolMotion, along_ray, peak_frame, reconstruct_clicks
from replay.motion.quality import FrameQuality, ReconstructionQuality, frame_quality, video_quality, wearable_quality
from replay.motion.side_by_side import (
    CLICK_WEIGHTS,
    KINEMATICS_BOTH,
    PEAKS,
    PosteriorQuality,
    advice,
    click_weights,
    curves,
    peak_rows,
    posterior_quality,
    spin_band,
    t0_band,
)
from replay.motion.summary import summary
from replay.motion.wearable import read_wearable, reconstruct_wearable
from replay.play import ClicksSource, Play, WearableSource
from replay.tables import Column, TableFormat


def _vector(template: str, meaning: str) -> tuple[Column, ...]:
    return tuple(Column(template.format(axis), f"{axis} {meaning}") for axis in "xyz")


POSES = TableFormat(
    "poses per frame",
    (
        Column("frame", "frame of the video", kind="int"),
        Column("time_s", "frame over frame rate [s]"),
        Column("own_pose", "1 where the frame has a pose of its own, 0 where it is bridged", kind="int"),
        *(
            Column(f"r{axis}_rad", f"{axis} of the rotation vector template to camera [rad]", may_be_empty=True)
            for axis in "xyz"
        ),
        *(
            Column(f"t{axis}_m", f"{axis} of the template's origin, camera axes [m]", may_be_empty=True)
            for axis in "xyz"
        ),
        Column("focal_px", "focal length of the frame [px]"),
        Column("focal_smooth_px", "after the focal filter; the pose belongs to this one [px]", may_be_empty=True),
        Column("sigma_log_focal", "standard deviation of log f, reference included"),
        Column("focal_source", "frame: the frame's own; clip: that of the clip (three landmarks)", kind="text"),
        *_vector("cg_raw_{}_m", "of the skull CG before filtering, global [m]"),
    ),
)
"""Format of ``poses_per_frame.csv``."""

QC = TableFormat(
    "quality per frame",
    (
        Column("frame", "frame of the video", kind="int"),
        Column("time_s", "frame over frame rate [s]"),
        Column("landmarks", "landmarks clicked", kind="int"),
        Column("degrees_of_freedom", "equations less unknowns", may_be_empty=True),
        Column("reprojection_rmse_px", "sqrt(sum |e|^2 / n) [px]", may_be_empty=True),
        Column("reprojection_rmse_dof_px", "sqrt(sum |e|^2 / degrees of freedom) [px]", may_be_empty=True),
        Column("focal_drift_percent", "100 |log f - smooth log f|"),
        Column("sigma_log_focal", "standard deviation of log f"),
        Column("scale_px_per_m", "f/Z [px/m]", may_be_empty=True),
        Column("scale_drift_percent", "100 |log f/Z - smooth log f/Z|"),
        Column(
            "baseline_drift_percent", "median over landmark pairs of 100 |measured/predicted - 1|", may_be_empty=True
        ),
        Column("flip_ratio", "residual of the best other pose over that of the chosen one", may_be_empty=True),
        Column("candidates", "distinct poses that fit", may_be_empty=True),
        Column("posterior_rmse_px", "posterior mode: sqrt(sum |e|^2 / n) [px]", may_be_empty=True),
        Column("least_click_weight", "posterior mode: weight of the frame's least supported click", may_be_empty=True),
        Column("sigma_rotation_deg", "posterior mode: standard deviation of the orientation, worst axis [deg]"),
        Column("sigma_log_depth", "posterior mode: standard deviation of the logarithm of the distance"),
        Column("a_across_ray_m_per_s2", "CG acceleration across the line of sight, magnitude [m/s^2]"),
        Column("a_along_ray_m_per_s2", "CG acceleration along the line of sight, away positive [m/s^2]"),
        Column("a_check_difference_m_per_s2", "CG acceleration less a + alpha x r + omega x (omega x r) [m/s^2]"),
    ),
)
"""Format of ``qc_per_frame.csv``."""


@dataclass(frozen=True)
class Reconstruction:
    """Motion of the skull CG of one play, with what it is worth.

    Parameters
    ----------
    play
        The play.
    kinematics
        Motion of the skull CG.
    t0_s, t0_angular_s, t0_linear_s
        Impact reference of the play, and both candidates: times of peak angular and linear acceleration [s].
    quality
        Numbers for the gate.
    tables
        Further files by name: format and columns.
    posterior, posterior_quality
        Posterior mode's motions, and what they are worth; None for a wearable.
    columns
        Further columns of ``kinematics.csv``: posterior mode's curves with their bands.
    notes
        Lines for the summary: what is resolved, what is not, what would help.
    """

    play: Play
    kinematics: Kinematics
    t0_s: float
    t0_angular_s: float
    t0_linear_s: float
    quality: ReconstructionQuality
    tables: dict[str, tuple[TableFormat, dict[str, Any]]] = field(default_factory=dict)
    posterior: PosteriorMotion | None = None
    posterior_quality: PosteriorQuality | None = None
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def driving(self) -> tuple[Kinematics, float]:
        """Motion that drives the replay, by the play's choice, and its t0 [s]."""
        if self.play.reconstruction.mode == "protocol" or self.posterior is None:
            return self.kinematics, self.t0_s
        motion = self.posterior.draws.motion(self.posterior.central)
        return motion, self.posterior_t0_s

    @property
    def posterior_t0_s(self) -> float:
        """Impact reference of the play in posterior mode [s]."""
        assert self.posterior is not None
        if self.play.t0 == "angular":
            return t0_band(self.posterior).value
        motion = self.posterior.draws.motion(self.posterior.central)
        return float(motion.time_s[peak_frame(motion.linear_resultant)])

    def drivers(self) -> list[Driver]:
        """Drivers of the play's ensemble: motions that the clip allows, evenly through the draws.

        Raises
        ------
        InputError
            When the play's window runs past the data.
        """
        count = self.play.reconstruction.ensemble
        if self.posterior is None or not count:
            return []
        picked = np.linspace(0, len(self.posterior.draws.omega_rad_per_s) - 1, count).round().astype(int)
        _, t0 = self.driving
        return [build_driver(self.posterior.draws.motion(int(d)), t0, self.play.window) for d in picked]

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files that `write` makes."""
        more = ("posterior_motion.csv",) if self.posterior is not None else ()
        ensemble = tuple(f"drivers/driver_{i:03d}.csv" for i in range(1, self.play.reconstruction.ensemble + 1))
        return ("kinematics.csv", "initial_conditions_t0.csv", *self.tables, *more, *ensemble, "qc_summary.txt")

    def write(self, folder: Path) -> tuple[Path, ...]:
        """Write the reconstruction's files and return their paths.

        Raises
        ------
        InputError
            When the play's window runs past the data.
        """
        folder = Path(folder)
        conditions, drivers = self._conditions(), self.drivers()
        if self.posterior is None:
            self.kinematics.write(folder / "kinematics.csv")
        else:
            KINEMATICS_BOTH.write(folder / "kinematics.csv", {**self.kinematics.columns(), **self.columns})
            central = self.posterior.draws.motion(self.posterior.central)
            KINEMATICS.write(folder / "posterior_motion.csv", central.columns())
        INITIAL_CONDITIONS.write(folder / "initial_conditions_t0.csv", conditions)
        for name, (form, columns) in self.tables.items():
            form.write(folder / name, columns)
        for i, driver in enumerate(drivers, start=1):
            driver.motion.write_driver(folder / "drivers" / f"driver_{i:03d}.csv")
        write_text(folder / "qc_summary.txt", summary(self))
        return tuple(folder / name for name in self.files)

    def _conditions(self) -> dict[str, list[Any]]:
        mode = "wearable" if self.posterior is None else "protocol"
        driver = build_driver(self.kinematics, self.t0_s, self.play.window)
        rows = [
            condition(mode, "t0", self.t0_s, self.kinematics, _sample(self.kinematics, self.t0_s), {}),
            condition(mode, "window_start", driver.start_s, driver.motion, 0, {}),
        ]
        if self.posterior is not None and self.posterior_quality is not None:
            motion, t0 = self.posterior.draws.motion(self.posterior.central), self.posterior_t0_s
            start = t0 - self.play.window.before_t0_s
            # where footage resolves no instant, the window may begin before the clip
            for instant, time in (("t0", t0), ("window_start", max(start, float(motion.time_s[0])))):
                at = _sample(motion, time)
                bands = {"spin_rad_per_s": spin_band(self.posterior, at)}
                if instant == "t0" and self.play.t0 == "angular" and self.posterior_quality.bands["t0_s"].resolved:
                    bands["time_s"] = self.posterior_quality.bands["t0_s"].ends
                rows.append(condition("posterior", instant, time, motion, at, bands))
            onset = self.posterior_quality.bands["onset_s"]
            if onset.resolved:
                before = self.posterior.before
                bands = {"time_s": onset.ends, **velocity_bands(before)}
                rows.append(condition("posterior", "onset", before.motion.time_s[0], before.motion, 0, bands))
        return {name: [row[name] for row in rows] for name in INITIAL_CONDITIONS.names}


def _sample(motion: Kinematics, time_s: float) -> int:
    """Index of the sample nearest to a time."""
    return int(np.argmin(np.abs(motion.time_s - time_s)))


def check_tracks(play: Play) -> dict[str, Any]:
    """Read every raw track of a play once and return facts on it.

    Raises
    ------
    InputError, InputErrors
        For the first file that cannot be used, all its problems at once.
    """
    source = play.source
    if isinstance(source, WearableSource):
        time, channels = read_wearable(play.file(source.kinematics), source)
        return {
            "samples": len(time),
            "duration_s": float(time[-1] - time[0]),
            "rate_hz": float(1.0 / np.median(np.diff(time))),
            "channels": list(channels),
        }
    if not isinstance(source, ClicksSource):
        return {}
    clip = load_clip(play, source)
    return {**clip.facts, "warnings": [*clip.camera.warnings(), *clip.warnings]}


def reconstruct(play: Play) -> Reconstruction:
    """Motion of the skull CG from a play's raw tracks.

    Raises
    ------
    InputError, InputErrors
        For tracks that cannot be used.
    """
    if isinstance(play.source, WearableSource):
        return _from_wearable(play, play.source)
    if isinstance(play.source, ClicksSource):
        return _from_clicks(play, play.source)
    where = play.folder / "play.yaml"
    raise InputError(where, "nothing was recorded", column="source", mend="name a source of tracks")


def _from_clicks(play: Play, source: ClicksSource) -> Reconstruction:
    clip = load_clip(play, source)
    camera, template, tracks = clip.camera, clip.template, clip.tracks
    motion = reconstruct_clicks(tracks, template, camera)
    k = motion.kinematics
    angular = float(k.time_s[peak_frame(k.alpha_resultant)])
    linear = float(k.time_s[peak_frame(k.linear_resultant)])
    t0 = angular if play.t0 == "angular" else linear
    null = null_peaks(motion, tracks, template, camera, k.time_s < t0 - 0.015)
    frames = frame_quality(motion, tracks, camera)
    quality = video_quality(motion, frames, tracks, camera, null)
    posterior = reconstruct_posterior(tracks, template, camera, motion, null=True)
    worth = posterior_quality(posterior, tracks, camera)
    quality = replace(quality, values={**quality.values, **worth.gate_values()})
    peaks = {**quality.peaks, "t0_s": angular}
    scale = float(np.nanmedian(frames.scale_px_per_m))
    return Reconstruction(
        play=play,
        kinematics=k,
        t0_s=t0,
        t0_angular_s=angular,
        t0_linear_s=linear,
        quality=replace(quality, warnings=(*clip.warnings, *quality.warnings)),
        tables={
            "poses_per_frame.csv": (POSES, _pose_columns(motion)),
            "qc_per_frame.csv": (QC, _qc_columns(motion, frames, posterior)),
            "peaks.csv": (PEAKS, peak_rows(worth, peaks, quality.null_peaks)),
            "click_weights.csv": (CLICK_WEIGHTS, click_weights(posterior, tracks, template)),
        },
        posterior=posterior,
        posterior_quality=worth,
        columns=curves(posterior, len(tracks.frames)),
        notes=tuple(advice(worth, tracks, camera, scale)),
    )


def _pose_columns(motion: ProtocolMotion) -> dict[str, Any]:
    k, used = motion.kinematics, motion.used
    vectors = np.full((len(used), 3), np.nan)
    positions, focal = vectors.copy(), np.full(len(used), np.nan)
    vectors[used] = Rotation.from_matrix(motion.poses.rotation).as_rotvec()
    positions[used] = motion.poses.position_m
    focal[used] = np.exp(motion.poses.log_f)
    return {
        "frame": motion.frames,
        "time_s": k.time_s,
        "own_pose": used.astype(int),
        **{f"r{a}_rad": vectors[:, i] for i, a in enumerate("xyz")},
        **{f"t{a}_m": positions[:, i] for i, a in enumerate("xyz")},
        "focal_px": np.exp(motion.log_f),
        "focal_smooth_px": focal,
        "sigma_log_focal": motion.sigma_log_f,
        "focal_source": ["frame" if own else "clip" for own in motion.own_focal],
        **{f"cg_raw_{a}_m": motion.position_raw_m[:, i] for i, a in enumerate("xyz")},
    }


def _qc_columns(motion: ProtocolMotion, frames: FrameQuality, posterior: PosteriorMotion) -> dict[str, Any]:
    k = motion.kinematics
    along, across = along_ray(k)
    difference = np.linalg.norm(k.acceleration_m_per_s2 - motion.acceleration_check_m_per_s2, axis=1)
    batch = posterior.batch
    seen = np.isfinite(batch.errors_px[..., 0])
    squared = np.sum(np.nan_to_num(batch.errors_px) ** 2, axis=(1, 2))
    none = ~seen.any(axis=1)
    return {
        "frame": motion.frames,
        "time_s": k.time_s,
        "landmarks": frames.landmarks,
        "degrees_of_freedom": frames.degrees_of_freedom,
        "reprojection_rmse_px": frames.rmse_px,
        "reprojection_rmse_dof_px": frames.rmse_per_freedom_px,
        "focal_drift_percent": frames.focal_drift_percent,
        "sigma_log_focal": motion.sigma_log_f,
        "scale_px_per_m": frames.scale_px_per_m,
        "scale_drift_percent": frames.scale_drift_percent,
        "baseline_drift_percent": frames.baseline_drift_percent,
        "flip_ratio": frames.flip_ratio,
        "candidates": frames.candidates,
        "posterior_rmse_px": np.where(none, np.nan, np.sqrt(squared / np.maximum(seen.sum(axis=1), 1))),
        "least_click_weight": np.where(none, np.nan, np.where(seen, batch.weights, np.inf).min(axis=1)),
        "sigma_rotation_deg": np.degrees(np.sqrt(np.linalg.eigvalsh(batch.covariance[:, :3, :3])[:, -1])),
        "sigma_log_depth": np.sqrt(batch.covariance[:, 5, 5]),
        "a_across_ray_m_per_s2": across,
        "a_along_ray_m_per_s2": along,
        "a_check_difference_m_per_s2": difference,
    }


def _from_wearable(play: Play, source: WearableSource) -> Reconstruction:
    motion = reconstruct_wearable(play.file(source.kinematics), source)
    k = motion.kinematics
    angular = float(k.time_s[peak_frame(k.alpha_resultant)])
    linear = float(k.time_s[peak_frame(k.linear_resultant)])
    t0 = angular if play.t0 == "angular" else linear
    start = t0 - play.window.before_t0_s
    offset = float(np.linalg.norm(source.sensor_to_cg_m))
    quality = wearable_quality(motion, offset, t0, (start, start + play.window.duration_s))
    return Reconstruction(play, k, t0, angular, linear, quality)
