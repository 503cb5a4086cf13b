"""Weights that tie two surfaces whose meshes do not match.

Where a tied node's faces lie wholly on the masters' surface the weights are those of the dual mortar method
(Wohlmuth 2000): with N the bilinear functions of the tied side, psi their biorthogonal partners face by face and M
those of the master side,

    w_si = int psi_s M_i dA / int N_s dA

over the common pieces of both meshes. A linear motion of the masters is then followed exactly, and a constant
stress is handed over exactly: the patch test holds for any pair of meshes on a plane. Elsewhere (at the rim of the
masters, across a fold) a node follows the closest point of a face, which keeps the first property and not the second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from replay.errors import InputError
from replay.solver.arrays import WHERE
from replay.solver.ties import Tie

#: Faces of a hexahedron, seen from outside counter-clockwise.
HEX_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
_SIGNS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_WHOLE = 1e-6
_FACING = -0.5
_NEWTON = 30
_ORDER = 5


@dataclass(frozen=True)
class TiedSurfaces:
    """Weights of an interface and where its nodes went.

    Parameters
    ----------
    tie
        For the problem.
    nodes : (n, 3) float64
        Coordinates with every tied node on the masters' surface [m].
    moved_m
        Greatest distance that a node was moved [m].
    loose : (k,) int
        Rows of nodes on faces that look at a master nearby, yet too far from it to be tied.
    """

    tie: Tie
    nodes: NDArray[np.float64]
    moved_m: float
    loose: NDArray[np.int64]


def outer_faces(hexes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces (k, 4) that belong to one element only, seen from outside counter-clockwise, in the elements' order."""
    faces = hexes[:, HEX_FACES].reshape(-1, 4)
    _, inverse, count = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    return faces[count[inverse.ravel()] == 1]


def tie_surfaces(
    name: str,
    nodes: NDArray[np.float64],
    tied_faces: NDArray[np.int64],
    master_faces: NDArray[np.int64],
    tolerance_m: float,
) -> TiedSurfaces:
    """Tie the nodes of some faces to other faces.

    Parameters
    ----------
    name
        Of the interface.
    nodes : (n, 3) float64
        All coordinates [m].
    tied_faces, master_faces : (a, 4), (b, 4) int
        Rows of `nodes`, seen from outside of their bodies counter-clockwise. The finer or softer side should be tied.
    tolerance_m
        Nodes farther than this from the masters' surface stay free.

    Raises
    ------
    InputError
        When no node is near enough.
    """
    nodes = np.array(nodes, float)
    near = _candidates(nodes, tied_faces, master_faces, tolerance_m)
    mortar = _mortar_weights(nodes, tied_faces, master_faces, near, tolerance_m)
    masters_used = set(master_faces.ravel().tolist())
    rows = [row for row in np.unique(tied_faces).tolist() if row not in masters_used]
    weights: dict[int, dict[int, float]] = {}
    for row in rows:
        found = mortar.get(row) or _closest(nodes, row, tied_faces, master_faces, near, tolerance_m)
        if found:
            weights[row] = found
    if not weights:
        raise InputError(
            WHERE, f"no node is within {tolerance_m:.3g} m of the masters", column=f"ties.{name}",
            mend="name the two surfaces that face one another, or raise the tolerance",
        )  # fmt: skip
    width = max(len(w) for w in weights.values())
    tied = np.array(list(weights), np.int64)
    masters, shares = np.zeros((len(tied), width), np.int64), np.zeros((len(tied), width))
    for k, found in enumerate(weights.values()):
        order = sorted(found)
        masters[k] = order[0]
        masters[k, : len(order)] = order
        value = np.array([found[i] for i in order])
        shares[k, : len(order)] = value / value.sum()
    place = np.einsum("kw,kwi->ki", shares, nodes[masters])
    moved = float(np.linalg.norm(place - nodes[tied], axis=1).max())
    nodes[tied] = place
    facing = set(tied_faces[[bool(n) for n in near]].ravel().tolist())
    loose = np.array([row for row in rows if row in facing and row not in weights], np.int64)
    return TiedSurfaces(Tie(name, tied, masters, shares), nodes, moved, loose)


