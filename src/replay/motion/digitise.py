"""Clicks of a whole clip from a video and a few clicks of its landmarks."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from replay.errors import InputError
from replay.motion.readers.clicks import read as read_clicks
from replay.motion.readers.observations import Context
from replay.motion.tracking import Digitised, Following, Seeds, follow
from replay.motion.tracks import DIGITISED
from replay.motion.video import Video, examine_video, read_frames

LARGEST_CLIP_BYTES = 3 << 30
"""Grey pictures that are held at once."""


def digitise(
    video: Path, seeds: Path, *, first: int | None = None, last: int | None = None, how: Following | None = None
) -> tuple[Digitised, Video]:
    """Follow the landmarks of a click table through a video.

    Parameters
    ----------
    video
        The file.
    seeds
        Click table: each landmark at least once; where it is lost, once more.
    first, last
        Frames to digitise; default from the first click to the last, or to the video's end where all are in one frame.
    how
        How landmarks are followed.

    Raises
    ------
    InputError, InputErrors
        A video or table that cannot be used, clicks outside the frames or the picture.
    """
    facts = examine_video(video)
    width, height = facts.image_size
    clicks = read_clicks(seeds, Context(facts.fps, (width, height)))
    frames = [click.frame for click in clicks]
    begin = min(frames) if first is None else first
    end = (max(frames) if max(frames) > min(frames) else facts.frames - 1) if last is None else last
    if not 0 <= begin < end < facts.frames:
        raise InputError(
            video,
            f"frames {begin} to {end} are not in the video",
            expected=f"0 <= first < last <= {facts.frames - 1}",
            mend="choose frames of the video; they are counted from 0",
        )
    if (end - begin + 1) * width * height > LARGEST_CLIP_BYTES:
        most = LARGEST_CLIP_BYTES // (width * height)
        found = f"{end - begin + 1} frames of {width} x {height} px are too many to hold"
        raise InputError(video, found, expected=f"at most {most}", mend="choose fewer frames around the impact")
    wanted: dict[str, dict[int, tuple[float, float]]] = {}
    for click in clicks:
        inside = 0.0 <= click.u_px <= width - 1.0 and 0.0 <= click.v_px <= height - 1.0
        if not inside or not begin <= click.frame <= end:
            raise InputError(
                seeds,
                f"the click ({click.u_px:g}, {click.v_px:g}) px in frame {click.frame} lies outside",
                line=click.line,
                expected=f"frames {begin} to {end} of {width} x {height} px",
                mend="correct the click, or the frames that are asked for",
            )
        if click.frame in wanted.setdefault(click.landmark, {}):
            found = f"landmark {click.landmark} is clicked twice in frame {click.frame}"
            raise InputError(seeds, found, line=click.line, mend="remove one of the two rows")
        wanted[click.landmark][click.frame] = click.u_px, click.v_px
    seeds_by_name: Seeds = wanted
    return follow(read_frames(video, begin, end), begin, seeds_by_name, how), facts


def write_digitised(path: Path, found: Digitised, click_sigma_px: float) -> None:
    """Write the click table of followed landmarks, atomically."""
    rows, columns = np.nonzero(np.isfinite(found.sigma_px))
    weight = found.weight(click_sigma_px)
    DIGITISED.write(
        path,
        {
            "frame": found.frames[rows],
            "landmark_id": [found.names[j] for j in columns],
            "u_px": np.round(found.pixels[rows, columns, 0], 3),
            "v_px": np.round(found.pixels[rows, columns, 1], 3),
            "weight": np.round(weight[rows, columns], 6),
            "sigma_px": np.round(found.sigma_px[rows, columns], 4),
            "source": ["click" if c else "followed" for c in found.clicked[rows, columns]],
        },
    )


def digitising_report(found: Digitised, video: Video) -> str:
    """What was followed how far and how well, what was lost where, and what to click next."""
    seen = np.isfinite(found.sigma_px)
    width, height = video.image_size
    clip = f"frames {found.frames[0]} to {found.frames[-1]} of {video.frames}"
    lines = [f"{clip}, {video.fps:.4g} frames per second, {width} x {height} px"]
    lines += [f"cut at frame {cut}: nothing can be followed across it" for cut in video.cuts if cut in found.frames[1:]]
    for j, name in enumerate(found.names):
        sigma = found.sigma_px[seen[:, j] & ~found.clicked[:, j], j]
        quality = f"noise {np.median(sigma):.2f} px, at most {sigma.max():.2f} px" if len(sigma) else "clicks only"
        lines.append(f"  {name:12s} {int(seen[:, j].sum()):4d} of {len(seen)} frames   {quality}")
    for loss in found.losses:
        lines.append(f"  {loss.landmark} is lost in frame {loss.frame}, clicked in {loss.seed}: {loss.reason}")
    for name in dict.fromkeys(loss.landmark for loss in found.losses):
        frames = ", ".join(str(loss.frame) for loss in found.losses if loss.landmark == name)
        lines.append(f"  click {name} again next to frame {frames}, add the row to the seeds, and run again")
    return "\n".join(lines)
