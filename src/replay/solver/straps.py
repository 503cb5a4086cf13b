"""Straps: cables that pull along a line of nodes and never push.

A strap slides without friction over its inner nodes, so that one tension acts along it:
``T = max(0, k (L - L0) + c dL/dt)`` while it is longer than L0, else zero. L0 is the length at time 0, more by the
slack, less by what has been paid in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.arrays import WHERE, checked_rows


@dataclass(frozen=True)
class Strap:
    """One strap.

    Parameters
    ----------
    name
        Unique.
    nodes : (k,) int
        Rows of the problem's nodes in the order in which the strap passes them, at least two.
    stiffness_n_per_m
        Tension per stretch of the whole strap.
    damping_n_s_per_m
        Tension per rate of its length; it only adds to a strap that is taut.
    slack_m
        Length that it has to spare at time 0.
    pay_in_m, pay_in_time_s
        Length that a buckle takes in, evenly over this time from time 0 on (at once, if it is 0).
    recorded
        Whether ``straps.csv`` has it; a net of many cables would be a table that nobody reads.
    """

    name: str
    nodes: NDArray[np.int64]
    stiffness_n_per_m: float
    damping_n_s_per_m: float = 0.0
    slack_m: float = 0.0
    pay_in_m: float = 0.0
    pay_in_time_s: float = 0.0
    recorded: bool = True

    def check(self, nodes: NDArray[np.float64]) -> None:
        """Refuse what is no strap.

        Parameters
        ----------
        nodes : (n, 3) float64
            The problem's [m].

        Raises
        ------
        InputError
            Naming the strap.
        """
        where = f"straps.{self.name}"
        rows = checked_rows(self.nodes, f"{where}.nodes", len(nodes))
        object.__setattr__(self, "nodes", rows)
        if len(rows) < 2:
            raise InputError(WHERE, "has one node", column=f"{where}.nodes", expected="at least two")
        for name in ("stiffness_n_per_m", "damping_n_s_per_m", "slack_m", "pay_in_m", "pay_in_time_s"):
            value = getattr(self, name)
            least = "> 0" if name.startswith("stiffness") else ">= 0"
            if not 0 <= value < math.inf or (value == 0 and least == "> 0"):
                raise InputError(WHERE, f"it is {value!r}", column=f"{where}.{name}", expected=least)
        pieces = np.linalg.norm(np.diff(nodes[rows], axis=0), axis=1)
        if not pieces.min() > 0:
            raise InputError(WHERE, "two of its nodes are at one place", column=f"{where}.nodes")
        if self.pay_in_m >= pieces.sum() + self.slack_m:
            raise InputError(
                WHERE, f"{self.pay_in_m:.6g} m are more than its length of {pieces.sum() + self.slack_m:.6g} m",
                column=f"{where}.pay_in_m",
            )  # fmt: skip
