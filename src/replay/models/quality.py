"""Numbers that say whether a hexahedral mesh can be computed on.

Scaled Jacobian as in the Verdict library (Sandia SAND2007-1751): the smallest of the eight corner triple
products of unit edge vectors; 1 for a brick, <= 0 for an inverted element.
"""

from __future__ import annotations

import numpy as np

from replay.models.cubed_sphere import HEX_CORNERS

# Corner, and its three neighbours in right-handed order.
CORNER_FRAMES = np.array(
    [
        [0, 1, 3, 4],
        [1, 2, 0, 5],
        [2, 3, 1, 6],
        [3, 0, 2, 7],
        [4, 7, 5, 0],
        [5, 4, 6, 1],
        [6, 5, 7, 2],
        [7, 6, 4, 3],
    ]
)
# Faces, counter-clockwise seen from outside.
FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])


def scaled_jacobians(nodes: np.ndarray, hexes: np.ndarray) -> np.ndarray:
    """Scaled Jacobian of each hex, (m,).

    Parameters
    ----------
    nodes
        (n, 3) [m].
    hexes
        (m, 8).
    """
    corners = nodes[hexes]
    smallest = np.full(len(hexes), np.inf)
    for corner, first, second, third in CORNER_FRAMES:
        a = corners[:, first] - corners[:, corner]
        b = corners[:, second] - corners[:, corner]
        c = corners[:, third] - corners[:, corner]
        triple = np.einsum("ij,ij->i", np.cross(a, b), c)
        lengths = np.sqrt(np.einsum("ij,ij->i", a, a) * np.einsum("ij,ij->i", b, b) * np.einsum("ij,ij->i", c, c))
        smallest = np.minimum(smallest, triple / np.maximum(lengths, np.finfo(float).tiny))
    return smallest


def hex_volumes(nodes: np.ndarray, hexes: np.ndarray) -> np.ndarray:
    """Volume of each trilinear hex [m^3], (m,): 2-point Gauss, exact (the integrand is quadratic in each variable)."""
    corners = nodes[hexes]
    total = np.zeros(len(hexes))
    for point in HEX_CORNERS / np.sqrt(3.0):
        total += jacobian_determinants(corners, point)
    return total


def shape_functions(point: np.ndarray) -> np.ndarray:
    """Trilinear shape functions at a point of [-1, 1]^3, (8,)."""
    return np.prod(1 + HEX_CORNERS * point, axis=1) / 8


def jacobian_determinants(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Jacobian determinant at one point of [-1, 1]^3 for hexes of corners (m, 8, 3), (m,)."""
    terms = 1 + HEX_CORNERS * point
    gradient = (
        np.stack(
            [
                HEX_CORNERS[:, 0] * terms[:, 1] * terms[:, 2],
                HEX_CORNERS[:, 1] * terms[:, 0] * terms[:, 2],
                HEX_CORNERS[:, 2] * terms[:, 0] * terms[:, 1],
            ],
            axis=1,
        )
        / 8
    )
    jacobian = np.einsum("na,enb->eab", gradient, corners)
    return np.einsum("ij,ij->i", jacobian[:, 0], np.cross(jacobian[:, 1], jacobian[:, 2]))


def edge_lengths(nodes: np.ndarray, hexes: np.ndarray) -> np.ndarray:
    """Lengths of the twelve edges of each hex [m], (m, 12)."""
    span = nodes[hexes[:, EDGES[:, 1]]] - nodes[hexes[:, EDGES[:, 0]]]
    return np.sqrt(np.einsum("eij,eij->ei", span, span))


def aspect_ratios(nodes: np.ndarray, hexes: np.ndarray) -> np.ndarray:
    """Longest over shortest edge of each hex, (m,)."""
    lengths = edge_lengths(nodes, hexes)
    return lengths.max(axis=1) / lengths.min(axis=1)


def characteristic_lengths(nodes: np.ndarray, hexes: np.ndarray) -> np.ndarray:
    """Volume over largest face area [m], (m,): the length that a wave crosses in the stable time step."""
    corners = nodes[hexes]
    largest = np.zeros(len(hexes))
    for face in FACES:
        quad = corners[:, face]
        normal = np.cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 1])
        largest = np.maximum(largest, 0.5 * np.sqrt(np.einsum("ij,ij->i", normal, normal)))
    return hex_volumes(nodes, hexes) / largest
