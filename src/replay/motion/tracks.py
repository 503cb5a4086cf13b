"""Tracks of a clip, the formats of the article's two tables, and the reader of its landmark template."""

from __future__ import annotations

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

WEIGHTED_CLICKS = TableFormat(
    "click table with weights",
    (
        *CLICKS.columns,
        Column("weight", "variance of a careful click over this one's, above 0, at most 1"),
    ),
)
"""Format of ``kinovea_clicks.csv`` where clicks differ in worth."""

DIGITISED = TableFormat(
    "digitised clicks",
    (
        *WEIGHTED_CLICKS.columns,
        Column("sigma_px", "standard deviation that following adds to the click, per coordinate [px]"),
        Column("source", "click, or followed", kind="text"),
    ),
)
"""Format that ``replay digitize`` writes; a click table with two columns more."""

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
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(errors[:_MOST_ERRORS])
    return Template(tuple(names), points)
