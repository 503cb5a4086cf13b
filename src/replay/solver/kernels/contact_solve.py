"""The multipliers of a step: projected iterations in which every constraint looks at the same velocities.

    normal      p   <- max(0, p - (w - bound) / d)
    tangential  p_t <- p_t - w_t / d, shortened to mu p                                (Coulomb)

with d the absolute row sum of the constraints' matrix (Jacobi's method in the l1 form of Baker, Falgout, Kolev and Yang
2011): no step overshoots, whatever the masses, and the result depends neither on the order of constraints nor on the
number of threads. Nesterov's momentum (1983; dropped where it points uphill, O'Donoghue and Candes 2015) takes the root
of the iterations. The other method takes directions from conjugate gradients instead (Silcowitz-Hansen, Niebe and
Erleben 2010).
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from replay.solver.kernels.contact_system import CORNERS
from replay.solver.kernels.device import compiled
from replay.solver.kernels.lanes import specialise

L1_JACOBI, PROJECTED_CG = 0, 1
# speeds below this share of the fastest node's are rounding
_ROUNDING = 1e-14


def _gather(k, constraints, nodes):
    """Impulse of a node from all its constraints, and the velocity it leads to."""
    for axis in range(3):
        total = 0.0
        for m in range(nodes.first[k], nodes.first[k + 1]):
            c = nodes.constraint[m]
            push = constraints.impulse[c] * constraints.normal[c, axis] + constraints.drag[c, axis]
            total += constraints.share[c, nodes.corner[m]] * push
        nodes.impulse[k, axis] = total
        nodes.now[k, axis] = nodes.start[k, axis] + nodes.mobility[k, axis] * total


gather = compiled(_gather)


def _move_nodes(used, constraints, nodes):
    """Velocities of all nodes under the present multipliers, but for what bodies carry."""
    for k in prange(used):
        gather(np.int64(k), constraints, nodes)


def _move_bodies(used, nodes, carriers):
    """Velocities of the bodies, and of the nodes they carry."""
    if carriers.mobility.shape[0] == 0:
        return
    carriers.velocity[:] = 0.0
    carriers.spin[:] = 0.0
    for k in range(used):
        body = nodes.carrier[k]
        if body < 0:
            continue
        px, py, pz = nodes.impulse[k, 0], nodes.impulse[k, 1], nodes.impulse[k, 2]
        rx, ry, rz = nodes.arm[k, 0], nodes.arm[k, 1], nodes.arm[k, 2]
        m = carriers.mobility[body]
        carriers.velocity[body, 0] += m * px
        carriers.velocity[body, 1] += m * py
        carriers.velocity[body, 2] += m * pz
        tx, ty, tz = ry * pz - rz * py, rz * px - rx * pz, rx * py - ry * px
        for axis in range(3):
            t = carriers.tensor[body]
            carriers.spin[body, axis] += t[axis, 0] * tx + t[axis, 1] * ty + t[axis, 2] * tz
    for k in range(used):
        body = nodes.carrier[k]
        if body < 0:
            continue
        rx, ry, rz = nodes.arm[k, 0], nodes.arm[k, 1], nodes.arm[k, 2]
        ox, oy, oz = carriers.spin[body, 0], carriers.spin[body, 1], carriers.spin[body, 2]
        nodes.now[k, 0] = nodes.start[k, 0] + carriers.velocity[body, 0] + oy * rz - oz * ry
        nodes.now[k, 1] = nodes.start[k, 1] + carriers.velocity[body, 1] + oz * rx - ox * rz
        nodes.now[k, 2] = nodes.start[k, 2] + carriers.velocity[body, 2] + ox * ry - oy * rx


def _step(c, constraints, nodes, new, new_drag, residual):
    """One step of a constraint's multipliers from the present velocities; `residual` in m/s."""
    vx = 0.0
    vy = 0.0
    vz = 0.0
    for corner in range(CORNERS):
        k = constraints.node[c, corner]
        if k >= 0:
            share = constraints.share[c, corner]
            vx += share * nodes.now[k, 0]
            vy += share * nodes.now[k, 1]
            vz += share * nodes.now[k, 2]
    nx, ny, nz = constraints.normal[c, 0], constraints.normal[c, 1], constraints.normal[c, 2]
    w = nx * vx + ny * vy + nz * vz
    d = constraints.weight[c]
    inverse = 1.0 / d if d > 0.0 else 0.0
    p = max(constraints.impulse[c] - (w - constraints.bound[c]) * inverse, 0.0)
    new[c] = p
    worst = abs(p - constraints.impulse[c])
    mu = constraints.friction[c]
    if mu > 0.0:
        tx = constraints.drag[c, 0] - (vx - w * nx) * inverse
        ty = constraints.drag[c, 1] - (vy - w * ny) * inverse
        tz = constraints.drag[c, 2] - (vz - w * nz) * inverse
        size = math.sqrt(tx * tx + ty * ty + tz * tz)
        keep = mu * p / size if size > mu * p else 1.0
        new_drag[c, 0] = keep * tx
        new_drag[c, 1] = keep * ty
        new_drag[c, 2] = keep * tz
        for axis in range(3):
            worst = max(worst, abs(new_drag[c, axis] - constraints.drag[c, axis]))
    residual[c] = worst * d


