"""Numbers and times as other programs print them: points or commas, time codes, times without a unit."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from replay.errors import InputError

_NUMBER = re.compile(r"[+-]?[0-9]{1,15}(?:[.,][0-9]{1,20})?(?:[eE][+-]?[0-9]{1,2})?")
_TIMECODE = re.compile(r"(-?)([0-9]{1,3}):([0-9]{1,2}):([0-9]{1,2})(?:[:.,]([0-9]{1,6}))?")
_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_STEP_TOLERANCE = 0.05
_FARTHEST_FROM_A_FRAME = 0.45


def number(text: str) -> float:
    """A finite number with a decimal point or comma, without thousands separators; NaN where it is none."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        return math.nan
    return float(text.replace(",", "."))


def number_at(path: Path, text: str, line: int | None, column: str) -> float:
    """As `number`, an error where it is none.

    Raises
    ------
    InputError
        Naming the place.
    """
    value = number(text)
    if not math.isfinite(value):
        raise InputError(
            path,
            f"{_shown(text)} is not a number",
            line=line,
            column=column,
            expected="a number with one decimal mark and no thousands separator",
            mend="correct it, or export the file again",
        )
    return value


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")


@dataclass(frozen=True)
class Stamp:
    """A time as the file has it: a number, or seconds of a time code; its decimals, its text and line for messages."""

    value: float
    is_code: bool
    decimals: int
    text: str
    line: int | None


def stamp_at(path: Path, text: str, line: int | None) -> Stamp:
    """Read a time.

    Raises
    ------
    InputError
        Neither a number nor hours:minutes:seconds.
    """
    text = text.strip()
    code = _TIMECODE.fullmatch(text)
    if code:
        sign, hours, minutes, seconds, fraction = code.groups()
        value = 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds)
        if fraction:
            value += int(fraction) / 10.0 ** len(fraction)
        return Stamp(-value if sign else value, True, len(fraction or ""), text, line)
    value = number(text)
    if not math.isfinite(value):
        raise InputError(
            path,
            f"{_shown(text)} is no time",
            line=line,
            column="time",
            expected="a number, or hours:minutes:seconds:hundredths",
            mend="export the file again",
        )
    return Stamp(value, False, len(re.split("[.,]", text)[1]) if re.search("[.,]", text) else 0, text, line)


def frames_of(path: Path, stamps: Sequence[Stamp], fps: float) -> list[int]:
    """Frame numbers of times whose unit the file does not state.

    The unit is the one of seconds, milliseconds, microseconds and frames in which the commonest step is a whole
    number of frames; where none is, where a time falls between two frames, or where the last decimal is coarser than
    half a frame (programs cut decimals off as often as they round), the file is refused rather than guessed.

    Raises
    ------
    InputError
        Steps that fit no unit; times between frames; frame numbers that no video has.
    """
    values = np.array([stamp.value for stamp in stamps])
    if any(stamp.is_code for stamp in stamps):
        scale = fps
    else:
        steps = np.diff(np.unique(values))
        scale = _scale(path, float(np.median(steps)) if len(steps) else 0.0, fps, stamps[0].line)
    coarseness = 10.0 ** -max(stamp.decimals for stamp in stamps)
    if coarseness * scale > 0.5 and scale != 1.0:
        raise InputError(
            path,
            f"times are given to {coarseness:g}, frames are {1.0 / scale:.3g} apart",
            line=stamps[0].line,
            column="time",
            expected="times that tell one frame from the next",
            mend="choose milliseconds or frames as Kinovea's time format, or give the .kva, which keeps the frames",
        )
    out = []
    for stamp in stamps:
        at = stamp.value * scale
        frame = round(at) if abs(at) < 1e9 else None
        if frame is None or abs(at - frame) > _FARTHEST_FROM_A_FRAME:
            raise InputError(
                path,
                f"the time {stamp.text} lies between two frames at {fps:g} frames per second",
                line=stamp.line,
                column="time",
                expected="times of frames",
                mend="check fps in the camera file, or export a .kva, which keeps the frames themselves",
            )
        out.append(frame)
    return out


def _scale(path: Path, step: float, fps: float, line: int | None) -> float:
    if step <= 0.0:
        return fps
    for unit in _UNITS.values():
        frames = step * unit * fps
        if abs(frames - 1.0) <= max(_STEP_TOLERANCE, 0.0006 * fps if unit == 1.0 else 0.0):
            return unit * fps
    if step == 1.0:
        return 1.0
    raise InputError(
        path,
        f"the times step by {step:g}, which is no frame at {fps:g} frames per second in s, ms, us or frames",
        line=line,
        column="time",
        expected=f"steps of {1 / fps:.4g} s, {1e3 / fps:.4g} ms or 1 frame",
        mend="check fps in the camera file, or export a .kva, which keeps the frames themselves",
    )
