"""Rows of a separated text file, each with its line."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from replay.errors import InputError
from replay.files import read_text


def rows_of(path: Path, separator: str = ",") -> list[tuple[int, list[str]]]:
    """Line number and stripped cells of every row that is not empty.

    Raises
    ------
    InputError
        A file that is no table of that kind.
    """
    reader = csv.reader(io.StringIO(read_text(path)), delimiter=separator)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(row)]
    except csv.Error as error:
        found = f"is no table of cells: {error}"
        raise InputError(path, found, line=reader.line_num + 1, mend="export the file again") from None
    if not rows:
        raise InputError(path, "holds no row", mend="export the file again")
    return rows
