"""The equiangular cubed sphere: a cube's lattice whose surface is blown up to directions of nearly equal spacing.

Ronchi, Iacono and Paolucci, "The cubed sphere" (J. Comput. Phys. 124, 1996): on each face the two angles, not
the two tangents, are spaced evenly. Eight points meet three quads, all others four; there is no pole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Node order of a hexahedron: corner signs along the three axes.
HEX_CORNERS = np.array(
    [
        [-1, -1, -1],
        [1, -1, -1],
        [1, 1, -1],
        [-1, 1, -1],
        [-1, -1, 1],
        [1, -1, 1],
        [1, 1, 1],
        [-1, 1, 1],
    ]
)


@dataclass(frozen=True)
class CubeLattice:
    """A cube of ``n**3`` cells and its surface.

    Parameters
    ----------
    divisions
        Cells along an edge, n; even, so that the mid-sagittal plane is a plane of faces.
    cube
        Lattice points in [-1, 1]^3, ((n+1)^3, 3).
    cells
        Hexes of the cube, rows of `cube`, (n^3, 8).
    surface
        Rows of `cube` that lie on its surface, (s,).
    surface_cube
        ``cube[surface]``, (s, 3): where a surface point is on the cube.
    directions
        Unit vectors of the surface points, (s, 3).
    quads
        Surface quads, indices into `surface`, (q, 4), counter-clockwise seen from outside.
    """

    divisions: int
    cube: np.ndarray
    cells: np.ndarray
    surface: np.ndarray
    surface_cube: np.ndarray
    directions: np.ndarray
    quads: np.ndarray

    @property
    def quad_centres(self) -> np.ndarray:
        """Centres of the surface quads on the cube, (q, 3); one coordinate is exactly +-1."""
        return np.round(self.surface_cube[self.quads].mean(axis=1), 9)

    def mirrored(self) -> np.ndarray:
        """Surface point that is the image of each across the plane y = 0, (s,)."""
        n = self.divisions
        key = np.rint((self.surface_cube + 1.0) * n / 2).astype(np.int64)
        flipped = key * [1, -1, 1] + [0, n, 0]
        weight = np.array([(n + 1) ** 2, n + 1, 1])
        order = np.argsort(key @ weight, kind="stable")
        return order[np.searchsorted((key @ weight)[order], flipped @ weight)]


def directions_of(cube_points: np.ndarray) -> np.ndarray:
    """Unit directions of points on the cube's surface, equiangular.

    Parameters
    ----------
    cube_points
        (n, 3) with max |component| = 1.
    """
    tangents = np.tan(np.pi / 4 * cube_points)
    return tangents / np.sqrt(np.einsum("ij,ij->i", tangents, tangents))[:, None]


def cube_lattice(divisions: int) -> CubeLattice:
    """Build the lattice.

    Parameters
    ----------
    divisions
        Cells along an edge, even and at least 2.

    Raises
    ------
    ValueError
        When `divisions` is odd or below 2.
    """
    n = divisions
    if n < 2 or n % 2:
        message = f"{n} divisions: an even number of at least 2 puts faces on the mid-sagittal plane"
        raise ValueError(message)
    index = np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    grid = np.stack(np.meshgrid(*(np.arange(n + 1),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cube = (2 * grid - n) / n
    shift = (HEX_CORNERS + 1) // 2
    cells = np.stack([index[i : n + i, j : n + j, k : n + k].reshape(-1) for i, j, k in shift], axis=1)
    surface = np.flatnonzero((np.abs(2 * grid - n) == n).any(axis=1))
    row = np.full(len(cube), -1)
    row[surface] = np.arange(len(surface))
    quads = []
    for axis in range(3):
        for end in (0, n):
            face = np.take(index, end, axis=axis)
            quad = np.stack([face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]], axis=-1).reshape(-1, 4)
            a, b = cube[quad[0, 1]] - cube[quad[0, 0]], cube[quad[0, 3]] - cube[quad[0, 0]]
            outward = np.cross(a, b)[axis] * (1 if end else -1) > 0
            quads.append(quad if outward else quad[:, ::-1])
    return CubeLattice(
        divisions=n,
        cube=cube,
        cells=cells,
        surface=surface,
        surface_cube=cube[surface],
        directions=directions_of(cube[surface]),
        quads=row[np.vstack(quads)],
    )


def inflated_core(lattice: CubeLattice, roundness: float = 0.45, size: float = 1.2) -> np.ndarray:
    """Points of the lattice as a cube inflated towards the unit ball, ((n+1)^3, 3).

    The surface lies between the inscribed cube and the sphere: a full sphere would flatten the hexes along
    its edges, a plain cube would crush the layers over its corners.

    Parameters
    ----------
    lattice
        The lattice.
    roundness
        Weight of the sphere at the surface, falling linearly to 0 at the centre.
    size
        Half diagonal of the plain cube over the sphere's radius.
    """
    reach = np.abs(lattice.cube).max(axis=1)
    ball = np.zeros_like(lattice.cube)
    off = reach > 0
    ball[off] = directions_of(lattice.cube[off] / reach[off, None]) * reach[off, None]
    plain = lattice.cube * size / np.sqrt(3.0)
    weight = (roundness * reach)[:, None]
    return (1 - weight) * plain + weight * ball
