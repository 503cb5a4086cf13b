"""The page of a season: how many plays were accepted, what they cost, a row for each, and their ensembles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from replay.report.markup import badge, document, number, section, table, text, unit

_KIND = {
    "ACCEPTED": "pass",
    "ACCEPTED WITH WARNINGS": "warn",
    "REJECTED": "fail",
    "FAILED": "fail",
    "UNREADABLE": "fail",
    "INTERRUPTED": "fail",
    "NOT RUN": "vacuous",
}
# Heading, unit, key and digits of each number; the keys of a band that stands under it.
_OMEGA_BAND = ("target_omega_low_rad_per_s", "target_omega_high_rad_per_s")
_NUMBERS: tuple[tuple[str, str, str, int, tuple[str, ...]], ...] = (
    ("acceleration", "m/s^2", "target_acceleration_m_per_s2", 4, ()),
    ("angular velocity", "rad/s", "target_omega_rad_per_s", 4, _OMEGA_BAND),
    ("angular acceleration", "rad/s^2", "target_alpha_rad_per_s2", 4, ()),
    ("HIC15", "", "hic15", 3, ()),
    ("BrIC", "", "bric", 3, ()),
    ("brain strain p95", "", "brain_strain_p95", 3, ()),
    ("driver RMSE", "%", "rmse_acceleration_percent", 2, ()),
)
_BANDS = ("HIC15", "BrIC", "brain mps_green_lagrange_p95")
_STYLE = """main, header .inner, footer { max-width: 100rem; }
.tally { display: grid; grid-template-columns: repeat(auto-fit, minmax(8.5rem, 1fr)); gap: .8rem; margin: 0; }
.tally div { border: 1px solid var(--line); border-top: .3rem solid var(--mute); border-radius: .4rem;
  padding: .5rem .8rem; }
.tally dt { color: var(--soft); font-size: .82rem; }
.tally dd { margin: 0; font-size: 1.5rem; font-weight: 650; font-variant-numeric: tabular-nums; }
.tally .pass { border-top-color: var(--pass); } .tally .warn { border-top-color: #c98a00; }
.tally .fail { border-top-color: var(--fail); }
tbody th { min-width: 9rem; overflow-wrap: anywhere; }
.why { display: block; min-width: 14rem; overflow-wrap: anywhere; }
td .detail { white-space: nowrap; } td .why { white-space: normal; }
"""


def season_page(rows: Sequence[Mapping[str, Any]], ensembles: Sequence[Mapping[str, Any]] = ()) -> str:
    """Return the page of a season.

    Parameters
    ----------
    rows
        One mapping a play, by the column names of the season's table; what a play did not reach is absent. Its files
        are linked as they lie beside the page: ``<play>/report/report.html``.
    ensembles
        ``name``, ``page`` and ``bands`` (measure to its row of the table of bands) of each.
    """
    head = [f"{name} [{unit(of)}]" if of else name for name, of, *_ in _NUMBERS]
    body = table(
        "One row a play",
        ["play", "verdict", *head, "time", "cost", "why"],
        [_cells(row) for row in rows],
        numeric=range(2, 4 + len(head)),
        note="Peaks are those of the reconstruction, with the calibrated band of the posterior where the footage has "
        "one; HIC15, BrIC and strain are those of the replayed head. Time is the sum of the wall clocks of the play's "
        "jobs, cost that of their processor time. An empty cell was not reached. The same as a table: "
        '<a href="plays.csv">plays.csv</a>.',
        stack=True,
    )
    sections = [section("plays", "Plays", body)]
    if ensembles:
        sections.append(section("ensembles", "Ensembles", _ensembles(ensembles)))
    many = f"{len(rows)} play{'' if len(rows) == 1 else 's'}"
    return document(many, "Finite-element replays of single plays", _tally(rows), "".join(sections), style=_STYLE)


def _tally(rows: Sequence[Mapping[str, Any]]) -> str:
    count = Counter(str(row["verdict"]) for row in rows)
    words = [word for word in [*_KIND, *sorted(set(count) - set(_KIND))] if count[word]]
    tiles = [(_KIND.get(word, "vacuous"), word.lower(), str(count[word])) for word in words]
    cpu = [float(row["cpu_s"]) for row in rows if "cpu_s" in row]
    if cpu:
        tiles += [("", "cost", duration(sum(cpu))), ("", "cost of a play", duration(sum(cpu) / len(cpu)))]
    shown = (f'<div class="{kind}"><dt>{text(name)}</dt><dd>{text(value)}</dd></div>' for kind, name, value in tiles)
    return f'<dl class="tally">{"".join(shown)}</dl>'


def duration(seconds: float) -> str:
    """Return a time as a person reads it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def _cells(row: Mapping[str, Any]) -> list[str]:
    verdict, play = str(row["verdict"]), str(row.get("play") or row["bundle"])
    sealed = verdict not in ("FAILED", "NOT RUN", "UNREADABLE")
    name = f'<a href="{text(play)}/report/report.html">{text(play)}</a>' if sealed else text(play)
    kind = " · ".join(text(row[key]) for key in ("source", "resolution") if row.get(key))
    bundle = f' · <a href="{text(row["bundle"])}">bundle</a>' if sealed else ""
    log = f' <a href="{text(row["log"])}">log</a>' if row.get("log") else ""
    return [
        f'{name}<br><span class="detail">{kind}{bundle}</span>' if kind or bundle else name,
        badge(_KIND.get(verdict, "vacuous"), verdict.lower()),
        *(_value(row, key, digits, band) for _, _, key, digits, band in _NUMBERS),
        duration(row["wall_s"]) if "wall_s" in row else "",
        duration(row["cpu_s"]) if "cpu_s" in row else "",
        f'<span class="why">{text(row.get("reason", ""))}{log}</span>',
    ]


def _value(row: Mapping[str, Any], key: str, digits: int, band: Sequence[str]) -> str:
    if key not in row:
        return ""
    shown = number(row[key], digits)
    if band and all(name in row for name in band):
        low, high = (number(row[name], 3) for name in band)
        shown += f'<br><span class="detail">{low} to {high}</span>'
    return shown


def _ensembles(ensembles: Sequence[Mapping[str, Any]]) -> str:
    def cell(bands: Mapping[str, Mapping[str, Any]], measure: str) -> str:
        if measure not in bands:
            return ""
        low, middle, high = (number(float(bands[measure][name]), 3) for name in ("p05", "median", "p95"))
        return f'{middle}<br><span class="detail">{low} to {high}</span>'

    return table(
        "One row an ensemble",
        ["ensemble", "members", "HIC15", "BrIC", "brain strain p95"],
        [
            [
                f'<a href="{text(entry["page"])}">{text(entry["name"])}</a>',
                str(max((int(row["members"]) for row in entry["bands"].values()), default=0)),
                *(cell(entry["bands"], measure) for measure in _BANDS),
            ]
            for entry in ensembles
        ],
        numeric=range(1, 5),
        note="Median over the members, and the range from the 5th to the 95th percentile.",
        stack=True,
    )
