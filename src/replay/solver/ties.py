"""Tied interfaces: nodes that follow others, with fixed weights.

A tied node has no motion of its own, ``x = sum_i w_i x_i``. Its forces go to its masters with the same weights,
and so does its mass. With ``sum w = 1`` that keeps momentum, with the node at that place angular momentum, and the tie
does no work. `replay.solver.mortar` finds weights for two surfaces whose meshes do not match.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.arrays import WHERE, checked_array, checked_integers

_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Tie:
    """One interface.

    Parameters
    ----------
    name
        Unique.
    nodes : (k,) int
        Rows of the problem's nodes that are tied.
    masters : (k, w) int
        Rows that each of them follows; a row of weight 0 fills up.
    weights : (k, w) float64
        Sum 1 in every row; together with the masters they give the place of the node.
    """

    name: str
    nodes: NDArray[np.int64]
    masters: NDArray[np.int64]
    weights: NDArray[np.float64]

    def __post_init__(self) -> None:
        where = f"ties.{self.name}"
        put = object.__setattr__
        put(self, "nodes", checked_integers(self.nodes, f"{where}.nodes", (None,)))
        put(self, "masters", checked_integers(self.masters, f"{where}.masters", (len(self.nodes), None)))
        put(self, "weights", checked_array(self.weights, f"{where}.weights", self.masters.shape))


def check_ties(
    ties: Sequence[Tie], nodes: NDArray[np.float64], ids: NDArray[np.int64], fixed: NDArray[np.bool_]
) -> None:
    """Refuse ties that cannot be kept.

    Parameters
    ----------
    ties
        All interfaces of a problem.
    nodes, ids
        Coordinates [m] and numbers of all nodes.
    fixed : (n, 3) bool
        Degrees of freedom with a support.

    Raises
    ------
    InputError
        Naming the interface and the node.
    """
    slaves = np.zeros(len(nodes), bool)
    for tie in ties:
        where = f"ties.{tie.name}"
        for rows, name in ((tie.nodes, "nodes"), (tie.masters, "masters")):
            if not rows.size or rows.min() < 0 or rows.max() >= len(nodes):
                raise InputError(
                    WHERE, "is empty or names a row that does not exist", column=f"{where}.{name}",
                    expected=f"rows 0 to {len(nodes) - 1}",
                )  # fmt: skip
        _, count = np.unique(tie.nodes, return_counts=True)
        twice = slaves[tie.nodes] | np.isin(tie.nodes, np.unique(tie.nodes)[count > 1])
        slaves[tie.nodes] = True
        place = np.einsum("kw,kwi->ki", tie.weights, nodes[tie.masters])
        size = np.ptp(nodes, axis=0).max()
        for bad, found, mend in (
            (twice, "is tied twice", "tie it once"),
            (fixed[tie.nodes].any(axis=1), "is tied and has a support of its own", "support its masters"),
            (abs(tie.weights.sum(axis=1) - 1) > _TOLERANCE, "has weights whose sum is not 1", "normalise them"),
            (
                np.abs(place - nodes[tie.nodes]).max(axis=1) > _TOLERANCE * size,
                "is not where its masters put it", "move it there: `replay.solver.mortar` does",
            ),
        ):  # fmt: skip
            if bad.any():
                raise InputError(WHERE, f"node {ids[tie.nodes[np.argmax(bad)]]} {found}", column=where, mend=mend)
    for tie in ties:
        chained = (slaves[tie.masters] & (tie.weights != 0)).any(axis=1)
        if chained.any():
            raise InputError(
                WHERE, f"node {ids[tie.nodes[np.argmax(chained)]]} follows a node that is tied itself",
                column=f"ties.{tie.name}", mend="change the roles of the two sides of one interface",
            )  # fmt: skip
