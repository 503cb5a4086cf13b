"""Tracks as Kinovea exports them, in user coordinates and user time, to raw pixels and frames.

Without calibration and with the default coordinate system the unit is px, the origin the image's centre and y points
up: u = u0 + X, v = v0 - Y.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from replay.errors import InputError
from replay.motion.readers.numerals import Stamp, frames_of
from replay.motion.readers.observations import Context, Observation

_PIXELS = ("", "px", "pixel", "pixels")


@dataclass(frozen=True)
class Row:
    """One point of a track, user coordinates."""

    x: float
    y: float
    time: Stamp
    line: int | None


@dataclass(frozen=True)
class Block:
    """One exported track: its name, its unit of length (empty where the file states none), its rows."""

    name: str
    unit: str
    rows: list[Row] = field(default_factory=list)
    line: int | None = None


def to_pixels(path: Path, blocks: list[Block], context: Context) -> list[Observation]:
    """Raw pixels and frames of exported tracks.

    Raises
    ------
    InputError
        Calibrated coordinates; tracks that start at their own zero (Kinovea 0.8 without a coordinate system);
        times that are no frames.
    """
    wanted = [block for block in blocks if block.rows and block.name not in context.ignore]
    for block in wanted:
        if block.unit.casefold() not in _PIXELS:
            raise InputError(
                path,
                f"track {block.name!r} is in {block.unit}",
                line=block.line,
                expected="pixels: a camera model needs where in the image a point is seen",
                mend="remove the calibration in Kinovea and export again, or give the .kva, which keeps raw pixels",
            )
    if len(wanted) > 1 and all(block.rows[0].x == 0.0 == block.rows[0].y for block in wanted):
        raise InputError(
            path,
            f"all {len(wanted)} tracks start at (0, 0): each counts from its own first point",
            line=wanted[0].rows[0].line,
            expected="one origin for all tracks",
            mend="set a coordinate system in Kinovea before exporting, or give the .kva, which keeps raw pixels",
        )
    u0, v0 = context.origin
    stamps = [row.time for block in wanted for row in block.rows]
    if not stamps:
        return []
    frames = iter(frames_of(path, stamps, context.fps))
    return [
        Observation(next(frames), block.name, u0 + row.x, v0 - row.y, line=row.line)
        for block in wanted
        for row in block.rows
    ]
