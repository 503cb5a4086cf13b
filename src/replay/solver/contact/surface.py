"""The surface that can touch: faces used once, outward, by part, and the points that may not pass a face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

# Faces of a hexahedron, outward by the right-hand rule.
HEX_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


@dataclass(frozen=True)
class Surface:
    """Outer faces of a mesh of hexahedra.

    A slave point is a surface node (number 0 to ``len(nodes)``) or a face's centre (the numbers after).

    Parameters
    ----------
    faces : (n_faces, 4) int64
        Node rows of each face, counter-clockwise seen from outside; sorted by part and node rows.
    part : (n_faces,) int64
        Part index of each face.
    element : (n_faces,) int64
        Element row of each face.
    body : (n_faces,) int64
        Number of the connected piece of mesh it belongs to.
    nodes : (n_nodes,) int64
        Node rows of the surface, increasing.
    node_part, node_body : (n_nodes,) int64
        The part (the lowest that has the node) and piece of each surface node.
    first_face, node_faces : int64
        Compressed rows: faces of surface node i are ``node_faces[first_face[i]:first_face[i + 1]]``.
    neighbours : (n_faces, 4) int64
        Face across each edge (edge k runs from corner k to k + 1); -1 where more than two faces meet.
    """

    faces: NDArray[np.int64]
    part: NDArray[np.int64]
    element: NDArray[np.int64]
    body: NDArray[np.int64]
    nodes: NDArray[np.int64]
    node_part: NDArray[np.int64]
    node_body: NDArray[np.int64]
    first_face: NDArray[np.int64]
    node_faces: NDArray[np.int64]
    neighbours: NDArray[np.int64]

    @property
    def n_points(self) -> int:
        """Slave points: nodes and face centres."""
        return len(self.nodes) + len(self.faces)

    def point_parts(self) -> NDArray[np.int64]:
        """Part index of every slave point."""
        return np.concatenate([self.node_part, self.part])

    def point_bodies(self) -> NDArray[np.int64]:
        """Piece of mesh of every slave point."""
        return np.concatenate([self.node_body, self.body])


def extract_surface(
    hexes: NDArray[np.int64], element_part: NDArray[np.int64], n_nodes: int, without: NDArray[np.int64] | None = None
) -> Surface:
    """Find the faces that one element alone uses.

    Parameters
    ----------
    hexes : (m, 8) int64
        In the solver's node order.
    element_part : (m,) int64
        Part index of each element.
    n_nodes
        Nodes of the mesh.
    without : (k,) int64, optional
        Faces that have one of these nodes are left out.
    """
    every = hexes[:, HEX_FACES].reshape(-1, 4)
    owner = np.repeat(np.arange(len(hexes)), 6)
    key = np.sort(every, axis=1)
    order = np.lexsort(key.T[::-1])
    same = (key[order][1:] == key[order][:-1]).all(axis=1)
    alone = np.ones(len(order), bool)
    alone[1:] &= ~same
    alone[:-1] &= ~same
    outer = order[alone]
    if without is not None and len(without):
        outer = outer[~np.isin(every[outer], without).any(axis=1)]
    part = element_part[owner[outer]]
    by_part = np.lexsort((*key[outer].T[::-1], part))
    outer, part = outer[by_part], part[by_part]
    faces, element = every[outer], owner[outer]
    body = _pieces(hexes, n_nodes)[faces[:, 0]]
    nodes = np.unique(faces)
    row = np.full(n_nodes, -1)
    row[nodes] = np.arange(len(nodes))
    corner = row[faces].ravel()
    face_of_corner = np.repeat(np.arange(len(faces)), 4)
    by_node = np.lexsort((face_of_corner, corner))
    first_face = np.searchsorted(corner[by_node], np.arange(len(nodes) + 1)).astype(np.int64)
    node_faces = face_of_corner[by_node].astype(np.int64)
    # faces are sorted by part, so the first face of a node has the lowest part
    lowest = node_faces[first_face[:-1]] if len(nodes) else np.zeros(0, np.int64)
    return Surface(
        faces=np.ascontiguousarray(faces), part=part, element=element, body=body, nodes=nodes,
        node_part=part[lowest], node_body=body[lowest], first_face=first_face, node_faces=node_faces,
        neighbours=_neighbours(faces),
    )  # fmt: skip


def _pieces(hexes: NDArray[np.int64], n_nodes: int) -> NDArray[np.int64]:
    """Number of the connected piece of mesh that each node belongs to."""
    first = np.repeat(hexes[:, 0], 7)
    other = hexes[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(other), bool), (first, other)), shape=(n_nodes, n_nodes))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _neighbours(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Face across each edge of each face, -1 where an edge has not just two faces."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    ordered = edges[order]
    start = np.flatnonzero(np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)]))
    count = np.diff(np.append(start, len(order)))
    pairs = start[count == 2]
    a, b = order[pairs], order[pairs + 1]
    result = np.full(len(edges), -1)
    result[a], result[b] = b // 4, a // 4
    return result.reshape(-1, 4).astype(np.int64)
