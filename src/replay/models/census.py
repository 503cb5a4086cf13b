"""What kinds of elements a foreign mesh holds, and what is loose, double or folded in it.

Solids come as keyword files write them: eight or ten nodes; a wedge, a pyramid or a tetrahedron is a hex with
repeated nodes.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from replay.models.quality import EDGES, FACES

KINDS = ("hexahedron", "wedge", "pyramid", "tetrahedron", "collapsed")
_HEX, _WEDGE, _PYRAMID, _TET, _COLLAPSED = range(5)


def element_kinds(solids: np.ndarray) -> np.ndarray:
    """Kind of each solid, an index into `KINDS`, (m,).

    Told by distinct nodes and by what the six faces collapse to: a wedge has six nodes, two triangles and three
    quadrilaterals; a pyramid five, four and one; a tetrahedron four. Anything else is collapsed.

    Parameters
    ----------
    solids
        Rows of nodes, (m, 8) or (m, 10); -1 where there is no node (a ten-node tetrahedron uses all ten).
    """
    corners = solids[:, :8]
    nodes = _distinct(corners)
    sides = np.stack([_distinct(corners[:, face]) for face in FACES], axis=1)
    triangles, quads = (sides == 3).sum(axis=1), (sides == 4).sum(axis=1)
    kinds = np.full(len(solids), _COLLAPSED)
    kinds[(nodes == 8) & (quads == 6)] = _HEX
    kinds[(nodes == 6) & (triangles == 2) & (quads == 3)] = _WEDGE
    kinds[(nodes == 5) & (triangles == 4) & (quads == 1)] = _PYRAMID
    kinds[nodes == 4] = _TET
    if solids.shape[1] == 10:
        kinds[(solids[:, 8:] >= 0).all(axis=1)] = _TET
    return kinds


def as_hexes(solids: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """Solids as hexes with repeated nodes, (m, 8); a tetrahedron as n1 n2 n3 n3 n4 n4 n4 n4."""
    hexes = solids[:, :8].copy()
    for row in np.flatnonzero(kinds == _TET).tolist():
        n1, n2, n3, n4 = dict.fromkeys(solids[row, :8].tolist()).keys() if solids[row, -1] < 0 else solids[row, :4]
        hexes[row] = (n1, n2, n3, n3, n4, n4, n4, n4)
    return hexes


def skin_edges(hexes: np.ndarray) -> tuple[int, int]:
    """Faces that only one solid has, and edges of that skin where more than two of them meet.

    A clean solid has no such edge; two blocks that touch along one edge, or a crack's end, have.
    """
    faces = hexes[:, FACES].reshape(-1, 4)
    whole = _distinct(faces) >= 3
    faces = faces[whole]
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    skin = faces[first[count == 1]]
    pairs = np.sort(np.stack([skin, np.roll(skin, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    _, users = np.unique(pairs, axis=0, return_counts=True)
    return len(skin), int((users > 2).sum())


def free_shell_edges(shells: np.ndarray) -> int:
    """Edges that only one shell has; shells are rows of nodes, (k, 4), a triangle repeating its last node."""
    pairs = np.sort(np.stack([shells, np.roll(shells, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    _, users = np.unique(pairs, axis=0, return_counts=True)
    return int((users == 1).sum())


def duplicate_nodes(nodes: np.ndarray, tolerance_m: float) -> np.ndarray:
    """Pairs of rows of nodes at one place, (k, 2)."""
    pairs = cKDTree(nodes).query_pairs(tolerance_m, output_type="ndarray")
    return pairs[np.lexsort(pairs.T[::-1])] if len(pairs) else pairs.reshape(0, 2)


def unreferenced(count: int, *tables: np.ndarray) -> np.ndarray:
    """Rows of nodes that no table names, (k,); negative entries of a table name none."""
    used = np.zeros(count, dtype=bool)
    for table in tables:
        used[table[table >= 0]] = True
    return np.flatnonzero(~used)


def shortest_edge(nodes: np.ndarray, hexes: np.ndarray) -> float:
    """Shortest edge that is not collapsed [m]; 0 where there is none."""
    ends = hexes[:, EDGES].reshape(-1, 2)
    ends = ends[ends[:, 0] != ends[:, 1]]
    if not len(ends):
        return 0.0
    span = nodes[ends[:, 1]] - nodes[ends[:, 0]]
    return float(np.sqrt(np.einsum("ij,ij->i", span, span).min()))


def _distinct(rows: np.ndarray) -> np.ndarray:
    """How many different numbers each row holds."""
    ordered = np.sort(rows, axis=1)
    return 1 + (ordered[:, 1:] != ordered[:, :-1]).sum(axis=1)
