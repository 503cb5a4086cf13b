"""Numbers and columns of keyword cards: what a field may hold, and where on its line it stands."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from replay.errors import InputError

# A FORTRAN real: the exponent's letter may be missing (1.0-3), or be D.
_NUMBER = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[eEdD]?([+-][0-9]+)|[eEdD]([0-9]+))?")
_MOST_DIGITS = 15  # a double holds every whole number of so many

Value = float | int | str | None


class Line(NamedTuple):
    """One physical line that holds data: its file, its one-based number, its text without newline."""

    file: Path
    number: int
    text: str


class Place(Protocol):
    """A line, or a block: anything with a file and a one-based number of a line."""

    @property
    def file(self) -> Path:
        """The file."""

    @property
    def number(self) -> int:
        """The line."""


def mistake(where: Place, column: str, found: str, expected: str, mend: str = "correct the line") -> InputError:
    """Error at a field: every mistake of a deck names file, line, field, what is there and what should be."""
    return InputError(where.file, found, line=where.number, column=column, expected=expected, mend=mend)


def shown(text: str) -> str:
    """Text of a file as it may stand in a message: short, printable, quoted."""
    text = repr(text.strip())
    return text if len(text) <= 40 else text[:36] + "...'"


def to_float(text: str) -> float | None:
    """Number of a field, or None where it is none or is not finite."""
    match = _NUMBER.fullmatch(text)
    if match is None:
        return None
    mantissa, signed, plain = match.groups()
    value = float(f"{mantissa}e{signed or plain or 0}")
    return value if math.isfinite(value) else None


def to_int(text: str) -> int | None:
    """Whole number of a field (``7`` or ``7.0``), or None where it is none."""
    if text.isdecimal() and text.isascii() and len(text) <= _MOST_DIGITS:
        return int(text)
    value = to_float(text)
    return int(value) if value is not None and value == int(value) and abs(value) < 10**_MOST_DIGITS else None


def split(text: str, widths: Sequence[int]) -> list[str]:
    """Fields of a line: by commas where it has any, else by columns; missing ones are empty."""
    if "," in text:
        fields = [field.strip() for field in text.split(",")]
        return (fields + [""] * len(widths))[: max(len(widths), len(fields))]
    fields, start = [], 0
    for width in widths:
        fields.append(text[start : start + width].strip())
        start += width
    rest = text[start:].strip()
    return [*fields, rest] if rest else fields


def lookup(line: Line, column: str, text: str, parameters: Mapping[str, Value]) -> str:
    """Text of a field with a reference to a parameter (``&name``, ``-&name``) replaced by its value.

    Raises
    ------
    InputError
        When no such parameter was defined before.
    """
    sign, name = ("-", text[2:]) if text.startswith("-&") else ("", text[1:])
    value = parameters.get(name.strip().lower())
    if value is None:
        known = ", ".join(sorted(parameters)[:8]) or "none"
        raise mistake(
            line, column, f"the parameter {shown(name)} is not defined", f"one of: {known}", "define it before"
        )
    return str(value) if not sign else str(-value) if not isinstance(value, str) else f"-{value}"
