"""Kinovea's own annotation file ``.kva``, 2.x and 0.8 (formats 1.x and 2.0): raw pixels, points as decimal marks.

A track point's text is ``x;y;t`` with the origin at the top left and y down; t counts time stamps, so that the
frame is ``round((t - FirstTimeStamp) / AverageTimeStampsPerFrame)``. Files before Kinovea 0.8.27 count from the track's
own start, ``TimePosition``: told by a first point at 0 in a track that starts later.
"""

from __future__ import annotations

from pathlib import Path

from replay.errors import InputError
from replay.motion.readers.markup import Node, parse
from replay.motion.readers.numerals import number_at
from replay.motion.readers.observations import Context, Observation

NAME = "kva"
_ROOT = "KinoveaVideoAnalysis"
_LISTS = (("TrackPointList", "TrackPoint"), ("TrackPositionList", "TrackPosition"))


def recognises(text: str) -> bool:
    """An XML file whose root is Kinovea's."""
    return f"<{_ROOT}" in text[:4000]


def read(path: Path, context: Context) -> list[Observation]:
    """Read every track.

    Raises
    ------
    InputError
        Another root, no time base, no tracks, points that are no points, an image of another size than the
        camera file's.
    """
    root = parse(path)
    if root.tag != _ROOT:
        raise InputError(path, f"the root element is {root.tag}", line=root.line, expected=_ROOT)
    ticks = number_at(path, root.value("AverageTimeStampsPerFrame"), root.line, "AverageTimeStampsPerFrame")
    first = number_at(path, root.value("FirstTimeStamp"), root.line, "FirstTimeStamp")
    if ticks <= 0.0:
        raise InputError(
            path,
            f"a frame lasts {ticks:g} time stamps",
            line=root.line,
            column="AverageTimeStampsPerFrame",
            expected="more than 0",
            mend="save the annotations again from Kinovea",
        )
    _refuse_other_size(path, root, context)
    out: list[Observation] = []
    for track in root.all("Track"):
        out += _track(path, track, first, ticks)
    if not out:
        raise InputError(
            path,
            "holds no track",
            expected="trajectories named after the landmarks",
            mend="track each landmark (Track path), name the track after it, and save again",
        )
    return out


def _refuse_other_size(path: Path, root: Node, context: Context) -> None:
    node = root.find("ImageSize")
    if node is None:
        return
    width, _, height = node.text.strip().partition(";")
    size = tuple(number_at(path, part, node.line, "ImageSize") for part in (width, height))
    if size != tuple(context.size):
        raise InputError(
            path,
            f"the image is {size[0]:g} x {size[1]:g} px",
            line=node.line,
            column="ImageSize",
            expected=f"{context.size[0]:g} x {context.size[1]:g} px, as the camera file says",
            mend="correct image_size and principal_point in the camera file, or load the right video in Kinovea",
        )


def _track(path: Path, track: Node, first: float, ticks: float) -> list[Observation]:
    label = track.find("MainLabel") or track.find("Label")
    name = track.attributes.get("name") or (label.attributes.get("Text") or label.value("Text") if label else "")
    points = next((list(track.all(point)) for outer, point in _LISTS if track.find(outer)), [])
    rows = []
    for point in points:
        parts = point.text.strip().split(";")
        if len(parts) < 3:
            raise InputError(
                path,
                f"the point {point.text.strip()[:40]!r} of track {name!r} is no x;y;t",
                line=point.line,
                expected="three numbers between semicolons",
                mend="save the annotations again from Kinovea",
            )
        u, v, t = (number_at(path, part, point.line, f"track {name}") for part in parts[:3])
        rows.append((u, v, t, point.line))
    start = track.value("TimePosition")
    relative = 0.0
    if rows and start and rows[0][2] == 0.0:
        relative = number_at(path, start, track.line, "TimePosition")
    return [
        Observation(_frame(path, t + relative, first, ticks, line), name.strip(), u, v, line=line)
        for u, v, t, line in rows
    ]


def _frame(path: Path, t: float, first: float, ticks: float, line: int) -> int:
    at = (t - first) / ticks
    if abs(at) > 1e9:
        raise InputError(path, f"the time stamp {t:g} is frame {at:.4g}", line=line, expected="a frame of the video")
    return round(at)
