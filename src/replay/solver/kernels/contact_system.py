"""The constraints of a step: which nodes and bodies they move, and how strongly they pull at each other.

A constraint says that a point does not run into a face: ``w = n . (sum of shares times velocities) >= bound``. It has
up to eight nodes: one of a slave node, four of a face's centre, and four of the face that holds it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.solver.kernels.bodies import rotation_matrix
from replay.solver.kernels.contact_detect import SLOTS
from replay.solver.kernels.device import compiled
from replay.solver.kernels.lanes import POSITION, VELOCITY
from replay.solver.kernels.tensors import apply, cross, dot

#: Nodes of a constraint.
CORNERS = 8


class Constraints(NamedTuple):
    """The constraints of a step, (n,) and (n, CORNERS); rooms are as large as ever needed.

    Attributes
    ----------
    point, slot
        Where each comes from.
    node, share
        Row in `Nodes` (-1 for none) and share of the node in the constraint's velocity.
    normal
        (n, 3), from the face to the point.
    bound
        Least opening speed [m/s].
    friction
        Coefficient.
    weight
        Sum of the absolute row of the constraints' matrix [1/kg]: one over it is the step of the multipliers.
    pair, sign
        Row of the pair of parts; 1 where the point's part is its first, -1 where the face's is.
    impulse, drag
        Multipliers: normal (n,) and in the tangent plane (n, 3) [N s].
    """

    point: NDArray[np.int64]
    slot: NDArray[np.int64]
    node: NDArray[np.int64]
    share: NDArray[np.float64]
    normal: NDArray[np.float64]
    bound: NDArray[np.float64]
    friction: NDArray[np.float64]
    weight: NDArray[np.float64]
    pair: NDArray[np.int64]
    sign: NDArray[np.float64]
    impulse: NDArray[np.float64]
    drag: NDArray[np.float64]


class Nodes(NamedTuple):
    """The nodes that constraints move, (n,) and (n, 3).

    Attributes
    ----------
    row
        Row of `nodal`.
    start, now
        Velocity without contact, and with the present multipliers [m/s].
    mobility
        Inverse mass by axis [1/kg]; zero where a body carries the node, or a support holds it.
    carrier
        Body that carries it, -1 for none.
    arm
        From the body's centre [m].
    impulse
        Of all its constraints [N s].
    first, constraint, corner
        Compressed rows: constraints of a node, and as which corner it is there.
    """

    row: NDArray[np.int64]
    start: NDArray[np.float64]
    now: NDArray[np.float64]
    mobility: NDArray[np.float64]
    carrier: NDArray[np.int64]
    arm: NDArray[np.float64]
    impulse: NDArray[np.float64]
    first: NDArray[np.int64]
    constraint: NDArray[np.int64]
    corner: NDArray[np.int64]


class Carriers(NamedTuple):
    """Rigid bodies as constraints see them, (n_bodies,).

    Attributes
    ----------
    mobility
        Inverse mass [1/kg]; zero for a driven body.
    tensor
        Inverse inertia in space, (n_bodies, 3, 3) [1/(kg m^2)]; zero for a driven body.
    velocity, spin
        Change by the present multipliers: of the centre [m/s], angular [rad/s].
    """

    mobility: NDArray[np.float64]
    tensor: NDArray[np.float64]
    velocity: NDArray[np.float64]
    spin: NDArray[np.float64]


def _carry(quaternion, centre, mass, inverse_inertia, driven, carriers):
    """Turn the bodies' inertia into space."""
    for body in range(driven.shape[0]):
        carriers.mobility[body] = 0.0 if driven[body] else 1.0 / mass[body]
        r = rotation_matrix(quaternion[body, 0], quaternion[body, 1], quaternion[body, 2], quaternion[body, 3])
        for i in range(3):
            for j in range(3):
                total = 0.0
                for a in range(3):
                    for b in range(3):
                        total += r[i][a] * inverse_inertia[body, a, b] * r[j][b]
                carriers.tensor[body, i, j] = 0.0 if driven[body] else total


def _recall(point, slot, face, slots_before, impulse_before):
    """Slot of the step before that belongs to this one: that of the same face, else the same slot; -1 for none."""
    for k in range(SLOTS):
        if slots_before[point, k] == face:
            return k
    if slots_before[point, slot] >= 0 and impulse_before[point, slot] > 0.0:
        return slot
    return -1


