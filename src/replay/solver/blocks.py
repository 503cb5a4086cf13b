"""Structured blocks of hexahedra: the meshes of verification problems, benchmarks and examples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def structured_block(
    counts: Sequence[int], lengths: Sequence[float], origin: Sequence[float] = (0.0, 0.0, 0.0)
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Mesh a box with equal hexahedra.

    Parameters
    ----------
    counts
        Elements along x, y, z.
    lengths, origin
        Edges and lowest corner of the box [m].

    Returns
    -------
    nodes : (n, 3) float64
        [m]; z runs fastest, then y, then x.
    hexes : (m, 8) int64
        In the solver's node order.

    Examples
    --------
    >>> nodes, hexes = structured_block((2, 1, 1), (2.0, 1.0, 1.0))
    >>> nodes.shape, hexes.shape
    ((12, 3), (2, 8))
    """
    lines = [o + np.linspace(0.0, length, count + 1) for o, length, count in zip(origin, lengths, counts)]
    nodes = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(len(nodes)).reshape([count + 1 for count in counts])
    low, high = slice(None, -1), slice(1, None)
    corners = (
        (low, low, low), (high, low, low), (high, high, low), (low, high, low),
        (low, low, high), (high, low, high), (high, high, high), (low, high, high),
    )  # fmt: skip
    return nodes, np.stack([index[c].ravel() for c in corners], axis=1).astype(np.int64)
