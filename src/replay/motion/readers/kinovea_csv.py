"""Kinovea's CSV export of trajectories: one time column, then X and Y of every track.

List separator and decimal mark follow the locale (``"1.0","2.0"`` or ``"1,0";"2,0"``), Time has no unit, cells are
empty where a track is not. The kinematics dialogs write CSV too, of filtered values: that one is refused.
"""

from __future__ import annotations

import re
from pathlib import Path

from replay.errors import InputError
from replay.files import read_text
from replay.motion.readers.cells import rows_of
from replay.motion.readers.exported import Block, Row, to_pixels
from replay.motion.readers.numerals import number_at, stamp_at
from replay.motion.readers.observations import Context, Observation

NAME = "kinovea_csv"
_TIME = re.compile(r"time(?:\s*\(.*\))?")
_COORDINATE = re.compile(r"(.*?)[\s./:_-]*(?:\b|(?<=[\s./:_-]))([XYxy])\s*(?:[(\[]\s*([^)\]]*?)\s*[)\]])?")
_DERIVED = ("velocity", "speed", "acceleration", "angle", "angular", "distance", "displacement", "position")


def recognises(text: str) -> bool:
    """A heading that begins with Time."""
    first = next((line for line in text.split("\n") if line.strip()), "")
    return _TIME.fullmatch(re.split(r"[,;\t]", first)[0].strip().strip('"').casefold()) is not None


def read(path: Path, context: Context) -> list[Observation]:
    """Read every track.

    Raises
    ------
    InputError
        An export of filtered kinematics, columns without a partner, rows longer than the heading, and what
        `to_pixels` refuses.
    """
    first = next(line for line in read_text(path).split("\n") if line.strip())
    separator = next((mark for mark in (";", "\t") if mark in first), ",")
    rows = rows_of(path, separator)
    heading_line, heading = rows[0]
    tracks = _tracks(path, heading_line, heading)
    for line, row in rows[1:]:
        if len(row) > len(heading) and any(row[len(heading) :]):
            raise InputError(
                path,
                f"{len(row)} cells where the heading has {len(heading)}",
                line=line,
                expected=f"cells separated by {separator!r}",
                mend="export the file again: list separator and decimal mark must differ",
            )
        row += [""] * (len(heading) - len(row))
        for block, x, y in tracks:
            if not row[x] and not row[y]:
                continue
            u, v = (number_at(path, row[i], line, heading[i]) for i in (x, y))
            block.rows.append(Row(u, v, stamp_at(path, row[0], line), line))
    return to_pixels(path, [block for block, _, _ in tracks], context)


def _tracks(path: Path, line: int, heading: list[str]) -> list[tuple[Block, int, int]]:
    """Blocks to fill, each with the columns of its X and Y."""
    found = []
    for index, title in enumerate(heading[1:], start=1):
        if not title and index == len(heading) - 1:
            continue
        match = _COORDINATE.fullmatch(title)
        if match is None or any(word in title.casefold() for word in _DERIVED):
            raise InputError(
                path,
                f"the column {title!r} is no X or Y of a track: an export of Kinovea's kinematics, which is filtered",
                line=line,
                expected="Time, then X and Y of every track",
                mend="export the trajectories, not the kinematics, or give the .kva, which keeps raw pixels",
            )
        found.append((match.group(1).strip(), match.group(2).upper(), match.group(3) or "", index))
    out = []
    for (name, axis, unit, x), (other, other_axis, _, y) in zip(found[::2], found[1::2]):
        if (axis, other_axis) != ("X", "Y") or name != other:
            raise InputError(
                path,
                f"the columns {heading[x]!r} and {heading[y]!r} are no X and Y of one track",
                line=line,
                expected="X and Y side by side",
                mend="export the file again",
            )
        out.append((Block(name, unit, [], line), x, y))
    if len(found) % 2 or not out:
        raise InputError(path, "the heading has no pairs of X and Y", line=line, mend="export the trajectories")
    return out
