"""What the helmet shake shows: edge stretch, part velocities and stress while the helmet flies freely.

`ShakeRecorder` is handed to the solver; `shake_measures` turns its table into the numbers
that the shake gate asks for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from replay.measures.strain import von_mises
from replay.tables import Column, TableFormat

# Node pairs of the twelve edges of a hexahedron: bottom ring, top ring, uprights.
HEX_EDGES = np.array(
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]], dtype=np.int64
)
# Stress below this share of rho c v is rounding: growth is measured from here.
_STRESS_FLOOR = 0.01

SHAKE_TABLE = TableFormat(
    "helmet shake",
    (
        Column("time_s", "time since the start of the run"),
        Column("edge_stretch_min", "least present over initial length of any element edge"),
        Column("edge_stretch_max", "greatest present over initial length of any element edge"),
        Column("part_velocity_deviation", "greatest |v_part - v0| / |v0| over the parts' centres of gravity"),
        Column("part", "the part that has it", "text"),
        Column("stress_over_impact_stress", "greatest von Mises stress over rho c v0 of its own part"),
        Column("negative_volumes", "elements whose volume is not positive", "int"),
    ),
)


class ShakeView(Protocol):
    """What the recorder needs to see of a state of the solver, in the solver's input order."""

    @property
    def time_s(self) -> float:
        """Time of the state [s]."""

    @property
    def coordinates(self) -> NDArray[np.float64]:
        """Coordinates (n, 3) [m]."""

    @property
    def velocities(self) -> NDArray[np.float64]:
        """Velocities (n, 3) [m/s]."""

    @property
    def stress(self) -> NDArray[np.float64]:
        """Cauchy stress (m, 6), xx, yy, zz, xy, yz, zx [Pa]."""

    @property
    def volumes(self) -> NDArray[np.float64]:
        """Volumes (m,) [m^3]."""


class ShakeRecorder:
    """Gathers what the visual inspection of the article (protocol 1.7) looks for.

    Parameters
    ----------
    hexes : (m, 8) int
        Node rows of every element.
    nodes : (n, 3)
        Initial coordinates [m].
    element_part : (m,) int
        Index of each element's part.
    part_names
        By that index.
    density_kg_per_m3, wave_speed_m_per_s
        By that index: rho and c of each part's material.
    velocity_m_per_s : (3,)
        Initial velocity of the whole helmet.
    """

    def __init__(
        self,
        hexes: ArrayLike,
        nodes: ArrayLike,
        element_part: ArrayLike,
        part_names: Sequence[str],
        density_kg_per_m3: ArrayLike,
        wave_speed_m_per_s: ArrayLike,
        velocity_m_per_s: ArrayLike,
    ) -> None:
        hexes = np.asarray(hexes, dtype=np.int64)
        start = np.asarray(nodes, dtype=float)
        self._hexes = hexes
        self._edges = np.unique(np.sort(hexes[:, HEX_EDGES].reshape(-1, 2), axis=1), axis=0)
        self._lengths = _lengths(start, self._edges)
        self._part = np.asarray(element_part, dtype=np.int64)
        self._names = list(part_names)
        self._velocity = np.asarray(velocity_m_per_s, dtype=float)
        self._speed = float(np.linalg.norm(self._velocity))
        if not self._speed > 0 or not (self._lengths > 0).all():
            message = "the shake needs a velocity, and edges with a length"
            raise ValueError(message)
        density = np.asarray(density_kg_per_m3, dtype=float)
        self._impact_stress = (density * np.asarray(wave_speed_m_per_s, dtype=float) * self._speed)[self._part]
        self._rows: list[NDArray[np.float64]] = []

    def sample(self, view: ShakeView) -> None:
        """Take the state of one history time."""
        stretch = _lengths(view.coordinates, self._edges) / self._lengths
        weight = np.maximum(view.volumes, 0.0)
        element_velocity = view.velocities[self._hexes].mean(axis=1)
        count = len(self._names)
        mass = np.bincount(self._part, weight, count)
        momentum = np.stack([np.bincount(self._part, weight * element_velocity[:, k], count) for k in range(3)], axis=1)
        there = mass > 0
        deviation = np.zeros(count)
        velocity = momentum[there] / mass[there, None]
        deviation[there] = np.linalg.norm(velocity - self._velocity, axis=1) / self._speed
        worst = int(np.argmax(deviation))
        stress = float((von_mises(view.stress) / self._impact_stress).max())
        negative = float((view.volumes <= 0).sum())
        self._rows.append(
            np.array([view.time_s, stretch.min(), stretch.max(), deviation[worst], worst, stress, negative])
        )

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far, for a checkpoint."""
        return {"rows": np.array(self._rows).reshape(-1, 7)}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a state that `state` returned."""
        self._rows = [np.array(row) for row in state["rows"]]

    def write(self, folder: Path) -> None:
        """Write shake.csv."""
        rows = np.array(self._rows).reshape(-1, 7)
        SHAKE_TABLE.write(
            Path(folder) / "shake.csv",
            {
                "time_s": rows[:, 0],
                "edge_stretch_min": rows[:, 1],
                "edge_stretch_max": rows[:, 2],
                "part_velocity_deviation": rows[:, 3],
                "part": [self._names[int(k)] for k in rows[:, 4]],
                "stress_over_impact_stress": rows[:, 5],
                "negative_volumes": rows[:, 6].astype(int),
            },
        )


def shake_measures(table: pd.DataFrame) -> dict[str, Any]:
    """Return the numbers of the shake gate that come from the state of the mesh.

    Parameters
    ----------
    table
        Rows of shake.csv.

    Returns
    -------
    dict
        ``edge_stretch_max``, ``edge_stretch_min``, ``part_velocity_deviation`` with
        ``part_velocity_deviation_detail``, ``stress_over_impact_stress``, ``stress_growth``
        (peak of the last third over that of the middle third, or over 1 % of rho c v if
        that is more), ``negative_volumes``. A growth that a run of fewer than six samples
        cannot show is a text that says so.
    """
    stress = table["stress_over_impact_stress"].to_numpy(dtype=float)
    third = len(table) // 3
    growth: float | str = f"{len(table)} samples cannot show a growth"
    if third >= 2:
        growth = float(stress[-third:].max() / max(stress[third:-third].max(), _STRESS_FLOOR))
    worst = table.loc[table["part_velocity_deviation"].idxmax()]
    return {
        "edge_stretch_max": float(table["edge_stretch_max"].max()),
        "edge_stretch_min": float(table["edge_stretch_min"].min()),
        "part_velocity_deviation": float(worst["part_velocity_deviation"]),
        "part_velocity_deviation_detail": f"{worst['part']} at {1e3 * worst['time_s']:.3g} ms",
        "stress_over_impact_stress": float(stress.max()),
        "stress_growth": growth,
        "negative_volumes": int(table["negative_volumes"].max()),
    }


def _lengths(nodes: NDArray, edges: NDArray) -> NDArray[np.float64]:
    return np.linalg.norm(nodes[edges[:, 1]] - nodes[edges[:, 0]], axis=1)
