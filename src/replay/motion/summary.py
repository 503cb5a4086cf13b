"""``qc_summary.txt``: the one page that a person reads."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING

from replay.motion.bands import LEAST_EVENT, QUANTITIES, UNITS
from replay.motion.initial_conditions import velocity_bands

if TYPE_CHECKING:
    from replay.motion.reconstruct import Reconstruction

_WIDTH = 116
_CAVEATS = {"onset_s": "; of filmed measured impacts, only half began inside such a band"}
"""What docs/accuracy.md says of a band that does not keep its promise on every family."""


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


def _in_short(result: Reconstruction) -> list[str]:
    """What the footage resolves, what it does not, and what would mend that."""
    assert result.posterior_quality is not None
    bands, seen = result.posterior_quality.bands, result.posterior_quality.event_probability
    lines = [f"NO IMPACT is seen: its probability is {seen:.2g}; a slow turn fits the clicks"] * (seen < LEAST_EVENT)
    promise = "where the truth lies 19 times in 20"
    if result.posterior_quality.band_class != "calibrated":
        promise = "a band that was not calibrated for footage like this"
    lines.append(f"RESOLVED by this footage: value, and {promise}")
    for name in QUANTITIES:
        label, unit, scale = UNITS[name]
        if bands[name].resolved:
            told = bands[name].text(scale, ".1f" if unit == "ms" else ".3g")
            lines.append(f"  {label:38s} {told} {unit}{_CAVEATS.get(name, '')}")
    if lines[-1].startswith("RESOLVED"):
        lines.append("  nothing")
    missing = [f"  {UNITS[name][0]}" for name in QUANTITIES if not bands[name].resolved]
    lines += ["NOT RESOLVED by this footage: no number is given", *missing] if missing else []
    return [*lines, *(["WHAT WOULD HELP", *_wrapped(result.notes)] if result.notes else [])]


def _wrapped(points: Iterable[str]) -> list[str]:
    """One point a line, folded to the page."""
    return [
        line
        for point in points
        for line in textwrap.wrap(point, _WIDTH, initial_indent="  - ", subsequent_indent=" " * 4)
    ]


def _posterior(result: Reconstruction) -> list[str]:
    """The other numbers of posterior mode."""
    quality = result.posterior_quality
    assert quality is not None
    margin = quality.document()["flip_margin"]
    mirrored = margin if isinstance(margin, str) else f"log odds against it {margin:.3g}"
    return [
        "Posterior mode: the head before the impact, and what the bands stand on",
        *_before(result),
        f"{'probability of an impact':38s} {quality.event_probability:.3g}",
        f"{'angular velocity of noise alone':38s} {quality.null_peak_rad_per_s:.3g} rad/s",
        f"{'click noise':38s} {quality.click_sigma_px:.2g} px",
        f"{'mirror image of the pose':38s} {'NOT excluded' if quality.flip_undecided else 'excluded'}, {mirrored}",
        f"{'bands':38s} {quality.band_class}",
        "",
    ]


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
        lines += [*_in_short(result), ""]
    if quality.warnings:
        lines += ["READ THIS", *_wrapped(quality.warnings), ""]
    if posterior is not None:
        lines += _posterior(result)
    title = "Protocol mode: greatest sample" if posterior else "Greatest sample"
    lines.append(f"{title:38s}      value          noise alone    ratio    at [ms]")
    for name in QUANTITIES:
        if name not in quality.peaks:
            continue
        label, unit, scale = UNITS[name]
        value, null = quality.peaks[name] / scale, quality.null_peaks.get(name)
        noise = f"{null / scale:13.4g}  {quality.peaks[name] / null:8.2f}" if null else "            -         -"
        lines.append(f"{label:38s} {value:10.4g} {unit:8s} {noise}  {quality.peak_times_s[name] * 1e3:9.2f}")
    if quality.kind == "clicks":
        lines.append("Noise alone: a head at rest under the same clicks. HIC comes from the finite-element head.")
    lines += ["", "Quality (verdicts are in gate.json)"]
    told = posterior.gate_values() if posterior else {}
    for name, item in quality.values.items():
        if name.endswith("_detail") or name in told:
            continue
        shown = f"{item:.4g}" if isinstance(item, float) else str(item)
        lines.append(f"  {name:34s} {shown}")
        detail = quality.values.get(f"{name}_detail")
        if detail:
            lines += textwrap.wrap(f"({detail})", _WIDTH, initial_indent=" " * 6, subsequent_indent=" " * 7)
    return "\n".join(line.rstrip() for line in lines) + "\n"
