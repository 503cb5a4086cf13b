"""The list of who may meet whom: built anew before anything could have come close unseen."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.solver.contact.surface import Surface
from replay.solver.kernels.contact_detect import Mesh
from replay.solver.kernels.contact_search import by_point, meet, place_points, sort_into_cells, spread
from replay.solver.kernels.lanes import POSITION

#: Share of the typical edge by which a face's box is widened.
_MARGIN_SHARE = 0.2
_MOST_TABLE = 1 << 22


class Search:
    """Candidate faces of every slave point.

    A face is listed for the points in its box, widened by a margin. The list holds as long as no point can
    have come nearer to a face than the margin leaves room for: what counts is the range of all
    displacements since the list was made, so a common motion costs nothing.

    Parameters
    ----------
    surface
        Its node rows are rows of the arrays given later.
    mesh
        The same for the kernels.
    active : (n_parts, n_parts) bool
        Which parts may touch.
    carrier : (n,) int64
        Rigid body of each node, -1 for none.
    awake : (n_points,) bool
        Slave points that take part.
    nodes : (n, 3) float64
        Coordinates, for the typical edge [m].
    """

    def __init__(
        self, surface: Surface, mesh: Mesh, active: NDArray[np.bool_], carrier: NDArray[np.int64],
        awake: NDArray[np.bool_], nodes: NDArray[np.float64],
    ) -> None:  # fmt: skip
        self._surface, self._mesh = surface, mesh
        self._active, self._carrier, self._awake = active, carrier, awake
        self._point_part, self._point_body = surface.point_parts(), surface.point_bodies()
        corners = nodes[surface.faces]
        edges = np.sqrt(((corners - np.roll(corners, -1, axis=1)) ** 2).sum(axis=2))
        self.edge = float(np.median(edges)) if len(edges) else 1.0
        self.longest_edge = float(edges.max()) if len(edges) else 1.0
        self._extent = float(np.ptp(corners, axis=1).max(axis=1).mean()) if len(corners) else 1.0
        self._origin = np.full((len(surface.nodes), 3), np.nan)
        self._margin = -1.0
        self._range = np.empty(6)
        self.points = np.empty((surface.n_points, 3))
        self.first = np.zeros(surface.n_points + 1, np.int64)
        self.candidates = np.empty(0, np.int64)
        self.built = 0

    def _moved(self, nodal: NDArray[np.float64], dt: float) -> float:
        """Bound on how much nearer a point can have come to a face since the list was made [m]."""
        spread(nodal, self._mesh.nodes, self._origin, dt, self._range)
        return float(math.sqrt(((self._range[3:] - self._range[:3]) ** 2).sum()))

    def update(self, nodal: NDArray[np.float64], dt: float, reach: float) -> None:
        """Place the slave points, and make the list anew if it could miss a face that comes within `reach`.

        Parameters
        ----------
        nodal : (n, 8) float64
            Positions and velocities.
        dt
            Length of the coming step [s].
        reach
            Distance within which a face must be listed at the end of the step [m].
        """
        place_points(nodal, self._mesh.nodes, self._mesh.faces, self.points)
        if self._margin < 0.0 or not self._moved(nodal, dt) + reach <= self._margin:
            self._build(nodal)
            self._margin = max(_MARGIN_SHARE * self.edge, 2.0 * (self._moved(nodal, dt) + reach))
            self._list(nodal)

    def forget(self) -> None:
        """Make the list anew at the next step."""
        self._margin = -1.0

    def _build(self, nodal: NDArray[np.float64]) -> None:
        self._origin[:] = nodal[self._mesh.nodes, POSITION : POSITION + 3]

    def _list(self, nodal: NDArray[np.float64]) -> None:
        surface, mesh = self._surface, self._mesh
        self.built += 1
        low = self._origin.min(axis=0) - self._margin if len(self._origin) else np.zeros(3)
        size = self._extent + 2.0 * self._margin
        bits = max(math.ceil(math.log2(max(self._awake.sum(), 1))), 4)
        mask = min(1 << bits, _MOST_TABLE) - 1
        row_first = np.zeros(mask + 2, np.int64)
        member = np.empty(int(self._awake.sum()), np.int64)
        sort_into_cells(self.points, self._awake, low, size, mask, row_first, member)
        start = np.zeros(len(surface.faces), np.int64)
        common = (
            self.points, mesh.faces, nodal, self._margin, low, size, mask, row_first, member, surface.part,
            surface.body, self._point_part, self._point_body, mesh.nodes, surface.first_face, surface.node_faces,
            self._active, self._carrier,
        )  # fmt: skip
        meet(*common, start, np.empty(0, np.int64), False)
        end = np.cumsum(start)
        start = end - start
        found = np.empty(int(end[-1]) if len(end) else 0, np.int64)
        meet(*common, start, found, True)
        self.candidates = np.empty(len(found), np.int64)
        by_point(start, end, found, self.first, self.candidates)
