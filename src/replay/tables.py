"""CSV tables with fixed columns: one `TableFormat` both writes and reads a kind of file.

The unit is part of a column's name (``time_s``, ``omega_x_rad_per_s``); the format carries
a sentence on each column, from which the documentation of the file formats is generated.
"""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from replay.errors import InputError, InputErrors
from replay.files import read_text, write_text

if TYPE_CHECKING:
    import pandas as pd

Kind = Literal["float", "int", "text"]
_MOST_ERRORS = 20


@dataclass(frozen=True)
class Column:
    """One column.

    Parameters
    ----------
    name
        Heading, with its unit as suffix (``_m``, ``_rad_per_s``).
    meaning
        One clause for the documentation.
    kind
        ``float``, ``int`` or ``text``.
    may_be_empty
        Whether an empty cell (NaN) is allowed.
    aliases
        Other headings accepted on reading.
    """

    name: str
    meaning: str
    kind: Kind = "float"
    may_be_empty: bool = False
    aliases: tuple[str, ...] = ()


@dataclass(frozen=True)
class TableFormat:
    """A kind of CSV file: its columns, and how it is read and written.

    Parameters
    ----------
    title
        What the file is, for messages and documentation.
    columns
        In file order.
    """

    title: str
    columns: tuple[Column, ...]

    @property
    def names(self) -> list[str]:
        """Headings in file order."""
        return [column.name for column in self.columns]

    def write(self, path: str | Path, values: Mapping[str, Any]) -> None:
        """Write a table; floats in shortest form that reads back to the same bits.

        Parameters
        ----------
        path
            File to write, atomically.
        values
            One sequence per column, all of one length; keys exactly the format's names.

        Raises
        ------
        ValueError
            When columns are missing, unknown, or of different lengths (our own mistake).
        """
        if set(values) != set(self.names):
            message = f"{self.title}: columns {sorted(set(values) ^ set(self.names))} missing or unknown"
            raise ValueError(message)
        data = [np.asarray(values[name]).tolist() for name in self.names]
        if len({len(column) for column in data}) > 1:
            message = f"{self.title}: columns have different lengths {[len(c) for c in data]}"
            raise ValueError(message)
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.names)
        for row in zip(*data):
            writer.writerow([_cell(value) for value in row])
        write_text(path, out.getvalue())

    def read(self, path: str | Path, *, extra: bool = False) -> pd.DataFrame:
        """Read and check a table.

        Parameters
        ----------
        path
            CSV file, comma separated, decimal points; BOM, CRLF and blank lines are accepted.
        extra
            Keep columns that the format does not know (as text); otherwise they are dropped.

        Returns
        -------
        pandas.DataFrame
            The format's columns in order, plus ``line`` in ``frame.attrs['lines']``:
            the one-based file line of each row.

        Raises
        ------
        InputError, InputErrors
            With file, line and column for everything that cannot be used.
        """
        text = read_text(path)
        lines = text.split("\n")
        self._refuse_foreign_separator(path, lines)
        rows = [(reader_line, row) for reader_line, row in _rows(path, text) if any(cell.strip() for cell in row)]
        if not rows:
            raise InputError(path, "every cell is empty", expected=f"a {self.title}", mend="export the file again")
        header = [cell.strip() for cell in rows[0][1]]
        where = self._find_columns(path, rows[0][0], header)
        errors: list[InputError] = []
        data: dict[str, list[Any]] = {name: [] for name in self.names}
        kept: dict[str, list[str]] = {h: [] for h in header if h and h not in where.values()} if extra else {}
        numbers: list[int] = []
        if len(rows) == 1:
            raise InputError(
                path,
                "there is a heading but no row",
                line=rows[0][0],
                expected=f"a {self.title} with at least one row",
                mend="export the file again",
            )
        for line, row in rows[1:]:
            if len(row) != len(header):
                errors.append(_ragged(path, line, row, header))
                continue
            cells = dict(zip(header, row))
            numbers.append(line)
            for column in self.columns:
                value, error = _value(path, line, column, cells[where[column.name]].strip())
                data[column.name].append(value)
                if error:
                    errors.append(error)
            for name in kept:
                kept[name].append(cells[name].strip())
        if errors:
            raise errors[0] if len(errors) == 1 else InputErrors(errors[:_MOST_ERRORS])
        import pandas as pd  # a second to import, and half of the stages read no table

        frame = pd.DataFrame({**data, **kept})
        frame.attrs["lines"] = numbers
        return frame

    def _refuse_foreign_separator(self, path: str | Path, lines: Sequence[str]) -> None:
        first = next(line for line in lines if line.strip())
        if "," not in first and (";" in first or "\t" in first) and len(self.columns) > 1:
            found = "semicolons" if ";" in first else "tabs"
            raise InputError(
                path,
                f"the columns are separated by {found}",
                line=lines.index(first) + 1,
                expected="commas between columns and points as decimal marks",
                mend="export with an English locale, or replace the separators and decimal commas",
            )

    def _find_columns(self, path: str | Path, line: int, header: list[str]) -> dict[str, str]:
        twice = sorted(h for h, count in Counter(header).items() if h and count > 1)
        if twice:
            raise InputError(path, f"the heading {twice[0]!r} occurs twice", line=line, mend="rename or remove one")
        where, missing = {}, []
        for column in self.columns:
            match = [h for h in header if h == column.name or h in column.aliases]
            if match:
                where[column.name] = match[0]
            else:
                missing.append(column.name)
        if missing:
            raise InputError(
                path,
                f"column {', '.join(missing)} is missing (found: {', '.join(header)})",
                line=line,
                expected=", ".join(self.names),
                mend="rename the heading or export the column",
            )
        return where


