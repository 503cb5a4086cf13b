"""Make ``src/replay/motion/data/bands.yaml``: the constants under which the bands cover.

    python benchmarks/calibrate_bands.py collect FILE.jsonl [FIRST LAST]   # slow; goes on where it stopped
    python benchmarks/calibrate_bands.py fit FILE.jsonl...                 # writes bands.yaml

Motions come from the building families only (`replay.motion.synthetic.families.BUILDING`), footage at random from the
ranges below. The accuracy suite tests on other families and other seeds.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import yaml
from footage import Clip, View, clip_of
from measured import Row, collect, kept_spread, rows_of
from scipy.optimize import minimize_scalar

from replay.motion.bands import BEFORE, CONSTANTS_FILE, CURVES, RATIOS, Calibration, level_set
from replay.motion.synthetic.families import BUILDING

LEVEL = 0.95
CLIPS = 600
RANGES = {"fps": (59.94, 239.76), "landmarks": (4.0, 10.0), "px_per_m": (120.0, 2500.0), "sigma_px": (0.7, 4.0)}


def view_of(seed: int) -> View:
    """Footage at random: half of it at 59.94 fps, where it is needed most."""
    rng = np.random.default_rng([7, seed])
    px_per_m = float(np.exp(rng.uniform(np.log(120.0), np.log(2500.0))))
    return View(
        fps=float(rng.choice([59.94, 119.88, 239.76], p=[0.5, 0.25, 0.25])),
        landmarks=int(rng.choice([4, 6, 8, 10])),
        sigma_px=float(np.exp(rng.uniform(np.log(0.7), np.log(4.0)))),
        px_per_m=px_per_m,
        distance_m=float(np.clip(6000.0 / px_per_m, 4.0, 60.0)),
        occluded=float(rng.choice([0.0, 0.1])),
        outliers=float(rng.choice([0.0, 0.03])),
    )


def filmed(seed: int) -> tuple[str, Clip]:
    """Family and clip of a seed."""
    family = BUILDING[seed % len(BUILDING)]
    return family, clip_of(view_of(seed), family, 100_000 + seed)


def fit(paths: list[Path]) -> None:
    """Constants of every quantity at every rate."""
    rows = [row for path in paths for row in rows_of(path)]
    rates = sorted({row["fps"] for row in rows})
    by_rate = [[row for row in rows if row["fps"] == rate] for rate in rates]
    content = {
        "made_by": "benchmarks/calibrate_bands.py",
        "clips": [len(some) for some in by_rate],
        "level": LEVEL,
        "families": list(BUILDING),
        "calibrated": {name: list(bounds) for name, bounds in RANGES.items()},
        "rates": rates,
        "peaks": {name: _fit_peak(name, rows, rates) for name in (*RATIOS, "onset_s")},
        "curves": {name: [_fit_curve(name, some) for some in by_rate] for name in CURVES},
        "before": {name: _fit_before(name, rows) for name in BEFORE},
        "instant": (level := _fit_instant(rows)),
        "instant_odds": _fit_odds(rows, level),
    }
    header = (
        "# Constants of the calibrated bands; made by benchmarks/calibrate_bands.py, read by replay.motion.bands.\n"
    )
    CONSTANTS_FILE.write_text(header + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110))


def _reach(score: np.ndarray, level: float = LEVEL) -> float:
    """What a share of the scores does not exceed, by the conformal rank."""
    n = len(score)
    return float(np.sort(score)[min(n - 1, int(np.ceil((n + 1) * level)) - 1)])


def _fit_peak(name: str, rows: list[Row], rates: list[float]) -> dict[str, list[float]]:
    """Shift by the median error and widen to the conformal quantile, by thirds of the posterior's width.

    How the error grows with the width is told by the clips of all rates together (median and 90th percentiles of its
    thirds): given the width, the rate tells next to nothing. One factor a rate then makes the bands cover.
    """
    found = [kept_spread(name, row) for row in rows]
    true, fps = np.array([row["truth"][name] for row in rows]), np.array([row["fps"] for row in rows])
    width = np.array([s.width for s in found])
    thirds = np.array_split(np.argsort(width), 3)
    widths = [float(np.median(width[third])) for third in thirds]
    width = np.maximum(width, widths[0])
    error = ((np.log(true) if name in RATIOS else true) - [s.centre for s in found]) / width
    shift = [float(np.median(error[third])) for third in thirds]
    below, above = (
        [float(np.quantile(sign * (error[third] - middle), 0.9)) for third, middle in zip(thirds, shift)]
        for sign in (-1.0, 1.0)
    )
    known = Calibration(*map(tuple, (widths, shift, below, above)), factor=())
    middle, down, up = np.array([known.at(w) for w in width]).T
    score = np.maximum((middle - error) / down, (error - middle) / up)
    factor = [_reach(score[fps == rate]) for rate in rates]
    out = {"widths": widths, "shift": shift, "below": below, "above": above, "factor": factor}
    return {key: [round(v, 6 if key == "widths" else 3) for v in values] for key, values in out.items()}


def _fit_curve(name: str, rows: list[Row]) -> float:
    """Factor under which the curve lies inside its band in 95 % of a clip's frames, in four clips of five."""
    return round(float(np.quantile([np.quantile(row["scaled"][name], LEVEL) for row in rows], 0.8)), 3)


def _fit_before(name: str, rows: list[Row]) -> float:
    """Factor for a component of a velocity before the impact."""
    scaled = [np.divide(r["before"][name], r["before"][f"sigma_{name}"]) for r in rows if "before" in r]
    return round(_reach(np.abs(np.ravel(scaled))), 3)


def _fit_instant(rows: list[Row]) -> float:
    """Least relative acceleration, over its greatest, in which 95 % of the true t0 lie."""
    curves = [_instant(row) for row in rows]
    return round(-_reach(-np.array([curve[at] / curve.max() for curve, at in curves])), 4)


def _instant(row: Row) -> tuple[np.ndarray, int]:
    """Relative acceleration on its grid, and the index of the true t0."""
    start, step = row["t0"]["time_s"]
    return np.array(row["t0"]["relative_alpha"]), round((row["truth"]["t0_s"] - start) / step)


def _fit_odds(rows: list[Row], level: float) -> float:
    """Power under which the lobes that hold the true t0 are likeliest among those that compete."""
    heights = []
    for row in rows:
        curve, at = _instant(row)
        pieces = level_set(curve, level)
        tops = np.array([curve[a:b].max() for a, b in pieces])
        heights += [tops / top for top, (a, b) in zip(tops, pieces) if len(tops) > 1 and a <= at < b]
    # log of a lobe's chance: of h^k over the sum of all
    fitted = minimize_scalar(lambda k: sum(np.log(np.sum(h**k)) for h in heights), bounds=(0.0, 30.0), method="bounded")
    return round(float(fitted.x), 2)


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("collect", "fit"):
        raise SystemExit(__doc__)
    if sys.argv[1] == "fit":
        fit([Path(name) for name in sys.argv[2:]])
    else:
        first, last = (int(v) for v in sys.argv[3:5]) if len(sys.argv) > 4 else (0, CLIPS)
        collect(Path(sys.argv[2]), range(first, last), filmed)
