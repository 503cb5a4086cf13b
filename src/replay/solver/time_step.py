"""The time step: bounded by the elements, shortened a little so that output times are met exactly; mass scaling."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.solver.elements import ElementGroup
from replay.solver.kernels.assembly import reduce_blocks
from replay.solver.problem import Problem

_MASS_ROUNDS = 8
_NO_STEP = 1e30


@dataclass(frozen=True)
class StepBound:
    """The smallest stable step and the element that has it.

    Parameters
    ----------
    step_s
        Stable step of that element [s]; negative when it is inverted or not a number.
    element
        The user's element row, -1 where nothing deforms.
    """

    step_s: float
    element: int


def smallest_step(groups: Sequence[ElementGroup], part_work: NDArray[np.float64]) -> StepBound:
    """Smallest step of all elements; adds the step's work of each block to its part on the way."""
    least = np.array([_NO_STEP, 0.0, 0.0])
    holder = None
    for group in groups:
        if reduce_blocks(group.step, group.work, group.group.part, part_work, least):
            holder = group
    if holder is None:
        return StepBound(math.inf, -1)
    return StepBound(float(least[0]), int(holder.group.rows[int(least[1]), int(least[2])]))


def fitted_step(stable: float, time: float, target: float) -> tuple[float, bool]:
    """Largest step up to `stable` that reaches `target` in equal steps.

    Parameters
    ----------
    stable, time, target
        Bound, present time and next output time [s].

    Returns
    -------
    tuple of float and bool
        The step [s], and whether it ends at the target.
    """
    remaining = target - time
    count = max(math.ceil(remaining / stable * (1.0 - 1e-12)), 1)
    return remaining / count, count == 1


@dataclass(frozen=True)
class AddedMass:
    """What mass scaling has added.

    Parameters
    ----------
    by_part_kg : (n_parts,)
        Added mass of each part [kg].
    elements : (n_parts,)
        Elements of each part that got some.
    """

    by_part_kg: NDArray[np.float64]
    elements: NDArray[np.int64]

    @property
    def total_kg(self) -> float:
        """Over all parts [kg]."""
        return float(self.by_part_kg.sum())


def scale_masses(problem: Problem, groups: Sequence[ElementGroup], nodal: NDArray[np.float64]) -> AddedMass:
    """Give mass to elements whose step is below the target, and say how much.

    The step of an element grows as the root of its mass but for the part of bulk viscosity, so a
    few rounds bring it to the target.
    """
    target = problem.controls.mass_scaling_time_step_s / problem.controls.time_step_factor
    for _ in range(_MASS_ROUNDS if target > 0 else 0):
        short = False
        for group in groups:
            group.forces(nodal, 0.0)
            ratio = np.where(group.step > 0, target / np.maximum(group.step, 1e-300), 1.0)
            below = ratio > 1.0 + 1e-9
            if below.any():
                group.mass[below] *= ratio[below] ** 2
                short = True
        if not short:
            break
    mass, count = np.zeros(len(problem.parts)), np.zeros(len(problem.parts), np.int64)
    for group in groups:
        added = np.where(group.group.filled, group.mass - group.physical_mass, 0.0)
        np.add.at(mass, group.group.part, added.sum(axis=1))
        np.add.at(count, group.group.part, (added > 0).sum(axis=1))
    return AddedMass(mass, count)
