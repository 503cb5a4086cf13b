"""Readers of tracks: one file a format, all giving `Observation` rows; which one is told by the file's contents.

To add one: a module with `NAME`, `recognises` and `read` as in `replay.motion.readers.sleap`, and its place in
`READERS` (docs/reconstruction.md has a worked example).
"""

from replay.motion.readers.observations import Context, Observation, assemble
from replay.motion.readers.registry import READERS, Reading, read_tracks

__all__ = ["READERS", "Context", "Observation", "Reading", "assemble", "read_tracks"]
