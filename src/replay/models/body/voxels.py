"""Voxel hexes inside a posed skin, parted where two segments merely touch.

Whether a point is inside is read off signed crossings along vertical lines: the winding number, which is right also
where a bent skin overlaps itself. A cell is kept where most of its sample points are inside, or a bone passes. Cells of
two segments share nodes only near the joint between them: an arm that lies against the trunk is not grown to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from replay.models.cubed_sphere import HEX_CORNERS

#: Samples along an edge of a cell, and their share inside above which a cell is kept.
_SAMPLES, KEPT_SHARE = 3, 0.5
_CORNERS = ((HEX_CORNERS + 1) // 2).astype(np.int64)


@dataclass(frozen=True)
class Grid:
    """Cubic cells.

    Parameters
    ----------
    origin : (3,)
        Corner of cell (0, 0, 0) [m].
    step_m
        Edge of a cell [m].
    shape
        Numbers of cells.
    """

    origin: np.ndarray
    step_m: float
    shape: tuple[int, int, int]

    @classmethod
    def around(cls, points: np.ndarray, step_m: float) -> Grid:
        """Grid about points, with a cell to spare and a plane of nodes at y = 0."""
        low = np.floor(points.min(axis=0) / step_m) - 1
        high = np.ceil(points.max(axis=0) / step_m) + 1
        a, b, c = (high - low).astype(int).tolist()
        return cls(low * step_m, step_m, (a, b, c))

    def centres(self, cells: np.ndarray) -> np.ndarray:
        """Centres of cells (m, 3) [m]."""
        return self.origin + (cells + 0.5) * self.step_m


def filled_share(grid: Grid, points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Share of each cell's sample points inside a closed skin, an array of the grid's shape."""
    nx, ny, nz = (n * _SAMPLES for n in grid.shape)
    fine = grid.step_m / _SAMPLES
    # scaled so that samples lie at whole numbers
    place = (points - grid.origin) / fine - 0.5
    column, height, sign = crossings(place, triangles, nx, ny)
    # a crossing counts for all samples above it
    level = np.clip(np.ceil(height).astype(np.int64), 0, nz)
    steps = np.bincount(column * (nz + 1) + level, weights=sign, minlength=nx * ny * (nz + 1))
    winding = np.cumsum(steps.reshape(nx, ny, nz + 1), axis=2)[:, :, :nz]
    inside = np.round(winding) > 0
    cells = inside.reshape(grid.shape[0], _SAMPLES, grid.shape[1], _SAMPLES, grid.shape[2], _SAMPLES)
    return cells.mean(axis=(1, 3, 5))


def crossings(points: np.ndarray, triangles: np.ndarray, nx: int, ny: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where vertical lines at whole numbers (x, y) pass triangles.

    An edge is judged alike by both triangles that share it, so that no line slips through: the line moved by the
    same vanishing amount for all.

    Parameters
    ----------
    points
        (n, 3) in units of the spacing of lines.
    triangles
        (m, 3).
    nx, ny
        Lines along x and y, from 0.

    Returns
    -------
    tuple
        Line ``x * ny + y``, height, and +1 where a line enters from below, -1 where it leaves, each (k,).
    """
    corner = points[triangles]
    low = np.clip(np.ceil(corner[:, :, :2].min(axis=1)).astype(np.int64), 0, None)
    high = np.minimum(np.floor(corner[:, :, :2].max(axis=1)).astype(np.int64), [nx - 1, ny - 1])
    span = np.maximum(high - low + 1, 0)
    count = span[:, 0] * span[:, 1]
    tri = np.repeat(np.arange(len(triangles)), count)
    nth = np.arange(len(tri)) - np.repeat(np.cumsum(count) - count, count)
    x, y = low[tri, 0] + nth // span[tri, 1], low[tri, 1] + nth % span[tri, 1]
    sides = np.stack([_side(points, triangles[tri, k], triangles[tri, (k + 1) % 3], x, y) for k in range(3)])
    up = np.asarray((sides > 0).all(axis=0))
    hit = up | np.asarray((sides < 0).all(axis=0))
    tri, x, y = tri[hit], x[hit], y[hit]
    a, b, c = (corner[tri, k] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    u = ((x - a[:, 0]) * (c[:, 1] - a[:, 1]) - (y - a[:, 1]) * (c[:, 0] - a[:, 0])) / area
    v = ((b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (b[:, 1] - a[:, 1]) * (x - a[:, 0])) / area
    height = a[:, 2] + u * (b[:, 2] - a[:, 2]) + v * (c[:, 2] - a[:, 2])
    # a face that looks up is left by a line that rises
    return x * ny + y, height, np.where(up[hit], -1.0, 1.0)


def _side(points: np.ndarray, first: np.ndarray, second: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """On which side of an edge a line passes, +1 or -1; computed from the lower to the higher row."""
    flip = first > second
    a, b = points[np.where(flip, second, first)], points[np.where(flip, first, second)]
    dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
    side = np.sign(dx * (y - a[:, 1]) - dy * (x - a[:, 0]))
    side = np.where(side == 0, np.sign(-dy), side)  # the line moved a little along x
    side = np.where(side == 0, np.sign(dx), side)
    return np.where(flip, -side, side)


def parted_mesh(
    grid: Grid, cells: np.ndarray, together: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hexes of cells; neighbours share nodes only if they belong together.

    Parameters
    ----------
    grid
        The grid.
    cells
        Indices (m, 3).
    together
        For rows of `cells` of pairs of neighbours, (k,) and (k,): which of them are grown together, (k,) bool.

    Returns
    -------
    tuple
        Nodes (n, 3) [m], hexes (m, 8), and the connected piece that each cell belongs to, (m,).
    """
    shape = np.array(grid.shape)
    row = np.full(grid.shape, -1)
    row[tuple(cells.T)] = np.arange(len(cells))
    links: list[np.ndarray] = []
    pairs: list[np.ndarray] = []
    for axis in range(3):
        inside = np.flatnonzero(cells[:, axis] + 1 < shape[axis])
        other = row[tuple((cells[inside] + np.eye(3, dtype=int)[axis]).T)]
        here, there = inside[other >= 0], other[other >= 0]
        grown = together(here, there)
        here, there = here[grown], there[grown]
        pairs.append(np.stack([here, there]))
        for corner in range(8):
            if _CORNERS[corner, axis] == 1:
                twin = int(np.flatnonzero((_CORNERS[corner] - np.eye(3, dtype=int)[axis] == _CORNERS).all(axis=1))[0])
                links.append(np.stack([8 * here + corner, 8 * there + twin]))
    slots, node = _pieces(8 * len(cells), np.concatenate(links, axis=1))
    hexes = node.reshape(-1, 8)
    nodes = np.empty((slots, 3))
    nodes[hexes] = grid.origin + (cells[:, None] + _CORNERS[None]) * grid.step_m
    return nodes, hexes, _pieces(len(cells), np.concatenate(pairs, axis=1))[1]


def _pieces(count: int, links: np.ndarray) -> tuple[int, np.ndarray]:
    graph = coo_matrix((np.ones(links.shape[1], np.int8), (links[0], links[1])), shape=(count, count))
    pieces, label = connected_components(graph, directed=False)
    # numbered by first appearance, whatever the library does
    _, first, back = np.unique(label, return_index=True, return_inverse=True)
    return pieces, np.argsort(np.argsort(first))[back]
