"""Tied nodes: their forces to their masters, their motion from them, in one fixed order."""

from __future__ import annotations

from replay.solver.kernels.device import compiled


def _share_forces(force, first_slot, slot, first, weight, base, total):
    """Write every master's share of the forces of a tied node to the slots that the master gathers.

    Parameters
    ----------
    force : (n_slots, 3) float64
        Element forces, and from row `base` on the shares (output) [N].
    first_slot, slot
        Slots of the elements around tied node k: ``slot[first_slot[k]:first_slot[k + 1]]``.
    first, weight : (n + 1,), (m,)
        Weights of node k: ``weight[first[k]:first[k + 1]]``; share j goes to row ``base + j``.
    base : int
        First row of the shares.
    total : (n, 3) float64
        Force of the elements on each tied node (output) [N].
    """
    for k in range(total.shape[0]):
        for axis in range(3):
            f = 0.0
            for j in range(first_slot[k], first_slot[k + 1]):
                f += force[slot[j], axis]
            total[k, axis] = f
            for j in range(first[k], first[k + 1]):
                force[base + j, axis] = weight[j] * f


def _follow(nodal, column, node, first, master, weight):
    """Set three columns of every tied node to the weighted sum of its masters'."""
    for k in range(node.shape[0]):
        for axis in range(column, column + 3):
            value = 0.0
            for j in range(first[k], first[k + 1]):
                value += weight[j] * nodal[master[j], axis]
            nodal[node[k], axis] = value


share_forces = compiled(_share_forces)
follow = compiled(_follow)
