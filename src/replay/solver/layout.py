"""The order in which the solver keeps elements and nodes, and the way back to the user's.

Elements are sorted by law, part and Morton code, so that a block of sixteen has one material
and touches few nodes; nodes stand in the order of their first use, those of rigid bodies
after all others. Results return to the user's order through the permutations kept here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.kernels.lanes import LANES
from replay.solver.problem import WHERE, Problem

_MORTON_BITS = 20


@dataclass(frozen=True)
class BlockGroup:
    """Blocks of one material law.

    Parameters
    ----------
    law
        Name of the law.
    rows : (n_blocks, LANES) int64
        The user's element row of every lane; lanes beyond `fill` repeat the last element.
    fill : (n_blocks,) int64
        Elements of each block.
    part : (n_blocks,) int64
        Index into the problem's parts.
    first_block : int
        Of this group, counted over all groups.
    """

    law: str
    rows: NDArray[np.int64]
    fill: NDArray[np.int64]
    part: NDArray[np.int64]
    first_block: int

    @property
    def filled(self) -> NDArray[np.bool_]:
        """Lanes that hold an element of their own, (n_blocks, LANES)."""
        return np.arange(LANES) < self.fill[:, None]


@dataclass(frozen=True)
class Layout:
    """Order of nodes, blocks of elements, bodies.

    Parameters
    ----------
    node_order : (n,) int64
        User's row of each solver row.
    node_row : (n,) int64
        Solver row of each of the user's rows.
    n_free : int
        Nodes that no body carries: the first rows.
    groups
        Deformable elements by law.
    body_parts
        Part indices of each rigid body; the driven body, if any, is the first.
    body_begin, body_end : (n_bodies,) int64
        Tied nodes of each body, counted from `n_free`.
    first_slot, slot : uint32
        Compressed rows from a solver node to its places in the force buffer.
    """

    node_order: NDArray[np.int64]
    node_row: NDArray[np.int64]
    n_free: int
    groups: tuple[BlockGroup, ...]
    body_parts: tuple[tuple[int, ...], ...]
    body_begin: NDArray[np.int64]
    body_end: NDArray[np.int64]
    first_slot: NDArray[np.uint32]
    slot: NDArray[np.uint32]

    @property
    def n_blocks(self) -> int:
        """Blocks of all groups."""
        return sum(len(group.fill) for group in self.groups)


def morton_codes(points: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Interleaved bits of the coordinates: neighbours in space get neighbouring codes."""
    low, size = points.min(axis=0), np.ptp(points, axis=0).max()
    cell = ((points - low) * ((2**_MORTON_BITS - 1) / (size or 1.0))).astype(np.uint64)
    codes = np.zeros(len(points), np.uint64)
    for bit in range(_MORTON_BITS):
        for axis in range(3):
            codes |= ((cell[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return codes


def arrange(problem: Problem) -> Layout:
    """Decide the order of a problem's elements and nodes.

    Raises
    ------
    InputError
        When a held node belongs to a rigid body, whose motion is not free to hold.
    """
    bodies, body_of_node = _bodies(problem)
    tied = body_of_node >= 0
    held = tied & problem.fixed.any(axis=1)
    if held.any():
        raise InputError(
            WHERE, f"node {problem.node_ids[np.argmax(held)]} is fixed and belongs to a rigid body", column="fixed",
            mend="drive the body with a prescribed motion instead",
        )  # fmt: skip
    groups = _groups(problem)
    used = [problem.hexes[group.rows[group.filled]].ravel() for group in groups]
    sequence = np.concatenate([*used, problem.hexes.ravel()])
    _, first = np.unique(sequence, return_index=True)
    node_order = np.lexsort((first, body_of_node, tied))
    node_row = np.empty_like(node_order)
    node_row[node_order] = np.arange(len(node_order))
    n_free = int((~tied).sum())
    ordered = body_of_node[node_order[n_free:]]
    begin = np.searchsorted(ordered, np.arange(len(bodies)), "left").astype(np.int64)
    end = np.searchsorted(ordered, np.arange(len(bodies)), "right").astype(np.int64)
    first_slot, slot = _slots(problem, groups, node_row)
    return Layout(node_order, node_row, n_free, groups, bodies, begin, end, first_slot, slot)


def _bodies(problem: Problem) -> tuple[tuple[tuple[int, ...], ...], NDArray[np.int64]]:
    """Join rigid parts that share nodes or are driven together; number the bodies, the driven one first."""
    rigid = [k for k, part in enumerate(problem.parts) if part.material.is_rigid]
    root = {k: k for k in rigid}

    def find(k: int) -> int:
        while root[k] != k:
            k = root[k]
        return k

    def join(a: int, b: int) -> None:
        a, b = find(a), find(b)
        root[max(a, b)] = min(a, b)

    nodes_of = {k: np.unique(problem.hexes[problem.element_part == k]) for k in rigid}
    rigid = [k for k in rigid if len(nodes_of[k])]
    owner = np.full(len(problem.nodes), -1)
    for k in rigid:
        for other in np.unique(owner[nodes_of[k]]):
            if other >= 0:
                join(int(other), k)
        owner[nodes_of[k]] = k
    driven = [k for k in rigid if problem.prescribed and problem.parts[k].pid in problem.prescribed.pids]
    for k in driven[1:]:
        join(driven[0], k)
    leaders = sorted({find(k) for k in rigid}, key=lambda k: (not (driven and find(driven[0]) == k), k))
    bodies = tuple(tuple(k for k in rigid if find(k) == leader) for leader in leaders)
    body_of_node = np.full(len(problem.nodes), -1)
    for number, parts in enumerate(bodies):
        for k in parts:
            body_of_node[nodes_of[k]] = number
    return bodies, body_of_node


def _groups(problem: Problem) -> tuple[BlockGroup, ...]:
    codes = morton_codes(problem.nodes[problem.hexes].mean(axis=1))
    laws = sorted({part.material.law for part in problem.parts if not part.material.is_rigid})
    groups, first = [], 0
    for law in laws:
        rows, fill, part = [], [], []
        for k, candidate in enumerate(problem.parts):
            if candidate.material.law != law:
                continue
            mine = np.flatnonzero(problem.element_part == k)
            mine = mine[np.argsort(codes[mine], kind="stable")]
            for start in range(0, len(mine), LANES):
                block = mine[start : start + LANES]
                fill.append(len(block))
                part.append(k)
                rows.append(np.concatenate([block, np.repeat(block[-1:], LANES - len(block))]))
        if rows:
            groups.append(BlockGroup(law, np.array(rows), np.array(fill), np.array(part), first))
            first += len(rows)
    return tuple(groups)


def _slots(
    problem: Problem, groups: tuple[BlockGroup, ...], node_row: NDArray[np.int64]
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    nodes, slots = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for group in groups:
        block, lane = np.nonzero(group.filled)
        corner = np.arange(8)
        nodes.append(node_row[problem.hexes[group.rows[block, lane]]].ravel())
        place = (group.first_block + block)[:, None] * (8 * LANES) + corner * LANES + lane[:, None]
        slots.append(place.ravel())
    node, slot = np.concatenate(nodes), np.concatenate(slots)
    order = np.lexsort((slot, node))
    first_slot = np.searchsorted(node[order], np.arange(len(node_row) + 1))
    return first_slot.astype(np.uint32), slot[order].astype(np.uint32)
