"""The page of an ensemble: the band of every measure as a bar, and its members."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from replay.report.markup import badge, document, label, number, section, table, text, unit

_FIRST = (
    "peak_linear_acceleration",
    "peak_angular_acceleration",
    "peak_angular_velocity",
    "HIC15",
    "SI",
    "BrIC",
    "brain mps_green_lagrange_p95",
    "action head",
    "blow peak_force_N",
    "facemask_mounts peak_force_N",
    "compression, most of the helmet's pads",
)
_STYLE = """svg.band { display: block; width: 9rem; height: .9rem; }
svg.band .whole { stroke: #8a9099; stroke-width: 1; } svg.band .middle { fill: #56B4E9; }
svg.band .median { stroke: #0072B2; stroke-width: 2; } svg.band .own { fill: #D55E00; }
"""


def ensemble_rows(bands: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Measure to its row of the table of bands."""
    return {str(row["measure"]): {str(key): value for key, value in row.items()} for row in bands.to_dict("records")}


def ensemble_page(name: str, title: str, members: Sequence[Mapping[str, Any]], bands: pd.DataFrame) -> str:
    """Return the page.

    Parameters
    ----------
    name, title
        Address of the ensemble, and what its description says of it.
    members
        ``member``, ``varied``, ``verdict`` and ``measures`` of each.
    bands
        Rows of the table of bands.
    """
    rows = ensemble_rows(bands)
    first = [measure for measure in _FIRST if measure in rows]
    rest = [measure for measure in rows if measure not in first]
    note = (
        "The line reaches from the least to the greatest member, the bar from the 5th to the 95th percentile, the "
        "stroke is the median; the dot is the play itself. Members that a gate stopped are not in a band."
    )
    body = _bands("Bands of the chief measures", [rows[m] for m in first], note)
    others = _bands("The other measures", [rows[m] for m in rest], "")
    body += f"<details><summary>The other {len(rest)} measures</summary>{others}</details>"
    paths = list(members[0]["varied"]) if members else []
    own = ["the play", *("" for _ in paths), "", *(number(float(rows[m]["of_play"]), 4) for m in first)]
    who = table(
        "The play, and one row a member",
        ["member", *paths, "verdict", *(label(measure) for measure in first)],
        [
            own,
            *(
                [
                    text(row["member"]),
                    *(text(row["varied"][path]) for path in paths),
                    _verdict(str(row["verdict"])),
                    *(number(row["measures"][m][0], 4) if m in row["measures"] else "" for m in first),
                ]
                for row in members
            ),
        ],
        numeric=range(2 + len(paths), 2 + len(paths) + len(first)),
        stack=True,
    )
    done = sum(bool(row["measures"]) for row in members)
    return document(
        name,
        "Ensemble of finite-element replays of one play",
        f"<p>{text(title)}</p><p>{done} of {len(members)} members have measures.</p>",
        section("bands", "Bands", body) + section("members", "Members", who),
        style=_STYLE,
    )


def _verdict(word: str) -> str:
    known = word in ("pass", "warn", "fail", "vacuous")
    return badge(word) if known else f'{badge("fail", "ended early")} <span class="detail">{text(word)}</span>'


def _bands(caption: str, rows: Sequence[Mapping[str, Any]], note: str) -> str:
    head = ["measure", "unit", "members", "play", "least", "5 %", "median", "95 %", "greatest", ""]
    keys = ("of_play", "lowest", "p05", "median", "p95", "highest")
    cells = [
        [
            label(str(row["measure"])),
            unit(row["unit"]) if row["unit"] != "1" else "",
            str(int(row["members"])),
            *(number(float(row[key]), 4) for key in keys),
            _drawn(row),
        ]
        for row in rows
    ]
    return table(caption, head, cells, numeric=range(2, 9), note=note)


def _drawn(row: Mapping[str, Any]) -> str:
    """Draw a band as a bar over the range of its members and of the play."""
    own = float(row["of_play"])
    ends = [float(row["lowest"]), float(row["highest"]), *([own] if own == own else [])]
    low, span = min(ends), max(ends) - min(ends)

    def at(value: float) -> float:
        return round(4.0 + 152.0 * ((value - low) / span if span > 0 else 0.5), 1)

    lowest, p05, median, p95, highest = (at(float(row[k])) for k in ("lowest", "p05", "median", "p95", "highest"))
    dot = f'<circle class="own" cx="{at(own)}" cy="8" r="3"/>' if own == own else ""
    return (
        f'<svg class="band" viewBox="0 0 160 16" role="img" aria-label="{text(row["measure"])}">'
        f'<path class="whole" d="M{lowest} 8H{highest}"/>'
        f'<rect class="middle" x="{p05}" y="4" width="{max(round(p95 - p05, 1), 1.0)}" height="8"/>'
        f'<path class="median" d="M{median} 2V14"/>{dot}</svg>'
    )
