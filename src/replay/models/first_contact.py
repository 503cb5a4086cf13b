"""Where two players first touch: one is moved along the closing velocity until a given gap is left.

The gap is the least distance of the two outer surfaces, each face as two triangles. A body that moves by less than
its distance from another cannot pass it, so the search advances by just that (conservative advancement).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from replay.errors import InputError
from replay.models.quality import FACES

_WHERE = "play.yaml"
_EXACT = 1e-9
_MOST_ADVANCES = 1000
# an exact distance is asked for once the bodies may be this near
_NEAR_M = 0.005


@dataclass(frozen=True)
class FirstContact:
    """Where a moved body is left.

    Parameters
    ----------
    travel_m
        How far it was moved along the direction [m].
    gap_m
        Least distance of the two surfaces there [m].
    point_m
        Middle of the shortest connection, (3,) [m].
    elements
        Rows of the two elements whose faces are nearest.
    """

    travel_m: float
    gap_m: float
    point_m: np.ndarray
    elements: tuple[int, int]


@dataclass(frozen=True)
class Skin:
    """The outer surface of a mesh, as triangles.

    Parameters
    ----------
    corners
        (t, 3, 3) [m].
    element
        Row of the hex of each triangle, (t,).
    """

    corners: np.ndarray
    element: np.ndarray

    @property
    def radius_m(self) -> float:
        """No point of a triangle is further than this from the nearest of its corners [m]."""
        sides = self.corners - np.roll(self.corners, 1, axis=1)
        return float(np.sqrt((sides**2).sum(axis=2).max()) / np.sqrt(3.0))


def skin_of(nodes: np.ndarray, hexes: np.ndarray) -> Skin:
    """Outer surface of hexes."""
    faces = hexes[:, FACES].reshape(-1, 4)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    rows = np.sort(first[count == 1])
    quads, owner = faces[rows], rows // len(FACES)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Skin(nodes[triangles], np.concatenate([owner, owner]))


def first_contact(still: Skin, moving: Skin, direction: np.ndarray, gap_m: float) -> FirstContact:
    """Move a surface along a direction until it is `gap_m` from another.

    Parameters
    ----------
    still, moving
        The two surfaces; they must begin further apart than the gap.
    direction
        Unit vector of the motion, (3,).
    gap_m
        Distance to be left [m].

    Raises
    ------
    InputError
        When the surfaces begin too near, or pass each other without coming so near.
    """
    end = _passed(still, moving, direction)
    travel, closest = 0.0, np.inf
    for _ in range(_MOST_ADVANCES):
        distance, pair, point = _distance(still, moving.corners + travel * direction)
        if travel == 0.0 and distance < gap_m:
            raise InputError(
                _WHERE, f"the players begin {1e3 * distance:.3g} mm apart", expected=f"more than {1e3 * gap_m:g} mm",
                mend="begin further back along the closing velocity",
            )  # fmt: skip
        closest = min(closest, distance)
        if distance <= gap_m + _EXACT and pair is not None:
            return FirstContact(travel, distance, point, (int(still.element[pair[0]]), int(moving.element[pair[1]])))
        travel += distance - gap_m
        if travel > end:
            break
    raise InputError(
        _WHERE,
        f"the players pass each other at {1e3 * closest:.3g} mm and never touch",
        expected="a closing velocity that leads the impactor into the struck player",
        mend="correct `collision.aim_m`, the velocities or the orientations",
    )


def _passed(still: Skin, moving: Skin, direction: np.ndarray) -> float:
    """Travel after which the moving surface lies beyond the still one [m]."""
    ahead = np.einsum("tck,k->tc", still.corners, direction).max()
    behind = np.einsum("tck,k->tc", moving.corners, direction).min()
    return float(ahead - behind)


def _distance(still: Skin, corners: np.ndarray) -> tuple[float, tuple[int, int] | None, np.ndarray]:
    """Least distance of two surfaces, the triangles where it is, and the middle of it.

    Far apart it is a lower bound by the corners alone, and no pair is named.
    """
    points = corners.reshape(-1, 3)
    near, _ = cKDTree(still.corners.reshape(-1, 3)).query(points)
    moved = Skin(corners, still.element)
    nearest, slack = float(near.min()), still.radius_m + moved.radius_m
    if nearest - slack > _NEAR_M:
        return nearest - slack, None, np.zeros(3)
    a, b = _near_pairs(still.corners, corners, nearest)
    distance, middle = triangle_distances(still.corners[a], corners[b])
    k = int(np.argmin(distance))
    return float(distance[k]), (int(a[k]), int(b[k])), middle[k]


def _near_pairs(first: np.ndarray, second: np.ndarray, most_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the triangles whose balls are no further apart than `most_m`."""
    (centre_a, radius_a), (centre_b, radius_b) = (_balls(corners) for corners in (first, second))
    found = cKDTree(centre_a).query_ball_point(centre_b, most_m + radius_a.max() + radius_b, return_sorted=True)
    b = np.repeat(np.arange(len(second)), [len(rows) for rows in found])
    a = np.concatenate([np.array(rows, dtype=int) for rows in found])
    away = np.sqrt(((centre_a[a] - centre_b[b]) ** 2).sum(axis=1))
    near = away <= most_m + radius_a[a] + radius_b[b]
    return a[near], b[near]


