"""Reconstruction quality: is the motion supported by the footage, or by the sensor? (article, protocol 2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

VIDEO_CHECKS = (
    "reprojection_rmse_median_px",
    "reprojection_rmse_p95_px",
    "frames_above_8_px",
    "degrees_of_freedom_min",
    "focal_drift_median_percent",
    "focal_drift_p95_percent",
    "focal_sigma_log",
    "scale_drift_percent",
    "baseline_drift_median_percent",
    "baseline_drift_p95_percent",
    "pixels_per_metre",
    "flip_margin",
    "peak_over_null",
    "linear_cutoff_over_nyquist",
    "angular_cutoff_over_nyquist",
    "focal_cutoff_over_nyquist",
    "helmet_to_com_m",
    "posterior_flip_margin",
    "posterior_peak_over_null",
    "peak_omega_resolved",
    "t0_resolved",
    "bands_calibrated",
)
WEARABLE_CHECKS = (
    "sampling_rate_hz",
    "sampling_jitter_percent",
    "filter_cutoff_over_nyquist",
    "range_used",
    "saturated_samples",
    "missing_samples",
    "window_covered",
    "sensor_to_cg_m",
    "peak_over_noise",
)
_RESIDUALS = ("reprojection_rmse_median_px", "reprojection_rmse_p95_px", "frames_above_8_px")
_FOCAL = ("focal_drift_median_percent", "focal_drift_p95_percent")


def video_reconstruction_gate(quality: Mapping[str, Any], limits: Limits) -> Gate:
    """Judge a motion that was reconstructed from clicked video.

    Parameters
    ----------
    quality
        One entry per name of `VIDEO_CHECKS`; a text in place of a number is the reason
        why that check has no power, ``<name>_detail`` adds a sentence.

        - ``reprojection_rmse_median_px``, ``reprojection_rmse_p95_px``: over frames of
          sqrt(sum |e|^2 / n).
        - ``frames_above_8_px``: number of frames whose RMSE exceeds 8 px.
        - ``degrees_of_freedom_min``: equations less unknowns of the worst frame. At zero
          the residual is identically zero and the three checks above say vacuous.
        - ``focal_drift_median_percent`` (the article's criterion), ``focal_drift_p95_percent``:
          of 100 |log f - log smooth(f)|. Vacuous where the focal length is not observable.
        - ``focal_sigma_log``: standard deviation of log f per frame.
        - ``scale_drift_percent``: median drift of f/Z; carries the gate where f is not observable.
        - ``baseline_drift_median_percent``, ``baseline_drift_p95_percent``.
        - ``pixels_per_metre``: f/Z at the head, median over frames.
        - ``flip_margin``: residual of the best mirrored pose over that of the chosen one, worst frame.
        - ``peak_over_null``: peak angular velocity over the one that noise alone shows.
        - ``linear_``, ``angular_``, ``focal_cutoff_over_nyquist``: 2 fc / fps.
        - ``helmet_to_com_m``: length of the offset from landmarks' origin to skull CG.
        - ``posterior_flip_margin``: log odds of the whole path against its mirrored twin.
        - ``posterior_peak_over_null``: posterior mode's peak angular velocity over the one that noise alone shows.
        - ``peak_omega_resolved``: whether its band is narrow enough to be a measurement.
        - ``t0_resolved``: whether the instant of peak angular acceleration is one, known to 40 ms.
        - ``bands_calibrated``: whether the bands were made to cover on footage like this (band coverage class).
    """
    values = dict(quality)
    freedom, sigma = values.get("degrees_of_freedom_min"), values.get("focal_sigma_log")
    if isinstance(freedom, int | float) and freedom <= 0:
        reason = "no degrees of freedom: as many unknowns as equations, the residual is zero whatever was clicked"
        values.update(dict.fromkeys((*_RESIDUALS, "flip_margin"), reason))
    if isinstance(sigma, int | float) and limits["reconstruction.focal_sigma_log"].judge(sigma) != "pass":
        reason = f"the focal length is not observable here (sigma of log f {sigma:.3g}); scale drift is judged instead"
        values.update(dict.fromkeys(_FOCAL, reason))
    judge = Judge("reconstruction", limits)
    judge.check_all(values, VIDEO_CHECKS)
    return judge.gate()


def wearable_reconstruction_gate(quality: Mapping[str, Any], limits: Limits) -> Gate:
    """Judge a motion that was measured by a wearable: sampling, filter and range in place of pixels.

    Parameters
    ----------
    quality
        One entry per name of `WEARABLE_CHECKS`; a text in place of a number is the reason
        why that check has no power, ``<name>_detail`` adds a sentence.

        - ``sampling_rate_hz``, ``sampling_jitter_percent``: median rate; greatest
          deviation of an interval from the median one.
        - ``filter_cutoff_over_nyquist``: 2 fc / rate, or the reason why there is no filter.
        - ``range_used``: peak over the sensor's full range.
        - ``saturated_samples``, ``missing_samples``: counts.
        - ``window_covered``: whether the record spans the analysis window.
        - ``sensor_to_cg_m``: length of the offset.
        - ``peak_over_noise``: peak over the standard deviation before the impact.
    """
    judge = Judge("reconstruction", limits)
    judge.check_all(quality, WEARABLE_CHECKS)
    return judge.gate()
