"""Stage ``bands`` of an ensemble: every measure of every member, and the band of each measure over the members."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from replay.files import read_json, write_text
from replay.gates import read_gate
from replay.play import ADDRESS, Member, members_of, read_ensemble
from replay.report import ensemble_page
from replay.stages.frame import Finished, Stage, Workspace
from replay.stages.limits import limits_of
from replay.stages.resolved import ensemble_file
from replay.tables import Column, TableFormat

BANDS = TableFormat(
    "bands of an ensemble",
    (
        Column("measure", "name of the measure: of the head, of a region of the brain, of action or damage", "text"),
        Column("unit", "its unit", "text", may_be_empty=True),
        Column("members", "members that have it", "int"),
        Column("of_play", "value of the play itself", may_be_empty=True),
        Column("lowest", "least value over the members"),
        Column("p05", "5th percentile, linear between members"),
        Column("median", "median"),
        Column("p95", "95th percentile, linear between members"),
        Column("highest", "greatest value over the members"),
        Column("mean", "mean"),
        Column("deviation", "standard deviation of a sample; empty for one member", may_be_empty=True),
    ),
)
MEMBERS = TableFormat(
    "members of an ensemble",
    (
        Column("member", "number of the member", "text"),
        Column("varied", "settings that tell it from the others", "text"),
        Column("verdict", "worst of its gates, or why it ended early", "text"),
        Column("measure", "name of the measure; empty where the member ended early", "text", may_be_empty=True),
        Column("unit", "its unit", "text", may_be_empty=True),
        Column("value", "its value", may_be_empty=True),
    ),
)
_JUDGED = ("replay", "fidelity")
_ORDER = ("pass", "vacuous", "warn", "fail")
_UNITS = (
    ("_m3", "m^3"),
    ("_force_N", "N"),
    ("_N_s", "N s"),
    ("_Pa", "Pa"),
    ("_J_s", "J s"),
    ("_time_s", "s"),
    ("_s", "s"),
)


def run(workspace: Workspace, *, ensemble: Path | None = None) -> str | None:
    """Gather the members of the workspace's ensemble.

    A member that a gate or the solver's watch-dog stopped has no measures; it stands in ``members.csv`` with its
    reason, and `members` of ``bands.csv`` does not count it.
    """
    match = ADDRESS.fullmatch(workspace.play)
    assert match
    settings = read_ensemble(ensemble or ensemble_file(workspace))
    members = members_of(match["play"], match["ensemble"], settings)
    stage = Stage(workspace, "bands")
    rows = [_member(stage, workspace, number, member) for number, member in members.items()]
    of_play = _own(stage, Workspace(match["play"], results=workspace.results))
    bands = bands_of([row["measures"] for row in rows], of_play)

    table = [
        (row["member"], row["told"], row["verdict"], name, unit, value)
        for row in rows
        for name, (value, unit) in (row["measures"] or {"": (np.nan, "")}).items()
    ]
    MEMBERS.write(
        stage.write("members.csv", "every measure of every member"),
        {name: [row[k] for row in table] for k, name in enumerate(MEMBERS.names)},
    )
    BANDS.write(
        stage.write("bands.csv", "band of every measure over the members"),
        {name: bands[name].tolist() for name in BANDS.names},
    )
    write_text(
        stage.write("ensemble.html", "the ensemble as a page"),
        ensemble_page(workspace.play, settings.title, rows, bands),
    )
    done = sum(bool(row["measures"]) for row in rows)
    print(f"{workspace.play}: {done} of {len(rows)} members have measures")
    return stage.finish(parameters={"vary": settings.values, "set": settings.set})


def bands_of(
    members: list[dict[str, tuple[float, str]]], of_play: dict[str, tuple[float, str]] | None = None
) -> pd.DataFrame:
    """Band of every measure.

    Parameters
    ----------
    members
        Of each member: measure to value and unit; empty for a member that ended early.
    of_play
        The same of the play itself.

    Returns
    -------
    pandas.DataFrame
        Columns of `BANDS`; measures in the order of the first member that has them.
    """
    names: dict[str, str] = {}
    for measures in members:
        names |= {name: unit for name, (_, unit) in measures.items() if name not in names}
    rows = []
    for name, unit in names.items():
        values = np.array([measures[name][0] for measures in members if name in measures])
        low, p05, median, p95, high = np.percentile(values, (0, 5, 50, 95, 100))
        spread = float(values.std(ddof=1)) if len(values) > 1 else np.nan
        own = (of_play or {}).get(name, (np.nan, ""))[0]
        rows.append((name, unit, len(values), own, low, p05, median, p95, high, values.mean(), spread))
    return pd.DataFrame(rows, columns=BANDS.names)


def measures_in(document: dict[str, Any]) -> dict[str, tuple[float, str]]:
    """Every number of ``measures.json`` by a name of its own, with its unit; what a member lacks is absent."""
    found = {entry["name"]: (entry["value"], entry["unit"]) for entry in document["head"]}
    for group in ("brain", "damage"):
        found |= _numbers(group if group == "damage" else "", document.get(group))
    found |= _numbers("blow", (document.get("contact") or {}).get("blow"))
    found |= _numbers("facemask_mounts", document.get("facemask_mounts"))
    action = {name: document["action"].get(name) for name in ("head", "helmet", "impactor")}
    found |= {f"action {name}": (value, "J s") for name, value in action.items()}
    found["action crossover_time_s"] = (document["action"]["crossover_time_s"], "s")
    pads = {pad["part"]: pad["compression_mean"] for pad in document.get("pads", ())}
    worn = [value for part, value in pads.items() if "_pad_" in part and not part.endswith("_2")]
    found["compression, most of the helmet's pads"] = (max(worn, default=None), "1")
    found |= {f"compression {part}": (value, "1") for part, value in pads.items()}
    return {
        name: (float(value), unit)
        for name, (value, unit) in found.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value)
    }


def _numbers(prefix: str, value: Any) -> dict[str, tuple[Any, str]]:
    if isinstance(value, dict):
        return {k: v for key, inner in value.items() for k, v in _numbers(f"{prefix} {key}".strip(), inner).items()}
    if value is None or isinstance(value, str | bool | list):
        return {}
    return {prefix: (value, next((unit for suffix, unit in _UNITS if prefix.endswith(suffix)), "1"))}


def _member(stage: Stage, workspace: Workspace, number: str, member: Member) -> dict[str, Any]:
    place = Workspace(member.address, plays=workspace.plays, results=workspace.results)
    part = Finished(place, ("settings", "replay", "fidelity", "measures"))
    told = "; ".join(f"{path} = {value}" for path, value in member.varied.items())
    row = {"member": number, "varied": dict(member.varied), "told": told, "measures": {}}
    stopped = part.stopped_by
    limits = limits_of(part)
    words: list[str] = []
    for name in _JUDGED:
        if part.made(name, "gate.json"):
            words.append(read_gate(part.read(name, "gate.json"), limits).verdict)
    row["verdict"] = stopped or max(words, key=_ORDER.index, default="not judged")
    if part.made("measures", "measures.json"):
        path = part.read("measures", "measures.json")
        stage.read_file(f"{number}/measures.json", path)
        row["measures"] = measures_in(read_json(path))
    return row


def _own(stage: Stage, play: Workspace) -> dict[str, tuple[float, str]]:
    part = Finished(play, ("measures",))
    if not part.made("measures", "measures.json"):
        return {}
    path = part.read("measures", "measures.json")
    stage.read_file("measures/measures.json", path)
    return measures_in(read_json(path))
