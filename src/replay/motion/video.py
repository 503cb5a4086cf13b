"""What a video file says of itself, and what in it a reconstruction cannot use: cuts, uneven frames, interlacing."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from replay.errors import InputError
from replay.files import sha256

LARGEST_FRAME_JITTER = 0.25
"""Share of the frame time by which an interval may differ: containers round time stamps, to 1 ms at worst."""
_ROUNDING_MS = 1.1
CUT_DISTANCE = 0.35
"""Share of the picture's grey levels that must change from one frame to the next, and twice as much as nearby."""
COMB_RATIO = 1.15
"""Neighbouring rows that differ more than rows of one field by this factor, where the picture moves."""
_BINS = 64


@dataclass(frozen=True)
class Video:
    """Facts of a video.

    Parameters
    ----------
    fps, image_size, frames
        Frame rate [Hz], width and height [px], and frames that can be decoded.
    sha256
        Of the file.
    cuts
        Frames at which the picture changes at once.
    """

    fps: float
    image_size: tuple[int, int]
    frames: int
    sha256: str
    cuts: tuple[int, ...]


def examine_video(path: Path, window: tuple[int, int] | None = None) -> Video:
    """Read a video through and refuse what has no frame rate of its own.

    Parameters
    ----------
    path
        The file.
    window
        First and last frame in which the picture is looked at for cuts and interlacing; default all.

    Raises
    ------
    InputError
        A file that OpenCV cannot open, frames at uneven times, interlaced pictures, a window beyond the last frame.
    """
    capture = _open(path)
    try:
        fps = float(capture.get(cv2.CAP_PROP_FPS))
        size = int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        times: list[float] = []
        histograms: list[np.ndarray] = []
        combs: list[float] = []
        before: np.ndarray | None = None
        first, last = window or (0, 1 << 40)
        while capture.grab():
            frame = len(times)
            times.append(float(capture.get(cv2.CAP_PROP_POS_MSEC)))
            if not first <= frame <= last:
                continue
            ok, picture = capture.retrieve()
            if not ok:
                break
            grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
            histograms.append(np.bincount(grey.ravel() // (256 // _BINS), minlength=_BINS) / grey.size)
            if before is not None:
                combs.append(_comb(before, grey))
            before = grey
    finally:
        capture.release()
    if not times:
        raise InputError(path, "holds no frame that can be decoded", mend="convert it to MP4 (H.264)")
    if window and last >= len(times):
        raise InputError(
            path,
            f"has {len(times)} frames, but tracks run to frame {last}",
            expected="tracks of this video, frames counted from 0",
            mend="check that the tracks belong to this video",
        )
    _refuse_uneven(path, np.sort(times), fps)  # the container hands them over in decoding order
    moving = [ratio for ratio in combs if ratio > 0.0]
    if len(moving) >= 3 and float(np.median(moving)) > COMB_RATIO:
        raise InputError(
            path,
            f"is interlaced: where the picture moves, neighbouring rows differ {np.median(moving):.2f} times as much "
            "as rows of one field",
            expected="one exposure a frame",
            mend="separate the fields (e.g. ffmpeg -vf bwdif=1), which also doubles the frame rate, and track again",
        )
    return Video(fps, size, len(times), sha256(path), tuple(int(first + at) for at in _cuts(histograms)))


def _open(path: Path) -> cv2.VideoCapture:
    if not path.is_file():
        raise InputError(path, "the file does not exist", mend="check the name and the folder")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        capture.release()
        found = "cannot be opened as a video"
        raise InputError(path, found, expected="a video OpenCV reads", mend="convert it to MP4 (H.264)")
    return capture


def read_frames(path: Path, first: int, last: int) -> list[np.ndarray]:
    """Grey pictures ``(height, width) uint8`` of frames `first` to `last`.

    Raises
    ------
    InputError
        A file that OpenCV cannot open, or that ends before.
    """
    capture = _open(path)
    out: list[np.ndarray] = []
    try:
        for frame in range(last + 1):
            if not capture.grab():
                break
            if frame >= first:
                out.append(cv2.cvtColor(capture.retrieve()[1], cv2.COLOR_BGR2GRAY))
    finally:
        capture.release()
    if len(out) <= last - first:
        raise InputError(
            path,
            f"ends after frame {first + len(out) - 1}",
            expected=f"frames {first} to {last}",
            mend="choose a window inside the video",
        )
    return out


def _refuse_uneven(path: Path, times_ms: np.ndarray, fps: float) -> None:
    steps = np.diff(times_ms)
    if len(steps) < 2:
        return
    usual = float(np.median(steps))
    off = np.abs(steps - usual)
    if usual <= 0.0 or off.max() > max(LARGEST_FRAME_JITTER * usual, _ROUNDING_MS):
        worst = int(np.argmax(off))
        raise InputError(
            path,
            f"has a variable frame rate: frame {worst + 1} comes after {steps[worst]:.2f} ms, the others after "
            f"{usual:.2f} ms",
            expected=f"one interval ({1e3 / fps:.2f} ms at the {fps:g} frames per second it states)",
            mend="take the original recording; converting to a constant rate repeats or drops frames and is no help",
        )


def _cuts(histograms: list[np.ndarray]) -> list[int]:
    """Indices of pictures whose grey levels are not those of the picture before."""
    jumps = np.array([0.5 * np.abs(b - a).sum() for a, b in itertools.pairwise(histograms)])
    out = []
    for i, jump in enumerate(jumps):
        near = np.concatenate([jumps[max(i - 4, 0) : i], jumps[i + 1 : i + 5]])
        if jump > CUT_DISTANCE and (len(near) == 0 or jump > 2.0 * near.max()):
            out.append(i + 1)
    return out


def _comb(before: np.ndarray, grey: np.ndarray) -> float:
    """How much more neighbouring rows differ than rows of one field, where the picture moves; 0 where it does not."""
    rows = grey.astype(np.int16)
    moves = np.abs(rows - before.astype(np.int16))[1:-1] > 20
    if moves.sum() < 0.0005 * grey.size:
        return 0.0
    across = np.abs(rows[:-2] + rows[2:] - 2 * rows[1:-1])[moves].mean()
    within = 2.0 * np.abs(rows[:-2] - rows[2:])[moves].mean()
    return float(across / max(within, 1.0))
