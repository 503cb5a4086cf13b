"""Every error a user can meet: what is wrong, where, what was expected, and how to mend it.

The command line prints the message alone and leaves with the class's ``exit_code``;
a traceback is for our own mistakes, never for a user's input.
"""

from __future__ import annotations

import re
from pathlib import Path

_MOST_LINES = 8
_LONGEST_TEXT = 800


class ReplayError(Exception):
    """Root of the tree: an error whose message is written for the user."""

    exit_code = 1


class InputError(ReplayError):
    """A file or setting that cannot be used.

    Parameters
    ----------
    file
        The offending file.
    found
        What is there, in a full sentence or clause.
    expected
        What would have been right.
    mend
        What the user can do about it.
    line
        One-based line in `file`, where there is one.
    column
        Name of the column or dotted path of the setting, where there is one.
    """

    exit_code = 2

    def __init__(
        self,
        file: str | Path,
        found: str,
        *,
        expected: str = "",
        mend: str = "",
        line: int | None = None,
        column: str | None = None,
    ) -> None:
        self.file, self.found, self.expected, self.mend = str(file), _short(found), _short(expected), _short(mend)
        self.line, self.column = line, column and _short(column)
        super().__init__(self._sentence())

    def _sentence(self) -> str:
        where = self.file if self.line is None else f"{self.file}:{self.line}"
        if self.column:
            where = f"{where}: {self.column}"
        parts = [f"{where}: {self.found}"]
        if self.expected:
            parts.append(f"expected: {self.expected}")
        if self.mend:
            parts.append(f"mend: {self.mend}")
        return "\n    ".join(parts)


def _short(text: str) -> str:
    """A file that is spoilt may hold a cell of any length; a message repeats no more than can be read."""
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]} ... ({len(text)} characters)"


class InputErrors(ReplayError):
    """Several `InputError` of one reading, so that a user mends them all at once.

    One mistake made on many lines (every row with a decimal comma) is one problem: its first line is shown,
    the others are named.
    """

    exit_code = 2

    def __init__(self, errors: list[InputError]) -> None:
        self.errors = errors
        kinds: dict[tuple[str, str | None, str, str], list[InputError]] = {}
        for error in errors:
            kind = (error.file, error.column, re.sub(r"[-+.\d]+", "#", error.found), error.mend)
            kinds.setdefault(kind, []).append(error)
        count = f"{len(kinds)} problems\n" if len(kinds) > 1 else ""
        super().__init__(count + "\n".join(_with_other_lines(alike) for alike in kinds.values()))


def _with_other_lines(alike: list[InputError]) -> str:
    lines = [str(error.line) for error in alike[1:] if error.line is not None]
    if not lines:
        return str(alike[0])
    shown = ", ".join(lines[:_MOST_LINES]) + (" ..." if len(lines) > _MOST_LINES else "")
    return f"{alike[0]}\n    also: line {shown}"


class InstabilityError(ReplayError):
    """The solver stopped itself: NaN, runaway speed, an inverted element, a collapsed time step."""

    exit_code = 3


class ResumeError(ReplayError):
    """A checkpoint that does not belong to this model, code or version."""

    exit_code = 2


class BundleError(ReplayError):
    """A bundle that does not verify; the message names the first bad file."""

    exit_code = 1
