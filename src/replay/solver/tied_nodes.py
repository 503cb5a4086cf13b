"""The ties of a run: who follows whom in the solver's order, and what that does to masses and the time step."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.arrays import WHERE
from replay.solver.kernels.lanes import POSITION, VELOCITY
from replay.solver.kernels.ties import follow, share_forces
from replay.solver.layout import Layout
from replay.solver.problem import Problem

#: Sharpening a bound this often brings it within a few per cent of where it tends to.
_SHARPENED = 12


class TiedNodes:
    """All tied nodes of a run.

    Parameters
    ----------
    problem, layout
        What to build.

    Attributes
    ----------
    count
        Tied nodes.
    step_scale
        Factor of the elements' stable step; 1 where no weight is negative.
    """

    def __init__(self, problem: Problem, layout: Layout) -> None:
        ties = problem.ties
        rows = [tie.nodes for tie in ties]
        self._n_ties = len(ties)
        self._tie = np.repeat(np.arange(len(ties)), [len(r) for r in rows])
        user = np.concatenate([np.empty(0, np.int64), *rows])
        self.nodes = layout.node_row[user]
        self.count = len(user)
        masters = [layout.node_row[m[w != 0]] for tie in ties for m, w in zip(tie.masters, tie.weights)]
        weights = [w[w != 0] for tie in ties for w in tie.weights]
        self._first = np.concatenate([[0], np.cumsum([len(m) for m in masters])]).astype(np.int64)
        self._master = np.concatenate([np.empty(0, np.int64), *masters])
        self._weight = np.concatenate([np.empty(0), *weights])
        self._base = layout.n_rows
        # what the elements take from the motion of each tied node
        self.force = np.zeros((self.count, 3))
        self.step_scale = 1.0
        carried = self.nodes >= layout.n_free
        if carried.any():
            raise InputError(
                WHERE, f"node {problem.node_ids[user[np.argmax(carried)]]} is tied and belongs to a rigid body",
                column="ties", mend="change the roles of the two sides",
            )  # fmt: skip
        self._ids = problem.node_ids[layout.node_order[self._master]] if self.count else np.empty(0, np.int64)

    def rearrange(self, layout: Layout) -> Layout:
        """Layout in which masters gather the shares of tied nodes, and tied nodes gather nothing."""
        if not self.count:
            return layout
        first, slot = layout.first_slot.astype(np.int64), layout.slot
        own = [slot[first[row] : first[row + 1]] for row in self.nodes]
        self._first_slot = np.concatenate([[0], np.cumsum([len(s) for s in own])]).astype(np.uint32)
        self._slot = np.concatenate(own)
        node = np.repeat(np.arange(len(first) - 1), np.diff(first))
        kept = ~np.isin(node, self.nodes)
        node = np.concatenate([node[kept], self._master])
        slots = np.concatenate([slot[kept].astype(np.int64), self._base + np.arange(len(self._master))])
        order = np.lexsort((slots, node))
        starts = np.searchsorted(node[order], np.arange(len(first)))
        return dataclasses.replace(
            layout,
            n_rows=layout.n_rows + len(self._master),
            first_slot=starts.astype(np.uint32),
            slot=slots[order].astype(np.uint32),
        )

    def share_masses(self, *masses: NDArray[np.float64]) -> None:
        """Hand the masses of tied nodes to their masters, in place; find `step_scale` from the first of them.

        Raises
        ------
        InputError
            When a master is left without mass.
        """
        if not self.count:
            return
        node = np.repeat(np.arange(self.count), np.diff(self._first))
        own = masses[0].copy()
        for mass in masses:
            mass += np.bincount(self._master, self._weight * mass[self.nodes][node], len(mass))
            mass[self.nodes] = 0.0
        empty = ~(masses[0][self._master] > 0)
        if empty.any():
            raise InputError(
                WHERE, f"the tie leaves node {self._ids[np.argmax(empty)]} without mass", column="ties",
                expected="tied nodes on the finer side", mend="change the roles of the two sides",
            )  # fmt: skip
        ratio = self._mass_ratio(own, masses[0])
        self.step_scale = 1.0 / math.sqrt(ratio) if ratio > 1.0 + 1e-9 else 1.0

    def _mass_ratio(self, own: NDArray[np.float64], lumped: NDArray[np.float64]) -> float:
        """Upper bound of the greatest eigenvalue of ``M'^-1 T^T M T``.

        M are the masses before sharing, M' those after, T the weights. With negative weights the tied motion can
        have less inertia in M' than in M, and the stable step is that of the elements over the root of this. For
        any x > 0 the greatest ``(|A| x)_i / x_i`` bounds the eigenvalues of A; powers of ``|A|`` sharpen it.
        """
        first, count = self._first, np.diff(self._first)
        # every pair of masters of one tied node
        left = np.concatenate([np.repeat(np.arange(a, b), b - a) for a, b in pairwise(first.tolist())])
        right = np.concatenate([np.tile(np.arange(a, b), b - a) for a, b in pairwise(first.tolist())])
        tied = np.repeat(self.nodes, count**2)
        rows, local = np.unique(self._master, return_inverse=True)
        key = local[left] * len(rows) + local[right]
        key, place = np.unique(np.concatenate([key, np.arange(len(rows)) * (len(rows) + 1)]), return_inverse=True)
        value = np.concatenate([self._weight[left] * own[tied] * self._weight[right], own[rows]])
        i, j = np.divmod(key, len(rows))
        size = np.abs(np.bincount(place, value, len(key))) / lumped[rows][i]
        x, bound = np.ones(len(rows)), math.inf
        for _ in range(_SHARPENED):
            y = np.bincount(i, size * x[j], len(rows))
            bound = min(bound, float((y / x).max()))
            x = y / y.max()
        return bound

    def share_loads(self, loads: NDArray[np.float64]) -> NDArray[np.float64]:
        """Loads (n, 3) of all solver nodes with those of tied nodes on their masters."""
        result = loads.copy()
        if self.count:
            node = np.repeat(np.arange(self.count), np.diff(self._first))
            np.add.at(result, self._master, self._weight[:, None] * loads[self.nodes][node])
            result[self.nodes] = 0.0
        return result

    def share(self, force: NDArray[np.float64]) -> None:
        """Hand the element forces of tied nodes to their masters' slots of the buffer."""
        if self.count:
            share_forces(force, self._first_slot, self._slot, self._first, self._weight, self._base, self.force)

    def place(self, nodal: NDArray[np.float64]) -> None:
        """Put every tied node where its masters are."""
        if self.count:
            follow(nodal, POSITION, self.nodes, self._first, self._master, self._weight)

    def move(self, nodal: NDArray[np.float64]) -> None:
        """Give every tied node the velocity of its masters."""
        if self.count:
            follow(nodal, VELOCITY, self.nodes, self._first, self._master, self._weight)

    def resultants(self) -> NDArray[np.float64]:
        """Force of the tied side's elements on the masters, by interface (n_ties, 3) [N]."""
        total = np.zeros((self._n_ties, 3))
        np.add.at(total, self._tie, -self.force)
        return total