recall = compiled(_recall)


def _assemble(
    nodal, mesh, slots, old, old_impulse, old_drag, ratio, dt, point_part, part, pair_row, friction, restitution,
    was, inverse_mass, body_of, centre, number, constraints, nodes,
):  # fmt: skip
    """Write the active slots as constraints and number their nodes.

    Parameters
    ----------
    nodal, mesh, slots
        See `contact_detect.detect`.
    old, old_impulse, old_drag
        Faces (n_points, SLOTS) and multipliers (n_points, SLOTS), (n_points, SLOTS, 3) of the step before [N s].
    ratio
        What the multipliers of the step before are multiplied by to start with: they go with the step's length.
    dt
        Length of the step [s].
    point_part, part, pair_row, friction, restitution
        Part of each point, of each face; row (n_parts, n_parts) and coefficients of each pair of parts.
    was : (n, 3) float64
        Velocities half a step before the present time, of rigid bodies' nodes [m/s]; row 0 is the first of them.
    inverse_mass, body_of, centre
        [1/kg]; body of each node, -1 for none; centres of the bodies [m].
    number : (n,) int64
        Room, -1 everywhere; left so.
    constraints, nodes
        Output.

    Returns
    -------
    tuple of int
        Constraints and nodes.
    """
    count = mesh.nodes.shape[0]
    free = nodal.shape[0] - was.shape[0]
    n = 0
    used = 0
    for point in range(slots.face.shape[0]):
        for slot in range(SLOTS):
            face = slots.face[point, slot]
            if face < 0:
                break
            if not slots.active[point, slot]:
                continue
            constraints.point[n] = point
            constraints.slot[n] = slot
            for corner in range(CORNERS):
                if corner >= 4:
                    row = mesh.faces[face, corner - 4]
                    share = -slots.shape[point, slot, corner - 4]
                elif point >= count:
                    row = mesh.faces[point - count, corner]
                    share = 0.25
                else:
                    row = mesh.nodes[point]
                    share = 1.0 if corner == 0 else 0.0
                constraints.share[n, corner] = share
                constraints.node[n, corner] = -1
                if share == 0.0:
                    continue
                if number[row] < 0:
                    number[row] = used
                    nodes.row[used] = row
                    body = body_of[row]
                    nodes.carrier[used] = body
                    for axis in range(3):
                        nodes.start[used, axis] = nodal[row, VELOCITY + axis]
                        nodes.mobility[used, axis] = inverse_mass[row, axis] if body < 0 else 0.0
                        nodes.arm[used, axis] = nodal[row, POSITION + axis] - centre[body, axis] if body >= 0 else 0.0
                    used += 1
                constraints.node[n, corner] = number[row]
            a = point_part[point]
            b = part[face]
            constraints.pair[n] = pair_row[a, b]
            constraints.sign[n] = 1.0 if a <= b else -1.0
            constraints.friction[n] = friction[a, b]
            gap = slots.gap[point, slot]
            constraints.bound[n] = -max(gap, 0.0) / dt
            for axis in range(3):
                constraints.normal[n, axis] = slots.normal[point, slot, axis]
            before = recall(point, slot, face, old, old_impulse)
            constraints.impulse[n] = 0.0
            along = 0.0
            for axis in range(3):
                constraints.drag[n, axis] = 0.0
                if before >= 0:
                    along += old_drag[point, before, axis] * constraints.normal[n, axis]
            if before >= 0:
                constraints.impulse[n] = ratio * old_impulse[point, before]
                for axis in range(3):
                    drag = old_drag[point, before, axis] - along * constraints.normal[n, axis]
                    constraints.drag[n, axis] = ratio * drag
            if restitution[a, b] > 0.0 and not (before >= 0 and old_impulse[point, before] > 0.0):
                closing = 0.0
                for corner in range(CORNERS):
                    if constraints.node[n, corner] >= 0:
                        row = nodes.row[constraints.node[n, corner]]
                        for axis in range(3):
                            speed = was[row - free, axis] if row >= free else nodal[row, VELOCITY + axis]
                            closing += constraints.share[n, corner] * speed * constraints.normal[n, axis]
                constraints.bound[n] = max(constraints.bound[n], -restitution[a, b] * closing)
            n += 1
    _list_constraints(n, used, constraints, nodes)
    for k in range(used):
        number[nodes.row[k]] = -1
    return n, used


