"""Many bundles in one table: a row a play, as CSV for programs and HTML for people."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from replay.bundle import SealedRun, foreign_content, open_run, shown
from replay.errors import ReplayError
from replay.files import write_text
from replay.report import overview_page
from replay.stages.show import INTERRUPTED
from replay.tables import Column, TableFormat

UNREADABLE = "UNREADABLE"


def maybe(name: str, meaning: str, kind: str = "float") -> Column:
    """A column whose cell is empty where the play did not come so far."""
    return Column(name, meaning, kind=kind, may_be_empty=True)  # type: ignore[arg-type]


PLAYS = TableFormat(
    "table of plays",
    (
        Column("bundle", "file or folder that was read", kind="text"),
        maybe("play", "name of the play", "text"),
        Column("verdict", f"as sealed, or {UNREADABLE}", kind="text"),
        maybe("reason", "what failed, stopped the play, or is wrong with the bundle", "text"),
        maybe("source", "clicks or wearable", "text"),
        maybe("resolution", "of the model", "text"),
        maybe("rate_hz", "of the footage or sensor [Hz]"),
        maybe("t0_s", "impact reference on the play's own clock [s]"),
        maybe("target_acceleration_m_per_s2", "peak resultant CG acceleration of the reconstruction [m/s^2]"),
        maybe("target_omega_rad_per_s", "peak resultant angular velocity of the reconstruction [rad/s]"),
        maybe("target_alpha_rad_per_s2", "peak resultant angular acceleration of the reconstruction [rad/s^2]"),
        maybe("omega_over_noise", "that angular velocity over the peak that noise alone shows"),
        maybe("hic15", "HIC15 of the replayed head"),
        maybe("bric", "BrIC of the replayed head"),
        maybe(
            "brain_strain_p95", "95th percentile of maximum principal strain (Green-Lagrange) in the brain, at its peak"
        ),
        maybe("rmse_acceleration_percent", "driver fidelity: RMSE of linear acceleration over its peak [%]"),
        maybe("energy_ratio_min", "least ratio of the energy ledger"),
        maybe("energy_ratio_max", "greatest ratio of the energy ledger"),
        maybe("not_checked", "checks without power"),
        maybe("loosened", "limits that the play loosened"),
        maybe("version", "of replay", "text"),
        maybe("commit", "of the source, + where it had changes", "text"),
    ),
)
"""Format of the CSV table of `replay table`."""


def table(bundles: Sequence[Path], out: Path) -> int:
    """Write ``<out>.csv`` and ``<out>.html``, a row a bundle; one that cannot be read has its reason instead.

    Parameters
    ----------
    bundles
        Bundles, unpacked bundles or results folders.
    out
        Name of both files, without suffix.

    Returns
    -------
    int
        0, or 1 when a bundle could not be read.
    """
    rows = [row_of(path) for path in bundles]
    columns = {column.name: [row.get(column.name, _empty(column)) for row in rows] for column in PLAYS.columns}
    PLAYS.write(out.with_name(out.name + ".csv"), columns)
    write_text(out.with_name(out.name + ".html"), overview_page(rows))
    bad = [row for row in rows if row["verdict"] == UNREADABLE]
    for row in bad:
        print(shown(f"{row['bundle']}: {row['reason']}"))
    print(f"{out}.csv, {out}.html: {len(rows)} plays, {len(bad)} of them unreadable")
    return 1 if bad else 0


def _empty(column: Column) -> Any:
    return "" if column.kind == "text" else np.nan


def row_of(path: Path) -> dict[str, Any]:
    """What a bundle says of its play, by the columns of `PLAYS`; what it lacks is absent."""
    try:
        with foreign_content(path), open_run(path) as run:
            found = {"bundle": path.as_posix(), **_verdict(run), **_numbers(run)}
    except ReplayError as error:
        return {"bundle": path.as_posix(), "verdict": UNREADABLE, "reason": str(error).splitlines()[0]}
    return {name: value for name, value in found.items() if value is not None}


def _verdict(run: SealedRun) -> dict[str, Any]:
    bundle = run.json("bundle.json") or {}
    verdict = run.json("results/verdict/verdict.json") or {}
    play = run.json("results/settings/play.json") or {}
    if bundle.get("verdict") == INTERRUPTED:
        verdict = {}
    causes = verdict.get("causes", [])
    failed = [f"{cause['gate']}.{cause['sentence']}" for cause in causes if cause["verdict"] == "fail"]
    warned = [f"{cause['gate']}.{cause['sentence']}" for cause in causes if cause["verdict"] == "warn"]
    powerless = sum(cause["verdict"] == "vacuous" for cause in causes)
    reason = "; ".join(failed or warned) or (f"{powerless} checks without power" if powerless else "")
    if not verdict:
        reason = bundle.get("line") or "the run ended before its verdict"
    source = bundle.get("source", {})
    return {
        "play": play.get("name") or bundle.get("play"),
        "verdict": bundle.get("verdict") or str(verdict.get("status", "not judged")).upper(),
        "reason": reason,
        "source": play.get("source", {}).get("kind"),
        "resolution": play.get("model", {}).get("resolution"),
        "not_checked": float(powerless) if verdict else None,
        "loosened": float(len(verdict["loosened"])) if verdict else None,
        "commit": (source.get("commit") or "")[:12] + ("+" if source.get("dirty") else ""),
    }


def _numbers(run: SealedRun) -> dict[str, Any]:
    quality = run.json("results/reconstruction/quality.json") or {}
    measures = run.json("results/measures/measures.json") or {}
    fidelity = run.json("results/fidelity/fidelity.json") or {}
    ledger = run.json("results/replay/run.json") or {}
    settings = run.json("results/settings/manifest.json") or {}
    peaks, head = quality.get("peaks", {}), {entry["name"]: entry["value"] for entry in measures.get("head", [])}
    noise = quality.get("null_peaks", {}).get("omega_rad_per_s")
    low, high = ledger.get("energy_ratio_range") or (None, None)
    return {
        "rate_hz": quality.get("rate_hz"),
        "t0_s": quality.get("t0_s"),
        "target_acceleration_m_per_s2": peaks.get("a_m_per_s2"),
        "target_omega_rad_per_s": peaks.get("omega_rad_per_s"),
        "target_alpha_rad_per_s2": peaks.get("alpha_rad_per_s2"),
        "omega_over_noise": peaks["omega_rad_per_s"] / noise if noise else None,
        "hic15": head.get("HIC15"),
        "bric": head.get("BrIC"),
        "brain_strain_p95": measures.get("brain", {}).get("brain", {}).get("mps_green_lagrange_p95"),
        "rmse_acceleration_percent": fidelity.get("linear_acceleration", {}).get("rmse_percent_of_peak"),
        "energy_ratio_min": low,
        "energy_ratio_max": high,
        "version": settings.get("versions", {}).get("replay"),
    }
