"""Every number a reconstruction gate needs; the verdicts are the gate's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.motion.filters import achieved_cutoff, moving_average
from replay.motion.null import NullPeaks, click_noise
from replay.motion.protocol import ProtocolMotion, along_ray, peak_frame
from replay.motion.settings import CameraSettings
from replay.motion.tracks import Tracks
from replay.motion.wearable import WearableMotion

REPROJECTION_LIMIT_PX = 8.0
"""Protocol 2.4: the bound that frames are counted against."""
OBSERVABLE_SIGMA_LOG_F = 0.03
"""Above this standard deviation of log f a drift of the focal length says nothing."""
SHORTEST_BASELINE_PX = 20.0

NO_FREEDOM = "no degrees of freedom: three landmarks fit any clicks exactly"


@dataclass(frozen=True)
class ReconstructionQuality:
    """Quality of one reconstruction; `None` where the source has no such quantity.

    Rates are in Hz, drifts in per cent, lengths in the unit of their name; arrays are one value a frame.
    """

    kind: str
    samples: int
    rate_hz: float
    peaks: dict[str, float]
    peak_times_s: dict[str, float]
    null_peaks: dict[str, float]
    offset_m: float
    warnings: tuple[str, ...]
    values: dict[str, float | int | bool | str]

    def gate_values(self) -> dict[str, float | int | bool | str]:
        """One entry for each check of the reconstruction gate; a text says why a number has no power."""
        return dict(self.values)


@dataclass(frozen=True)
class FrameQuality:
    """Per-frame numbers of `qc_per_frame.csv`, NaN for frames without a pose of their own."""

    landmarks: np.ndarray
    degrees_of_freedom: np.ndarray
    rmse_px: np.ndarray
    rmse_per_freedom_px: np.ndarray
    focal_drift_percent: np.ndarray
    scale_px_per_m: np.ndarray
    scale_drift_percent: np.ndarray
    baseline_drift_percent: np.ndarray
    flip_ratio: np.ndarray
    candidates: np.ndarray


def frame_quality(motion: ProtocolMotion, tracks: Tracks, camera: CameraSettings) -> FrameQuality:
    """Residuals and drifts of every frame.

    Reprojection RMSE is sqrt(sum |e|^2 / n), beside it sqrt(sum |e|^2 / (2n - 6)); a focal length of the
    frame's own without a reference takes one more equation. Focal drift is 100 |log f - smooth(log f)|,
    baseline drift the median over pairs of 100 |measured / predicted distance - 1|, pairs under 20 px left out.
    """
    used, seen = motion.used, tracks.seen[motion.used]
    n = seen.sum(axis=1)
    squared = np.where(seen, np.sum(np.nan_to_num(motion.errors_px) ** 2, axis=2), 0.0).sum(axis=1)
    freedom = 2 * n - 6 - (motion.own_focal[used] & (not camera.has_reference))
    with np.errstate(divide="ignore", invalid="ignore"):
        per_freedom = np.where(freedom > 0, np.sqrt(squared / np.maximum(freedom, 1)), np.nan)
    smooth_f = moving_average(motion.log_f, motion.lengths.focal)
    scale = motion.poses.scale_px_per_m
    every = np.arange(len(used))
    log_scale = np.interp(every, every[used], np.log(scale))
    smooth_scale = moving_average(log_scale, motion.lengths.focal)

    def spread(values: np.ndarray) -> np.ndarray:
        out = np.full(len(used), np.nan)
        out[used] = values
        return out

    return FrameQuality(
        landmarks=tracks.seen.sum(axis=1),
        degrees_of_freedom=spread(freedom),
        rmse_px=spread(np.sqrt(squared / n)),
        rmse_per_freedom_px=spread(per_freedom),
        focal_drift_percent=100.0 * np.abs(motion.log_f - smooth_f),
        scale_px_per_m=spread(scale),
        scale_drift_percent=100.0 * np.abs(log_scale - smooth_scale),
        baseline_drift_percent=spread(_baseline_drift(tracks.pixels[used], motion.predicted_px, seen)),
        flip_ratio=spread(motion.flip_ratio),
        candidates=spread(motion.candidates),
    )


def _baseline_drift(pixels: np.ndarray, predicted: np.ndarray, seen: np.ndarray) -> np.ndarray:
    out = np.full(len(pixels), np.nan)
    for k in range(len(pixels)):
        index = np.flatnonzero(seen[k])
        i, j = (index[pair] for pair in np.triu_indices(len(index), 1))
        measured = np.linalg.norm(pixels[k, i] - pixels[k, j], axis=1)
        expected = np.linalg.norm(predicted[k, i] - predicted[k, j], axis=1)
        long = expected >= SHORTEST_BASELINE_PX
        if long.any():
            out[k] = 100.0 * float(np.median(np.abs(measured[long] / expected[long] - 1.0)))
    return out


def peaks_of(motion: ProtocolMotion) -> tuple[dict[str, float], dict[str, float]]:
    """Peaks and their times, the one-sided end frames left out."""
    k = motion.kinematics
    along, across = along_ray(k)
    curves = {
        "omega_rad_per_s": k.omega_resultant,
        "alpha_rad_per_s2": k.alpha_resultant,
        "a_m_per_s2": k.linear_resultant,
        "a_across_m_per_s2": across,
        "a_along_m_per_s2": np.abs(along),
    }
    at = {name: peak_frame(curve) for name, curve in curves.items()}
    return (
        {name: float(curve[at[name]]) for name, curve in curves.items()},
        {name: float(k.time_s[at[name]]) for name in curves},
    )


def video_quality(
    motion: ProtocolMotion, frames: FrameQuality, tracks: Tracks, camera: CameraSettings, null: NullPeaks
) -> ReconstructionQuality:
    """Quality of a reconstruction from clicks."""
    peaks, times = peaks_of(motion)
    nulls = {name: float(getattr(null, name)) for name in peaks}
    sigma, measured = click_noise(motion, camera, tracks)
    freedom = frames.degrees_of_freedom[motion.used]
    rmse = frames.rmse_px[motion.used]
    nyquist = 0.5 * camera.fps
    warnings = list(camera.warnings())
    values: dict[str, float | int | bool | str] = {
        "reprojection_rmse_median_px": float(np.median(rmse)),
        "reprojection_rmse_p95_px": float(np.percentile(rmse, 95)),
        "frames_above_8_px": int(np.sum(rmse > REPROJECTION_LIMIT_PX)),
        "degrees_of_freedom_min": int(freedom.min()),
        "focal_drift_median_percent": float(np.median(frames.focal_drift_percent)),
        "focal_drift_p95_percent": float(np.percentile(frames.focal_drift_percent, 95)),
        "focal_sigma_log": float(np.median(motion.sigma_log_f)),
        "scale_drift_percent": float(np.median(frames.scale_drift_percent)),
        "baseline_drift_median_percent": float(np.nanmedian(frames.baseline_drift_percent)),
        "baseline_drift_p95_percent": float(np.nanpercentile(frames.baseline_drift_percent, 95)),
        "pixels_per_metre": float(np.nanmedian(frames.scale_px_per_m)),
        "flip_margin": (
            float(np.nanmin(frames.flip_ratio))
            if np.isfinite(frames.flip_ratio).any()
            else "no second pose fits any frame"
        ),
        "peak_over_null": peaks["omega_rad_per_s"] / nulls["omega_rad_per_s"],
        "peak_over_null_detail": (
            f"angular velocity {peaks['omega_rad_per_s']:.3g} against {nulls['omega_rad_per_s']:.3g} rad/s of noise; "
            f"angular acceleration {peaks['alpha_rad_per_s2']:.3g} against {nulls['alpha_rad_per_s2']:.3g} rad/s^2; "
            f"CG acceleration across the ray {peaks['a_across_m_per_s2']:.3g} against "
            f"{nulls['a_across_m_per_s2']:.3g} m/s^2"
        ),
        "linear_cutoff_over_nyquist": camera.cutoffs.linear / nyquist,
        "angular_cutoff_over_nyquist": camera.cutoffs.angular / nyquist,
        "focal_cutoff_over_nyquist": camera.cutoffs.focal / nyquist,
        "helmet_to_com_m": camera.offset_m,
    }
    for name in ("linear", "angular", "focal"):
        length = getattr(motion.lengths, name)
        reached = achieved_cutoff(length, camera.fps)
        values[f"{name}_cutoff_over_nyquist_detail"] = (
            f"{getattr(camera.cutoffs, name):g} Hz asked, "
            + ("no filter" if length == 1 else f"{reached:.1f} Hz achieved by {length} samples")
            + f", Nyquist {nyquist:.2f} Hz"
        )
    if freedom.min() <= 0:
        warnings.append(f"{int((freedom <= 0).sum())} of {len(freedom)} frames have {NO_FREEDOM}")
        if freedom.max() <= 0:
            for name in ("baseline_drift_median_percent", "baseline_drift_p95_percent"):
                values[name] = NO_FREEDOM
    if not motion.own_focal.any():
        reason = "every frame has three landmarks and takes the focal length of the clip: it cannot drift"
        values["focal_drift_median_percent"] = values["focal_drift_p95_percent"] = reason
    if np.median(motion.sigma_log_f) > OBSERVABLE_SIGMA_LOG_F:
        warnings.append(
            f"the focal length is not observable (sigma of log f {np.median(motion.sigma_log_f):.2g}): depth and the "
            "acceleration along the line of sight are not supported by this footage"
        )
    if not motion.used.all():
        warnings.append(f"{int((~motion.used).sum())} frames with fewer than 3 landmarks are bridged")
    for name, label, unit in (
        ("alpha_rad_per_s2", "angular acceleration", "rad/s^2"),
        ("a_m_per_s2", "linear acceleration", "m/s^2"),
    ):
        if peaks[name] < 2.0 * nulls[name]:
            noise = f"{nulls[name]:.4g}"
            shown = f"{peaks[name]:.4g} {unit}"
            warnings.append(f"peak {label} {shown} is not told from noise (a head without impact shows {noise})")
    if not measured:
        warnings.append(f"click noise is taken from the camera file ({sigma:g} px): residuals cannot tell it")
    return ReconstructionQuality(
        kind="clicks",
        samples=len(tracks.frames),
        rate_hz=camera.fps,
        peaks=peaks,
        peak_times_s=times,
        null_peaks={**nulls, "click_sigma_px": sigma},
        offset_m=camera.offset_m,
        warnings=tuple(warnings),
        values=values,
    )


def wearable_quality(
    motion: WearableMotion, offset_m: float, t0_s: float, window: tuple[float, float]
) -> ReconstructionQuality:
    """Quality of a reconstruction from a wearable; `window` is its start and end [s]."""
    k = motion.kinematics
    curves = {
        "omega_rad_per_s": k.omega_resultant,
        "alpha_rad_per_s2": k.alpha_resultant,
        "a_m_per_s2": k.linear_resultant,
    }
    quiet = k.time_s < t0_s - 0.020
    noise: float | str = "fewer than 10 samples before the impact"
    if quiet.sum() >= 10:
        spread = float(np.sqrt(np.sum(np.var(k.acceleration_m_per_s2[quiet], axis=0))))
        noise = float(k.linear_resultant.max() / spread) if spread > 0.0 else "the record before the impact is constant"
    cutoff = motion.cutoff_hz
    return ReconstructionQuality(
        kind="wearable",
        samples=len(k.time_s),
        rate_hz=motion.rate_hz,
        peaks={name: float(curve.max()) for name, curve in curves.items()},
        peak_times_s={name: float(k.time_s[np.argmax(curve)]) for name, curve in curves.items()},
        null_peaks={},
        offset_m=offset_m,
        warnings=(),
        values={
            "sampling_rate_hz": motion.rate_hz,
            "sampling_jitter_percent": motion.jitter_percent,
            "filter_cutoff_over_nyquist": (
                "no filter was asked for" if cutoff is None else cutoff / (0.5 * motion.rate_hz)
            ),
            "range_used": (
                "the play does not state the sensor's range" if motion.range_used is None else motion.range_used
            ),
            "saturated_samples": motion.saturated_samples,
            "missing_samples": 0,
            "window_covered": bool(window[0] >= k.time_s[0] - 1e-9 and window[1] <= k.time_s[-1] + 1e-9),
            "sensor_to_cg_m": offset_m,
            "peak_over_noise": noise,
        },
    )
