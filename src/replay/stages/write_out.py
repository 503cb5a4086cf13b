"""A row of the table of plays, written out as a play folder: what is run and sealed is complete in itself."""

from __future__ import annotations

from pathlib import Path

from replay.errors import InputError
from replay.play import read_plays_table, write_out


def write_row(play: str, table: Path, plays: Path, into: Path) -> int:
    """Write one row's ``play.yaml`` and its tracks; return 0.

    Raises
    ------
    InputError, InputErrors
        What is wrong with the table, the base or an override, with line and column.
    """
    rows = read_plays_table(table)
    if play not in rows:
        raise InputError(table, f"has no play {play!r}", expected=", ".join(rows), mend="correct the name")
    print(f"{play}: {write_out(rows[play], plays, into)}, made of {rows[play].base}")
    return 0
