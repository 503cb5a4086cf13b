"""HTML from values: escaped text, numbers a person reads, tables with captions, figures without links."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

from replay.report.figure import Picture

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNITS = {"m^2": "m²", "m^3": "m³", "m/s^2": "m/s²", "rad/s^2": "rad/s²", "kg/m^3": "kg/m³", "deg": "°", "1": ""}
_SUFFIX_OF_UNIT = {
    "px": "_px",
    "kg": "_kg",
    "m": "_m",
    "m^3": "_m3",
    "s": "_s",
    "ms": "_ms",
    "mm": "_mm",
    "deg": "_deg",
    "%": "_percent",
    "Hz": "_hz",
    "J": "_J",
}
VERDICT_MARK = {"pass": "✓", "warn": "!", "fail": "✕", "vacuous": "○", "done": "✓", "not run": "–"}
VERDICT_WORD = {"pass": "passes", "warn": "warns", "fail": "fails", "vacuous": "no power", "done": "done"}


def text(value: Any) -> str:
    """Escape a value for HTML."""
    return escape(str(value), quote=True)


def number(value: Any, digits: int = 4) -> str:
    """Return a number as a person reads it, or a dash; yes and no for a truth value; other things as text."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f") if abs(value) >= 10_000 else str(value)
    if not isinstance(value, float):
        return text(value)
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e6:
        shown = f"{value:.0f}" if abs(value) >= 10**digits else f"{value:.{digits}g}"
        return shown.replace("-", "−")
    return scientific(value, digits)


def scientific(value: float, digits: int = 3) -> str:
    """Return a number with its power of ten."""
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{mantissa} × 10{str(int(exponent)).translate(_SUPERSCRIPT)}".replace("-", "−")


def limit(words: str) -> str:
    """Return a limit as it is printed: signs and powers of ten as in a book."""

    def power(match: re.Match[str]) -> str:
        mantissa = "" if match[1] == "1" else f"{match[1]} × "
        return f"{mantissa}10{str(int(match[2])).translate(_SUPERSCRIPT)}"

    words = re.sub(r"\b([\d.]+)e([+-]?\d+)", power, words)
    return text(words.replace("<=", "≤").replace(">=", "≥").replace("-", "−"))


def fixed(value: Any, decimals: int = 2) -> str:
    """Return a difference with its sign and so many decimals, or a dash."""
    return "–" if value is None else f"{value + 0.0:+.{decimals}f}".replace("-", "−")


def unit(name: Any) -> str:
    """Return a unit as it is printed."""
    return text(_UNITS.get(str(name), name))


def label(name: str, of_unit: str = "") -> str:
    """Turn the name of a check or measure into words; the unit's suffix goes where the unit stands beside it."""
    head, _, tail = name.partition(": ")
    suffix = _SUFFIX_OF_UNIT.get(of_unit, "")
    if suffix and head.endswith(suffix):
        head = head[: -len(suffix)]
    return text(head.replace("_", " ") + (f": {tail.replace('_', ' ')}" if tail else ""))


def badge(verdict: str, words: str = "") -> str:
    """Return a verdict as a coloured word with a sign, so that colour is not all that tells it."""
    kind = verdict.replace(" ", "-")
    return (
        f'<span class="badge {text(kind)}"><span aria-hidden="true">{VERDICT_MARK.get(verdict, "")}</span> '
        f"{text(words or VERDICT_WORD.get(verdict, verdict))}</span>"
    )


def table(
    caption: str,
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    numeric: Iterable[int] = (),
    note: str = "",
    stack: bool = False,
) -> str:
    """Return a table whose cells are HTML already; the first cell of a row is its heading.

    Parameters
    ----------
    caption
        Plain text over the table.
    head
        Plain column headings.
    rows
        Cells as HTML.
    numeric
        Columns set to the right.
    note
        HTML under the table.
    stack
        On a narrow screen, set each row as a block of its own instead of scrolling sideways.
    """
    right = set(numeric)

    def classed(k: int) -> str:
        return ' class="number"' if k in right else ""

    top = "".join(f'<th scope="col"{classed(k)}>{text(name)}</th>' for k, name in enumerate(head))
    body = []
    for row in rows:
        cells = [f'<th scope="row"{classed(0)}>{row[0]}</th>']
        cells += [f'<td{classed(k)} data-label="{text(head[k])}">{cell}</td>' for k, cell in enumerate(row) if k > 0]
        body.append(f"<tr>{''.join(cells)}</tr>")
    stacked = ' class="stack"' if stack else ""
    under = f'<p class="note">{note}</p>' if note else ""
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{text(caption)}"><table{stacked}>'
        f"<caption>{text(caption)}</caption><thead><tr>{top}</tr></thead>"
        f"<tbody>{''.join(body)}</tbody></table></div>{under}"
    )


def document(title: str, kicker: str, lead: str, content: str, *, style: str = "") -> str:
    """Return a whole page without scripts or links to other hosts.

    Parameters
    ----------
    title, kicker
        Plain text: the heading, and the line over it.
    lead
        HTML under the heading.
    content
        HTML of the sections.
    style
        Style sheet after the house's.
    """
    css = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{text(title)}</title>\n<style>\n{css}{style}</style></head>\n<body>"
        f'<header><div class="inner"><p class="kicker">{text(kicker)}</p><h1>{text(title)}</h1>{lead}</div></header>\n'
        f"<main>{content}</main>\n"
        "<footer><p>Process diagnostics of computed replays. No medical statement, no helmet rating.</p></footer>"
        "</body></html>\n"
    )


def figure(picture: Picture, *, wide: bool = False) -> str:
    """Return a figure whose bytes lie in the page itself."""
    kind = "svg+xml" if picture.ending == "svg" else picture.ending
    data = base64.b64encode(picture.data).decode("ascii")
    return (
        f'<figure{" class=wide" if wide else ""}><img alt="{text(picture.alt)}" src="data:image/{kind};base64,{data}">'
        f"<figcaption>{text(picture.caption)}</figcaption></figure>"
    )


def section(identifier: str, title: str, *content: str) -> str:
    """Return a section of the page with its heading."""
    return f'<section id="{identifier}"><h2>{text(title)}</h2>{"".join(content)}</section>'


def absent(reason: str) -> str:
    """Say that something is not here, and why."""
    return f'<p class="absent">{text(reason)}</p>'


def paragraph(words: str) -> str:
    """Return plain text as a paragraph."""
    return f"<p>{text(words)}</p>"
