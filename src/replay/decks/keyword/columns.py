"""Writing cards: fixed columns throughout, so that any reader of the format takes them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from replay.decks.keyword.entries import Entry
from replay.decks.keyword.fields import Value

FACTS_MARK = "$replay "
"""Begins a comment line that holds facts of a deck of ours."""
FACTS_SCHEMA = "replay-deck-facts 1"


def field_names(*names: str) -> str:
    """Comment line that names the fields of the card below it."""
    return ("$#" + "".join(f"{name:>10}" for name in names)[2:]).rstrip()


def card(*values: Value) -> str:
    """Ten-column fields; None is blank."""
    return "".join(_field(value, 10) for value in values).rstrip()


def number_text(value: float, width: int) -> str:
    """As many digits as fit a field with one blank before it.

    Raises
    ------
    ValueError
        For a number that is not finite, or has no room at one digit.
    """
    if not math.isfinite(value):
        message = f"{value} cannot stand in a deck"
        raise ValueError(message)
    for digits in range(17, 0, -1):
        text = f"{value:.{digits}g}"
        if "." not in text and "e" not in text:
            text += "."
        if "e" in text:
            mantissa, exponent = text.split("e")
            text = f"{mantissa}e{int(exponent)}"
        if len(text) < width:
            return text.rjust(width)
    message = f"{value} does not fit {width} columns"
    raise ValueError(message)


def curve_lines(number: int, abscissa: Sequence[float], ordinate: Sequence[float]) -> list[str]:
    """A ``*DEFINE_CURVE``."""
    points = [f"{number_text(a, 20)}{number_text(o, 20)}" for a, o in zip(abscissa, ordinate)]
    return ["*DEFINE_CURVE", field_names("lcid"), card(number), *points]


def set_lines(keyword: str, number: int, title: str, members: Sequence[int]) -> list[str]:
    """A ``*SET_..._TITLE``, eight members a line."""
    rows = [card(*members[k : k + 8]) for k in range(0, len(members), 8)]
    return [f"*{keyword}_TITLE", title[:80], card(number), *rows]


def node_lines(ids: np.ndarray, nodes: np.ndarray) -> list[str]:
    """A ``*NODE`` block: I8, 3E16, I8, I8."""
    return ["*NODE"] + [
        f"{i:8d}{number_text(x, 16)}{number_text(y, 16)}{number_text(z, 16)}{0:8d}{0:8d}"
        for i, (x, y, z) in zip(ids.tolist(), nodes.tolist())
    ]


def solid_lines(ids: np.ndarray, parts: np.ndarray, nodes: np.ndarray) -> list[str]:
    """An ``*ELEMENT_SOLID`` block, two lines of I8 an element (the layout of the format since 1997)."""
    return ["*ELEMENT_SOLID"] + [
        f"{e:8d}{p:8d}\n" + "".join(f"{n:8d}" for n in row)
        for e, p, row in zip(ids.tolist(), parts.tolist(), nodes.tolist())
    ]


def shell_lines(ids: np.ndarray, parts: np.ndarray, nodes: np.ndarray) -> list[str]:
    """An ``*ELEMENT_SHELL`` block."""
    return ["*ELEMENT_SHELL"] + [
        f"{e:8d}{p:8d}" + "".join(f"{n:8d}" for n in row)
        for e, p, row in zip(ids.tolist(), parts.tolist(), nodes.tolist())
    ]


def entry_lines(entry: Entry) -> list[str]:
    """An entry in its form; lines beyond the form are the caller's affair."""
    lines = [f"*{entry.keyword}"]
    if entry.keyword.startswith("CONTACT_"):
        lines = [f"*{entry.keyword}_ID", f"{entry.cid:10d}{entry.title[:70]}"]
    elif entry.title and entry.kind != "part":
        lines = [f"*{entry.keyword}_TITLE", entry.title[:80]]
    for row in entry.rows:
        if row.fields[0].width == 80:
            lines.append(str(row.values[0] or "")[:80])
        else:
            lines.append("".join(_field(v, f.width) for f, v in zip(row.fields, row.values)).rstrip())
    return lines


def facts_lines(facts: Mapping[str, Any]) -> list[str]:
    """Comment lines for facts: 80 columns each, ASCII."""
    text = json.dumps({"schema": FACTS_SCHEMA, **facts}, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    room = 80 - len(FACTS_MARK)
    # A space at the end of a line would not survive an editor: it is written as its escape, which JSON permits.
    text = text.replace(" ", "\\u0020")
    return [FACTS_MARK + text[k : k + room] for k in range(0, len(text), room)]


def joined(lines: Iterable[str]) -> str:
    """Lines as the text of a keyword file."""
    return "\n".join(["*KEYWORD", *lines, "*END"]) + "\n"


def _field(value: Value, width: int) -> str:
    if value is None:
        return " " * width
    if isinstance(value, int | np.integer):
        return f"{value:{width}d}"
    return number_text(float(value), width) if isinstance(value, float) else str(value)[: width - 1].rjust(width)
