"""The order in which the solver keeps elements and nodes, and the way back to the user's.

Elements are sorted by law, part and Morton code, so that a block of sixteen has one material
and touches few nodes; nodes stand in the order of their first use, those of rigid bodies
after all others. Results return to the user's order through the permutations kept here.

Forces are summed twice. Blocks that follow one another make a batch, the work of one thread, which sums its
elements into rows of its own, one row a node that it touches; a node then sums its rows. Most nodes lie
inside a batch and have one row, so that little goes through memory, and both sums have one order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.arrays import WHERE
from replay.solver.kernels.lanes import BATCH_BLOCKS, LANES
from replay.solver.problem import Problem

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
    """

    law: str
    rows: NDArray[np.int64]
    fill: NDArray[np.int64]
    part: NDArray[np.int64]

    @property
    def filled(self) -> NDArray[np.bool_]:
        """Lanes that hold an element of their own, (n_blocks, LANES)."""
        return np.arange(LANES) < self.fill[:, None]


@dataclass(frozen=True)
class BatchRows:
    """Where the batches of one law sum their forces.

    Parameters
    ----------
    first_row : (n_batches + 1,) int64
        Rows of each batch: ``first_row[b]`` to ``first_row[b + 1]`` of the force array of all laws.
    place : (n_blocks, 8, LANES) uint16
        Row of every corner within its batch; 0 in lanes that hold no element of their own.
    """

    first_row: NDArray[np.int64]
    place: NDArray[np.uint16]


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
    body_parts, body_sets
        Part indices and rigid set indices of each rigid body; the driven bodies are the first, in the order of
        their motions.
    body_begin, body_end : (n_bodies,) int64
        Tied nodes of each body, counted from `n_free`.
    carrier : (n,) int64
        Body of each solver node, -1 for none.
    batches
        Rows of the force array by group.
    n_rows : int
        Rows of the force array.
    first_slot, slot : uint32
        Compressed rows from a solver node to its rows of the force array.
    """

    node_order: NDArray[np.int64]
    node_row: NDArray[np.int64]
    n_free: int
    groups: tuple[BlockGroup, ...]
    body_parts: tuple[tuple[int, ...], ...]
    body_sets: tuple[tuple[int, ...], ...]
    body_begin: NDArray[np.int64]
    body_end: NDArray[np.int64]
    carrier: NDArray[np.int64]
    batches: tuple[BatchRows, ...]
    n_rows: int
    first_slot: NDArray[np.uint32]
    slot: NDArray[np.uint32]

    def body_named(self, problem: Problem, name: int | str) -> int:
        """Number of the body that a part number or the name of a rigid set stands for."""
        for body, (parts, sets) in enumerate(zip(self.body_parts, self.body_sets)):
            if name in [problem.parts[k].pid for k in parts] or name in [problem.rigid_sets[k].name for k in sets]:
                return body
        raise InputError(WHERE, f"rigid part {name} has no elements", column="parts", mend="remove what names it")

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
        When a held node belongs to a rigid body, whose motion is not free to hold; when two motions drive one body.
    """
    members, body_of_node = _bodies(problem)
    bodies = len(members)
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
    begin = np.searchsorted(ordered, np.arange(bodies), "left").astype(np.int64)
    end = np.searchsorted(ordered, np.arange(bodies), "right").astype(np.int64)
    batches, row_node = _batches(problem, groups, node_row)
    slot = np.argsort(row_node, kind="stable")
    first_slot = np.searchsorted(row_node[slot], np.arange(len(node_row) + 1))
    n_parts = len(problem.parts)
    parts = tuple(tuple(k for k in keys if k < n_parts) for keys in members)
    sets = tuple(tuple(k - n_parts for k in keys if k >= n_parts) for keys in members)
    return Layout(
        node_order, node_row, n_free, groups, parts, sets, begin, end, body_of_node[node_order], batches, len(row_node),
        first_slot.astype(np.uint32), slot.astype(np.uint32),
    )  # fmt: skip


