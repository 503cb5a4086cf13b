"""Histories of chosen nodes and elements, for who wants curves without the states of the whole mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.solver.link_histories import TableRecorder
from replay.solver.problem import Problem
from replay.solver.view import StateView
from replay.tables import Column, TableFormat

NODE_TABLE = TableFormat(
    "motion of nodes",
    (
        Column("time_s", "time of the run"),
        Column("node_id", "number of the node", "int"),
        *(Column(f"{axis}_m", "coordinate") for axis in "xyz"),
        *(Column(f"v{axis}_m_per_s", "velocity") for axis in "xyz"),
    ),
)
ELEMENT_TABLE = TableFormat(
    "stress of elements",
    (
        Column("time_s", "time of the run"),
        Column("element_id", "number of the element", "int"),
        *(Column(f"stress_{pair}_Pa", "Cauchy stress") for pair in ("xx", "yy", "zz", "xy", "yz", "zx")),
        Column("von_mises_Pa", "von Mises stress"),
        Column("pressure_Pa", "pressure, compression positive"),
        Column("volume_ratio", "volume over volume before deformation"),
    ),
)


def node_recorder(problem: Problem, rows: NDArray[np.int64]) -> TableRecorder:
    """Recorder of place and velocity of some nodes, rows of the problem's; writes node_histories.csv."""

    def values(view: StateView) -> NDArray[np.float64]:
        return np.hstack([view.coordinates[rows], view.velocities[rows]])

    return TableRecorder(NODE_TABLE, "node_histories.csv", problem.node_ids[rows].tolist(), values)


def element_recorder(problem: Problem, rows: NDArray[np.int64]) -> TableRecorder:
    """Recorder of stress and volume of some elements, rows of the problem's; writes element_histories.csv."""

    def values(view: StateView) -> NDArray[np.float64]:
        ratio = view.volumes / view.reference_volumes
        return np.column_stack([view.stress[rows], view.von_mises[rows], view.pressure[rows], ratio[rows]])

    return TableRecorder(ELEMENT_TABLE, "element_histories.csv", problem.element_ids[rows].tolist(), values)
