"""What the brain went through: regional histories, the peak of every element, snapshots of strain.

`BrainRecorder` is handed to the solver, which shows it the state at each history time; what
it has gathered is part of a checkpoint, so a resumed run writes the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import h5py
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from replay.errors import InputError
from replay.files import atomic_path
from replay.measures.strain import (
    green_lagrange,
    logarithmic,
    maximum_shear_strain,
    principal_stretches,
    tensile_pressure,
    volume_fraction_at_least,
    von_mises,
    weighted_percentile,
)
from replay.tables import Column, TableFormat

WHOLE_BRAIN = "brain"
_STATISTICS = (
    ("mps_green_lagrange_p50", "median over volume of the maximum principal Green-Lagrange strain"),
    ("mps_green_lagrange_p95", "its 95th percentile over volume"),
    ("mps_green_lagrange_max", "its maximum over elements"),
    ("mps_log_p50", "median over volume of the maximum principal logarithmic strain"),
    ("mps_log_p95", "its 95th percentile over volume"),
    ("mps_log_max", "its maximum over elements"),
    ("maximum_shear_strain_p95", "95th percentile of (E1 - E3) / 2, Green-Lagrange"),
    ("tensile_pressure_p95_Pa", "95th percentile of max(tr sigma / 3, 0)"),
    ("tensile_pressure_max_Pa", "its maximum over elements"),
    ("von_mises_p95_Pa", "95th percentile of the von Mises stress"),
    ("csdm15", "volume share whose strain (Green-Lagrange) has reached 0.15 so far"),
    ("csdm25", "volume share whose strain (Green-Lagrange) has reached 0.25 so far"),
)
HISTORY_TABLE = TableFormat(
    "regional histories of the brain",
    (
        Column("time_s", "time since the start of the run"),
        Column("region", "region of the brain, or `brain` for all of it", "text"),
        Column("volume_m3", "undeformed volume, the weight of all percentiles"),
        *(Column(name, meaning, may_be_empty=True) for name, meaning in _STATISTICS),
    ),
)
_ELEMENT_MEASURES = (
    ("mps_green_lagrange", "greatest maximum principal Green-Lagrange strain of the element"),
    ("mps_log", "greatest maximum principal logarithmic strain"),
    ("maximum_shear_strain", "greatest (E1 - E3) / 2"),
    ("tensile_pressure_Pa", "greatest tensile pressure"),
    ("von_mises_Pa", "greatest von Mises stress"),
)
PEAK_TABLE = TableFormat(
    "peaks of the brain's elements",
    (
        Column("element_id", "number of the element in the model", "int"),
        Column("volume_m3", "undeformed volume"),
        *(
            column
            for name, meaning in _ELEMENT_MEASURES
            for column in (
                Column(name, meaning),
                Column(f"{name.removesuffix('_Pa')}_time_s", "when the element first reached it"),
            )
        ),
    ),
)


class BrainView(Protocol):
    """What the recorder needs to see of a state of the solver, all elements in the solver's input order."""

    @property
    def time_s(self) -> float:
        """Time of the state [s]."""

    @property
    def stress(self) -> NDArray[np.float64]:
        """Cauchy stress (m, 6), xx, yy, zz, xy, yz, zx [Pa]."""

    @property
    def volumes(self) -> NDArray[np.float64]:
        """Volumes (m,) [m^3]."""

    def deformation_gradient(self) -> NDArray[np.float64]:
        """Return F of every element, (m, 3, 3)."""


