"""Kinovea's spreadsheet export: SpreadsheetML (XML 2003), one block of rows ``x, y, t`` for each track."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from replay.errors import InputError
from replay.motion.readers.exported import Block, Row, to_pixels
from replay.motion.readers.markup import Node, parse
from replay.motion.readers.numerals import number_at, stamp_at
from replay.motion.readers.observations import Context, Observation

NAME = "kinovea_xml"
_UNIT = re.compile(r"\(\s*x\s*,\s*y\s*:\s*([^;)]*)")


def recognises(text: str) -> bool:
    """An XML file whose root is a workbook."""
    return "<Workbook" in text[:4000]


@dataclass(frozen=True)
class _Cells:
    texts: list[str]
    line: int


def read(path: Path, context: Context) -> list[Observation]:
    """Read every track of every sheet.

    Raises
    ------
    InputError
        No track, coordinates that are not pixels or not from a common origin, cells that are no numbers.
    """
    return to_pixels(path, blocks(path), context)


def blocks(path: Path) -> list[Block]:
    """Every track as the file has it, in its own units.

    Raises
    ------
    InputError
        No track, cells that are no numbers or times.
    """
    root = parse(path)
    rows = [_cells(row) for row in root.all("Row")]
    out: list[Block] = []
    unit = name = ""
    inside: list[Row] | None = None
    for row in rows:
        first = row.texts[0].casefold() if row.texts else ""
        if [text.casefold() for text in row.texts[:3]] == ["x", "y", "t"]:
            inside = []
            out.append(Block(name, unit, inside, row.line))
        elif inside is not None and len(row.texts) >= 3 and row.texts[0]:
            x, y = (number_at(path, text, row.line, f"track {name}") for text in row.texts[:2])
            inside.append(Row(x, y, stamp_at(path, row.texts[2], row.line), row.line))
        else:
            inside = None
            found = _UNIT.search(row.texts[0]) if row.texts else None
            if found:
                unit = found.group(1).strip()
            elif first.startswith("label") and len(row.texts) > 1:
                name = row.texts[1].strip()
    if not out:
        raise InputError(
            path,
            "holds no track",
            expected="blocks of rows x, y, t under a track's label",
            mend="track the landmarks in Kinovea before exporting",
        )
    return out


def _cells(row: Node) -> _Cells:
    texts = []
    for cell in row.children:
        data = cell.find("Data")
        texts.append(data.text.strip() if data else "")
    return _Cells(texts, row.line)
