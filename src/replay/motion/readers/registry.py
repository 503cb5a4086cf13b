"""Which reader reads a file, and the tracks it gives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from replay.errors import InputError
from replay.files import read_text
from replay.motion.readers import clicks, deeplabcut, kinovea_csv, kinovea_txt, kinovea_xml, kva, sleap
from replay.motion.readers.observations import Context, Observation, assemble, refuse_gaps
from replay.motion.tracks import Template, Tracks


class Reader(Protocol):
    """A module that reads one format."""

    NAME: str
    recognises: Callable[[str], bool]
    read: Callable[[Path, Context], list[Observation]]


READERS: dict[str, Reader] = {
    module.NAME: module for module in (kva, kinovea_xml, kinovea_txt, kinovea_csv, deeplabcut, sleap, clicks)
}
"""Readers in the order in which they are asked; the article's table comes last and takes what is left."""


@dataclass(frozen=True)
class Reading:
    """Tracks of a file.

    Parameters
    ----------
    format
        Name of the reader.
    tracks
        Of the landmarks.
    static_px
        ``(k, m, 2)`` of the static points, in the frames of `tracks`; NaN where not seen.
    """

    format: str
    tracks: Tracks
    static_px: np.ndarray


def read_tracks(
    path: Path,
    template: Template,
    context: Context,
    *,
    format: str = "auto",
    static_points: Sequence[str] = (),
) -> Reading:
    """Read a file of tracks.

    Parameters
    ----------
    path
        The file.
    template
        Landmarks that may be seen.
    context
        Frame rate, image size, and what the play says of the file.
    format
        Name of a reader, or ``auto``: the first of `READERS` that recognises the file by its contents.
    static_points
        Names of tracks that stand still in the scene.

    Raises
    ------
    InputError, InputErrors
        Whatever cannot be used, by line.
    """
    text = read_text(path)
    name = format if format != "auto" else next(n for n, reader in READERS.items() if reader.recognises(text))
    both = sorted(set(static_points) & set(template.names))
    if both:
        raise InputError(path, f"{both[0]} is a landmark and a static point", mend="remove it from static_points")
    observations = READERS[name].read(path, context)
    frames, pixels, weight = assemble(path, observations, [*template.names, *static_points], context)
    n = len(template.names)
    used = np.isfinite(pixels[:, :n, 0]).any(axis=1)
    if not used.any():
        raise InputError(path, "holds no track of a landmark", expected=", ".join(template.names))
    clip = slice(int(np.argmax(used)), len(used) - int(np.argmax(used[::-1])))
    tracks = Tracks(frames[clip], pixels[clip, :n], weight[clip, :n])
    refuse_gaps(path, tracks)
    return Reading(name, tracks, pixels[clip, n:])
