"""SLEAP's analysis CSV: ``track, frame_idx, instance.score``, then ``<node>.x, <node>.y, <node>.score``."""

from __future__ import annotations

from pathlib import Path

from replay.errors import InputError
from replay.motion.readers.cells import rows_of
from replay.motion.readers.numerals import number_at
from replay.motion.readers.observations import Context, Observation
from replay.motion.readers.predictions import choose_individual, weight_of

NAME = "sleap"


def recognises(text: str) -> bool:
    """A heading with ``frame_idx``."""
    first = next((line for line in text.split("\n") if line.strip()), "")
    return "frame_idx" in first.casefold().split(",")


def read(path: Path, context: Context) -> list[Observation]:
    """Read one track's nodes; a node's score becomes its weight.

    Raises
    ------
    InputError
        Nodes without coordinates, several tracks and none named, frames that are no whole numbers.
    """
    rows = rows_of(path)
    line, heading = rows[0]
    where = {title: index for index, title in enumerate(heading)}
    nodes = [title[:-2] for title in heading if title.endswith(".x")]
    lacking = [node for node in nodes if f"{node}.y" not in where]
    if "frame_idx" not in where or not nodes or lacking or len(where) != len(heading):
        raise InputError(
            path,
            f"node {lacking[0]!r} has no .y" if lacking else "the heading is not that of a SLEAP analysis",
            line=line,
            expected="track, frame_idx, instance.score, then <node>.x, <node>.y, <node>.score",
            mend="export it again (Export Analysis CSV)",
        )
    for number, row in rows[1:]:
        if len(row) != len(heading):
            found = f"{len(row)} cells where the heading has {len(heading)}"
            raise InputError(path, found, line=number, mend="complete the row or remove it")
    track = where.get("track")
    chosen = choose_individual(path, [row[track] for _, row in rows[1:]] if track is not None else [""], context)
    out = []
    for number, row in rows[1:]:
        if track is not None and row[track] != chosen:
            continue
        frame = number_at(path, row[where["frame_idx"]], number, "frame_idx")
        if frame != round(frame):
            raise InputError(path, f"{frame:g} is no frame", line=number, column="frame_idx", expected="a whole number")
        for node in nodes:
            x, y = row[where[f"{node}.x"]], row[where[f"{node}.y"]]
            if not x or not y or "nan" in (x.casefold(), y.casefold()):
                continue
            score = row[where[f"{node}.score"]] if f"{node}.score" in where else "1"
            weight = weight_of(path, score, number, f"{node}.score", context)
            if weight is not None:
                u, v = number_at(path, x, number, f"{node}.x"), number_at(path, y, number, f"{node}.y")
                out.append(Observation(round(frame), node, u, v, weight, number))
    return out
