"""From element forces to nodal motion: every node sums its elements in one fixed order.

Batches of elements leave the sums of their forces, a row a node they touch (`lanes`); a node gathers
its rows through a list of slots sorted by batch (compressed sparse rows). No two threads write one number and
no sum depends on who computes it, so any number of threads gives the same bits.
"""

from __future__ import annotations

from numba import prange

from replay.solver.kernels.device import compiled
from replay.solver.kernels.lanes import LANES, POSITION, VELOCITY

#: Nodes whose energies are summed together, whatever the number of threads.
CHUNK = 512

#: Columns of the sums over a chunk.
KINETIC, INTERNAL_WORK, EXTERNAL_WORK, RUNAWAYS = 0, 1, 2, 3


def _advance_nodes(
    nodal, count, force, first_slot, slot, mass, inverse_mass, external, dt_kick, dt_drift, speed_limit, sums
):  # fmt: skip
    """Kick and drift the free nodes, and keep account of the work.

    A step of central differences changes the kinetic energy by exactly the force times the
    mean of the velocities before and after: ``m (v+ - v-)(v+ + v-)/2 = dt f (v+ + v-)/2``.

    Parameters
    ----------
    nodal : (n, 8) float64
        Positions and velocities, updated in place.
    count : int
        Free nodes: the first `count` rows.
    force : (n_rows, 3) float64
        Sums of element forces, batch by batch [N].
    first_slot, slot : uint32
        Compressed rows: slots of node i are ``slot[first_slot[i]:first_slot[i + 1]]``.
    mass : (n,) float64
        [kg].
    inverse_mass : (n, 3) float64
        [1/kg]; zero where a degree of freedom keeps its velocity.
    external : (n, 3) float64
        Loads and weight [N].
    dt_kick, dt_drift : float
        Mean of the step before and after; step after, or zero to leave positions alone [s].
    speed_limit : float
        Faster nodes are counted as runaways, and so are velocities that are not numbers [m/s].
    sums : (n_chunks, 4) float64
        Kinetic energy after the kick, work absorbed by elements, work of loads and of held degrees of
        freedom [J], number of runaways (output).
    """
    for chunk in prange(sums.shape[0]):
        kinetic = 0.0
        internal = 0.0
        outside = 0.0
        runaways = 0.0
        for node in range(chunk * CHUNK, min((chunk + 1) * CHUNK, count)):
            fx = 0.0
            fy = 0.0
            fz = 0.0
            for k in range(first_slot[node], first_slot[node + 1]):
                fx += force[slot[k], 0]
                fy += force[slot[k], 1]
                fz += force[slot[k], 2]
            square = 0.0
            for axis in range(3):
                inner = fx if axis == 0 else (fy if axis == 1 else fz)
                load = external[node, axis]
                mobility = inverse_mass[node, axis]
                old = nodal[node, VELOCITY + axis]
                new = old + dt_kick * mobility * (load - inner)
                mean = 0.5 * dt_kick * (old + new)
                internal += inner * mean
                outside += (load if mobility > 0.0 else inner) * mean
                square += new * new
                nodal[node, VELOCITY + axis] = new
                nodal[node, POSITION + axis] += dt_drift * new
            kinetic += 0.5 * mass[node] * square
            runaways += 0.0 if square <= speed_limit * speed_limit else 1.0
        sums[chunk, 0] = kinetic
        sums[chunk, 1] = internal
        sums[chunk, 2] = outside
        sums[chunk, 3] = runaways


def _gather_forces(force, first_slot, slot, begin, end, result):
    """Sum the rows of nodes `begin` to `end` into rows of `result` (n, 3) [N]."""
    for node in range(begin, end):
        for axis in range(3):
            total = 0.0
            for k in range(first_slot[node], first_slot[node + 1]):
                total += force[slot[k], axis]
            result[node - begin, axis] = total


def _drift_nodes(nodal, begin, end, dt):
    """Move nodes `begin` to `end` by `dt` times their velocities."""
    for node in range(begin, end):
        for axis in range(3):
            nodal[node, POSITION + axis] += dt * nodal[node, VELOCITY + axis]


def _reduce_blocks(step, work, part, part_work, least):
    """Add each block's work to its part and find the smallest step, block by block.

    Parameters
    ----------
    step : (n_blocks, LANES) float64
        Stable steps [s].
    work : (n_blocks, 3) float64
        Work of the step [J].
    part : (n_blocks,) int64
        Row of `part_work` of each block.
    part_work : (n_parts, 3) float64
        Updated in place [J].
    least : (3,) float64
        Smallest step [s], its block and lane; lowered in place.

    Returns
    -------
    bool
        Whether this group holds the smallest step so far.
    """
    found = False
    for block in range(step.shape[0]):
        for k in range(3):
            part_work[part[block], k] += work[block, k]
        for lane in range(LANES):
            if step[block, lane] < least[0]:
                least[0] = step[block, lane]
                least[1] = block
                least[2] = lane
                found = True
    return found


advance_nodes = compiled(_advance_nodes, parallel=True)
gather_forces = compiled(_gather_forces)
drift_nodes = compiled(_drift_nodes)
reduce_blocks = compiled(_reduce_blocks)
