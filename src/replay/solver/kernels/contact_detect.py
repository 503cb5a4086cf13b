"""Which faces hold back a slave point: closest points, the side it came from, at most three faces a point.

A point *outside* a face in front of it may be held by it. A point *inside* is held only by a face that held it, or a
neighbour of that face: the side is remembered, so that a thin plate is not left through its other side, and the far
side of a solid is never taken for a hit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from replay.solver.kernels.contact_geometry import area_vector, bilinear, closest, face_point, shape, unit
from replay.solver.kernels.device import compiled, device
from replay.solver.kernels.lanes import POSITION, VELOCITY
from replay.solver.kernels.tensors import add, add_scaled, dot, scale, subtract

#: Faces that may hold one point at a time: a floor and two walls.
SLOTS = 3
_FAR = 1e300
# hits closer together than this share of a face's size are equally near
_TIE = 1e-3
# a point this share of a face's size behind a face that never held it still counts as touching
_TOUCH = 1e-3
# cosine between a point's inward normal and that of a face, below which the point glides past it
_FLUSH = 0.1
# cosine between normals of faces that hold a point the same way
_ALIKE = 0.9


class Mesh(NamedTuple):
    """A surface for the kernels; see `replay.solver.contact.surface.Surface`, with rows of `nodal` for nodes."""

    faces: NDArray[np.int64]
    nodes: NDArray[np.int64]
    first_face: NDArray[np.int64]
    node_faces: NDArray[np.int64]
    body: NDArray[np.int64]
    point_body: NDArray[np.int64]


class Hits(NamedTuple):
    """What was found for every candidate: (n_candidates,) each.

    Distance to the closest point and its share along the outward normal [m], size of the face [m], how much the face
    looks at the point, coordinates on the face, and whether the point lies over the face rather than beside it.
    """

    distance: NDArray[np.float64]
    along: NDArray[np.float64]
    size: NDArray[np.float64]
    facing: NDArray[np.float64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    over: NDArray[np.bool_]


class Slots(NamedTuple):
    """What holds each point: (n_points, SLOTS) each, and normal (…, 3) and shares of the corners (…, 4)."""

    face: NDArray[np.int64]
    gap: NDArray[np.float64]
    normal: NDArray[np.float64]
    shape: NDArray[np.float64]
    size: NDArray[np.float64]
    active: NDArray[np.bool_]


@device
def position(nodal, row):
    """Position of a node."""
    return (nodal[row, POSITION], nodal[row, POSITION + 1], nodal[row, POSITION + 2])


@device
def velocity(nodal, row):
    """Velocity of a node."""
    return (nodal[row, VELOCITY], nodal[row, VELOCITY + 1], nodal[row, VELOCITY + 2])


@device
def quad(nodal, faces, face):
    """Coefficients of a face at the present positions."""
    return bilinear(
        position(nodal, faces[face, 0]),
        position(nodal, faces[face, 1]),
        position(nodal, faces[face, 2]),
        position(nodal, faces[face, 3]),
    )


def _outward(nodal, mesh, point):
    """Outward normal of a slave point: the mean of its faces' normals."""
    count = mesh.nodes.shape[0]
    if point >= count:
        return unit(area_vector(quad(nodal, mesh.faces, point - count), 0.0, 0.0))
    total = (0.0, 0.0, 0.0)
    for k in range(mesh.first_face[point], mesh.first_face[point + 1]):
        total = add(total, unit(area_vector(quad(nodal, mesh.faces, mesh.node_faces[k]), 0.0, 0.0)))
    return unit(total)


def _touching(faces, a, b):
    """Whether two faces share a node."""
    for i in range(4):
        for j in range(4):
            if faces[a, i] == faces[b, j]:
                return True
    return False


outward = compiled(_outward)
touching = compiled(_touching)


def _look(nodal, mesh, point, p, first, candidate, reach, hits):
    """Find the closest points of all candidate faces within reach; whether there is any."""
    near = False
    own = (0.0, 0.0, 0.0)
    for k in range(first[point], first[point + 1]):
        hits.distance[k] = _FAR
        face = candidate[k]
        q = quad(nodal, mesh.faces, face)
        radius = 0.0
        for corner in range(4):
            arm = subtract(position(nodal, mesh.faces[face, corner]), q[0])
            radius = max(radius, dot(arm, arm))
        radius = math.sqrt(radius)
        away = subtract(p, q[0])
        if dot(away, away) > (radius + reach) * (radius + reach):
            continue
        u, v = closest(q, p)
        d = subtract(p, face_point(q, u, v))
        far = math.sqrt(dot(d, d))
        vector = area_vector(q, u, v)
        area = math.sqrt(dot(vector, vector))
        if far > reach or not area > 0.0:
            continue
        if not near:
            near = True
            own = outward(nodal, mesh, point)
        n = scale(1.0 / area, vector)
        along = dot(d, n)
        aside = add_scaled(d, -along, n)
        size = 2.0 * math.sqrt(area)
        hits.distance[k] = far
        hits.along[k] = along
        hits.size[k] = size
        hits.u[k] = u
        hits.v[k] = v
        hits.over[k] = (abs(u) < 1.0 and abs(v) < 1.0) or dot(aside, aside) <= (1e-6 * size) * (1e-6 * size)
        # beside a face it is the rim that looks at the point
        hits.facing[k] = -dot(own, n if hits.over[k] else scale((1.0 if along >= 0.0 else -1.0) / far, d))
    return near