def _rows(path: str | Path, text: str) -> list[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text))
    out, start = [], 1
    try:
        for row in reader:
            out.append((start, row))
            start = reader.line_num + 1
    except csv.Error as error:
        mend = "close the quotation mark that opens in or before that line"
        raise InputError(path, f"is no table of cells: {error}", line=start, mend=mend) from None
    return out


def _ragged(path: str | Path, line: int, row: list[str], header: list[str]) -> InputError:
    mend = "complete the row or remove it"
    if len(row) > len(header) and any(cell.strip().lstrip("-").isdigit() for cell in row):
        mend = "if numbers use decimal commas, export with decimal points; otherwise mend the row"
    return InputError(
        path, f"{len(row)} cells where the heading has {len(header)}", line=line, expected=", ".join(header), mend=mend
    )


def _value(path: str | Path, line: int, column: Column, cell: str) -> tuple[Any, InputError | None]:
    def bad(found: str, expected: str, mend: str) -> tuple[Any, InputError]:
        return math.nan, InputError(path, found, line=line, column=column.name, expected=expected, mend=mend)

    if column.kind == "text":
        if not cell and not column.may_be_empty:
            return bad("the cell is empty", "a name", "fill it in or remove the row")
        return cell, None
    if not cell or cell.lower() in ("nan", "na", "none", "null"):
        if column.may_be_empty:
            return math.nan, None
        return bad(f"the cell is {cell or 'empty'!s}", "a number", "fill it in or remove the row")
    try:
        number = float(cell)
    except ValueError:
        if "," in cell and cell.replace(",", "").replace("-", "").replace(".", "").isdigit():
            return bad(f"{cell!r} has a decimal comma", "a decimal point", "export with decimal points")
        return bad(f"{cell!r} is not a number", f"{'an integer' if column.kind == 'int' else 'a number'}", "correct it")
    if not math.isfinite(number):
        return bad(f"{cell!r} is not finite", "a finite number", "correct it or remove the row")
    if column.kind == "int":
        if number != int(number):
            return bad(f"{cell!r} is not a whole number", "an integer", "correct it")
        return int(number), None
    return number, None


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(value)
    return str(value)
