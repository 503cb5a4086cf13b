"""Mechanical action: the time integral of kinetic energy (article, discussion and Figure 7)."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from replay.errors import InputError
from replay.tables import Column, TableFormat

_ENERGY_FILE = "part_energy.csv"
ACTION_TABLE = TableFormat(
    "mechanical action",
    (
        Column("time_s", "time since the start of the window"),
        Column("head_J_s", "mechanical action of the head, time integral of its kinetic energy"),
        Column("helmet_J_s", "mechanical action of the helmet"),
        Column("impactor_J_s", "mechanical action of the impactor; empty where there is none", may_be_empty=True),
    ),
)


def mechanical_action(time_s: ArrayLike, kinetic_energy_J: ArrayLike) -> NDArray[np.float64]:
    """A(t) = int_0^t E_k dt [J s], by the trapezoidal rule.

    Parameters
    ----------
    time_s : (n,)
        Rising times [s].
    kinetic_energy_J : (n,)
        Kinetic energy [J].

    Returns
    -------
    (n,) float64
        Starts at zero.
    """
    time, energy = np.asarray(time_s, dtype=float), np.asarray(kinetic_energy_J, dtype=float)
    if time.shape != energy.shape or time.ndim != 1:
        message = f"{time.shape} times for {energy.shape} energies"
        raise ValueError(message)
    return np.concatenate([[0.0], np.cumsum(0.5 * (energy[1:] + energy[:-1]) * np.diff(time))])


def kinetic_energy_of(part_energy: pd.DataFrame, pids: Iterable[int]) -> NDArray[np.float64]:
    """Sum the kinetic energy [J] of some parts at each time of part_energy.csv.

    Raises
    ------
    InputError
        When a part has no row.
    """
    wanted = set(pids)
    missing = wanted - set(part_energy["pid"])
    if missing:
        raise InputError(_ENERGY_FILE, f"part {min(missing)} is not there", mend="run the replay again")
    rows = part_energy[part_energy["pid"].isin(wanted)]
    return rows.groupby("time_s", sort=True)["kinetic_J"].sum().to_numpy(dtype=float)


def crossover_time(time_s: ArrayLike, first: ArrayLike, second: ArrayLike) -> float:
    """Time at which `first` stops being the larger one (or the smaller one), linear between samples.

    Returns
    -------
    float
        NaN where the two histories never cross after they first differ.
    """
    time = np.asarray(time_s, dtype=float)
    lead = np.asarray(first, dtype=float) - np.asarray(second, dtype=float)
    differ = np.flatnonzero(lead != 0.0)
    if differ.size == 0:
        return float("nan")
    sign = np.sign(lead[differ[0]])
    after = np.flatnonzero((np.sign(lead) == -sign) & (np.arange(lead.size) > differ[0]))
    if after.size == 0:
        return float("nan")
    k = int(after[0])
    share = lead[k - 1] / (lead[k - 1] - lead[k])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def write_action(
    path: str | Path, time_s: ArrayLike, head: ArrayLike, helmet: ArrayLike, impactor: ArrayLike | None = None
) -> None:
    """Write action.csv; without an impactor (a driven head) its column is empty."""
    time = np.asarray(time_s, dtype=float)
    absent = np.full(time.size, np.nan) if impactor is None else impactor
    ACTION_TABLE.write(path, {"time_s": time, "head_J_s": head, "helmet_J_s": helmet, "impactor_J_s": absent})
