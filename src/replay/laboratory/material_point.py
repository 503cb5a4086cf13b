"""One element, one law, any test: the stress answer of a material to a programme of strain.

The deformation is uniform, so the law itself is driven, by the very kernel that the solver inlines. Where the sides
are free, their stretch is found in every step so that they carry no stress.
"""

# ruff: noqa: F821 - some names are bound for each law by `_compiled_law`
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.laboratory.programme import Programme
from replay.solver import LAWS, Material, law_parameters
from replay.solver.kernels.device import compiled
from replay.solver.kernels.element import IDENTITY, Motion
from replay.solver.kernels.lanes import load, specialise, state_size
from replay.solver.materials import law_fields
from replay.tables import Column, TableFormat

_TRIES = 40
ANSWER_TABLE = TableFormat(
    "answer of a material to a test",
    (
        Column("time_s", "since the start of the test"),
        Column("strain", "nominal, positive in the sense of the test; amount of shear"),
        Column("nominal_stress_Pa", "force over first area, positive in the sense of the test; shear stress in shear"),
        Column("true_stress_Pa", "Cauchy stress, in the same sense"),
        Column("lateral_stretch", "stretch of the sides"),
        *(Column(f"stress_{k}_Pa", "Cauchy stress; x is the axis") for k in ("xx", "yy", "zz", "xy", "yz", "zx")),
        Column("HV57", "damage variable phi; 0 where the law has none"),
        Column("equivalent_plastic_strain", "0 where the law has none"),
    ),
)

# bound for each law by `_compiled_law`
update: Callable[..., Any]
N_STATE: int
N_CONSTANTS: int


@dataclass(frozen=True)
class Answer:
    """What a specimen did.

    Parameters
    ----------
    programme
        What was done to it.
    nominal_pa : (n,) float64
        Force over first area, in the sense of the test (compression positive in compression) [Pa].
    true_pa : (n,) float64
        Cauchy stress along the axis, or its shear component, in the sense of the test [Pa].
    lateral : (n,) float64
        Stretch of the sides.
    stress_pa : (n, 6) float64
        Cauchy stress xx, yy, zz, xy, yz, zx; x is the axis [Pa].
    fields
        What the law shows beside the stress, by name, (n,).
    """

    programme: Programme
    nominal_pa: NDArray[np.float64]
    true_pa: NDArray[np.float64]
    lateral: NDArray[np.float64]
    stress_pa: NDArray[np.float64]
    fields: dict[str, NDArray[np.float64]]

    def table(self) -> dict[str, NDArray[np.float64]]:
        """Columns of `ANSWER_TABLE`."""
        nothing = np.zeros(len(self.lateral))
        test = self.programme
        columns = [test.times, test.strains, self.nominal_pa, self.true_pa, self.lateral, *self.stress_pa.T]
        columns += [self.fields.get(name, nothing) for name in ("HV57", "equivalent_plastic_strain")]
        return dict(zip(ANSWER_TABLE.names, columns))


def _follow(stretch, dt, free, shear, p, rest, stress, lateral, state):
    """Fill stress (n, 6), lateral (n,) and state (n, k) of a programme; False where the sides could not be freed."""
    now = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    kept = load(rest, 0, 1, N_STATE)
    constants = load(p, 0, 1, N_CONSTANTS)
    axis, side = stretch[0], 1.0
    good = True
    for k in range(stretch.shape[0]):
        goal = stretch[k]
        if shear:
            grown = goal - axis
            spin = 0.25 * grown
            share = 1.0 / (1.0 + spin * spin)
            # rotation of the half-step spin about z (Cayley)
            c, s = (1.0 - spin * spin) * share, -2.0 * spin * share
            turn = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
            motion = Motion(
                (0.0, 0.0, 0.0, 0.5 * grown, 0.0, 0.0), turn, ((1.0, goal, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 1.0
            )
            found, after, _ = update(motion, now, kept, dt[k], constants)
        else:
            along = 2.0 * (goal - axis) / (goal + axis)
            guess = side * np.sqrt(axis / goal) if free else side
            before, before_stress = 0.0, 0.0
            for attempt in range(_TRIES):
                across = 2.0 * (guess - side) / (guess + side)
                f = ((goal, 0.0, 0.0), (0.0, guess, 0.0), (0.0, 0.0, guess))
                motion = Motion((along, across, across, 0.0, 0.0, 0.0), IDENTITY, f, goal * guess * guess)
                found, after, moduli = update(motion, now, kept, dt[k], constants)
                wave = moduli.lame + 2.0 * moduli.shear
                if not free or abs(found[1]) <= 1e-13 * wave + 1e-9 * abs(found[0]):
                    break
                slope = 2.0 * (moduli.lame + moduli.shear) / guess
                if attempt > 0 and guess != before:
                    secant = (found[1] - before_stress) / (guess - before)
                    slope = secant if secant > 0.0 else slope
                before, before_stress = guess, found[1]
                guess = min(max(guess - found[1] / slope, 0.8 * guess), 1.25 * guess)
            if free and not abs(found[1]) <= 1e-9 * wave + 1e-6 * abs(found[0]):
                good = False
            side = guess
        axis, now, kept = goal, found, after
        lateral[k] = side
        for i in range(6):
            stress[k, i] = now[i]
        for i in range(N_STATE):
            state[k, i] = kept[i]
    return good


@cache
def _compiled_law(name: str) -> Any:
    """Loop over the steps of a programme for one law."""
    law = LAWS[name]
    names = {"update": law.update, "N_STATE": state_size(law), "N_CONSTANTS": law.N_CONSTANTS}
    return compiled(specialise(_follow, f"follow_{name}", **names))


def answer(material: Material, test: Programme) -> Answer:
    """Put a material through a test.

    Parameters
    ----------
    material
        Any deformable law.
    test
        What is done to it.

    Raises
    ------
    InputError
        When the material makes no sense, is rigid, or its sides find no stretch without stress.
    """
    where = f"material {material.name!r}"
    if material.is_rigid:
        raise InputError(where, "a rigid material has no stress", column="law", expected="a law that deforms")
    law, parameters = LAWS[material.law], law_parameters(material)
    rest = np.zeros(state_size(law))
    if hasattr(parameters, "initial_state"):
        rest[:] = parameters.initial_state()
    n = len(test.times)
    stress, lateral, state = np.zeros((n, 6)), np.ones(n), np.zeros((n, state_size(law)))
    dt = np.diff(test.times, prepend=test.times[0])
    constants = np.array(parameters.constants(), dtype=float)
    arrays = (constants, rest, stress, lateral, state)
    if not _compiled_law(material.law)(test.stretches, dt, test.free_sides, test.sheared, *arrays):
        raise InputError(
            where, f"in {test.mode} at {test.rate_per_s:g} per s its free sides find no stretch without stress",
            column="parameters", mend="the law has no stable answer there; try a smaller strain",
        )  # fmt: skip
    fields = {name: state[:, law.STATE.index(kept)] for name, kept in law_fields(law).items()}
    sense = 1.0 if test.sheared or test.mode == "tension" else -1.0
    true = sense * stress[:, 3 if test.sheared else 0]
    return Answer(test, true if test.sheared else true * lateral**2, true, lateral, stress, fields)
