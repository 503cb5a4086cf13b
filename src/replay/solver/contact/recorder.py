"""Histories of contact by pair of parts: force, impulse, work."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.solver.problem import Problem
from replay.solver.view import StateView
from replay.tables import Column, TableFormat

CONTACT_TABLE = TableFormat(
    "contact by pair of parts",
    (
        Column("time_s", "time of the run"),
        Column("pid_a", "number of the first part", "int"),
        Column("part_a", "its name", "text"),
        Column("pid_b", "number of the second part", "int"),
        Column("part_b", "its name", "text"),
        Column("force_x_N", "force of the second part on the first, mean since the row before"),
        Column("force_y_N", "the same"),
        Column("force_z_N", "the same"),
        Column("impulse_x_N_s", "impulse of the second part on the first since the start"),
        Column("impulse_y_N_s", "the same"),
        Column("impulse_z_N_s", "the same"),
        Column("normal_J", "work lost in normal contact since the start"),
        Column("friction_J", "work lost in friction since the start"),
    ),
)


class ContactRecorder:
    """Gathers the sums of every pair of parts at history times; writes those of pairs that touched.

    Parameters
    ----------
    problem
        For names and numbers of the parts.
    """

    FILE = "contact.csv"

    def __init__(self, problem: Problem) -> None:
        self._parts = problem.parts
        self._pairs: tuple[tuple[int, int], ...] = ()
        self._times: list[float] = []
        self._sums: list[NDArray[np.float64]] = []

    def sample(self, view: StateView) -> None:
        """Take the sums at a history time."""
        self._pairs, sums = view.contact_sums
        self._times.append(view.time_s)
        self._sums.append(sums)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far."""
        return {
            "times": np.array(self._times),
            "sums": np.array(self._sums).reshape(len(self._times), -1, 5),
            "pairs": np.array(self._pairs, np.int64).reshape(-1, 2),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `state` returned."""
        self._times, self._sums = state["times"].tolist(), list(state["sums"])
        self._pairs = tuple((int(a), int(b)) for a, b in state["pairs"])

    def write(self, folder: Path) -> None:
        """Write contact.csv."""
        state = self.state()
        touched = np.flatnonzero((state["sums"] != 0).any(axis=(0, 2))) if self._times else np.zeros(0, int)
        times, sums = state["times"], state["sums"][:, touched]
        step = np.diff(times, prepend=times[:1])
        change = np.diff(sums[:, :, :3], axis=0, prepend=sums[:1, :, :3])
        force = np.divide(change, step[:, None, None], out=np.zeros_like(change), where=step[:, None, None] > 0)
        rows = np.concatenate([force, sums], axis=2).reshape(-1, 8)
        pairs = [self._pairs[k] for k in touched] * len(times)
        a, b = ([self._parts[pair[side]] for pair in pairs] for side in (0, 1))
        columns: dict[str, Any] = {
            "time_s": np.repeat(times, len(touched)),
            "pid_a": [part.pid for part in a],
            "part_a": [part.name for part in a],
            "pid_b": [part.pid for part in b],
            "part_b": [part.name for part in b],
        }
        CONTACT_TABLE.write(folder / self.FILE, columns | dict(zip(CONTACT_TABLE.names[5:], rows.T)))
