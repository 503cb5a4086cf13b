"""How far the pads of a helmet are compressed: a foam crushes without widening, so its volume tells its thickness."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from replay.measures.brain import BrainView
from replay.tables import Column, TableFormat

PAD_TABLE = TableFormat(
    "compression of pads",
    (
        Column("time_s", "time since the start of the run"),
        Column("part", "name of the pad", "text"),
        Column("compression_mean", "1 - V / V0 of the whole pad"),
        Column("compression_max", "greatest 1 - V / V0 of one of its elements"),
    ),
)


class PadRecorder:
    """Gathers the compression of every pad at history times; writes pads.csv.

    Parameters
    ----------
    pads
        Name of each pad -> rows of its elements.
    """

    FILE = "pads.csv"

    def __init__(self, pads: Mapping[str, ArrayLike]) -> None:
        self._pads = {name: np.asarray(rows, dtype=np.int64) for name, rows in pads.items()}
        self._before = np.zeros(0)
        self._times: list[float] = []
        self._values: list[NDArray[np.float64]] = []

    def sample(self, view: BrainView) -> None:
        """Take the state of one history time; the first is taken as uncompressed."""
        volumes = np.asarray(view.volumes, dtype=float)
        if self._before.size == 0:
            self._before = volumes.copy()
        self._times.append(float(view.time_s))
        rows = []
        for pad in self._pads.values():
            now, before = volumes[pad], self._before[pad]
            rows.append([1.0 - now.sum() / before.sum(), 1.0 - (now / before).min()])
        self._values.append(np.array(rows))

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far, for a checkpoint."""
        values = np.array(self._values).reshape(len(self._times), len(self._pads), 2)
        return {"before": self._before.copy(), "times": np.array(self._times), "values": values}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a state that `state` returned."""
        self._before = np.array(state["before"], dtype=float)
        self._times, self._values = [float(t) for t in state["times"]], list(np.array(state["values"]))

    def write(self, folder: Path) -> None:
        """Write pads.csv."""
        state = self.state()
        mean, most = state["values"].reshape(-1, 2).T
        PAD_TABLE.write(
            Path(folder) / self.FILE,
            {
                "time_s": np.repeat(state["times"], len(self._pads)),
                "part": list(self._pads) * len(self._times),
                "compression_mean": mean,
                "compression_max": most,
            },
        )


def pad_summary(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Greatest compression of each pad, the most compressed pad first."""
    rows = []
    for part, pad in table.groupby("part", sort=False):
        worst = pad.loc[pad["compression_mean"].idxmax()]
        rows.append(
            {
                "part": str(part),
                "compression_mean": float(worst["compression_mean"]),
                "compression_max": float(pad["compression_max"].max()),
                "time_s": float(worst["time_s"]),
            }
        )
    return sorted(rows, key=lambda row: -row["compression_mean"])
