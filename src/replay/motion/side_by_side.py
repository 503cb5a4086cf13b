"""Protocol mode beside posterior mode: the columns, rows and words in which both are handed over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from replay.motion.bands import CURVES, INSTANTS, NOT_RESOLVABLE, QUANTITIES, UNITS, Band, band, constants
from replay.motion.kinematics import KINEMATICS
from replay.motion.posterior import PosteriorMotion
from replay.motion.settings import CameraSettings
from replay.motion.tracks import Template, Tracks
from replay.tables import Column, TableFormat

COMPETE = "{} instants compete"
"""Where the band of an instant is in several parts."""
DECIDED_FLIP = 3.0
"""Log odds from which the path is told from its mirrored twin: twenty to one."""
SMOOTHNESS_ALONE = "three landmarks fit the path and its mirror image exactly: only smoothness tells them apart"
_CURVE_UNITS = {"omega": "rad_per_s", "alpha": "rad_per_s2", "a": "m_per_s2"}
_CURVE_WORDS = {"omega": "angular velocity", "alpha": "angular acceleration", "a": "CG acceleration"}


def _names(curve: str) -> list[tuple[str, str]]:
    """Stem of each column of a curve, and what it is."""
    unit, words = _CURVE_UNITS[curve], _CURVE_WORDS[curve]
    joint = "" if curve == "a" else "_"
    return [
        *((f"{curve}{joint}{axis}_{unit}", f"{axis} of the {words}") for axis in "xyz"),
        (f"{curve}_{unit}", f"resultant {words}"),
    ]


KINEMATICS_BOTH = TableFormat(
    "kinematics of the skull CG, both modes",
    (
        *KINEMATICS.columns,
        *(
            Column(f"posterior_{stem}{end}", f"{words}, posterior mode, global{kind}", may_be_empty=True)
            for curve in CURVES
            for stem, words in _names(curve)
            for end, kind in (
                ("", ""),
                ("_lo", ": lower end of its 95 % band"),
                ("_hi", ": upper end of its 95 % band"),
            )
        ),
    ),
)
"""Format of ``kinematics.csv`` where the motion comes from clicks: protocol mode first."""

PEAKS = TableFormat(
    "peaks, both modes",
    (
        Column("quantity", "what peaks; SI, the unit is part of the name", kind="text"),
        Column("protocol", "protocol mode: greatest sample", may_be_empty=True),
        Column("protocol_null", "protocol mode on a head at rest under the same noise", may_be_empty=True),
        Column("posterior", "posterior mode: between the frames; empty where not resolvable", may_be_empty=True),
        Column("posterior_lo", "lower end of its 95 % band", may_be_empty=True),
        Column("posterior_hi", "upper end of its 95 % band", may_be_empty=True),
        Column("resolved", f"yes, `{COMPETE.format('k')}`, or `{NOT_RESOLVABLE}`", kind="text"),
    ),
)
"""Format of ``peaks.csv``."""

CLICK_WEIGHTS = TableFormat(
    "weights of the clicks",
    (
        Column("frame", "frame of the video", kind="int"),
        Column("landmark_id", "landmark of the template", kind="text"),
        Column("weight", "weight in the batch estimate: about 1, near 0 for a click that nothing else supports"),
        Column("error_u_px", "click less projection, right [px]"),
        Column("error_v_px", "click less projection, down [px]"),
    ),
)
"""Format of ``click_weights.csv``."""


@dataclass(frozen=True)
class PosteriorQuality:
    """What posterior mode reports, as ``quality.json`` holds it.

    Parameters
    ----------
    bands
        By quantity: value, low, high, resolved.
    band_class
        ``calibrated`` where the bands were made to cover on footage like this, else why not.
    flip_margin
        Log odds of the path against its mirrored twin; infinite where there is none.
    flip_undecided
        Why the twin is not excluded; empty where it is.
    event_probability, null_peak_rad_per_s, click_sigma_px
        Of `replay.motion.posterior.PosteriorMotion`; click noise as estimated.
    """

    bands: dict[str, Band]
    band_class: str
    flip_margin: float
    flip_undecided: str
    event_probability: float
    null_peak_rad_per_s: float
    click_sigma_px: float

    @property
    def peak_over_null(self) -> float:
        """Peak angular velocity over the null peak."""
        return self.bands["omega_rad_per_s"].value / max(self.null_peak_rad_per_s, 1e-9)

    def document(self) -> dict[str, Any]:
        """For ``quality.json``."""
        return {
            "bands": {
                name: {
                    "value": b.value,
                    "low": b.low,
                    "high": b.high,
                    **({"parts": [[p.low, p.high, p.chance] for p in b.parts]} if b.parts else {}),
                }
                if b.resolved
                else NOT_RESOLVABLE
                for name, b in self.bands.items()
            },
            "band_class": self.band_class,
            "flip_margin": self.flip_margin if np.isfinite(self.flip_margin) else "no second path",
            "flip_undecided": self.flip_undecided,
            "event_probability": self.event_probability,
            "null_peak_rad_per_s": self.null_peak_rad_per_s,
            "click_sigma_px": self.click_sigma_px,
        }

    def gate_values(self) -> dict[str, float | bool | str]:
        """Posterior mode's part of the reconstruction gate."""
        omega, t0 = self.bands["omega_rad_per_s"], self.bands["t0_s"]
        return {
            "posterior_flip_margin": (
                SMOOTHNESS_ALONE
                if self.flip_undecided == SMOOTHNESS_ALONE
                else self.flip_margin
                if np.isfinite(self.flip_margin)
                else "no mirrored twin of the path fits the clicks"
            ),
            "posterior_peak_over_null": self.peak_over_null,
            "bands_calibrated": self.band_class == "calibrated",
            "bands_calibrated_detail": f"band coverage class: {self.band_class}",
            "peak_omega_resolved": omega.resolved,
            "peak_omega_resolved_detail": f"peak angular velocity {omega.text()} rad/s"
            if omega.resolved
            else f"peak angular velocity is {NOT_RESOLVABLE}",
            "t0_resolved": t0.resolved and not t0.parts,
            "t0_resolved_detail": f"{UNITS['t0_s'][0]}: {t0.text(1e-3, '.1f')}{' ms' if t0.resolved else ''}",
        }