def _list_constraints(n, used, constraints, nodes):
    """Sort (constraint, corner) by node."""
    nodes.first[: used + 1] = 0
    for c in range(n):
        for corner in range(CORNERS):
            if constraints.node[c, corner] >= 0:
                nodes.first[constraints.node[c, corner] + 1] += 1
    for k in range(used):
        nodes.first[k + 1] += nodes.first[k]
    place = nodes.first[:used].copy()
    for c in range(n):
        for corner in range(CORNERS):
            k = constraints.node[c, corner]
            if k >= 0:
                nodes.constraint[place[k]] = c
                nodes.corner[place[k]] = corner
                place[k] += 1


_list_constraints = compiled(_list_constraints)


def _lever(c, body, constraints, nodes):
    """Sum of shares, and of shares times arms, of the nodes of a constraint that a body carries."""
    total = 0.0
    x = 0.0
    y = 0.0
    z = 0.0
    for corner in range(CORNERS):
        k = constraints.node[c, corner]
        if k >= 0 and nodes.carrier[k] == body:
            share = constraints.share[c, corner]
            total += share
            x += share * nodes.arm[k, 0]
            y += share * nodes.arm[k, 1]
            z += share * nodes.arm[k, 2]
    return total, (x, y, z)


lever = compiled(_lever)


def _turning(c, arm, tensor, constraints):
    """Root of how much a unit impulse at a lever turns a body back at the lever; in all directions under friction."""
    rows = (
        (tensor[0, 0], tensor[0, 1], tensor[0, 2]),
        (tensor[1, 0], tensor[1, 1], tensor[1, 2]),
        (tensor[2, 0], tensor[2, 1], tensor[2, 2]),
    )
    if constraints.friction[c] > 0.0:
        total = 0.0
        for axis in range(3):
            e = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
            t = cross(arm, e)
            total += dot(t, apply(rows, t))
        return math.sqrt(max(total, 0.0))
    t = cross(arm, (constraints.normal[c, 0], constraints.normal[c, 1], constraints.normal[c, 2]))
    return math.sqrt(max(dot(t, apply(rows, t)), 0.0))


turning = compiled(_turning)


def _weigh(n, used, constraints, nodes, carriers, load, twist, sum_share):
    """Bound the row sums of the constraints' matrix ``L M^-1 L^T``.

    A node with mobility m couples two constraints by at most m |share| |share'|; a body by its mobility, and by turning
    (Cauchy and Schwarz).

    Parameters
    ----------
    n, used, constraints, nodes, carriers
        The problem; fills ``constraints.weight``.
    load : (n_nodes,) float64
    twist, sum_share : (n_bodies,) float64
        Room.
    """
    twist[:] = 0.0
    sum_share[:] = 0.0
    for k in range(used):
        total = 0.0
        for m in range(nodes.first[k], nodes.first[k + 1]):
            total += abs(constraints.share[nodes.constraint[m], nodes.corner[m]])
        load[k] = total
    for step in range(2):
        for c in range(n):
            weight = 0.0
            for corner in range(CORNERS):
                k = constraints.node[c, corner]
                if k < 0:
                    continue
                body = nodes.carrier[k]
                if body < 0:
                    mobility = max(nodes.mobility[k, 0], nodes.mobility[k, 1], nodes.mobility[k, 2])
                    weight += abs(constraints.share[c, corner]) * mobility * load[k]
                    continue
                first = True
                for other in range(corner):
                    j = constraints.node[c, other]
                    first = first and not (j >= 0 and nodes.carrier[j] == body)
                if not first:
                    continue
                share, arm = lever(c, body, constraints, nodes)
                turn = turning(c, arm, carriers.tensor[body], constraints)
                if step == 0:
                    sum_share[body] += abs(share)
                    twist[body] += turn
                else:
                    weight += abs(share) * carriers.mobility[body] * sum_share[body] + turn * twist[body]
            constraints.weight[c] = weight


carry = compiled(_carry)
assemble = compiled(_assemble)
weigh = compiled(_weigh)