def _better(k, best, hits):
    """Whether hit `k` is nearer than hit `best`.

    Of equals it is a face that the point is over, not one whose rim the same point lies beside; then the one that
    looks at the point, then the first.
    """
    tie = _TIE * min(hits.size[k], hits.size[best])
    if hits.distance[k] < hits.distance[best] - tie:
        return True
    if hits.distance[k] > hits.distance[best] + tie:
        return False
    if hits.over[k] != hits.over[best]:
        return hits.over[k]
    if not hits.over[k]:
        # one edge or corner seen by two faces: the one that is more in front of it, or behind
        return abs(hits.along[k]) / hits.distance[k] > abs(hits.along[best]) / hits.distance[best] + 1e-9
    return hits.facing[k] > hits.facing[best] + 1e-9


look = compiled(_look)
better = compiled(_better)


def _hold(nodal, mesh, point, slot, p, face, k, hits, slots):
    """Write hit `k` to a slot. Over a face the normal is the face's; beside one it points from its rim to the point."""
    q = quad(nodal, mesh.faces, face)
    n = unit(area_vector(q, hits.u[k], hits.v[k]))
    gap = hits.along[k]
    if not hits.over[k] and hits.distance[k] > 1e-6 * hits.size[k]:
        sign = 1.0 if gap >= 0.0 else -1.0
        gap = sign * hits.distance[k]
        n = scale(1.0 / gap, subtract(p, face_point(q, hits.u[k], hits.v[k])))
    shares = shape(hits.u[k], hits.v[k])
    slots.face[point, slot] = face
    slots.gap[point, slot] = gap
    slots.size[point, slot] = hits.size[k]
    for axis in range(3):
        slots.normal[point, slot, axis] = n[axis]
    for corner in range(4):
        slots.shape[point, slot, corner] = shares[corner]


hold = compiled(_hold)


def _inside(nodal, mesh, point, p, first, candidate, old, hits, slots):
    """Fill slots with faces that the point is behind and that, or whose neighbours, held it; return how many."""
    held = 0
    for slot in range(SLOTS):
        if old[point, slot] < 0:
            continue
        best = -1
        for k in range(first[point], first[point + 1]):
            if (
                hits.distance[k] < _FAR
                and (candidate[k] == old[point, slot] or touching(mesh.faces, candidate[k], old[point, slot]))
                and (best < 0 or better(k, best, hits))
            ):
                best = k
        if best < 0 or hits.along[best] >= 0.0:
            continue
        known = False
        for other in range(held):
            known = known or slots.face[point, other] == candidate[best]
        if not known:
            hold(nodal, mesh, point, held, p, candidate[best], best, hits, slots)
            held += 1
    return held


def _outside(nodal, mesh, point, p, first, candidate, old, held, hits, slots):
    """Add faces that the point is in front of, nearest first; return how many hold it in all.

    A point that nothing holds and that glides past a side or a rim keeps that face in mind: it may be behind its
    neighbour next.
    """
    remembered = old[point, 0] >= 0
    glides = False
    while held < SLOTS:
        best = -1
        for k in range(first[point], first[point + 1]):
            if hits.distance[k] < _FAR and (best < 0 or better(k, best, hits)):
                best = k
        if best < 0:
            break
        face = candidate[best]
        far = hits.distance[best]
        hits.distance[best] = _FAR  # used up
        size = hits.size[best]
        if hits.along[best] < 0.0 and (remembered or not hits.over[best] or far > _TOUCH * size):
            continue
        facing = hits.facing[best]
        if mesh.body[face] == mesh.point_body[point] and facing <= 0.0:
            continue
        # a side, or a rim, that lies flush is not what the point runs against
        if facing < _FLUSH:
            if held == 0 and not glides and mesh.body[face] != mesh.point_body[point]:
                glides = True
                hold(nodal, mesh, point, 0, p, face, best, hits, slots)
                slots.gap[point, 0] = far
            continue
        hits.distance[best] = far
        hold(nodal, mesh, point, held, p, face, best, hits, slots)
        hits.distance[best] = _FAR
        hidden = False
        for other in range(held):
            alike = 0.0
            for axis in range(3):
                alike += slots.normal[point, held, axis] * slots.normal[point, other, axis]
            beside = not hits.over[best] and touching(mesh.faces, face, slots.face[point, other])
            hidden = hidden or alike > _ALIKE or beside or slots.face[point, other] == face
        if not hidden:
            held += 1
    for slot in range(max(held, 1 if glides else 0), SLOTS):
        slots.face[point, slot] = -1
    return held