step_one = compiled(_step)


def _step_all(n, constraints, nodes, new, new_drag, residual):
    """One step of every constraint's multipliers."""
    for c in prange(n):
        step_one(np.int64(c), constraints, nodes, new, new_drag, residual)


# one text, compiled with and without threads: few constraints are not worth them
move_nodes = compiled(_move_nodes)
move_nodes_shared = compiled(specialise(_move_nodes, "_move_nodes_shared"), parallel=True)
step_all = compiled(_step_all)
step_all_shared = compiled(specialise(_step_all, "_step_all_shared"), parallel=True)
move_bodies = compiled(_move_bodies)


def _move(used, constraints, nodes, carriers, shared):
    """Velocities under the present multipliers."""
    if shared:
        move_nodes_shared(used, constraints, nodes)
    else:
        move_nodes(used, constraints, nodes)
    move_bodies(used, nodes, carriers)


move = compiled(_move)


def _solve(n, used, constraints, nodes, carriers, most, tolerance, method, shared, new, new_drag, before,
           before_drag, residual):  # fmt: skip
    """Find the multipliers, starting from those in `constraints`; leave the velocities they lead to in `nodes.now`.

    Parameters
    ----------
    n, used, constraints, nodes, carriers
        The problem.
    most : int
        Iterations.
    tolerance : float
        On the remaining speeds over the largest closing speed without multipliers, and on the last change of the
        multipliers over the largest of them.
    method : int
        Of `contact_solve`.
    shared : bool
        Whether the loops are worth several threads.
    new, new_drag, before, before_drag, residual
        Room for the constraints.

    Returns
    -------
    tuple of int, bool and float
        Iterations done, whether they converged, and the last residual over the reference speed.
    """
    fastest = 0.0
    for k in range(used):
        for axis in range(3):
            fastest = max(fastest, abs(nodes.start[k, axis]))
    rounding = _ROUNDING * fastest
    reference = 0.0
    for c in range(n):
        w = -constraints.bound[c]
        for corner in range(CORNERS):
            k = constraints.node[c, corner]
            if k >= 0:
                for axis in range(3):
                    w += constraints.share[c, corner] * constraints.normal[c, axis] * nodes.start[k, axis]
        reference = max(reference, -w)
    reference = max(reference, rounding)
    move(used, constraints, nodes, carriers, shared)
    last_square = 0.0
    last = 1.0
    momentum = 1.0
    done = 0
    converged = False
    share = 0.0
    for c in range(n):
        before[c] = constraints.impulse[c]
        for axis in range(3):
            before_drag[c, axis] = constraints.drag[c, axis]
    while done < most and not converged:
        if shared:
            step_all_shared(n, constraints, nodes, new, new_drag, residual)
        else:
            step_all(n, constraints, nodes, new, new_drag, residual)
        done += 1
        worst = 0.0
        largest = 0.0
        change = 0.0
        square = 0.0
        turn = 0.0
        for c in range(n):
            worst = max(worst, residual[c])
            largest = max(largest, new[c])
            step = new[c] - constraints.impulse[c]
            change = max(change, abs(step))
            square += step * step * constraints.weight[c]
            turn -= step * (new[c] - before[c]) * constraints.weight[c]
            for axis in range(3):
                step = new_drag[c, axis] - constraints.drag[c, axis]
                square += step * step * constraints.weight[c]
                turn -= step * (new_drag[c, axis] - before_drag[c, axis]) * constraints.weight[c]
        share = worst / reference if reference > 0.0 else 0.0
        converged = worst <= rounding or (worst <= tolerance * reference and change <= tolerance * largest)
        beta = 0.0
        going_on = not converged and done < most
        if method == L1_JACOBI and going_on:
            if turn > 0.0:
                momentum = 1.0
            last = momentum
            momentum = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * last * last))
            beta = (last - 1.0) / momentum
        if method == PROJECTED_CG and going_on:
            beta = square / last_square if last_square > 0.0 else 0.0
            last_square = square
            if beta > 1.0:
                beta = 0.0
        for c in range(n):
            if method == PROJECTED_CG:
                step = new[c] - constraints.impulse[c]
                constraints.impulse[c] = new[c] + beta * before[c]
                before[c] = step + beta * before[c]
                for axis in range(3):
                    step = new_drag[c, axis] - constraints.drag[c, axis]
                    constraints.drag[c, axis] = new_drag[c, axis] + beta * before_drag[c, axis]
                    before_drag[c, axis] = step + beta * before_drag[c, axis]
                continue
            constraints.impulse[c] = new[c] + beta * (new[c] - before[c])
            before[c] = new[c]
            for axis in range(3):
                constraints.drag[c, axis] = new_drag[c, axis] + beta * (new_drag[c, axis] - before_drag[c, axis])
                before_drag[c, axis] = new_drag[c, axis]
        move(used, constraints, nodes, carriers, shared)
    return done, converged, share


solve = compiled(_solve)