def _bodies(problem: Problem) -> tuple[list[list[int]], NDArray[np.int64]]:
    """Join rigid parts and sets that share nodes or are driven together; number the bodies, driven ones first.

    A key below the number of parts is a part, one above it a rigid set.
    """
    n_parts = len(problem.parts)
    nodes_of = {
        k: np.unique(problem.hexes[problem.element_part == k])
        for k, part in enumerate(problem.parts)
        if part.material.is_rigid
    } | {n_parts + k: np.sort(rigid_set.nodes) for k, rigid_set in enumerate(problem.rigid_sets)}
    rigid = [k for k in nodes_of if len(nodes_of[k])]
    root = {k: k for k in rigid}

    def find(k: int) -> int:
        while root[k] != k:
            k = root[k]
        return k

    def join(a: int, b: int) -> None:
        a, b = find(a), find(b)
        root[max(a, b)] = min(a, b)

    owner = np.full(len(problem.nodes), -1)
    for k in rigid:
        for other in np.unique(owner[nodes_of[k]]):
            if other >= 0:
                join(int(other), k)
        owner[nodes_of[k]] = k
    driven = [_driven_keys(problem, number, rigid) for number in range(len(problem.prescribed))]
    for keys in driven:
        for k in keys[1:]:
            join(keys[0], k)
    motion_of: dict[int, int] = {}
    for number, keys in enumerate(driven):
        for leader in {find(k) for k in keys}:
            if leader in motion_of:
                raise InputError(
                    WHERE, f"motions {motion_of[leader] + 1} and {number + 1} drive one body", column="prescribed",
                    expected="one motion for a body", mend="parts that share nodes are one body",
                )  # fmt: skip
            motion_of[leader] = number
    leaders = sorted({find(k) for k in rigid}, key=lambda k: (motion_of.get(k, len(driven)), k))
    members = [[k for k in rigid if find(k) == leader] for leader in leaders]
    body_of_node = np.full(len(problem.nodes), -1)
    for number, keys in enumerate(members):
        for k in keys:
            body_of_node[nodes_of[k]] = number
    return members, body_of_node


def _driven_keys(problem: Problem, number: int, rigid: list[int]) -> list[int]:
    motion = problem.prescribed[number]
    keys = [k for k, part in enumerate(problem.parts) if part.pid in motion.pids]
    keys += [len(problem.parts) + k for k, s in enumerate(problem.rigid_sets) if s.name in motion.rigid_sets]
    found = [k for k in keys if k in rigid]
    if not found:
        raise InputError(WHERE, f"motion {number + 1} drives parts without elements", column="prescribed.pids")
    return found


def _groups(problem: Problem) -> tuple[BlockGroup, ...]:
    codes = morton_codes(problem.nodes[problem.hexes].mean(axis=1))
    laws = sorted({part.material.law for part in problem.parts if not part.material.is_rigid})
    groups = []
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
            groups.append(BlockGroup(law, np.array(rows), np.array(fill), np.array(part)))
    return tuple(groups)


def _batches(
    problem: Problem, groups: tuple[BlockGroup, ...], node_row: NDArray[np.int64]
) -> tuple[tuple[BatchRows, ...], NDArray[np.int64]]:
    """Rows of every batch, and the solver node of each row."""
    batches, row_node, total = [], [np.empty(0, np.int64)], 0
    for group in groups:
        corners = node_row[problem.hexes[group.rows]].transpose(0, 2, 1)
        place = np.zeros(corners.shape, np.uint16)
        filled = np.broadcast_to(group.filled[:, None, :], corners.shape)
        first_row = [total]
        for begin in range(0, len(corners), BATCH_BLOCKS):
            here = slice(begin, begin + BATCH_BLOCKS)
            nodes, row = np.unique(corners[here][filled[here]], return_inverse=True)
            place[here][filled[here]] = row
            row_node.append(nodes)
            total += len(nodes)
            first_row.append(total)
        batches.append(BatchRows(np.array(first_row), place))
    return tuple(batches), np.concatenate(row_node)
