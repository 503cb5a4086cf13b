"""Make ``src/replay/motion/data/bands.yaml``: the constants under which the bands cover.

    python benchmarks/calibrate_bands.py collect FILE.jsonl [CLIPS]   # slow; goes on where it stopped
    python benchmarks/calibrate_bands.py fit FILE.jsonl               # writes bands.yaml

Motions come from the building families only (`replay.motion.families.BUILDING`), footage at random from the ranges
below. The accuracy suite tests on other families and other seeds.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import yaml
from footage import Footage, both_modes, film, true_peaks

from replay.motion.bands import CONSTANTS_FILE, CURVES, QUANTITIES, RATIOS, spread
from replay.motion.families import BUILDING

LEVEL = 0.95
CLIPS = 134
RANGES = {"fps": (59.94, 239.76), "landmarks": (4.0, 10.0), "px_per_m": (120.0, 2500.0), "sigma_px": (0.7, 4.0)}


def footage_of(seed: int) -> Footage:
    """Footage at random: half of it at 59.94 fps, where it is needed most."""
    rng = np.random.default_rng([7, seed])
    px_per_m = float(np.exp(rng.uniform(np.log(120.0), np.log(2500.0))))
    return Footage(
        fps=float(rng.choice([59.94, 119.88, 239.76], p=[0.6, 0.2, 0.2])),
        landmarks=int(rng.choice([4, 6, 8, 10])),
        sigma_px=float(np.exp(rng.uniform(np.log(0.7), np.log(4.0)))),
        px_per_m=px_per_m,
        distance_m=float(np.clip(6000.0 / px_per_m, 4.0, 60.0)),
        occluded=float(rng.choice([0.0, 0.1])),
        outliers=float(rng.choice([0.0, 0.03])),
    )


def collect(path: Path, clips: int) -> None:
    """Append one line a clip: truth and spread of every peak, scaled errors of every curve."""
    done = len(path.read_text().splitlines()) if path.exists() else 0
    for seed in range(done, clips):
        family = BUILDING[seed % len(BUILDING)]
        clip = film(footage_of(seed), family, 100_000 + seed)
        _, posterior = both_modes(clip)
        truth, time = true_peaks(clip, posterior)
        margin = 1.0 / clip.camera.fps
        peaks = posterior.draws.peaks(margin)
        row = {"family": family, "seed": seed, "fps": clip.camera.fps, "peaks": {}, "curves": {}}
        for name in QUANTITIES:
            found = spread(name, peaks[name])
            true = np.log(truth[name]) if name in RATIOS else truth[name]
            row["peaks"][name] = [float(true), found.centre, found.width]
        k, d = clip.truth.at(time), posterior.draws
        steps = (len(time) - 1) // (len(posterior.frames_s) - 1) if len(posterior.frames_s) <= 120 else 1
        for name, true, drawn in (
            ("omega", k.omega_rad_per_s, d.omega_rad_per_s),
            ("alpha", k.alpha_rad_per_s2, d.alpha_rad_per_s2),
            ("a", k.acceleration_m_per_s2, d.acceleration_m_per_s2),
        ):
            scaled = np.abs(drawn.mean(axis=0) - true) / drawn.std(axis=0)
            row["curves"][name] = float(np.quantile(scaled[steps:-steps:steps], LEVEL))
        with path.open("a") as out:
            out.write(json.dumps(row) + "\n")


def fit(path: Path) -> None:
    """Shift by the median error and widen to the conformal quantile, by thirds of the posterior's width."""
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    peaks = {name: _fit_peak(np.array([r["peaks"][name] for r in rows])) for name in QUANTITIES}
    curves = {name: float(np.quantile([r["curves"][name] for r in rows], 0.8)) for name in CURVES}
    content = {
        "made_by": "benchmarks/calibrate_bands.py",
        "clips": len(rows),
        "level": LEVEL,
        "families": list(BUILDING),
        "calibrated": {name: list(bounds) for name, bounds in RANGES.items()},
        "peaks": peaks,
        "curves": {name: round(value, 3) for name, value in curves.items()},
    }
    CONSTANTS_FILE.parent.mkdir(exist_ok=True)
    header = (
        "# Constants of the calibrated bands; made by benchmarks/calibrate_bands.py, read by replay.motion.bands.\n"
    )
    CONSTANTS_FILE.write_text(header + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110))


def _fit_peak(table: np.ndarray) -> dict[str, list[float]]:
    """Constants of one quantity.

    The thirds tell how the error grows with the width (median and 80th percentile, which a few clips settle); all
    clips together tell how far 95 % of the truths reach in that measure, by the conformal rank.
    """
    true, centre, width = table.T
    thirds = np.array_split(np.argsort(width), 3)
    shift = np.array([np.median((true[third] - centre[third]) / width[third]) for third in thirds])
    reach, score = np.empty(3), np.empty(len(true))
    for i, third in enumerate(thirds):
        off = np.abs((true[third] - centre[third]) / width[third] - shift[i])
        reach[i] = np.quantile(off, 0.8)
        score[third] = off / reach[i]
    n = len(score)
    factor = float(np.sort(score)[min(n - 1, int(np.ceil((n + 1) * LEVEL)) - 1)])
    out = {"widths": [float(np.median(width[third])) for third in thirds], "shift": shift, "reach": factor * reach}
    return {name: [round(float(v), 6 if name == "widths" else 3) for v in values] for name, values in out.items()}


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("collect", "fit"):
        raise SystemExit(__doc__)
    if sys.argv[1] == "collect":
        collect(Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else CLIPS)
    else:
        fit(Path(sys.argv[2]))