def _candidates(
    nodes: NDArray[np.float64], tied: NDArray[np.int64], masters: NDArray[np.int64], tolerance: float
) -> list[list[int]]:
    """Master faces whose surrounding ball meets that of each tied face, and that look its way."""
    tied_centre, tied_size, tied_normal = _balls(nodes[tied])
    centre, size, normal = _balls(nodes[masters])
    reach = tied_size + size.max() + tolerance
    found = cKDTree(centre).query_ball_point(tied_centre, reach, return_sorted=True)
    return [[m for m in near if normal[m] @ tied_normal[k] < _FACING] for k, near in enumerate(found)]


def _balls(corners: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray]:
    centre = corners.mean(axis=1)
    size = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return centre, size, normal / np.linalg.norm(normal, axis=1)[:, None]


def _mortar_weights(
    nodes: NDArray[np.float64],
    tied: NDArray[np.int64],
    masters: NDArray[np.int64],
    near: list[list[int]],
    tolerance: float,
) -> dict[int, dict[int, float]]:
    """Weights of the nodes all of whose faces lie on the masters."""
    total: dict[int, float] = {}
    sums: dict[int, dict[int, float]] = {}
    broken: set[int] = set()
    for k, face in enumerate(tied.tolist()):
        pieces = _face_integrals(nodes[face], nodes[masters[near[k]]], tolerance) if near[k] else None
        if pieces is None:
            broken.update(face)
            continue
        own, cross = pieces
        for a, row in enumerate(face):
            total[row] = total.get(row, 0.0) + float(own[a])
            share = sums.setdefault(row, {})
            for place, m in enumerate(near[k]):
                for b, master in enumerate(masters[m].tolist()):
                    if cross[a, place, b] != 0.0:
                        share[master] = share.get(master, 0.0) + float(cross[a, place, b])
    return {
        row: {i: value / total[row] for i, value in share.items() if abs(value) > 1e-14 * total[row]}
        for row, share in sums.items()
        if row not in broken
    }


def _face_integrals(
    corners: NDArray[np.float64], masters: NDArray[np.float64], tolerance: float
) -> tuple[NDArray, NDArray] | None:
    """``int N_a`` (4,) and ``int psi_a M_b`` (4, n, 4) of one tied face; None where masters do not cover it."""
    origin = corners.mean(axis=0)
    e3 = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    e3 = e3 / np.linalg.norm(e3)
    e1 = corners[1] - corners[0]
    e1 = e1 - (e1 @ e3) * e3
    e1 /= np.linalg.norm(e1)
    plane = np.stack([e1, np.cross(e3, e1)])
    flat = (corners - origin) @ plane.T
    own, mass = np.zeros(4), np.zeros((4, 4))
    mixed = np.zeros((4, len(masters), 4))
    covered = 0.0
    for number, master in enumerate(masters):
        other = ((master - origin) @ plane.T)[::-1]
        points, weight = _quadrature(_clipped(flat, other))
        if not len(points):
            continue
        n, m = _shapes(flat, points), _shapes(other, points)[:, ::-1]
        gap = np.abs(m @ ((master - origin) @ e3) - n @ ((corners - origin) @ e3))
        if gap.max() > tolerance:
            continue
        covered += weight.sum()
        own += weight @ n
        mass += np.einsum("q,qa,qb->ab", weight, n, n)
        mixed[:, number] = np.einsum("q,qa,qb->ab", weight, n, m)
    if abs(covered / _area(flat) - 1.0) > _WHOLE:
        return None
    dual = own[:, None] * np.linalg.inv(mass)
    return own, np.einsum("ac,cnb->anb", dual, mixed)


