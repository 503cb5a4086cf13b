"""What every reader gives, and how its rows become the tracks of a clip."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from replay.errors import InputError, InputErrors
from replay.motion.tracks import Tracks

LONGEST_CLIP_FRAMES = 20_000
"""More frames than any play has: a frame number beyond is a mistake."""
LARGEST_GAP_FRAMES = 2
FEWEST_FRAMES = 5
_MOST_ERRORS = 20


@dataclass(frozen=True)
class Observation:
    """One landmark in one frame.

    Parameters
    ----------
    frame
        Frame of the video.
    landmark
        The name in the file.
    u_px, v_px
        To the right and downward from the image's top left corner [px].
    weight
        In (0, 1]: a careful click's variance over this one's.
    line
        One-based line of the file, where there is one.
    """

    frame: int
    landmark: str
    u_px: float
    v_px: float
    weight: float = 1.0
    line: int | None = None


@dataclass(frozen=True)
class Context:
    """What a reader may need beyond its file.

    Parameters
    ----------
    fps
        Frame rate [Hz].
    size
        Width and height of the image [px].
    origin_px
        Where an export in user coordinates has its origin; None is the image's centre.
    individual
        Which animal or track of a file with several.
    least_likelihood
        Predictions below are left out.
    """

    fps: float
    size: tuple[float, float]
    origin_px: tuple[float, float] | None = None
    individual: str | None = None
    least_likelihood: float = 0.6
    names: dict[str, str] = field(default_factory=dict)
    ignore: tuple[str, ...] = ()

    @property
    def origin(self) -> tuple[float, float]:
        """Origin of user coordinates [px]."""
        return self.origin_px or (0.5 * self.size[0], 0.5 * self.size[1])


def assemble(
    path: Path, observations: Sequence[Observation], landmarks: Sequence[str], context: Context
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Arrays of named landmarks, every row checked.

    Returns
    -------
    frames
        ``(k,)`` consecutive.
    pixels
        ``(k, n, 2)`` [px], NaN where not seen.
    weight
        ``(k, n)``.

    Raises
    ------
    InputError, InputErrors
        No rows, unknown landmarks, a landmark twice in a frame, positions far outside the image, frames that
        no play has.
    """
    errors: list[InputError] = []
    where: dict[tuple[int, str], int | None] = {}
    kept: list[Observation] = []
    width, height = context.size
    for seen in observations:
        name = context.names.get(seen.landmark, seen.landmark)
        if seen.landmark in context.ignore:
            continue
        if name not in landmarks:
            errors.append(_unknown(path, seen, name, landmarks))
        elif (seen.frame, name) in where:
            first = where[seen.frame, name]
            errors.append(
                InputError(
                    path,
                    f"landmark {name} is clicked twice in frame {seen.frame}"
                    + (f" (first in line {first})" if first else ""),
                    line=seen.line,
                    column="landmark_id",
                    expected="one click of each landmark in a frame",
                    mend="remove one of the two rows, or rename one of two tracks of one name",
                )
            )
        where.setdefault((seen.frame, name), seen.line)
        if not (-0.5 * width <= seen.u_px <= 1.5 * width and -0.5 * height <= seen.v_px <= 1.5 * height):
            errors.append(
                InputError(
                    path,
                    f"the click ({seen.u_px:g}, {seen.v_px:g}) px lies far outside the image of "
                    f"{width:g} x {height:g} px",
                    line=seen.line,
                    column="u_px, v_px",
                    expected="pixels from the top left corner, v downward",
                    mend="check the coordinate origin of the export, and image_size in the camera file",
                )
            )
        kept.append(Observation(seen.frame, name, seen.u_px, seen.v_px, seen.weight, seen.line))
    raise_all(errors)
    if not kept:
        raise InputError(path, "holds no track of a landmark", expected=", ".join(landmarks), mend="name the tracks")
    first, last = min(o.frame for o in kept), max(o.frame for o in kept)
    if last - first >= LONGEST_CLIP_FRAMES:
        far = max(kept, key=lambda o: abs(o.frame))
        raise InputError(
            path,
            f"the frames run from {first} to {last}",
            line=far.line,
            column="frame",
            expected=f"one clip of less than {LONGEST_CLIP_FRAMES} frames",
            mend="correct the frame number",
        )
    frames = np.arange(first, last + 1)
    pixels = np.full((len(frames), len(landmarks), 2), np.nan)
    weight = np.ones(pixels.shape[:2])
    index = {name: i for i, name in enumerate(landmarks)}
    for seen in kept:
        at = seen.frame - first, index[seen.landmark]
        pixels[at] = seen.u_px, seen.v_px
        weight[at] = seen.weight
    return frames, pixels, weight


def _unknown(path: Path, seen: Observation, name: str, landmarks: Sequence[str]) -> InputError:
    close = difflib.get_close_matches(name, landmarks, n=1)
    return InputError(
        path,
        f"landmark {name!r} is not in the template",
        line=seen.line,
        column="landmark_id",
        expected=f"one of {', '.join(landmarks)}",
        mend=f"did you mean {close[0]}?" if close else "correct the name or add it to the template",
    )


def refuse_gaps(path: Path, tracks: Tracks) -> None:
    """Refuse clips that no pose can bridge.

    Raises
    ------
    InputError
        Too few frames, or frames with fewer than three landmarks at an end or in a row.
    """
    enough = tracks.seen.sum(axis=1) >= 3
    if len(tracks.frames) < FEWEST_FRAMES:
        raise InputError(
            path,
            f"{len(tracks.frames)} frames are too few to differentiate twice",
            expected=f"at least {FEWEST_FRAMES} consecutive frames",
            mend="click more frames around the impact",
        )
    run = 0
    for frame, good in zip(tracks.frames, enough):
        run = 0 if good else run + 1
        if run > LARGEST_GAP_FRAMES or (run and frame in (tracks.frames[0], tracks.frames[-1])):
            raise InputError(
                path,
                f"frame {frame} and its neighbours show fewer than 3 landmarks",
                column="frame",
                expected=f"3 landmarks a frame, at most {LARGEST_GAP_FRAMES} frames in a row without, none at the ends",
                mend="click these frames, or cut the clip there",
            )


def raise_all(errors: list[InputError]) -> None:
    """Raise what was found: one error as it is, several together."""
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(errors[:_MOST_ERRORS])
