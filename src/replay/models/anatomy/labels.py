"""Grey matter, white matter or fluid at a place of the brain: labels on a 2 mm grid, left being the mirror of right."""

from __future__ import annotations

import zlib
from enum import IntEnum

import numpy as np

LABEL_STEP_MM = 2


class Tissue(IntEnum):
    """What fills a place inside the head's brain surface."""

    OUTSIDE = 0
    GREY = 1
    WHITE = 2
    FLUID = 3


def pack_labels(tissue: np.ndarray) -> tuple[np.ndarray, tuple[int, int, int]]:
    """Every second voxel of 1 mm labels as compressed bytes, and the shape of what was packed.

    Parameters
    ----------
    tissue : (nx, ny, nz) uint8
        `Tissue` values.
    """
    step = LABEL_STEP_MM
    thin = np.ascontiguousarray(tissue[::step, ::step, ::step])
    a, b, c = thin.shape
    return np.frombuffer(zlib.compress(thin.tobytes(), 9), np.uint8), (a, b, c)


class LabelVolume:
    """Labels that can be asked.

    Parameters
    ----------
    packed, shape
        From `pack_labels`.
    origin_mm
        MNI coordinates of the first label.
    step_mm
        Grid spacing.
    """

    def __init__(self, packed: np.ndarray, shape: tuple[int, ...], origin_mm: np.ndarray, step_mm: float) -> None:
        self._labels = np.frombuffer(zlib.decompress(packed.tobytes()), np.uint8).reshape(shape)
        self._origin, self._step = np.asarray(origin_mm, float), float(step_mm)

    def at(self, points_mm: np.ndarray) -> np.ndarray:
        """Labels of the nearest grid points of MNI coordinates (..., 3) [mm]; outside the grid `Tissue.OUTSIDE`."""
        index = np.rint((points_mm - self._origin) / self._step).astype(np.int64)
        within = ((index >= 0) & (index < np.array(self._labels.shape))).all(axis=-1)
        found = self._labels[tuple(np.where(within[..., None], index, 0).reshape(-1, 3).T)].reshape(within.shape)
        return np.where(within, found, Tissue.OUTSIDE)
