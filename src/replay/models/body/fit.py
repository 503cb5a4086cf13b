"""Boundary nodes to the skin, inner nodes between their neighbours, and never a bad hex for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.spatial import cKDTree

from replay.models.quality import EDGES, FACES, edge_lengths, scaled_jacobians

_SWEEPS = 24
_HALVINGS = 5
_NEIGHBOURS = 6
#: No edge gets shorter than this, over the edge of a cube.
_LEAST_EDGE = 0.35


@dataclass(frozen=True)
class Skin:
    """Points of a surface with outward normals.

    Parameters
    ----------
    points, normals : (n, 3)
        [m], unit vectors.
    label : (n,)
        What the point belongs to.
    """

    points: np.ndarray
    normals: np.ndarray
    label: np.ndarray

    @classmethod
    def sampled(cls, points: np.ndarray, triangles: np.ndarray, label: np.ndarray) -> Skin:
        """Centres of triangles and of their quarters, with the label of the nearest corner."""
        corner = points[triangles]
        a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        normal = np.cross(a, b)
        size = np.sqrt(np.einsum("ij,ij->i", normal, normal))
        whole = size > 1e-12
        corner, normal, names = corner[whole], normal[whole] / size[whole, None], label[triangles[whole]]
        places, labels = [corner.mean(axis=1)], [names[:, 0]]
        for k in range(3):
            places.append((4 * corner[:, k] + corner[:, (k + 1) % 3] + corner[:, (k + 2) % 3]) / 6)
            labels.append(names[:, k])
        return cls(np.concatenate(places), np.tile(normal, (4, 1)), np.concatenate(labels))


def fit_to_skin(
    nodes: np.ndarray, hexes: np.ndarray, skin: Skin, step_m: float, *, least_quality: float
) -> tuple[np.ndarray, np.ndarray]:
    """Move nodes so that the boundary lies on the skin as far as quality allows.

    Parameters
    ----------
    nodes, hexes
        Cubes, (n, 3) [m] and (m, 8).
    skin
        Where the boundary should lie.
    step_m
        Edge of the cubes [m]; no node goes further than this.
    least_quality
        Scaled Jacobian that every hex keeps.

    Returns
    -------
    tuple
        New nodes, and the rows of those on the boundary.
    """
    neighbours = _neighbours(len(nodes), hexes)
    faces = _outer(hexes)
    boundary = np.unique(faces)
    inner = np.ones(len(nodes), dtype=bool)
    inner[boundary] = False
    surface = _neighbours_on(len(nodes), faces)
    tree = cKDTree(skin.points)
    place = nodes.copy()
    for sweep in range(_SWEEPS):
        if sweep % 3 == 0:
            pull = _towards(place, faces, boundary, skin, tree, step_m)
            aim = place[boundary] + pull
        trial = place.copy()
        trial[inner] += 0.3 * (neighbours @ place - place)[inner]
        smooth = (surface @ place - place)[boundary]
        trial[boundary] += 0.35 * (aim - place[boundary]) + 0.15 * smooth
        place = _kept_good(place, trial, hexes, least_quality, _LEAST_EDGE * step_m)
    return place, boundary


def _kept_good(old: np.ndarray, new: np.ndarray, hexes: np.ndarray, least: float, least_edge_m: float) -> np.ndarray:
    """The new places, halved or taken back around hexes that they would spoil."""
    out, tries = new.copy(), 0
    while True:
        bad = (scaled_jacobians(out, hexes) < least) | (edge_lengths(out, hexes).min(axis=1) < least_edge_m)
        if not bad.any():
            return out
        rows = np.unique(hexes[bad])
        out[rows] = 0.5 * (out[rows] + old[rows]) if tries < _HALVINGS else old[rows]
        tries += 1


def _towards(
    nodes: np.ndarray, faces: np.ndarray, boundary: np.ndarray, skin: Skin, tree: cKDTree, most: float
) -> np.ndarray:
    """From each boundary node to the tangent plane of the nearest skin that looks its way, (b, 3)."""
    corners = nodes[faces]
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    outward = np.stack([np.bincount(faces.ravel(), np.repeat(across[:, k], 4), len(nodes)) for k in range(3)], axis=1)[
        boundary
    ]
    here = nodes[boundary]
    _, near = tree.query(here, k=_NEIGHBOURS)
    faces_out = np.einsum("bkj,bj->bk", skin.normals[near], outward) > 0
    chosen = near[np.arange(len(near)), np.argmax(faces_out, axis=1)]
    normal = skin.normals[chosen]
    height = np.einsum("bj,bj->b", skin.points[chosen] - here, normal)
    height = np.where(faces_out.any(axis=1), np.clip(height, -most, most), 0.0)
    return normal * height[:, None]


def _outer(hexes: np.ndarray) -> np.ndarray:
    faces = hexes[:, FACES].reshape(-1, 4)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[np.sort(first[count == 1])]


def _neighbours(count: int, hexes: np.ndarray) -> csr_matrix:
    return _mean_of(count, np.unique(np.sort(hexes[:, EDGES].reshape(-1, 2), axis=1), axis=0))


def _neighbours_on(count: int, faces: np.ndarray) -> csr_matrix:
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    return _mean_of(count, np.unique(np.sort(edges, axis=1), axis=0))


def _mean_of(count: int, edges: np.ndarray) -> csr_matrix:
    """Matrix that gives every node the mean of its neighbours; a node without any, itself."""
    i, j = np.concatenate([edges, edges[:, ::-1]]).T
    number = np.bincount(i, minlength=count)
    lonely = np.flatnonzero(number == 0)
    value = np.concatenate([1.0 / number[i], np.ones(len(lonely))])
    rows, columns = np.concatenate([i, lonely]), np.concatenate([j, lonely])
    return coo_matrix((value, (rows, columns)), shape=(count, count)).tocsr()
