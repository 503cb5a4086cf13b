"""Replay numerics: is the energy kept, is the hourglass energy bounded? (article, abstract gate iii, protocol 3.7)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

if TYPE_CHECKING:
    import pandas as pd

NO_CONTACT = "no contact in this model"
NO_ENERGY = "the run has no energy to keep account of"
RUN_CHECKS = (
    "added_mass_share",
    "added_mass_part_share",
    "min_time_step_s",
    "min_volume_ratio",
    "flow_residual",
)
CONTACT_CHECKS = (
    "contact_creation_share",
    "friction_work_J",
    "contact_unconverged_share",
    "penetration_over_edge",
)
_ENERGIES = ("kinetic_J", "internal_J", "hourglass_J", "bulk_viscosity_J", "external_work_J", "total_J")


@dataclass(frozen=True)
class PartEnergy:
    """Energies of one part over the run.

    Parameters
    ----------
    name
        Of the part.
    internal_J, hourglass_J
        Peak of each over the run [J].
    fluid
        Whether the part has almost no shear energy of its own (cerebrospinal fluid).
    """

    name: str
    internal_J: float
    hourglass_J: float
    fluid: bool = False


def part_energies(table: pd.DataFrame, fluid_pids: Iterable[int] = ()) -> list[PartEnergy]:
    """Take the peak energies of each part from the rows of part_energy.csv.

    Parameters
    ----------
    table
        ``pid``, ``part``, ``internal_J``, ``hourglass_J``, one row a part and time.
    fluid_pids
        Numbers of the fluid parts.
    """
    fluids = set(fluid_pids)
    return [
        PartEnergy(
            name=str(rows["part"].iloc[0]),
            internal_J=float(rows["internal_J"].max()),
            hourglass_J=float(rows["hourglass_J"].max()),
            fluid=int(cast(int, pid)) in fluids,
        )
        for pid, rows in table.groupby("pid", sort=False)
    ]


def numerics_gate(
    energy: Mapping[str, ArrayLike],
    parts: Sequence[PartEnergy],
    run: Mapping[str, Any],
    limits: Limits,
    *,
    steps: ArrayLike | None = None,
    free: bool = False,
    contact: Mapping[str, Any] | None = None,
) -> Gate:
    """Judge the numbers that the solver kept while it ran.

    Parameters
    ----------
    energy
        Columns of energy.csv: ``kinetic_J``, ``internal_J``, ``hourglass_J``,
        ``bulk_viscosity_J``, ``external_work_J``, ``total_J``, ``ratio`` and
        ``momentum_{x,y,z}_N_s``, one value a row.
    parts
        Peak energies of each part.
    run
        ``ran_to_end`` and one entry per name of `RUN_CHECKS`; a text in place of a number
        is the reason why that check has no power, ``<name>_detail`` adds a sentence.
    steps
        Step number of each row of `energy`; without it neighbouring rows are compared.
    free
        Whether nothing outside acts on the system: only then its momentum must be kept,
        and is judged.
    contact
        One entry per name of `CONTACT_CHECKS`, or None for a model without contact.
    """
    judge = Judge("numerics", limits)
    run = dict(run)
    judge.check("ran_to_end", run.pop("ran_to_end"))
    table = {name: np.asarray(values, dtype=float) for name, values in energy.items()}
    peak = max(float(np.abs(table[name]).max(initial=0.0)) for name in _ENERGIES)
    if np.isfinite(peak) and peak <= judge.parameter("energy_floor_J"):
        for name in ("energy_ratio_min", "energy_ratio_max", "energy_jump", "hourglass_share"):
            judge.check(name, NO_ENERGY)
    else:
        _energy_balance(judge, table, None if steps is None else np.asarray(steps))
        _hourglass(judge, parts)
    if free:
        judge.check("momentum_drift", momentum_drift(table))
    judge.check_all(run, RUN_CHECKS)
    judge.check_all(contact if contact is not None else dict.fromkeys(CONTACT_CHECKS, NO_CONTACT), CONTACT_CHECKS)
    return judge.gate()


def _energy_balance(judge: Judge, energy: Mapping[str, NDArray], steps: NDArray | None) -> None:
    total, ratio = energy["total_J"], energy["ratio"]
    with np.errstate(divide="ignore", invalid="ignore"):
        reference = np.where(ratio != 0, total / ratio, 0.0)
    finite = np.isfinite(total) & np.isfinite(ratio)
    if not finite.all():
        detail = f"row {int(np.flatnonzero(~finite)[0]) + 1} of the ledger is not a number"
        for name in ("energy_ratio_min", "energy_ratio_max", "energy_jump"):
            judge.check(name, float("nan"), detail)
        return
    scale = float(np.abs(reference).max())
    least = judge.parameter("energy_reference_least")
    told = np.abs(reference) >= least * scale
    detail = f"over {int(told.sum())} of {told.size} rows: reference energy above {least:g} of its peak {scale:.4g} J"
    judge.check("energy_ratio_min", float(ratio[told].min()), detail)
    judge.check("energy_ratio_max", float(ratio[told].max()), detail)
    error = total - reference
    span = int(judge.parameter("energy_jump_steps"))
    judge.check("energy_jump", _greatest_jump(error, steps, span) / scale)


def _greatest_jump(error: NDArray, steps: NDArray | None, span: int) -> float:
    """Return the greatest change of `error` between rows at most `span` steps apart, or between neighbours."""
    if error.size < 2:
        return 0.0
    jump = float(np.abs(np.diff(error)).max())
    if steps is None:
        return jump
    lag = 2
    while lag < error.size:
        near = steps[lag:] - steps[:-lag] <= span
        if not near.any():
            break
        jump = max(jump, float(np.abs(error[lag:] - error[:-lag])[near].max()))
        lag += 1
    return jump


def _hourglass(judge: Judge, parts: Sequence[PartEnergy]) -> None:
    """Judge each part by its own internal energy, a fluid one by that of the whole model."""
    whole = sum(part.internal_J for part in parts)
    least = judge.parameter("hourglass_part_ignored_below") * whole
    judged = [part for part in parts if part.internal_J + part.hourglass_J > least]
    if not judged:
        judge.check("hourglass_share", "no part has internal energy")
    for part in judged:
        own = whole if part.fluid else part.internal_J
        share = part.hourglass_J / own if own > 0 else float("inf")
        detail = "a fluid part: of the whole model's peak internal energy" if part.fluid else ""
        judge.check("hourglass_share", share, detail, of=part.name)


def momentum_drift(energy: Mapping[str, ArrayLike]) -> float | str:
    """Greatest |p - p0| / |p0| over the rows of energy.csv, or the reason why there is none."""
    momentum = np.stack([np.asarray(energy[f"momentum_{axis}_N_s"], dtype=float) for axis in "xyz"], axis=1)
    start = float(np.linalg.norm(momentum[0]))
    if start == 0.0:
        return "the system starts without momentum"
    return float(np.linalg.norm(momentum - momentum[0], axis=1).max() / start)
