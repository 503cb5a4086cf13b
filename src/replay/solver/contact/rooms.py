"""Arrays that the kernels of contact read and write."""

from __future__ import annotations

import numpy as np

from replay.solver.contact.surface import Surface
from replay.solver.kernels.contact_detect import SLOTS, Hits, Mesh, Slots


def mesh_of(surface: Surface) -> Mesh:
    """The surface as the kernels take it."""
    return Mesh(
        surface.faces, surface.nodes, surface.first_face, surface.node_faces, surface.body, surface.point_bodies()
    )


def room_for_hits(n: int) -> Hits:
    """Room for the hits of `n` candidates."""
    return Hits(np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n, np.bool_))


def room_for_slots(points: int) -> Slots:
    """Room for what holds each of so many points; nothing does."""
    size = (points, SLOTS)
    return Slots(
        np.full(size, -1, np.int64), np.zeros(size), np.zeros((*size, 3)), np.zeros((*size, 4)), np.ones(size),
        np.zeros(size, np.bool_),
    )  # fmt: skip
