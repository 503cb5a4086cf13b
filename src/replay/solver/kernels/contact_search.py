"""Who may meet whom: slave points near faces, by a uniform grid of cells hashed into a table; O(n).

A point lies in one cell. A face asks the cells that its box, widened by the margin, touches. Lists are sorted by point
and face, whatever the order in which cells are met.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from replay.solver.kernels.device import compiled, device
from replay.solver.kernels.lanes import POSITION


@device
def _bucket(i, j, k, mask):
    """Row of the table for a cell: a mixing of its three whole numbers."""
    return ((i * 73856093) ^ (j * 19349663) ^ (k * 83492791)) & mask


def _place_points(nodal, nodes, faces, points):
    """Positions (n_nodes + n_faces, 3) of the slave points: nodes, then centres of faces [m]."""
    count = nodes.shape[0]
    for point in range(points.shape[0]):
        for axis in range(3):
            if point < count:
                points[point, axis] = nodal[nodes[point], POSITION + axis]
            else:
                face = point - count
                total = 0.0
                for corner in range(4):
                    total += nodal[faces[face, corner], POSITION + axis]
                points[point, axis] = 0.25 * total


def _sort_into_cells(points, awake, low, size, mask, first, member):
    """Sort the awake points by table row: row r holds ``member[first[r]:first[r + 1]]``, in increasing order."""
    first[:] = 0
    rows = np.empty(points.shape[0], np.int64)
    for point in range(points.shape[0]):
        if awake[point]:
            i = np.int64((points[point, 0] - low[0]) / size)
            j = np.int64((points[point, 1] - low[1]) / size)
            k = np.int64((points[point, 2] - low[2]) / size)
            rows[point] = _bucket(i, j, k, mask)
            first[rows[point] + 1] += 1
    for row in range(mask + 1):
        first[row + 1] += first[row]
    place = first.copy()
    for point in range(points.shape[0]):
        if awake[point]:
            member[place[rows[point]]] = point
            place[rows[point]] += 1


def _excluded(point, face, faces, part, body, point_part, point_body, nodes, first_face, node_faces, active, carrier):
    """Whether a point and a face can never meet: parts that may not, neighbours, or one rigid body."""
    if not active[point_part[point], part[face]]:
        return True
    count = nodes.shape[0]
    if point < count:
        tied = carrier[nodes[point]]
    else:
        tied = carrier[faces[point - count, 0]]
        for corner in range(1, 4):
            if carrier[faces[point - count, corner]] != tied:
                tied = -1
    if tied >= 0:
        together = True
        for corner in range(4):
            together = together and carrier[faces[face, corner]] == tied
        if together:
            return True
    if point_body[point] != body[face]:
        return False
    # on one piece of mesh: not the point's own faces, nor those that touch them
    if point >= count:
        own = point - count
        for a in range(4):
            for b in range(4):
                if faces[own, a] == faces[face, b]:
                    return True
        return False
    for k in range(first_face[point], first_face[point + 1]):
        for a in range(4):
            for b in range(4):
                if faces[node_faces[k], a] == faces[face, b]:
                    return True
    return False


excluded = compiled(_excluded)


def _meet_face(
    face, points, faces, nodal, margin, low, size, mask, first, member, part, body, point_part, point_body, nodes,
    first_face, node_faces, active, carrier, start, found, fill,
):  # fmt: skip
    """Points in the widened box of one face; see `meet`."""
    box = np.empty(6)
    span = np.empty(6, np.int64)
    for axis in range(3):
        lower = nodal[faces[face, 0], POSITION + axis]
        upper = lower
        for corner in range(1, 4):
            value = nodal[faces[face, corner], POSITION + axis]
            lower = min(lower, value)
            upper = max(upper, value)
        box[axis] = lower - margin
        box[3 + axis] = upper + margin
        span[axis] = np.int64(max((box[axis] - low[axis]) / size, 0.0))
        span[3 + axis] = np.int64(max((box[3 + axis] - low[axis]) / size, -1.0))
    count = 0
    for i in range(span[0], span[3] + 1):
        for j in range(span[1], span[4] + 1):
            for k in range(span[2], span[5] + 1):
                row = _bucket(i, j, k, mask)
                for m in range(first[row], first[row + 1]):
                    point = member[m]
                    x = points[point, 0]
                    y = points[point, 1]
                    z = points[point, 2]
                    # another cell may share the row: only points of this very cell count, once
                    if (
                        np.int64((x - low[0]) / size) == i
                        and np.int64((y - low[1]) / size) == j
                        and np.int64((z - low[2]) / size) == k
                        and box[0] <= x <= box[3]
                        and box[1] <= y <= box[4]
                        and box[2] <= z <= box[5]
                        and not excluded(
                            point, face, faces, part, body, point_part, point_body, nodes, first_face, node_faces,
                            active, carrier,
                        )
                    ):  # fmt: skip
                        if fill:
                            found[start[face] + count] = point
                        count += 1
    return count


meet_face = compiled(_meet_face)


def _meet(
    points, faces, nodal, margin, low, size, mask, first, member, part, body, point_part, point_body, nodes,
    first_face, node_faces, active, carrier, start, found, fill,
):  # fmt: skip
    """Find the points in the box of every face, widened by `margin`.

    Counts them into `start`, (n_faces,) int64, unless `fill`; else writes them from there to `found`, (n_pairs,).
    """
    for index in prange(faces.shape[0]):
        face = np.int64(index)  # the loop's own index is unsigned
        count = meet_face(
            face, points, faces, nodal, margin, low, size, mask, first, member, part, body, point_part, point_body,
            nodes, first_face, node_faces, active, carrier, start, found, fill,
        )  # fmt: skip
        if not fill:
            start[face] = count


def _by_point(start, end, found, first, candidate):
    """Turn lists of points by face into lists of faces by point, faces in increasing order."""
    first[:] = 0
    for k in range(found.shape[0]):
        first[found[k] + 1] += 1
    for point in range(first.shape[0] - 1):
        first[point + 1] += first[point]
    place = first[:-1].copy()
    for face in range(start.shape[0]):
        for k in range(start[face], end[face]):
            candidate[place[found[k]]] = face
            place[found[k]] += 1


def _spread(nodal, nodes, origin, dt, drift):
    """Range of the displacements of the surface nodes since `origin`, (6,): least and greatest by axis [m].

    With their motion of the coming step of length `dt`.
    """
    for axis in range(3):
        drift[axis] = 1e300
        drift[3 + axis] = -1e300
    for k in range(nodes.shape[0]):
        row = nodes[k]
        for axis in range(3):
            now = nodal[row, POSITION + axis] - origin[k, axis]
            then = now + dt * nodal[row, POSITION + 4 + axis]
            drift[axis] = min(drift[axis], now, then)
            drift[3 + axis] = max(drift[3 + axis], now, then)


place_points = compiled(_place_points)
sort_into_cells = compiled(_sort_into_cells)
meet = compiled(_meet, parallel=True)
by_point = compiled(_by_point)
spread = compiled(_spread)
