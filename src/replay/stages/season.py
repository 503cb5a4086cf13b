"""Every play of a season in one table and on one page: verdict, peaks, bands, what it cost, and what failed."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from replay.files import read_json, write_text
from replay.manifest import NAME
from replay.play import ADDRESS
from replay.report import ensemble_rows, season_page
from replay.stages.bands import BANDS
from replay.stages.frame import COMMANDS, Workspace, stages_of
from replay.stages.table import PLAYS, maybe, row_of
from replay.tables import TableFormat

FAILED, NOT_RUN = "FAILED", "NOT RUN"
SEASON = TableFormat(
    "table of a season",
    (
        *PLAYS.columns,
        maybe("target_omega_low_rad_per_s", "calibrated band of the posterior's peak angular velocity: low [rad/s]"),
        maybe("target_omega_high_rad_per_s", "calibrated band of the posterior's peak angular velocity: high [rad/s]"),
        maybe("wall_s", "sum of the wall-clock times of its jobs [s]"),
        maybe("cpu_s", "sum of the processor times of its jobs: the cost [s]"),
        maybe("memory_mb", "greatest resident memory of a job [MB]"),
        maybe("log", "log of the stage that failed", "text"),
    ),
)
"""Format of ``results/plays.csv``."""
_LAST_LINES = 3


def season(plays: Sequence[str], results: Path) -> int:
    """Write ``plays.csv`` and ``index.html`` into the results folder: a row a play, whatever became of it.

    Parameters
    ----------
    plays
        Names of the plays.
    results
        Holds ``<play>`` for each.

    Returns
    -------
    int
        0: a play that failed is a row that says so.
    """
    rows = [_row(play, results) for play in plays]
    columns = {
        column.name: [row.get(column.name, "" if column.kind == "text" else np.nan) for row in rows]
        for column in SEASON.columns
    }
    SEASON.write(results / "plays.csv", columns)
    ensembles = [entry for play in plays for entry in _ensembles(play, results)]
    write_text(results / "index.html", season_page(rows, ensembles))
    failed = [row for row in rows if row["verdict"] == FAILED]
    for row in failed:
        print(f"{row['play']}: {row['reason']}\n    log: {results / row['log']}")
    missing = sum(row["verdict"] == NOT_RUN for row in rows)
    print(f"{results / 'index.html'}: {len(rows)} plays, {len(failed)} failed, {missing} not run")
    return 0


def _row(play: str, results: Path) -> dict[str, Any]:
    folder = results / play
    bundle = folder / "bundle" / f"{play}.zip"
    asked = stages_of(Workspace(play, results=results))
    unfinished = [stage for stage in asked if not (folder / stage / NAME).is_file()]
    if bundle.is_file() and not unfinished:
        found = row_of(bundle)
        found |= {"bundle": bundle.relative_to(results).as_posix(), **_band(folder)}
    else:
        found = {"bundle": f"{play}/bundle/{play}.zip", "play": play, **_failure(play, results, asked, unfinished)}
    return found | cost_of(folder / "logs")


def _failure(play: str, results: Path, asked: Sequence[str], unfinished: Sequence[str]) -> dict[str, Any]:
    """What the log of the first stage that did not finish ends with."""
    logs = [results / play / "logs" / "write_out.log"] if "settings" in unfinished else []
    logs += [results / play / "logs" / f"{COMMANDS[stage]}.log" for stage in unfinished]
    for log in (*logs, results / play / "logs" / "seal.log"):
        text = log.read_text(encoding="utf-8", errors="replace").strip() if log.is_file() else ""
        said = re.search(r"^replay [\w-]+: (.*)\Z", text, re.MULTILINE | re.DOTALL)
        if log.name == "write_out.log" and not said:
            continue
        if text:
            reason = said[1] if said else "; ".join(text.splitlines()[-_LAST_LINES:])
            where = log.relative_to(results).as_posix()
            return {"verdict": FAILED, "reason": "; ".join(line.strip() for line in reason.splitlines()), "log": where}
    came = [stage for stage in asked if stage not in unfinished]
    return {
        "verdict": NOT_RUN,
        "reason": f"not finished; came to stage {came[-1]}" if came else "nothing of it has run",
    }


def _band(folder: Path) -> dict[str, float]:
    """Calibrated band of the posterior's peak angular velocity, where the footage carries one."""
    quality = folder / "reconstruction" / "quality.json"
    posterior = (read_json(quality).get("posterior") if quality.is_file() else None) or {}
    band = posterior.get("bands", {}).get("omega_rad_per_s")
    if not isinstance(band, dict) or posterior.get("band_class") != "calibrated":
        return {}
    return {"target_omega_low_rad_per_s": band["low"], "target_omega_high_rad_per_s": band["high"]}


def cost_of(logs: Path) -> dict[str, float]:
    """Sum the workflow's own measurements of a play's jobs.

    Parameters
    ----------
    logs
        Folder with ``<rule>.benchmark.tsv``; a job too short to be measured counts its wall clock alone.
    """
    wall = cpu = memory = 0.0
    found = False
    for path in sorted(logs.glob("*.benchmark.tsv")):
        with path.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream, delimiter="\t"):
                found = True
                wall += _number(row.get("s"))
                cpu += _number(row.get("cpu_time"))
                memory = max(memory, _number(row.get("max_rss")))
    return {"wall_s": wall, "cpu_s": cpu, "memory_mb": memory} if found else {}


def _number(cell: str | None) -> float:
    try:
        return float(cell or 0.0)
    except ValueError:  # NA, of a job that was over before it was looked at
        return 0.0


def _ensembles(play: str, results: Path) -> Iterator[dict[str, Any]]:
    """The finished ensembles of a play."""
    for manifest in sorted(results.glob(f"{play}.*/bands/{NAME}")):
        name = manifest.parents[1].name
        table = manifest.parent / "bands.csv"
        if ADDRESS.fullmatch(name) and table.is_file():
            bands: pd.DataFrame = BANDS.read(table)
            yield {"name": name, "page": f"{name}/bands/ensemble.html", "bands": ensemble_rows(bands)}
