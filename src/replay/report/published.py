"""A collision beside published numbers: the article's own and those of recorded play, each with a reason."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import yaml

from replay.report.markup import number, paragraph, table, text, unit

_FILE = Path(__file__).with_name("published.yaml")
_FIELD = (
    "Recorded play: reconstructed concussive impacts of professional players (Viano, Casson and Pellman 2007, and"
    " Pellman and others 2003). These numbers place a run; they judge no player and no helmet."
)


def published_section(values: Mapping[str, float | None]) -> str:
    """Return the table of this run's values beside the published ones.

    Parameters
    ----------
    values
        Value of the run by `key` of ``published.yaml``; None for one that it does not have.

    Raises
    ------
    KeyError
        When a key has no value: a row would be silently empty.
    """
    rows = [
        [
            text(row["what"]),
            number(values[row["key"]]),
            unit(row["unit"]),
            text(row["article"]),
            text(row["field"] or "–"),
            text(row["why"]),
        ]
        for row in yaml.safe_load(_FILE.read_text(encoding="utf-8"))
    ]
    head = ["Quantity", "This run", "Unit", "Article", "Recorded play", "Why they differ"]
    return table("This run beside published numbers", head, rows, numeric=(1,), stack=True) + paragraph(_FIELD)
