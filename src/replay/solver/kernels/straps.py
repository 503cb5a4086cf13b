"""Tension of straps."""

from __future__ import annotations

import math

from replay.solver.kernels.device import compiled
from replay.solver.kernels.lanes import POSITION, VELOCITY

#: Columns of a strap's row: length, length without tension, tension, stiffness over mass that tension itself gives.
LENGTH, NATURAL, TENSION, TIGHTNESS = 0, 1, 2, 3
STRAP_COLUMNS = 4


def _strap_forces(
    first, node, body, mobility, natural, pay_in, constants, time, nodal, centre, wrench, external, force, row
):  # fmt: skip
    """Tension of all straps, and its pull on nodes and bodies.

    The pull on a node is the tension times the sum of the unit vectors to its neighbours: internal forces along
    lines between nodes, which keep momentum and angular momentum to rounding.

    Parameters
    ----------
    first, node : (n + 1,), (m,) int64
        Nodes of strap k are ``node[first[k]:first[k + 1]]``, rows of `nodal`.
    body : (m,) int64
        Rigid body of each of them, or -1.
    mobility : (m,) float64
        Bound of the inverse mass that each opposes to the strap [1/kg].
    natural : (n,) float64
        Length without tension at time 0 [m].
    pay_in : (n, 2) float64
        Length [m] and time [s].
    constants : (n, 2) float64
        Stiffness [N/m] and damping [N s/m].
    time : float
        Present time [s].
    nodal, centre, wrench
        See `kernels.bodies`; `wrench` is updated in place.
    external : (n_nodes, 3) float64
        Loads on nodes [N]; updated in place for free nodes.
    force : (m, 3) float64
        Pull on each node (output) [N].
    row : (n, STRAP_COLUMNS) float64
        Output; see `LENGTH` and its neighbours.
    """
    for k in range(natural.shape[0]):
        length = 0.0
        rate = 0.0
        tight = 0.0
        for j in range(first[k], first[k + 1]):
            for axis in range(3):
                force[j, axis] = 0.0
        for j in range(first[k], first[k + 1] - 1):
            a, b = node[j], node[j + 1]
            square = 0.0
            closing = 0.0
            for axis in range(3):
                d = nodal[b, POSITION + axis] - nodal[a, POSITION + axis]
                square += d * d
                closing += d * (nodal[b, VELOCITY + axis] - nodal[a, VELOCITY + axis])
            piece = math.sqrt(square)
            length += piece
            rate += closing / piece
            tight = max(tight, (mobility[j] + mobility[j + 1]) / piece)
            for axis in range(3):
                e = (nodal[b, POSITION + axis] - nodal[a, POSITION + axis]) / piece
                force[j, axis] += e
                force[j + 1, axis] -= e
        share = min(time / pay_in[k, 1], 1.0) if pay_in[k, 1] > 0.0 else 1.0
        free = natural[k] - share * pay_in[k, 0]
        tension = 0.0
        if length > free:
            tension = max(constants[k, 0] * (length - free) + constants[k, 1] * rate, 0.0)
        for j in range(first[k], first[k + 1]):
            a = node[j]
            for axis in range(3):
                force[j, axis] *= tension
            if body[j] < 0:
                for axis in range(3):
                    external[a, axis] += force[j, axis]
            else:
                rx = nodal[a, POSITION] - centre[body[j], 0]
                ry = nodal[a, POSITION + 1] - centre[body[j], 1]
                rz = nodal[a, POSITION + 2] - centre[body[j], 2]
                for axis in range(3):
                    wrench[body[j], axis] += force[j, axis]
                wrench[body[j], 3] += ry * force[j, 2] - rz * force[j, 1]
                wrench[body[j], 4] += rz * force[j, 0] - rx * force[j, 2]
                wrench[body[j], 5] += rx * force[j, 1] - ry * force[j, 0]
        row[k, 0] = length
        row[k, 1] = free
        row[k, 2] = tension
        # both ends of a piece move against one another: twice the sum of what they oppose
        row[k, 3] = 2.0 * tension * tight


def _strap_work(node, body, nodal, before, centre, twist, force, dt, work):
    """Work that all straps do on nodes and on bodies over a kick.

    Parameters
    ----------
    node, body, nodal, centre, force
        See `_strap_forces`; the velocities of free nodes are those after the kick.
    before : (m, 3) float64
        Velocities before it [m/s].
    twist : (n_bodies, 6) float64
        Mean over the kick.
    dt : float
        [s].
    work : (2,) float64
        On free nodes, on bodies (output) [J].
    """
    work[0] = 0.0
    work[1] = 0.0
    for j in range(node.shape[0]):
        a, b = node[j], body[j]
        if b < 0:
            for axis in range(3):
                work[0] += force[j, axis] * 0.5 * dt * (before[j, axis] + nodal[a, VELOCITY + axis])
        else:
            rx = nodal[a, POSITION] - centre[b, 0]
            ry = nodal[a, POSITION + 1] - centre[b, 1]
            rz = nodal[a, POSITION + 2] - centre[b, 2]
            work[1] += dt * force[j, 0] * (twist[b, 0] + twist[b, 4] * rz - twist[b, 5] * ry)
            work[1] += dt * force[j, 1] * (twist[b, 1] + twist[b, 5] * rx - twist[b, 3] * rz)
            work[1] += dt * force[j, 2] * (twist[b, 2] + twist[b, 3] * ry - twist[b, 4] * rx)


strap_forces = compiled(_strap_forces)
strap_work = compiled(_strap_work)