def posterior_quality(posterior: PosteriorMotion, tracks: Tracks, camera: CameraSettings) -> PosteriorQuality:
    """Bands of every quantity, and whether they are to be trusted."""
    batch = posterior.batch
    scale = float(np.median(np.exp(batch.state.log_f - batch.state.shift[:, 2])))
    facts = {
        "fps": camera.fps,
        "landmarks": float(np.median(tracks.seen.sum(axis=1))),
        "px_per_m": scale,
        "sigma_px": batch.sigma_px,
    }
    outside = [
        f"{name} {value:.3g} lies outside {low:g} to {high:g}"
        for name, value in facts.items()
        for low, high in [constants().calibrated[name]]
        if not 0.95 * low <= value <= 1.05 * high
    ]
    undecided = ""
    if facts["landmarks"] <= 3:
        undecided = SMOOTHNESS_ALONE
    elif posterior.flip_margin < DECIDED_FLIP:
        undecided = "the clicks do not tell the path from its mirrored twin"
    outside += [undecided] * bool(undecided)
    bands = {name: band(name, values, posterior.fps) for name, values in posterior.peaks.items() if name != "t0_s"}
    bands |= {"t0_s": t0_band(posterior)}
    return PosteriorQuality(
        bands=bands | {name: bands[name].of_event(posterior.event_probability) for name in INSTANTS},
        band_class="calibrated" if not outside else "extrapolated: " + "; ".join(outside),
        flip_margin=posterior.flip_margin,
        flip_undecided=undecided,
        event_probability=posterior.event_probability,
        null_peak_rad_per_s=posterior.null_peak_rad_per_s,
        click_sigma_px=batch.sigma_px,
    )


def t0_band(posterior: PosteriorMotion) -> Band:
    """Band of the instant of peak angular acceleration."""
    _, time = posterior.draws.inner(1.0 / posterior.fps)
    return constants().instants(time, posterior.relative_alpha)


