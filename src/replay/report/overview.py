"""The page of many plays: how many were accepted, and a row for each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from replay.report.markup import badge, document, number, section, table, text, unit

_KIND = {
    "ACCEPTED": "pass",
    "ACCEPTED WITH WARNINGS": "warn",
    "REJECTED": "fail",
    "INTERRUPTED": "fail",
    "UNREADABLE": "fail",
}
# Heading, unit, key and digits of each number.
_NUMBERS = (
    ("t0", "ms", "t0_s", 1e3, 5),
    ("acceleration", "m/s^2", "target_acceleration_m_per_s2", 1.0, 4),
    ("angular velocity", "rad/s", "target_omega_rad_per_s", 1.0, 4),
    ("angular acceleration", "rad/s^2", "target_alpha_rad_per_s2", 1.0, 4),
    ("over noise", "", "omega_over_noise", 1.0, 3),
    ("HIC15", "", "hic15", 1.0, 3),
    ("BrIC", "", "bric", 1.0, 3),
    ("brain strain p95", "", "brain_strain_p95", 1.0, 3),
    ("driver RMSE", "%", "rmse_acceleration_percent", 1.0, 2),
)


def overview_page(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the page of many plays.

    Parameters
    ----------
    rows
        One mapping a play, by the column names of the table of plays; what a play did not reach is absent.
    """
    count = Counter(str(row["verdict"]) for row in rows)
    summary = ", ".join(
        f"{count[word]} {word.lower()}" for word in [*_KIND, *sorted(set(count) - set(_KIND))] if count[word]
    )
    head = ["play", "verdict", *(f"{name} [{unit(of)}]" if of else name for name, of, *_ in _NUMBERS), "why", "made by"]
    first = 2
    body = table(
        "One row a play",
        head,
        [_cells(row) for row in rows],
        numeric=range(first, first + len(_NUMBERS)),
        note="Peaks are those of the reconstruction; HIC15, BrIC and strain are those of the replayed head. An empty "
        "cell was not reached. Over noise: the peak angular velocity over the one that clicks alone would show.",
        stack=True,
    )
    return document(
        f"{len(rows)} plays",
        "Finite-element replays of single plays",
        f"<p>{text(summary)}</p>",
        section("plays", "Plays", body),
        style="main, header .inner, footer { max-width: 100rem; }\n"
        "tbody th, td:nth-last-child(2) { min-width: 12rem; overflow-wrap: anywhere; }\n",
    )


def _cells(row: Mapping[str, Any]) -> list[str]:
    verdict = str(row["verdict"])
    name = str(row.get("play") or row["bundle"])
    where = f'<br><span class="detail">{text(row["bundle"])}</span>' if row.get("play") else ""
    kind = " · ".join(text(row[key]) for key in ("source", "resolution") if row.get(key))
    numbers = [number(scale * row[key], digits) if key in row else "" for _, _, key, scale, digits in _NUMBERS]
    made = " ".join(text(row[key]) for key in ("version", "commit") if row.get(key))
    return [
        f"{text(name)}{where}" + (f'<br><span class="detail">{kind}</span>' if kind else ""),
        badge(_KIND.get(verdict, "vacuous"), verdict.lower()),
        *numbers,
        text(row.get("reason", "")),
        f'<span class="detail">{made}</span>',
    ]
