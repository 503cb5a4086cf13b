"""The last resort of the mesh: nodes of the worst hexes are moved, if and only if that makes the worst better."""

from __future__ import annotations

import numpy as np

from replay.models.quality import EDGES, scaled_jacobians

_SHARES = (0.25, 0.5, 1.0)


def relocate_worst_nodes(
    nodes: np.ndarray, hexes: np.ndarray, *, target: float = 0.30, passes: int = 12, fixed: np.ndarray | None = None
) -> tuple[np.ndarray, int]:
    """Move nodes of hexes below the target towards the mean of their neighbours.

    A trial is kept when the smallest scaled Jacobian of the hexes around the node rises. The order is that of the
    node numbers: the result does not depend on anything else.

    Parameters
    ----------
    nodes
        (n, 3) [m]; not changed.
    hexes
        (m, 8).
    target
        Scaled Jacobian below which a hex is worked on.
    passes
        Sweeps at most.
    fixed
        Mask of nodes that stay, (n,) bool.

    Returns
    -------
    tuple
        New nodes, and how many moved.
    """
    quality = scaled_jacobians(nodes, hexes)
    if quality.min() >= target:
        return nodes, 0
    out = nodes.copy()
    flat = hexes.ravel()
    order = np.argsort(flat, kind="stable")
    start = np.searchsorted(flat[order], np.arange(len(nodes) + 1))
    for _ in range(passes):
        bad = np.flatnonzero(scaled_jacobians(out, hexes) < target)
        improved = False
        for node in np.unique(hexes[bad]).tolist():
            if fixed is None or not fixed[node]:
                around = hexes[np.unique(order[start[node] : start[node + 1]] // 8)]
                improved |= _improve(out, node, around, target)
        if not improved:
            break
    return out, int(np.any(out != nodes, axis=1).sum())


def _improve(nodes: np.ndarray, node: int, around: np.ndarray, target: float) -> bool:
    """Try a few places for one node, in place; say whether one was better."""
    best, place = scaled_jacobians(nodes, around).min(), nodes[node].copy()
    if best >= target:
        return False
    start = place.copy()
    ends = around[:, EDGES]
    touching = (ends == node).any(axis=2)
    neighbours = np.unique(ends[touching])
    neighbours = neighbours[neighbours != node]
    towards = nodes[neighbours].mean(axis=0) - start
    reach = np.sqrt(np.sum((nodes[neighbours] - start) ** 2, axis=1)).mean()
    trials = [towards * share for share in _SHARES]
    trials += [sign * reach * share * axis for share in (0.05, 0.15, 0.3) for axis in np.eye(3) for sign in (1, -1)]
    for trial in trials:
        nodes[node] = start + trial
        quality = scaled_jacobians(nodes, around).min()
        if quality > best + 1e-9:
            best, place = quality, nodes[node].copy()
    nodes[node] = place
    return bool(np.any(place != start))
