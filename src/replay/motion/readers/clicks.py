"""The article's click table: ``frame, landmark_id, u_px, v_px``, retyped from Kinovea or written by `digitize`."""

from __future__ import annotations

from pathlib import Path

from replay.errors import InputError
from replay.motion.readers.cells import rows_of
from replay.motion.readers.observations import Context, Observation, raise_all
from replay.motion.tracks import CLICKS, WEIGHTED_CLICKS

NAME = "clicks"


def recognises(text: str) -> bool:
    """Whatever no other reader knows: its errors say what a click table needs."""
    return bool(text)


def read(path: Path, context: Context) -> list[Observation]:
    """Read the table; a ``weight`` column is used where there is one.

    Raises
    ------
    InputError, InputErrors
        Missing columns or numbers, weights outside (0, 1], frames out of order.
    """
    weighted = "weight" in rows_of(path)[0][1]
    table = (WEIGHTED_CLICKS if weighted else CLICKS).read(path)
    weights = table["weight"] if weighted else [1.0] * len(table)
    rows = zip(table.attrs["lines"], table["frame"], table["landmark_id"], table["u_px"], table["v_px"], weights)
    errors: list[InputError] = []
    out = []
    latest = None
    for line, frame, name, u, v, weight in rows:
        if latest is not None and frame < latest:
            errors.append(
                InputError(
                    path,
                    f"frame {frame} comes after frame {latest}: frames are out of order",
                    line=line,
                    column="frame",
                    expected="rows sorted by frame",
                    mend="sort the rows by frame, and check that no other clip was appended",
                )
            )
        latest = frame if latest is None else max(latest, frame)
        if not 0.0 < weight <= 1.0:
            found = f"the weight is {weight:g}"
            mend = "remove the row, or give it the weight of its noise: (careful click's sigma / this one's)^2"
            errors.append(InputError(path, found, line=line, column="weight", expected="above 0, at most 1", mend=mend))
        out.append(Observation(int(frame), str(name), float(u), float(v), float(weight), line))
    raise_all(errors)
    return out
