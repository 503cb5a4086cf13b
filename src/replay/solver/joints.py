"""Joints between rigid bodies: a centre that holds together, and springs and dampers against turning.

A joint has axes that are fixed in its first body. The turn of the second body against the first is its rotation
vector theta in these axes; the springs have the potential ``U = sum_a k_a(sign theta_a) theta_a^2 / 2``, and
moments are its exact derivatives, so that a joint without damper gives back what it takes at any angle. The centre is
held by a spring and a damper between the two bodies' points. See docs/physics.md.
"""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.arrays import WHERE, checked_array

#: The rotation vector of a joint loses its meaning at half a turn.
MOST_ANGLE_RAD = math.radians(170.0)


@dataclass(frozen=True)
class Joint:
    """One joint.

    Parameters
    ----------
    name
        Unique.
    first, second
        Number of a rigid part or name of a rigid set; `first` may be None, which is ground.
    centre : (3,)
        At time 0 [m].
    stiffness : (3, 2)
        Moment per angle about x, y and z of the joint, for a positive and for a negative angle of the second body
        against the first [N m/rad].
    damping_ratio
        Of every axis, with the mean of its two stiffnesses and the inertia that both bodies oppose to it at time 0.
    centre_stiffness
        Force per distance of the two centres [N/m]; 0 lets them part.
    centre_damping_ratio
        With `centre_stiffness` and the mass that both bodies oppose.
    axes : (3, 3)
        x, y and z of the joint in space at time 0, in rows; those of space by default.
    """

    name: str
    first: int | str | None
    second: int | str
    centre: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    damping_ratio: float = 0.0
    centre_stiffness: float = 1e8
    centre_damping_ratio: float = 0.0
    axes: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        where = f"joints.{self.name}"
        put = object.__setattr__
        put(self, "centre", checked_array(self.centre, f"{where}.centre", (3,)))
        put(self, "stiffness", checked_array(self.stiffness, f"{where}.stiffness", (3, 2)))
        put(self, "axes", checked_array(self.axes, f"{where}.axes", (3, 3)))
        if (self.stiffness < 0).any():
            raise InputError(WHERE, "a stiffness is negative", column=f"{where}.stiffness", expected=">= 0")
        for name in ("damping_ratio", "centre_stiffness", "centre_damping_ratio"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise InputError(WHERE, f"it is {value!r}", column=f"{where}.{name}", expected=">= 0")
        if np.abs(self.axes @ self.axes.T - np.eye(3)).max() > 1e-9 or np.linalg.det(self.axes) < 0:
            raise InputError(
                WHERE, "the axes are not orthonormal and right-handed", column=f"{where}.axes",
                expected="three unit vectors in rows, the third the product of the first two",
            )  # fmt: skip

    def check(self, rigid: Container[int | str]) -> None:
        """Refuse bodies that do not exist.

        Raises
        ------
        InputError
            Naming the joint and the body.
        """
        for end in ("first", "second"):
            body = getattr(self, end)
            if body not in rigid and not (body is None and end == "first"):
                raise InputError(
                    WHERE, f"{body!r} is no rigid part and no rigid set", column=f"joints.{self.name}.{end}",
                    expected="the number of a part of the law 'rigid', or the name of a rigid set",
                )  # fmt: skip
