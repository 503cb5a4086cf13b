"""One door for both kinds of source: a play in, the reconstruction's files out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from replay.files import write_text
from replay.motion.clip import load_clip
from replay.motion.driver import axis_points, build_driver
from replay.motion.kinematics import STANDARD_GRAVITY, Kinematics
from replay.motion.null import null_peaks
from replay.motion.protocol import ProtocolMotion, along_ray, peak_frame, reconstruct_clicks
from replay.motion.quality import FrameQuality, ReconstructionQuality, frame_quality, video_quality, wearable_quality
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

INITIAL_CONDITIONS = TableFormat(
    "initial conditions",
    (
        Column("instant", "t0, or window_start: the first sample of the driver", kind="text"),
        Column("time_s", "time on the clock of kinematics.csv [s]"),
        *_vector("{}_m", "of the skull CG, global [m]"),
        *(Column(f"q{c}", f"quaternion head to global, {c}") for c in "xyzw"),
        *_vector("v{}_m_per_s", "of the CG velocity, global [m/s]"),
        *_vector("omega_{}_rad_per_s", "of the angular velocity, global [rad/s]"),
        Column("spin_rad_per_s", "magnitude of the angular velocity, about the axis from P to Q [rad/s]"),
        *_vector("p{}_m", "of P, on the axis: the skull CG [m]"),
        *_vector("q{}_axis_m", "of Q, one metre along the axis [m]"),
        Column("a_m_per_s2", "resultant CG acceleration [m/s^2]"),
        Column("alpha_rad_per_s2", "resultant angular acceleration [rad/s^2]"),
    ),
)
"""Format of ``initial_conditions_t0.csv``."""

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
    """

    play: Play
    kinematics: Kinematics
    t0_s: float
    t0_angular_s: float
    t0_linear_s: float
    quality: ReconstructionQuality
    tables: dict[str, tuple[TableFormat, dict[str, Any]]] = field(default_factory=dict)

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files that `write` makes."""
        return ("kinematics.csv", "initial_conditions_t0.csv", *self.tables, "qc_summary.txt")

    def write(self, folder: Path) -> tuple[Path, ...]:
        """Write the reconstruction's files and return their paths.

        Raises
        ------
        InputError
            When the play's window runs past the data.
        """
        folder = Path(folder)
        conditions = self._conditions()
        self.kinematics.write(folder / "kinematics.csv")
        INITIAL_CONDITIONS.write(folder / "initial_conditions_t0.csv", conditions)
        for name, (form, columns) in self.tables.items():
            form.write(folder / name, columns)
        write_text(folder / "qc_summary.txt", summary(self))
        return tuple(folder / name for name in self.files)

    def _conditions(self) -> dict[str, list[Any]]:
        driver = build_driver(self.kinematics, self.t0_s, self.play.window)
        at = int(np.argmin(np.abs(self.kinematics.time_s - self.t0_s)))
        out: dict[str, list[Any]] = {name: [] for name in INITIAL_CONDITIONS.names}
        for instant, time, motion, row in (
            ("t0", self.t0_s, self.kinematics, at),
            ("window_start", driver.start_s, driver.motion, 0),
        ):
            columns = motion.columns()
            axis = axis_points(motion.position_m[row], motion.omega_rad_per_s[row])
            p, q = np.asarray(axis["P_m"]), np.asarray(axis["Q_m"])
            values: dict[str, Any] = {
                "instant": instant,
                "time_s": float(time),
                "spin_rad_per_s": axis["spin_rad_per_s"],
            }
            for i, a in enumerate("xyz"):
                values[f"p{a}_m"], values[f"q{a}_axis_m"] = float(p[i]), float(q[i])
            for name in out:
                out[name].append(values[name] if name in values else float(columns[name][row]))
        return out


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
    return _from_clicks(play, play.source)


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
    return Reconstruction(
        play=play,
        kinematics=k,
        t0_s=t0,
        t0_angular_s=angular,
        t0_linear_s=linear,
        quality=replace(quality, warnings=(*clip.warnings, *quality.warnings)),
        tables={
            "poses_per_frame.csv": (POSES, _pose_columns(motion)),
            "qc_per_frame.csv": (QC, _qc_columns(motion, frames)),
        },
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


def _qc_columns(motion: ProtocolMotion, frames: FrameQuality) -> dict[str, Any]:
    k = motion.kinematics
    along, across = along_ray(k)
    difference = np.linalg.norm(k.acceleration_m_per_s2 - motion.acceleration_check_m_per_s2, axis=1)
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


_PEAK_LINES = (
    ("omega_rad_per_s", "angular velocity", "rad/s", 1.0),
    ("alpha_rad_per_s2", "angular acceleration", "rad/s^2", 1.0),
    ("a_m_per_s2", "CG acceleration, resultant", "g", STANDARD_GRAVITY),
    ("a_across_m_per_s2", "  across the line of sight", "g", STANDARD_GRAVITY),
    ("a_along_m_per_s2", "  along the line of sight", "g", STANDARD_GRAVITY),
)


def summary(result: Reconstruction) -> str:
    """One page a person reads: what was found, beside what noise alone would show."""
    play, quality = result.play, result.quality
    samples = "frames" if quality.kind == "clicks" else "samples"
    angular, linear = result.t0_angular_s * 1e3, result.t0_linear_s * 1e3
    lines = [
        f"Reconstruction of play {play.name}",
        f"{play.title}" if play.title else "",
        "",
        f"source      {quality.kind}, {quality.samples} {samples} at {quality.rate_hz:.6g} Hz",
        f"t0          {result.t0_s * 1e3:.2f} ms ({play.t0}); angular {angular:.2f} ms, linear {linear:.2f} ms",
        "",
        "Peaks                              value      noise alone   ratio    at [ms]",
    ]
    for name, label, unit, scale in _PEAK_LINES:
        if name not in quality.peaks:
            continue
        value, null = quality.peaks[name] / scale, quality.null_peaks.get(name)
        noise = f"{null / scale:10.4g}  {quality.peaks[name] / null:8.2f}" if null else "         -         -"
        lines.append(f"{label:28s} {value:10.4g} {unit:8s} {noise}  {quality.peak_times_s[name] * 1e3:9.2f}")
    lines += ["", "Quality (verdicts are in gate.json)"]
    for name, item in quality.values.items():
        if name.endswith("_detail"):
            continue
        shown = f"{item:.4g}" if isinstance(item, float) else str(item)
        lines.append(f"  {name:34s} {shown}")
        detail = quality.values.get(f"{name}_detail")
        if detail:
            lines.append(f"  {'':34s} ({detail})")
    if quality.warnings:
        lines += ["", "Read this"]
        lines += [f"  - {warning}" for warning in quality.warnings]
    if quality.kind == "clicks":
        lines += [
            "",
            "The noise column is the peak that a head standing still would show under the same clicks:",
            "a peak is worth its ratio to it.",
            "HIC is not computed from footage; it comes from the finite-element head.",
        ]
    return "\n".join(line.rstrip() for line in lines) + "\n"