def curves(posterior: PosteriorMotion, frames: int) -> dict[str, np.ndarray]:
    """Posterior columns of `KINEMATICS_BOTH`; empty for frames beyond the window that was read."""
    index, at = posterior.at_frames
    out: dict[str, np.ndarray] = {}
    draws = posterior.draws
    for curve, values in (
        ("omega", draws.omega_rad_per_s[:, at]),
        ("alpha", draws.alpha_rad_per_s2[:, at]),
        ("a", draws.acceleration_m_per_s2[:, at]),
    ):
        factor = constants().at_rate(constants().curves[curve], posterior.fps)
        columns = [*(values[..., i] for i in range(3)), np.linalg.norm(values, axis=2)]
        for (stem, _), column in zip(_names(curve), columns):
            mean, sigma = column.mean(axis=0), column.std(axis=0)
            low = mean - factor * sigma
            if stem == _names(curve)[-1][0]:
                low = np.maximum(low, 0.0)
            for end, part in (("", mean), ("_lo", low), ("_hi", mean + factor * sigma)):
                full = np.full(frames, np.nan)
                full[index] = part
                out[f"posterior_{stem}{end}"] = full
    return out


def spin_band(posterior: PosteriorMotion, at: int) -> tuple[float, float]:
    """95 % band of the angular velocity's magnitude at a point of the grid [rad/s]."""
    spin = np.linalg.norm(posterior.draws.omega_rad_per_s[:, at], axis=1)
    half = constants().at_rate(constants().curves["omega"], posterior.fps) * float(spin.std())
    return max(float(spin.mean()) - half, 0.0), float(spin.mean()) + half


def peak_rows(quality: PosteriorQuality, protocol: dict[str, float], null: dict[str, float]) -> dict[str, list[Any]]:
    """Columns of `PEAKS`."""
    bands = [quality.bands[name] for name in QUANTITIES]

    def told(values: list[float]) -> list[float]:
        return [value if b.resolved else float("nan") for value, b in zip(values, bands)]

    return {
        "quantity": list(QUANTITIES),
        "protocol": [protocol.get(name, float("nan")) for name in QUANTITIES],
        "protocol_null": [null.get(name, float("nan")) for name in QUANTITIES],
        "posterior": told([b.value for b in bands]),
        "posterior_lo": told([b.low for b in bands]),
        "posterior_hi": told([b.high for b in bands]),
        "resolved": [
            NOT_RESOLVABLE if not b.resolved else COMPETE.format(len(b.parts)) if b.parts else "yes" for b in bands
        ],
    }


def click_weights(posterior: PosteriorMotion, tracks: Tracks, template: Template) -> dict[str, Any]:
    """Columns of `CLICK_WEIGHTS`."""
    rows, columns = np.nonzero(tracks.seen)
    errors = posterior.batch.errors_px[rows, columns]
    return {
        "frame": tracks.frames[rows],
        "landmark_id": [template.names[i] for i in columns],
        "weight": posterior.batch.weights[rows, columns],
        "error_u_px": errors[:, 0],
        "error_v_px": errors[:, 1],
    }


def advice(quality: PosteriorQuality, tracks: Tracks, camera: CameraSettings, scale_px_per_m: float) -> list[str]:
    """What would make more of the motion resolvable, the strongest first; each line begins with what to change."""
    bands, mend = quality.bands, []
    landmarks = int(np.median(tracks.seen.sum(axis=1)))
    missing = any(not band.resolved for band in bands.values())
    t0 = bands["t0_s"]
    if quality.flip_undecided:
        mend.append("mirror image: the picture fits two poses; click a fourth landmark out of the plane of the others")
    if landmarks < 6:
        mend.append(f"landmarks: {landmarks} a frame are clicked; 6 that do not lie in one plane settle the pose")
    if camera.fps < 115.0:
        mend.append(
            f"frame rate: {1e3 / camera.fps:.0f} ms between frames is as long as an impact; 240 fps narrows the band "
            "of peak angular velocity by a third"
        )
    if scale_px_per_m < 300.0:
        mend.append(f"closeness: {scale_px_per_m:.0f} px/m; zooming in to 300 px/m or more narrows every band")
    if quality.click_sigma_px > 1.5:
        mend.append(f"clicks: {quality.click_sigma_px:.2g} px of noise; click twice, or use `replay digitize`")
    if t0.resolved and t0.parts:
        mend.append(f"t0: {COMPETE.format(len(t0.parts))}, lobes of like height; replay each of them")
    if any(not bands[name].resolved for name in ("alpha_rad_per_s2", "a_across_m_per_s2", "a_along_m_per_s2")):
        mend.append("accelerations: no video up to 240 fps resolved them in our tests; an instrumented mouthguard does")
    return mend if missing or t0.parts or quality.flip_undecided else []
