"""Readers of the article's clicks and landmark template; each names what it refuses by line."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from replay.errors import InputError, InputErrors
from replay.tables import Column, TableFormat

CLICKS = TableFormat(
    "click table",
    (
        Column("frame", "frame of the video", kind="int"),
        Column("landmark_id", "landmark of the template", kind="text", aliases=("landmark",)),
        Column("u_px", "click to the right from the image's left edge [px]", aliases=("u",)),
        Column("v_px", "click downward from the image's top edge [px]", aliases=("v",)),
    ),
)
"""Format of ``kinovea_clicks.csv``."""

TEMPLATE = TableFormat(
    "landmark template",
    (
        Column("landmark", "name", kind="text", aliases=("landmark_id",)),
        Column("X", "template x [m]", aliases=("X_m",)),
        Column("Y", "template y [m]", aliases=("Y_m",)),
        Column("Z", "template z [m]", aliases=("Z_m",)),
    ),
)
"""Format of ``helmet_landmarks.csv``."""

LARGEST_HELMET_M = 1.0
LARGEST_GAP_FRAMES = 2
FEWEST_FRAMES = 5
_MOST_ERRORS = 20


@dataclass(frozen=True)
class Template:
    """Landmarks of one helmet: names and ``(n, 3)`` points [m]."""

    names: tuple[str, ...]
    points_m: np.ndarray


@dataclass(frozen=True)
class Tracks:
    """Clicks of one clip.

    Parameters
    ----------
    frames
        ``(k,)`` consecutive frame numbers.
    pixels
        ``(k, n, 2)`` [px]; NaN where a landmark was not clicked.
    weight
        ``(k, n)`` in (0, 1]: a click's variance is that of a careful click over its weight. Default 1.
    """

    frames: np.ndarray
    pixels: np.ndarray
    weight: np.ndarray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.weight is None:
            object.__setattr__(self, "weight", np.ones(self.pixels.shape[:2]))

    def sigma_px(self, click_sigma_px: float) -> np.ndarray:
        """``(k, n)`` standard deviation of a click coordinate, where `click_sigma_px` is a careful click's [px]."""
        return click_sigma_px / np.sqrt(self.weight)

    @property
    def seen(self) -> np.ndarray:
        """``(k, n)`` whether a landmark was clicked in a frame."""
        return np.isfinite(self.pixels[..., 0])


def read_template(path: Path) -> Template:
    """Read ``helmet_landmarks.csv``.

    Raises
    ------
    InputError, InputErrors
        Missing columns or numbers, a name twice, fewer than three points, points on one line,
        an extent beyond a helmet's (millimetres).
    """
    frame = TEMPLATE.read(path)
    lines = frame.attrs["lines"]
    names = [str(name) for name in frame["landmark"]]
    errors = [
        InputError(
            path,
            f"landmark {name!r} is given twice (first in line {lines[names.index(name)]})",
            line=line,
            column="landmark",
            mend="keep one of the two rows",
        )
        for i, (name, line) in enumerate(zip(names, lines))
        if name in names[:i]
    ]
    points = frame[["X", "Y", "Z"]].to_numpy(dtype=float)
    extent = float(np.max(np.ptp(points, axis=0)))
    if len(points) < 3:
        errors.append(
            InputError(
                path,
                f"{len(points)} landmarks are too few for a pose",
                expected="at least 3, better 6",
                mend="measure more points of the helmet",
            )
        )
    elif extent > LARGEST_HELMET_M:
        unit = "millimetres" if extent > 100.0 else "centimetres" if extent > 10.0 else "another unit"
        errors.append(
            InputError(
                path,
                f"the landmarks extend over {extent:g} m, which looks like {unit}",
                line=lines[0],
                column="X, Y, Z",
                expected=f"metres: a helmet is less than {LARGEST_HELMET_M:g} m across",
                mend="divide the coordinates by 1000" if extent > 100.0 else "convert the coordinates to metres",
            )
        )
    elif np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] < 1e-3:
        errors.append(
            InputError(
                path,
                "all landmarks lie on one line (or in one point)",
                line=lines[0],
                expected="points that span a plane",
                mend="add a landmark off that line",
            )
        )
    _raise(errors)
    return Template(tuple(names), points)


def read_clicks(path: Path, template: Template, size: tuple[float, float]) -> Tracks:
    """Read ``kinovea_clicks.csv``.

    Parameters
    ----------
    path
        The table.
    template
        Landmarks that may be clicked.
    size
        Width and height of the image [px].

    Raises
    ------
    InputError, InputErrors
        Missing columns or numbers, unknown landmarks, a landmark twice in a frame, frames out of
        order, clicks far outside the image, gaps and frames with fewer than three landmarks that
        cannot be bridged.
    """
    table = CLICKS.read(path)
    lines = table.attrs["lines"]
    errors: list[InputError] = []
    where: dict[tuple[int, str], int] = {}
    latest = None
    width, height = size
    for line, frame, name, u, v in zip(lines, table["frame"], table["landmark_id"], table["u_px"], table["v_px"]):
        if name not in template.names:
            close = difflib.get_close_matches(name, template.names, n=1)
            errors.append(
                InputError(
                    path,
                    f"landmark {name!r} is not in the template",
                    line=line,
                    column="landmark_id",
                    expected=f"one of {', '.join(template.names)}",
                    mend=f"did you mean {close[0]}?" if close else "correct the name or add it to the template",
                )
            )
        elif (frame, name) in where:
            errors.append(
                InputError(
                    path,
                    f"landmark {name} is clicked twice in frame {frame} (first in line {where[frame, name]})",
                    line=line,
                    column="landmark_id",
                    expected="one click of each landmark in a frame",
                    mend="remove one of the two rows",
                )
            )
        where.setdefault((frame, name), line)
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
        if not (-0.5 * width <= u <= 1.5 * width and -0.5 * height <= v <= 1.5 * height):
            errors.append(
                InputError(
                    path,
                    f"the click ({u:g}, {v:g}) px lies far outside the image of {width:g} x {height:g} px",
                    line=line,
                    column="u_px, v_px",
                    expected="pixels from the top left corner, v downward",
                    mend="check the coordinate origin of the export, and image_size in the camera file",
                )
            )
    _raise(errors)
    frames = np.arange(int(table["frame"].min()), int(table["frame"].max()) + 1)
    pixels = np.full((len(frames), len(template.names), 2), np.nan)
    rows = table["frame"].to_numpy() - frames[0]
    columns = np.array([template.names.index(name) for name in table["landmark_id"]])
    pixels[rows, columns, 0] = table["u_px"]
    pixels[rows, columns, 1] = table["v_px"]
    tracks = Tracks(frames, pixels)
    _refuse_gaps(path, tracks)
    return tracks


def _refuse_gaps(path: Path, tracks: Tracks) -> None:
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


def _raise(errors: list[InputError]) -> None:
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(errors[:_MOST_ERRORS])