def _balls(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres and radii of balls about triangles."""
    centre = corners.mean(axis=1)
    return centre, np.sqrt(((corners - centre[:, None]) ** 2).sum(axis=2).max(axis=1))


def triangle_distances(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each of k pairs of triangles that do not cross, and the middle of the shortest connection.

    It is between a corner and a triangle, or between two edges.

    Parameters
    ----------
    first, second
        Corners, (k, 3, 3) [m].
    """
    best = np.full(len(first), np.inf)
    middle = np.zeros((len(first), 3))

    def offer(p: np.ndarray, q: np.ndarray) -> None:
        away = np.sqrt(((p - q) ** 2).sum(axis=1))
        better = away < best
        best[better] = away[better]
        middle[better] = 0.5 * (p + q)[better]

    for corner in range(3):
        offer(first[:, corner], _on_triangle(first[:, corner], second))
        offer(second[:, corner], _on_triangle(second[:, corner], first))
    for i in range(3):
        for j in range(3):
            offer(*_between_edges(first[:, i], first[:, i - 1], second[:, j], second[:, j - 1]))
    return best, middle


def _on_triangle(point: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Foot of the perpendicular where it falls into the triangle, else a corner (the edges are asked apart)."""
    a, u, v = triangle[:, 0], triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0]
    w = point - a
    uu, uv, vv, wu, wv = ((x * y).sum(axis=1) for x, y in ((u, u), (u, v), (v, v), (w, u), (w, v)))
    scale = uu * vv - uv**2
    s, t = (vv * wu - uv * wv) / scale, (uu * wv - uv * wu) / scale
    inside = (s >= 0) & (t >= 0) & (s + t <= 1)
    return np.where(inside[:, None], a + s[:, None] * u + t[:, None] * v, a)


def _between_edges(p0: np.ndarray, p1: np.ndarray, q0: np.ndarray, q1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nearest points of two segments each (Ericson, Real-Time Collision Detection, 5.1.9)."""
    u, v, w = p1 - p0, q1 - q0, p0 - q0
    uu, uv, vv, uw, vw = ((x * y).sum(axis=1) for x, y in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    scale = uu * vv - uv**2
    parallel = scale <= 1e-12 * uu * vv
    s = np.where(parallel, 0.0, np.clip((uv * vw - vv * uw) / np.where(parallel, 1.0, scale), 0, 1))
    t = (uv * s + vw) / vv
    clipped = np.clip(t, 0, 1)
    s = np.where(t == clipped, s, np.clip((uv * clipped - uw) / uu, 0, 1))
    return p0 + s[:, None] * u, q0 + clipped[:, None] * v
