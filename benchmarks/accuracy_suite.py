"""Both modes on motions that the estimator was not built on: the second table of docs/accuracy.md.

    python benchmarks/accuracy_suite.py run [CELLS...]    # slow; every clip is kept, goes on where it stopped
    python benchmarks/accuracy_suite.py table             # writes the table into docs/accuracy.md

Cells vary one thing at a time around footage that a good broadcast gives. Families are those of
`replay.motion.synthetic.families.TESTING`, in turn, under fixed seeds; the bands' constants come from other families
and seeds.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from footage import RECORDS, Clip, View, clip_of
from measured import Row, collect, kept_band, rows_of

from replay.motion.bands import BEFORE, constants
from replay.motion.side_by_side import DECIDED_FLIP
from replay.motion.synthetic.families import TESTING

CLIPS = 60
"""Replicates of a cell: 20 of each family."""
FIRST_SEED = 700_000
"""Of the test motions: beyond all that were looked at while estimator and bands were made."""
CACHE = Path(__file__).parents[1] / "results" / "accuracy"
PAGE = Path(__file__).parents[1] / "docs" / "accuracy.md"
BEGIN, END = "<!-- table of both modes: begin -->\n", "<!-- table of both modes: end -->\n"
BASE = View()


@dataclass(frozen=True)
class Cell:
    """One row: its footage, and whether the impact is left out."""

    title: str
    view: View
    quiet: bool = False

    def filmed(self, seed: int) -> tuple[str, Clip]:
        """Family and clip of a seed."""
        families = TESTING if RECORDS.is_dir() else TESTING[:2]
        family = families[seed % len(families)]
        return family, clip_of(self.view, family, FIRST_SEED + seed, quiet=self.quiet)


CORNER = replace(BASE, px_per_m=150.0, sigma_px=2.7, distance_m=45.0)
CELLS = {
    "corner": Cell("150 px/m, 2.7 px", CORNER),
    "noisy": Cell("300 px/m, 2.7 px", replace(BASE, sigma_px=2.7)),
    "coarse": Cell("300 px/m, 4 px", replace(BASE, sigma_px=4.0)),
    "far": Cell("150 px/m, 1 px", replace(BASE, px_per_m=150.0, distance_m=45.0)),
    "base": Cell("**300 px/m, 1 px**", BASE),
    "near": Cell("600 px/m, 1 px", replace(BASE, px_per_m=600.0, distance_m=10.0)),
    "three": Cell("3 landmarks", replace(BASE, landmarks=3)),
    "four": Cell("4 landmarks", replace(BASE, landmarks=4)),
    "ten": Cell("10 landmarks", replace(BASE, landmarks=10)),
    "double_rate": Cell("119.88 fps", replace(BASE, fps=119.88)),
    "fast": Cell("239.76 fps", replace(BASE, fps=239.76)),
    "outliers": Cell("4 % wild clicks", replace(BASE, outliers=0.04)),
    "occluded": Cell("15 % hidden", replace(BASE, occluded=0.15)),
    "zoom": Cell("zooming, 40 %/s", replace(BASE, zoom_per_s=0.4)),
    "null": Cell("no impact; 150 px/m, 2.7 px", CORNER, quiet=True),
    "null_base": Cell("no impact; 300 px/m, 1 px", BASE, quiet=True),
}


def run(names: list[str]) -> None:
    """Film and reconstruct what is not yet in the cache."""
    for name in names or list(CELLS):
        collect(CACHE / f"{name}.jsonl", range(CLIPS), CELLS[name].filmed)


HEADER = (
    "| footage | peak omega, protocol | peak omega, posterior | its 95 % band | omega(t) RMSE, protocol | posterior "
    "| t0, protocol [ms] | posterior [ms] | in one piece | onset [ms] | covered: omega | t0 | onset | v before "
    "| omega before | omega(t) |\n" + "|---" * 16 + "|\n"
)
SELDOM = 0.2
"""Share of clips below which a quantity is called not resolvable in a cell."""


def _pair(values: Sequence[float] | np.ndarray, digits: int = 1) -> str:
    return f"{np.median(values):.{digits}f} / {np.quantile(values, 0.9):.{digits}f}"


def line(cell: Cell, rows: list[Row]) -> str:
    """One row: errors as median / 90th percentile; coverage counts the clips whose band is no wider than allowed."""
    omega = [kept_band("omega_rad_per_s", r) for r in rows]
    values = np.array([b.value for b in omega])
    rmse = [_pair([r[key] for r in rows]) for key in ("protocol_rmse", "rmse")]
    if cell.quiet:
        peaks = [f"{np.median([r['protocol_omega'] for r in rows]):.1f} rad/s", f"{np.median(values):.1f} rad/s"]
        cells = [f"{cell.title} (false peak)", *peaks, "–", *rmse, *["–"] * 10]
        return f"| {' | '.join(cells)} |\n"
    truth = np.array([r["truth"]["omega_rad_per_s"] for r in rows])
    protocol = np.array([r["protocol_omega"] for r in rows])
    protocol_t0 = [1e3 * abs(r["protocol_t0_s"] - r["truth"]["t0_s"]) for r in rows]
    half = np.median([(b.high - b.low) / 2 / b.value for b in omega])
    t0 = [kept_band("t0_s", r) for r in rows]
    factor = constants().at_rate(constants().curves["omega"], cell.view.fps)
    inside = np.mean(np.concatenate([r["scaled"]["omega"] for r in rows]) <= factor)
    cells = [
        cell.title,
        f"{_pair(100 * np.abs(protocol / truth - 1))} %",
        f"{_pair(100 * np.abs(values / truth - 1))} %",
        f"±{100 * half:.0f} %",
        *rmse,
        _pair(protocol_t0),
        _late("t0_s", rows),
        str(sum(b.resolved and not b.parts for b in t0)),
        _late("onset_s", rows),
        *(_covered(name, rows) for name in ("omega_rad_per_s", "t0_s", "onset_s")),
        *(_covered_before(rows, kind) for kind in BEFORE),
        f"{100 * inside:.0f} %",
    ]
    return f"| {' | '.join(cells)} |\n"


def _late(name: str, rows: list[Row]) -> str:
    """Errors of an instant [ms]; none where a clip was kept before it was measured."""
    if not all(name in r["draws"] for r in rows):
        return "–"
    return _pair([1e3 * abs(kept_band(name, r).value - r["truth"][name]) for r in rows])


def _covered(name: str, rows: list[Row]) -> str:
    """Share of the bands that hold the truth, of those that are no wider than a measurement may be."""
    if not all(name in r["draws"] for r in rows):
        return "–"
    resolved = [(b, r["truth"][name]) for r in rows for b in [kept_band(name, r)] if b.resolved]
    if len(resolved) < SELDOM * len(rows):
        return f"resolved in {len(resolved)}"
    share = 100 * np.mean([b.covers(x) for b, x in resolved])
    return f"{share:.0f} %" + (f" of {len(resolved)}" if len(resolved) < len(rows) else "")


def _covered_before(rows: list[Row], kind: str) -> str:
    """Share of the components of a velocity before the impact that lie in their bands, where the onset is resolved."""
    if not all("before" in r for r in rows):
        return "–"
    rows = [r for r in rows if kept_band("onset_s", r).resolved]
    if not rows:
        return "–"
    scaled = [np.abs(np.divide(r["before"][kind], r["before"][f"sigma_{kind}"])) for r in rows]
    return f"{100 * np.mean(np.ravel(scaled) <= constants().before[kind]):.0f} %"


def accelerations(cells: dict[str, list[Row]]) -> str:
    """In how many clips of all cells a peak of acceleration has a band, and how many of those cover."""
    out = []
    for name, words in (
        ("alpha_rad_per_s2", "angular"),
        ("a_across_m_per_s2", "across the line of sight"),
        ("a_along_m_per_s2", "along it"),
    ):
        rows = [row for some in cells.values() for row in some]
        bands = [(kept_band(name, row), row["truth"][name]) for row in rows]
        inside = [band.covers(true) for band, true in bands if band.resolved]
        out.append(f"{words} in {len(inside)} of {len(rows)} clips" + (f" ({sum(inside)} cover)" if inside else ""))
    return "Peaks of acceleration with a band narrower than a factor of 3: " + ", ".join(out) + "."


def by_family(rows: list[Row]) -> str:
    """Error of the peak, and coverage of what has a band, of each family over the rows of all cells."""
    lines = [
        "| family | clips | peak omega, posterior | covered: omega | t0 | onset | omega before |\n",
        "|---" * 7 + "|\n",
    ]
    for family in dict.fromkeys(row["family"] for row in rows):
        some = [row for row in rows if row["family"] == family]
        error = [100 * abs(kept_band("omega_rad_per_s", r).value / r["truth"]["omega_rad_per_s"] - 1) for r in some]
        covered = [_covered(name, some) for name in ("omega_rad_per_s", "t0_s", "onset_s")]
        cells = [
            family.replace("_", "-"),
            str(len(some)),
            f"{_pair(error)} %",
            *covered,
            _covered_before(some, "omega"),
        ]
        lines.append(f"| {' | '.join(cells)} |\n")
    return "".join(lines)


def flips(cells: dict[str, list[Row]]) -> str:
    """How often a path is its mirror image, and whether that was said."""
    three = cells.get("three", [])
    others = [row for name, rows in cells.items() if name != "three" for row in rows]
    out = []
    for words, rows in (("With three landmarks", three), ("With four or more", others)):
        wrong = [r for r in rows if r["flipped"]]
        unsure = sum(r["flip_margin"] < DECIDED_FLIP for r in rows)
        sure = sum(r["flip_margin"] >= DECIDED_FLIP for r in wrong)
        out.append(
            f"{words}, {len(rows)} clips: protocol mode holds the mirror image in "
            f"{sum(r['protocol_flipped'] for r in rows)}, posterior mode in {len(wrong)}; the margin is below "
            f"{DECIDED_FLIP:g} in {unsure}, and above it in {sure} of those that are flipped."
        )
    return " ".join(out)


def table() -> None:
    """Write what the cache holds."""
    kept = {name: rows_of(CACHE / f"{name}.jsonl") for name in CELLS}
    for name, rows in kept.items():
        if len(rows) < 50:
            print(f"{name}: {len(rows)} clips of {CLIPS}, left out")
    full = {name: rows for name, rows in kept.items() if len(rows) >= 50}
    struck = {name: rows for name, rows in full.items() if not CELLS[name].quiet}
    lines = [
        HEADER,
        *(line(CELLS[name], rows) for name, rows in full.items()),
        f"\n{accelerations(struck)}\n\n",
        by_family([row for name, rows in struck.items() if name != "three" for row in rows]),
        f"\n{flips(struck)}\n",
    ]
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
