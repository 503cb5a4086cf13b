"""What a user says about contact: the article's controls, and what holds between which parts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError

WHERE = "solver contact"
SOLVERS = ("l1_jacobi", "projected_cg")
POINTS = ("corners", "center_plus_corners")


@dataclass(frozen=True)
class ContactPair:
    """What holds where two sets of parts touch.

    Parameters
    ----------
    first, second
        Numbers of the parts on either side.
    friction
        Coulomb's coefficient.
    restitution
        Share of the closing speed that comes back; for rigid bodies only, 0 (inelastic) unless chosen.
    active
        False lets these parts pass through each other.
    name
        For tables and messages.
    """

    first: tuple[int, ...]
    second: tuple[int, ...]
    friction: float = 0.0
    restitution: float = 0.0
    active: bool = True
    name: str = ""


@dataclass(frozen=True)
class ContactControls:
    """Global contact of all parts by Lagrange multipliers on velocities (the article's scheme 3, constraint type 0).

    Parameters
    ----------
    most_iterations
        Of the multipliers, each step.
    tolerance
        On the remaining closing speed over the largest one, and on the change of the multipliers over the largest.
    points
        What may not pass a face: ``corners`` (nodes), or ``center_plus_corners``: centres too, of faces about which
        the surface turns.
    centre_angle_deg
        A face gets a centre point where a neighbour turns more than this [degrees].
    solver
        ``l1_jacobi`` or ``projected_cg``; neither depends on the order of the constraints.
    friction
        Coefficient between parts that no pair names.
    pairs
        Exceptions to it; a later one wins.
    self_contact
        Numbers of parts that may touch themselves.
    """

    most_iterations: int = 200
    tolerance: float = 1e-3
    points: str = "center_plus_corners"
    centre_angle_deg: float = 15.0
    solver: str = "l1_jacobi"
    friction: float = 0.0
    pairs: tuple[ContactPair, ...] = ()
    self_contact: tuple[int, ...] = ()

    def check(self, pids: Iterable[int], rigid: Iterable[int]) -> None:
        """Refuse settings that make no sense for a model.

        Parameters
        ----------
        pids, rigid
            Numbers of all parts, of the rigid ones.

        Raises
        ------
        InputError
            Naming the setting.
        """
        known, stiff = set(pids), set(rigid)
        if self.most_iterations < 1:
            raise InputError(WHERE, f"it is {self.most_iterations}", column="most_iterations", expected="at least 1")
        if not 0 < self.tolerance < 1:
            raise InputError(WHERE, f"it is {self.tolerance!r}", column="tolerance", expected="between 0 and 1")
        if not 0 < self.centre_angle_deg <= 180:
            raise InputError(WHERE, f"it is {self.centre_angle_deg!r}", column="centre_angle_deg", expected="0 to 180")
        for name, value, choices in (("solver", self.solver, SOLVERS), ("points", self.points, POINTS)):
            if value not in choices:
                raise InputError(WHERE, f"{value!r} is none", column=name, expected=" or ".join(choices))
        _check_friction(self.friction, "friction")
        _check_known(self.self_contact, known, "self_contact")
        for number, pair in enumerate(self.pairs):
            where = f"pairs[{number}]" + (f" ({pair.name})" if pair.name else "")
            for side in (pair.first, pair.second):
                if not side:
                    raise InputError(WHERE, "one side names no part", column=where, expected="a part on either side")
                _check_known(side, known, where)
            _check_friction(pair.friction, where)
            if not 0 <= pair.restitution <= 1:
                raise InputError(
                    WHERE, f"the restitution is {pair.restitution!r}", column=where, expected="0 (inelastic) to 1"
                )
            soft = {*pair.first, *pair.second} - stiff
            if pair.restitution > 0 and soft:
                raise InputError(
                    WHERE, f"part {min(soft)} deforms and has a restitution", column=where,
                    expected="restitution between rigid parts only", mend="what deforms springs back by itself",
                )  # fmt: skip


def _check_friction(value: float, where: str) -> None:
    if not 0 <= value < math.inf:
        raise InputError(WHERE, f"the friction is {value!r}", column=where, expected="a coefficient, 0 or more")


def _check_known(pids: Iterable[int], known: set[int], where: str) -> None:
    strange = sorted(set(pids) - known)
    if strange:
        raise InputError(
            WHERE, f"part {strange[0]} does not exist", column=where, expected=", ".join(map(str, sorted(known)))
        )


@dataclass(frozen=True)
class PairTable:
    """The settings of every pair of parts, as matrices over part indices.

    Parameters
    ----------
    active : (n_parts, n_parts) bool
        Whether they may touch.
    friction, restitution : (n_parts, n_parts) float64
        Symmetric.
    """

    active: NDArray[np.bool_]
    friction: NDArray[np.float64]
    restitution: NDArray[np.float64]


def pair_table(controls: ContactControls, pids: Iterable[int]) -> PairTable:
    """Resolve pairs and defaults for parts in the order of `pids`."""
    row = {pid: k for k, pid in enumerate(pids)}
    n = len(row)
    active = ~np.eye(n, dtype=bool)
    for pid in controls.self_contact:
        active[row[pid], row[pid]] = True
    friction, restitution = np.full((n, n), float(controls.friction)), np.zeros((n, n))
    for pair in controls.pairs:
        a, b = np.array([row[p] for p in pair.first]), np.array([row[p] for p in pair.second])
        for i, j in ((a, b), (b, a)):
            block = np.ix_(i, j)
            friction[block], restitution[block] = pair.friction, pair.restitution
            if not pair.active:
                active[block] = False
    return PairTable(active, friction, restitution)