class BrainRecorder:
    """Gathers strain and stress of the brain while the solver runs.

    Parameters
    ----------
    rows : (k,) int
        Elements of the brain, as rows of the model's elements.
    element_ids : (k,) int
        Their numbers in the model.
    groups
        Region name -> positions within `rows`. The whole brain is added as ``brain``.
    snapshot_interval_s
        Strain of every element is kept this often, for pictures.
    """

    def __init__(
        self,
        rows: ArrayLike,
        element_ids: ArrayLike,
        groups: Mapping[str, ArrayLike],
        *,
        snapshot_interval_s: float = 1e-3,
    ) -> None:
        self._rows = np.asarray(rows, dtype=np.int64)
        self._element_ids = np.asarray(element_ids, dtype=np.int64)
        if self._rows.size == 0 or self._rows.shape != self._element_ids.shape:
            message = f"{self._rows.size} rows and {self._element_ids.size} numbers of brain elements"
            raise ValueError(message)
        chosen = {name: np.asarray(at, dtype=np.int64) for name, at in groups.items()}
        self._groups = {WHOLE_BRAIN: np.arange(self._rows.size)} | {n: g for n, g in chosen.items() if g.size}
        self._snapshot_interval_s = snapshot_interval_s
        self._volumes = np.zeros(0)
        count = len(_ELEMENT_MEASURES)
        self._peaks = np.full((count, self._rows.size), -np.inf)
        self._peak_times = np.full((count, self._rows.size), np.nan)
        self._times: list[float] = []
        self._histories: list[NDArray[np.float64]] = []
        self._snapshot_times: list[float] = []
        self._snapshots: list[NDArray[np.float32]] = []

    def sample(self, view: BrainView) -> None:
        """Take the state of one history time."""
        stretches = principal_stretches(view.deformation_gradient()[self._rows])
        stress = view.stress[self._rows]
        if self._volumes.size == 0:
            self._volumes = np.array(view.volumes[self._rows], dtype=float)
        now = np.stack(
            [
                green_lagrange(stretches[:, 0]),
                logarithmic(stretches[:, 0]),
                maximum_shear_strain(stretches),
                tensile_pressure(stress),
                von_mises(stress),
            ]
        )
        higher = now > self._peaks
        self._peaks = np.where(higher, now, self._peaks)
        self._peak_times = np.where(higher, view.time_s, self._peak_times)
        self._times.append(float(view.time_s))
        self._histories.append(np.stack([self._statistics(now, at) for at in self._groups.values()]))
        due = len(self._snapshot_times) * self._snapshot_interval_s
        if view.time_s >= due * (1 - 1e-9):
            self._snapshot_times.append(float(view.time_s))
            self._snapshots.append(now[0].astype(np.float32))

    def _statistics(self, now: NDArray, at: NDArray) -> NDArray[np.float64]:
        weight = self._volumes[at]
        green, log, shear, pressure, mises = now[:, at]
        reached = self._peaks[0, at]
        return np.array(
            [
                weighted_percentile(green, weight, 50),
                weighted_percentile(green, weight, 95),
                green.max(),
                weighted_percentile(log, weight, 50),
                weighted_percentile(log, weight, 95),
                log.max(),
                weighted_percentile(shear, weight, 95),
                weighted_percentile(pressure, weight, 95),
                pressure.max(),
                weighted_percentile(mises, weight, 95),
                volume_fraction_at_least(reached, weight, 0.15),
                volume_fraction_at_least(reached, weight, 0.25),
            ]
        )

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far, for a checkpoint."""
        shape = (len(self._times), len(self._groups), len(_STATISTICS))
        return {
            "volumes": self._volumes.copy(),
            "peaks": self._peaks.copy(),
            "peak_times": self._peak_times.copy(),
            "times": np.array(self._times),
            "histories": np.array(self._histories).reshape(shape),
            "snapshot_times": np.array(self._snapshot_times),
            "snapshots": np.array(self._snapshots, dtype=np.float32).reshape(-1, self._rows.size),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a state that `state` returned.

        Raises
        ------
        ValueError
            When it belongs to another brain.
        """
        if np.shape(state["peaks"]) != self._peaks.shape or np.shape(state["histories"])[1] != len(self._groups):
            message = f"the state holds {np.shape(state['peaks'])[1]} elements, this brain has {self._rows.size}"
            raise ValueError(message)
        self._volumes = np.array(state["volumes"], dtype=float)
        self._peaks = np.array(state["peaks"], dtype=float)
        self._peak_times = np.array(state["peak_times"], dtype=float)
        self._times = [float(t) for t in state["times"]]
        self._histories = [np.array(row) for row in state["histories"]]
        self._snapshot_times = [float(t) for t in state["snapshot_times"]]
        self._snapshots = [np.array(row, dtype=np.float32) for row in state["snapshots"]]

    def write(self, folder: Path) -> None:
        """Write brain_histories.csv, element_peaks.csv and brain_snapshots.h5."""
        folder = Path(folder)
        names = list(self._groups)
        table = np.array(self._histories).reshape(-1, len(_STATISTICS))
        columns = {name: table[:, k] for k, (name, _) in enumerate(_STATISTICS)}
        volumes = [float(self._volumes[at].sum()) if self._volumes.size else 0.0 for at in self._groups.values()]
        HISTORY_TABLE.write(
            folder / "brain_histories.csv",
            {
                "time_s": np.repeat(self._times, len(names)),
                "region": names * len(self._times),
                "volume_m3": volumes * len(self._times),
                **columns,
            },
        )
        peaks: dict[str, Any] = {"element_id": self._element_ids, "volume_m3": self._volumes}
        for k, (name, _) in enumerate(_ELEMENT_MEASURES):
            peaks[name] = self._peaks[k]
            peaks[f"{name.removesuffix('_Pa')}_time_s"] = self._peak_times[k]
        PEAK_TABLE.write(folder / "element_peaks.csv", peaks)
        with atomic_path(folder / "brain_snapshots.h5") as temporary, h5py.File(temporary, "w") as file:
            file["time_s"] = np.array(self._snapshot_times)
            file["element_id"] = self._element_ids
            file["mps_green_lagrange"] = np.array(self._snapshots, dtype=np.float32).reshape(-1, self._rows.size)


def read_snapshots(path: str | Path) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float32]]:
    """Read brain_snapshots.h5.

    Returns
    -------
    time_s : (s,) float64
    element_id : (k,) int64
    mps_green_lagrange : (s, k) float32

    Raises
    ------
    InputError
        When the file is missing or holds something else.
    """
    try:
        with h5py.File(path, "r") as file:
            return file["time_s"][()], file["element_id"][()], file["mps_green_lagrange"][()]
    except (OSError, KeyError) as error:
        raise InputError(
            path, f"is not a file of brain snapshots ({error})", mend="run the replay again that writes it"
        ) from None


def regional_summary(histories: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Peak over time of every statistic, by region.

    Parameters
    ----------
    histories
        Rows of brain_histories.csv.

    Returns
    -------
    dict
        Region -> ``volume_m3``, each statistic's greatest value over time, and
        ``mps_green_lagrange_p95_time_s``: when that one occurs. None where nothing is finite.
    """
    out: dict[str, dict[str, Any]] = {}
    for region, rows in histories.groupby("region", sort=False):
        entry: dict[str, Any] = {"volume_m3": float(rows["volume_m3"].iloc[0])}
        for name, _ in _STATISTICS:
            values = rows[name].to_numpy(dtype=float)
            entry[name] = float(np.nanmax(values)) if np.isfinite(values).any() else None
        strain = rows["mps_green_lagrange_p95"].to_numpy(dtype=float)
        finite = np.isfinite(strain).any()
        entry["mps_green_lagrange_p95_time_s"] = (
            float(rows["time_s"].iloc[int(np.nanargmax(strain))]) if finite else None
        )
        out[str(region)] = entry
    return out
