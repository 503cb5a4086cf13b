"""Kinovea's text export for Gnuplot: a comment with each track's name, then rows ``T X Y``.

Time has a point or is a time code whatever the locale; X and Y have the locale's decimal mark. Tracks differ in length.
"""

from __future__ import annotations

from pathlib import Path

from replay.errors import InputError
from replay.files import read_text
from replay.motion.readers.exported import Block, Row, to_pixels
from replay.motion.readers.numerals import number_at, stamp_at
from replay.motion.readers.observations import Context, Observation

NAME = "kinovea_txt"
_FIRST = "#kinovea trajectory"
_HEADING = "#t x y"


def recognises(text: str) -> bool:
    """Kinovea's first comment."""
    return text.lstrip().casefold().startswith(_FIRST)


def read(path: Path, context: Context) -> list[Observation]:
    """Read every track.

    Raises
    ------
    InputError
        Rows that are no ``T X Y``, rows before a track's name, and what `to_pixels` refuses.
    """
    blocks: list[Block] = []
    for line, text in enumerate(read_text(path).split("\n"), start=1):
        content = text.strip()
        if content.startswith("#"):
            if not content.casefold().startswith((_FIRST, _HEADING)):
                blocks.append(Block(content.lstrip("#").strip(), "", [], line))
            continue
        if not content:
            continue
        cells = content.split()
        if len(cells) != 3 or not blocks:
            raise InputError(
                path,
                f"{content[:40]!r} is no row of a track" if blocks else "a row comes before the name of its track",
                line=line,
                expected="`# name`, then rows of time, X and Y",
                mend="export the file again",
            )
        x, y = (number_at(path, cell, line, f"track {blocks[-1].name}") for cell in cells[1:])
        blocks[-1].rows.append(Row(x, y, stamp_at(path, cells[0], line), line))
    return to_pixels(path, blocks, context)
