"""``qc_summary.txt``: the one page that a person reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from replay.motion.bands import QUANTITIES, UNITS
from replay.motion.initial_conditions import velocity_bands

if TYPE_CHECKING:
    from replay.motion.reconstruct import Reconstruction


def _before(result: Reconstruction) -> list[str]:
    """Velocities just before the impact, where its onset is known."""
    assert result.posterior is not None
    assert result.posterior_quality is not None
    if not result.posterior_quality.bands["onset_s"].resolved:
        return []
    before = result.posterior.before
    bands, lines = velocity_bands(before), []
    for stem, unit, words, values in (
        ("v", "m_per_s", "CG velocity before it [m/s]", before.motion.velocity_m_per_s[0]),
        ("omega_", "rad_per_s", "angular velocity before it [rad/s]", before.motion.omega_rad_per_s[0]),
    ):
        halves = [0.5 * (high - low) for low, high in (bands[f"{stem}{a}_{unit}"] for a in "xyz")]
        told = ", ".join(f"{a} {v:.2f} +- {h:.2f}" for a, v, h in zip("xyz", values, halves))
        lines.append(f"{words:38s} {told}")
    return lines


def summary(result: Reconstruction) -> str:
    """What was found in both modes, what noise alone would show, and what would help."""
    play, quality, posterior = result.play, result.quality, result.posterior_quality
    samples = "frames" if quality.kind == "clicks" else "samples"
    angular, linear = result.t0_angular_s * 1e3, result.t0_linear_s * 1e3
    lines = [
        f"Reconstruction of play {play.name}",
        f"{play.title}" if play.title else "",
        "",
        f"source      {quality.kind}, {quality.samples} {samples} at {quality.rate_hz:.6g} Hz",
        f"t0          {result.t0_s * 1e3:.2f} ms ({play.t0}); angular {angular:.2f} ms, linear {linear:.2f} ms",
        f"driven by   {play.reconstruction.mode if posterior else 'the wearable'}",
        "",
    ]
    if posterior is not None:
        lines += [*result.notes, "", "Posterior mode: between the frames, with 95 % bands"]
        for name in QUANTITIES:
            label, unit, scale = UNITS[name]
            band = posterior.bands[name]
            form = ".1f" if unit == "ms" else ".3g"
            lines.append(f"{label:38s} {band.text(scale, form)}{f' {unit}' if band.resolved else ''}")
        lines += _before(result)
        margin = posterior.document()["flip_margin"]
        lines += [
            f"{'noise alone would show':38s} {posterior.null_peak_rad_per_s:.3g} rad/s",
            f"{'click noise':38s} {posterior.click_sigma_px:.2g} px",
            f"{'log odds against the mirrored pose':38s} {margin if isinstance(margin, str) else f'{margin:.3g}'}",
            f"{'probability of an impact':38s} {posterior.event_probability:.3g}",
            f"{'bands':38s} {posterior.band_class}",
            "",
        ]
    lines.append("Protocol mode: greatest sample     value      noise alone   ratio    at [ms]")
    for name in QUANTITIES:
        if name not in quality.peaks:
            continue
        label, unit, scale = UNITS[name]
        value, null = quality.peaks[name] / scale, quality.null_peaks.get(name)
        noise = f"{null / scale:10.4g}  {quality.peaks[name] / null:8.2f}" if null else "         -         -"
        lines.append(f"{label:28s} {value:10.4g} {unit:8s} {noise}  {quality.peak_times_s[name] * 1e3:9.2f}")
    lines += ["", "Quality (verdicts are in gate.json)"]
    told = posterior.gate_values() if posterior else {}
    for name, item in quality.values.items():
        if name.endswith("_detail") or name in told:
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
            "Noise alone: the peak of a head at rest under the same clicks. HIC comes from the finite-element head.",
        ]
    return "\n".join(line.rstrip() for line in lines) + "\n"
