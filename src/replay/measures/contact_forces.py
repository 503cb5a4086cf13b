"""What touched what, how hard, and what the mounts of a facemask carried."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replay.measures.fidelity import Motion
from replay.tables import Column, TableFormat

_IMPULSES = ["impulse_x_N_s", "impulse_y_N_s", "impulse_z_N_s"]
_FORCES = ["force_x_N", "force_y_N", "force_z_N"]

FORCE_TABLE = TableFormat(
    "force history",
    (
        Column("time_s", "end of the interval over which the force is a mean"),
        *(Column(f"force_{axis}_N", "component, global axes") for axis in "xyz"),
        Column("force_N", "resultant"),
    ),
)


def contact_summary(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Pairs of parts that touched, the one with the greatest force first.

    Parameters
    ----------
    table
        Rows of contact.csv.
    """
    rows = []
    for (first, second), pair in table.groupby(["part_a", "part_b"], sort=False):
        force = np.sqrt((pair[_FORCES].to_numpy() ** 2).sum(axis=1))
        last = pair.iloc[-1]
        rows.append(
            {
                "first": first,
                "second": second,
                "peak_force_N": float(force.max()),
                "peak_time_s": float(pair["time_s"].iloc[int(np.argmax(force))]),
                "impulse_N_s": float(np.sqrt((last[_IMPULSES].to_numpy(float) ** 2).sum())),
                "normal_J": float(last["normal_J"]),
                "friction_J": float(last["friction_J"]),
            }
        )
    return sorted(rows, key=lambda row: -row["peak_force_N"])


def impulse_on(table: pd.DataFrame, pids: Collection[int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times of contact.csv, and the impulse (n, 3) that all other parts have given to these [N s]."""
    time = np.sort(table["time_s"].unique())
    total = np.zeros((len(time), 3))
    for (first, second), pair in table.groupby(["pid_a", "pid_b"], sort=False):
        sign = float(first in pids) - float(second in pids)
        if sign:
            total += sign * pair.sort_values("time_s")[_IMPULSES].to_numpy(float)
    return time, total


def force_history(time_s: NDArray[np.float64], impulse: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Columns of `FORCE_TABLE`: mean force of each interval between two times of an impulse (n, 3) [N s]."""
    force = np.diff(impulse, axis=0) / np.diff(time_s)[:, None]
    columns = {f"force_{axis}_N": force[:, k] for k, axis in enumerate("xyz")}
    return {"time_s": time_s[1:], **columns, "force_N": np.sqrt((force**2).sum(axis=1))}


def mount_impulse(facemask: Motion, mass_kg: float, touched: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Impulse (n, 3) that the mounts have given to a rigid facemask [N s]: its momentum less what contact gave it.

    Parameters
    ----------
    facemask
        Motion of its centre of gravity.
    mass_kg
        Of the facemask alone.
    touched
        Impulse of contact on it, (n, 3) [N s], or 0 where nothing can touch.
    """
    velocity = facemask.velocity_m_per_s
    return np.asarray(mass_kg * (velocity - velocity[0]) - touched, dtype=float)
