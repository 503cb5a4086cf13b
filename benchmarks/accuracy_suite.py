"""Both modes on motions that the estimator was not built on: the second table of docs/accuracy.md.

    python benchmarks/accuracy_suite.py run [CELLS...]    # slow; every clip is kept, goes on where it stopped
    python benchmarks/accuracy_suite.py table             # writes the table into docs/accuracy.md

Cells vary one thing at a time around footage that a good broadcast gives. Families are those of
`replay.motion.families.TESTING`, in turn, under fixed seeds; the bands' constants come from other families and seeds.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from footage import RECORDS, Clip, Footage, both_modes, film, true_peaks
from scipy.spatial.transform import Rotation

from replay.motion.bands import QUANTITIES, Spread, constants, spread
from replay.motion.families import TESTING
from replay.motion.posterior import PosteriorMotion
from replay.motion.protocol import ProtocolMotion, peak_frame

CLIPS = 51
"""Replicates of a cell: 17 of each family."""
CACHE = Path(__file__).parents[1] / "results" / "accuracy"
PAGE = Path(__file__).parents[1] / "docs" / "accuracy.md"
BEGIN, END = "<!-- table of both modes: begin -->\n", "<!-- table of both modes: end -->\n"
BASE = Footage(px_per_m=300.0, sigma_px=1.0, distance_m=30.0)


@dataclass(frozen=True)
class Cell:
    """One row: its footage, and whether the impact is left out."""

    title: str
    footage: Footage
    quiet: bool = False


CELLS = {
    "corner": Cell("150 px/m, 2.7 px", replace(BASE, px_per_m=150.0, sigma_px=2.7, distance_m=45.0)),
    "noisy": Cell("300 px/m, 2.7 px", replace(BASE, sigma_px=2.7)),
    "base": Cell("**300 px/m, 1 px**", BASE),
    "far": Cell("150 px/m, 1 px", replace(BASE, px_per_m=150.0, distance_m=45.0)),
    "null": Cell(
        "no impact; 150 px/m, 2.7 px", replace(BASE, px_per_m=150.0, sigma_px=2.7, distance_m=45.0), quiet=True
    ),
    "three": Cell("3 landmarks", replace(BASE, landmarks=3)),
    "fast": Cell("239.76 fps", replace(BASE, fps=239.76)),
    "near": Cell("600 px/m, 1 px", replace(BASE, px_per_m=600.0, distance_m=10.0)),
    "outliers": Cell("4 % wild clicks", replace(BASE, outliers=0.04)),
    "occluded": Cell("15 % hidden", replace(BASE, occluded=0.15)),
    "four": Cell("4 landmarks", replace(BASE, landmarks=4)),
    "ten": Cell("10 landmarks", replace(BASE, landmarks=10)),
    "double_rate": Cell("119.88 fps", replace(BASE, fps=119.88)),
    "zoom": Cell("zooming, 40 %/s", replace(BASE, zoom_per_s=0.4)),
    "coarse": Cell("4 px", replace(BASE, sigma_px=4.0)),
    "null_base": Cell("no impact", BASE, quiet=True),
}


def run(names: list[str]) -> None:
    """Film and reconstruct what is not yet in the cache."""
    CACHE.mkdir(parents=True, exist_ok=True)
    families = TESTING if RECORDS.is_dir() else TESTING[:2]
    for name in names or list(CELLS):
        path = CACHE / f"{name}.jsonl"
        done = len(path.read_text().splitlines()) if path.exists() else 0
        for seed in range(done, CLIPS):
            family = families[seed % len(families)]
            clip = film(CELLS[name].footage, family, 500_000 + seed, quiet=CELLS[name].quiet)
            row = {"family": family, "seed": seed, **measure(clip, *both_modes(clip))}
            with path.open("a") as out:
                out.write(json.dumps(row) + "\n")


def measure(clip: Clip, protocol: ProtocolMotion, posterior: PosteriorMotion) -> dict[str, Any]:
    """Everything the table needs of one clip: truth, draws' spreads and protocol mode's values."""
    truth, _ = true_peaks(clip, posterior)
    peaks = posterior.peaks
    index, at = posterior.at_frames
    inner = slice(1, -1)
    exact = clip.truth.at(clip.times)
    k = protocol.kinematics
    raw = k.omega_rad_per_s - exact.omega_rad_per_s
    curve = posterior.draws.omega_rad_per_s[:, at]
    error = curve.mean(axis=0) - exact.omega_rad_per_s[index]
    scaled = np.abs(error / curve.std(axis=0))[inner]
    true_turn = Rotation.from_quat(clip.camera.camera_to_global).inv() * exact.rotation
    off = (Rotation.from_matrix(posterior.batch.state.rotation) * true_turn.inv()).magnitude()
    off_protocol = (k.rotation * exact.rotation.inv()).magnitude()
    return {
        "truth": truth,
        "spread": {n: [s.centre, s.width] for n in QUANTITIES for s in [spread(n, peaks[n])]},
        "protocol_omega": float(k.omega_resultant[inner].max()),
        "protocol_alpha": float(k.alpha_resultant[inner].max()),
        "protocol_t0_s": float(k.time_s[peak_frame(k.alpha_resultant)]),
        "rmse": float(np.sqrt(np.mean(np.sum(error[inner] ** 2, axis=1)))),
        "protocol_rmse": float(np.sqrt(np.mean(np.sum(raw[inner] ** 2, axis=1)))),
        "scaled": [round(float(v), 2) for v in scaled.ravel()],
        "flip_margin": min(posterior.flip_margin, 1e3),
        "flipped": bool(np.quantile(off, 0.75) > np.radians(20.0)),
        "protocol_flipped": bool(np.quantile(off_protocol, 0.75) > np.radians(20.0)),
        "event": posterior.event_probability,
        "sigma_ratio": posterior.batch.sigma_px / clip.camera.click_sigma_px,
    }


HEADER = (
    "| footage | peak omega, protocol | peak omega, posterior | its 95 % band | omega(t) RMSE, protocol | posterior "
    "| t0, protocol [ms] | posterior [ms] | covered: omega | t0 | alpha | a across | a along | omega(t) |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
)


def line(cell: Cell, rows: list[dict[str, Any]]) -> str:
    """One row: errors as median / 90th percentile; coverage counts the clips whose band is no wider than allowed."""
    told = {n: [constants().peaks[n].apply(n, Spread(*r["spread"][n])) for r in rows] for n in QUANTITIES}
    true = {n: np.array([r["truth"][n] for r in rows]) for n in QUANTITIES}
    omega = np.array([b.value for b in told["omega_rad_per_s"]])

    def pair(values: np.ndarray, digits: int = 1) -> str:
        return f"{np.median(values):.{digits}f} / {np.quantile(values, 0.9):.{digits}f}"

    rmse = [pair(np.array([r[key] for r in rows])) for key in ("protocol_rmse", "rmse")]
    if cell.quiet:
        peaks = [f"{np.median([r['protocol_omega'] for r in rows]):.1f} rad/s", f"{np.median(omega):.1f} rad/s"]
        return (
            f"| {cell.title} (false peak) | {peaks[0]} | {peaks[1]} | – | {rmse[0]} | {rmse[1]} |" + " – |" * 8 + "\n"
        )
    truth = true["omega_rad_per_s"]
    shares = [
        pair(100 * np.abs(np.array([r["protocol_omega"] for r in rows]) / truth - 1)),
        pair(100 * np.abs(omega / truth - 1)),
    ]
    width = np.median([(b.high - b.low) / 2 / b.value for b in told["omega_rad_per_s"]])
    t0 = [
        pair(1e3 * np.abs(np.array([r["protocol_t0_s"] for r in rows]) - true["t0_s"])),
        pair(1e3 * np.abs(np.array([b.value for b in told["t0_s"]]) - true["t0_s"])),
    ]
    covered = []
    for name in ("omega_rad_per_s", "t0_s", "alpha_rad_per_s2", "a_across_m_per_s2", "a_along_m_per_s2"):
        resolved = [(b, x) for b, x in zip(told[name], true[name]) if b.resolved]
        if len(resolved) < 0.2 * len(rows):
            covered.append("not resolvable")
        else:
            share = 100 * np.mean([b.low <= x <= b.high for b, x in resolved])
            covered.append(f"{share:.0f} %" + (f" of {len(resolved)}" if len(resolved) < len(rows) else ""))
    inside = np.mean(np.concatenate([r["scaled"] for r in rows]) <= constants().curves["omega"])
    return (
        f"| {cell.title} | {shares[0]} % | {shares[1]} % | ±{100 * width:.0f} % | {rmse[0]} | {rmse[1]} "
        f"| {t0[0]} | {t0[1]} | {' | '.join(covered)} | {100 * inside:.0f} % |\n"
    )


def flips(rows: list[dict[str, Any]]) -> str:
    """How often a path is its mirror image, and whether that was said."""
    wrong = [r for r in rows if r["flipped"]]
    silent = [r for r in wrong if r["flip_margin"] >= 3.0]
    protocol = sum(r["protocol_flipped"] for r in rows)
    unsure = sum(r["flip_margin"] < 3.0 for r in rows)
    return (
        f"{len(rows)} clips: protocol mode holds the mirror image in {protocol}, posterior mode in {len(wrong)}; "
        f"{unsure} margins are below 3 and say so, {len(silent)} flipped silently."
    )


def table() -> None:
    """Write what the cache holds."""
    lines = [HEADER]
    for name, cell in CELLS.items():
        path = CACHE / f"{name}.jsonl"
        rows = [json.loads(text) for text in path.read_text().splitlines()] if path.exists() else []
        if len(rows) < 50:
            print(f"{name}: {len(rows)} clips of {CLIPS}, left out")
            continue
        lines.append(line(cell, rows))
    three = CACHE / "three.jsonl"
    if three.exists():
        lines += ["\nThree landmarks, ", flips([json.loads(text) for text in three.read_text().splitlines()]), "\n"]
    page = PAGE.read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    PAGE.write_text(before + BEGIN + "\n" + "".join(lines) + "\n" + END + rest.split(END)[1], encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:2] == ["run"]:
        run(sys.argv[2:])
    elif sys.argv[1:] == ["table"]:
        table()
    else:
        raise SystemExit(__doc__)