def _area(polygon: NDArray[np.float64]) -> float:
    x, y = polygon.T
    return 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def _clipped(subject: NDArray[np.float64], window: NDArray[np.float64]) -> NDArray[np.float64]:
    """Common piece of two convex polygons, both counter-clockwise (Sutherland and Hodgman 1974)."""
    piece = list(subject)
    for a, b in zip(window, np.roll(window, -1, axis=0)):
        side = [(b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) for p in piece]
        result = []
        for k, (p, s) in enumerate(zip(piece, side)):
            q, t = piece[(k + 1) % len(piece)], side[(k + 1) % len(piece)]
            if s >= 0:
                result.append(p)
            if s * t < 0:
                result.append(p + (q - p) * (s / (s - t)))
        piece = result
        if not piece:
            break
    return np.array(piece).reshape(-1, 2)


_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(_ORDER)


def _quadrature(polygon: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Points (q, 2) and weights (q,) on a convex polygon, exact to the eighth degree on each of its triangles."""
    centre = polygon.sum(axis=0) / max(len(polygon), 1)
    u, v = (g.ravel() for g in np.meshgrid(0.5 + 0.5 * _GAUSS_X, 0.5 + 0.5 * _GAUSS_X, indexing="ij"))
    weight = (0.25 * np.outer(_GAUSS_W, _GAUSS_W)).ravel() * u
    points, weights = [], []
    for a, b in zip(polygon - centre, np.roll(polygon, -1, axis=0) - centre):
        twice = a[0] * b[1] - a[1] * b[0]
        if twice > 0:
            points.append(centre + u[:, None] * (a + v[:, None] * (b - a)))
            weights.append(weight * twice)
    return (np.concatenate(points), np.concatenate(weights)) if points else (np.empty((0, 2)), np.empty(0))


def _functions(xi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bilinear functions (q, 4) at parameters (q, 2)."""
    return 0.25 * (1 + xi[:, :1] * _SIGNS[:, 0]) * (1 + xi[:, 1:] * _SIGNS[:, 1])


def _shapes(quad: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bilinear functions (q, 4) of a plane quadrilateral at points of its plane (q, 2), by Newton's method."""
    xi = np.zeros_like(points)
    for _ in range(_NEWTON):
        miss = points - _functions(xi) @ quad
        d1 = 0.25 * _SIGNS[:, 0] * (1 + xi[:, 1:] * _SIGNS[:, 1]) @ quad
        d2 = 0.25 * _SIGNS[:, 1] * (1 + xi[:, :1] * _SIGNS[:, 0]) @ quad
        det = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
        step = np.stack(
            [miss[:, 0] * d2[:, 1] - miss[:, 1] * d2[:, 0], d1[:, 0] * miss[:, 1] - d1[:, 1] * miss[:, 0]], axis=1
        )
        step /= det[:, None]
        xi = xi + step
        if not (np.abs(step) > 1e-15).any():
            break
    return _functions(xi)


def _closest(
    nodes: NDArray[np.float64],
    row: int,
    tied: NDArray[np.int64],
    masters: NDArray[np.int64],
    near: list[list[int]],
    tolerance: float,
) -> dict[int, float] | None:
    """Weights of the closest point of a master face, the lowest of equals; None beyond the tolerance."""
    faces = sorted({m for k in np.flatnonzero((tied == row).any(axis=1)) for m in near[k]})
    best, found = tolerance, None
    for m in faces:
        distance, weight = _project(nodes[masters[m]], nodes[row])
        if distance <= best and (found is None or distance < best):
            best, found = distance, dict(zip(masters[m].tolist(), weight.tolist()))
    return found


def _project(quad: NDArray[np.float64], point: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Distance of a point from a bilinear face and the weights of the closest place, by Gauss-Newton held inside."""
    xi = np.zeros((1, 2))
    for _ in range(_NEWTON):
        miss = point - (_functions(xi) @ quad)[0]
        slope = np.stack(
            [
                0.25 * (_SIGNS[:, 0] * (1 + xi[0, 1] * _SIGNS[:, 1])) @ quad,
                0.25 * (_SIGNS[:, 1] * (1 + xi[0, 0] * _SIGNS[:, 0])) @ quad,
            ],
            axis=1,
        )
        xi = np.clip(xi + np.linalg.lstsq(slope, miss, rcond=None)[0], -1.0, 1.0)
    weight = _functions(xi)[0]
    return float(np.linalg.norm(point - weight @ quad)), weight