inside = compiled(_inside)
outside = compiled(_outside)


def _closing(nodal, mesh, point, slot, slots):
    """Opening speed of a slot's gap: of the point against the face along the normal."""
    count = mesh.nodes.shape[0]
    if point < count:
        motion = velocity(nodal, mesh.nodes[point])
    else:
        motion = (0.0, 0.0, 0.0)
        for corner in range(4):
            motion = add_scaled(motion, 0.25, velocity(nodal, mesh.faces[point - count, corner]))
    face = slots.face[point, slot]
    for corner in range(4):
        motion = add_scaled(motion, -slots.shape[point, slot, corner], velocity(nodal, mesh.faces[face, corner]))
    n = (slots.normal[point, slot, 0], slots.normal[point, slot, 1], slots.normal[point, slot, 2])
    return dot(n, motion)


closing = compiled(_closing)


def _detect_point(nodal, mesh, points, point, first, candidate, reach, dt, near_share, old, depth, hits, slots):
    """Find what holds one slave point; see `detect`."""
    p = (points[point, 0], points[point, 1], points[point, 2])
    within = reach + depth[point]
    depth[point] = 0.0
    for slot in range(SLOTS):
        slots.face[point, slot] = -1
        slots.active[point, slot] = False
    if first[point] == first[point + 1] or not look(nodal, mesh, point, p, first, candidate, within, hits):
        return
    behind = inside(nodal, mesh, point, p, first, candidate, old, hits, slots)
    held = outside(nodal, mesh, point, p, first, candidate, old, behind, hits, slots)
    for slot in range(held):
        gap = slots.gap[point, slot]
        depth[point] = max(depth[point], -gap)
        speed = closing(nodal, mesh, point, slot, slots)
        slots.active[point, slot] = gap + dt * speed < near_share * slots.size[point, slot]


def _penetrate(nodal, mesh, points, point, first, candidate, reach, hits, slots):
    """Find whether one slave point is inside a solid; see `penetrations`."""
    p = (points[point, 0], points[point, 1], points[point, 2])
    slots.face[point, 0] = -1
    slots.active[point, 0] = False
    if not look(nodal, mesh, point, p, first, candidate, reach, hits):
        return
    best = -1
    for k in range(first[point], first[point + 1]):
        if (
            hits.distance[k] < _FAR
            and mesh.body[candidate[k]] != mesh.point_body[point]
            and (best < 0 or better(k, best, hits))
        ):
            best = k
    if best >= 0 and hits.along[best] < 0.0 and hits.facing[best] > -0.3:
        hold(nodal, mesh, point, 0, p, candidate[best], best, hits, slots)
        slots.active[point, 0] = True


detect_point = compiled(_detect_point)
penetrate = compiled(_penetrate)


def _detect(nodal, mesh, points, first, candidate, reach, dt, near_share, old, depth, hits, slots):
    """Find the faces that hold each slave point, and whether they do in the coming step.

    Parameters
    ----------
    nodal : (n, 8) float64
        Positions at the present time, velocities that lead to the end of the step without contact.
    mesh : Mesh
        The surface.
    points : (n_points, 3) float64
        Positions of the slave points [m].
    first, candidate : int64
        Compressed rows: candidate faces of each point, increasing.
    reach, dt : float
        No point comes further than `reach` in the step [m]; its length [s].
    near_share : float
        Points that end nearer than this share of a face's size take part in the problem too.
    old : (n_points, SLOTS) int64
        Faces that held the point in the step before, -1 for none.
    depth : (n_points,) float64
        How far inside it was [m]; updated.
    hits : Hits
        Room.
    slots : Slots
        What holds each point (output).
    """
    for index in prange(points.shape[0]):
        point = np.int64(index)  # the loop's own index is unsigned
        detect_point(nodal, mesh, points, point, first, candidate, reach, dt, near_share, old, depth, hits, slots)


def _penetrations(nodal, mesh, points, first, candidate, reach, hits, slots):
    """Find the slave points inside a solid: their nearest face, if they are behind it, in slot 0.

    Only for a model at rest: here the nearest face tells the side, and nothing is remembered.
    """
    for point in range(points.shape[0]):
        penetrate(nodal, mesh, points, point, first, candidate, reach, hits, slots)


detect = compiled(_detect, parallel=True)
penetrations = compiled(_penetrations)
