"""Of two constraints that say the same of a pair of nodes, one is left out of the step's problem.

Nodes of two bodies that meet node on node hold each other twice, once a pass, with normals that differ as little as the
faces about them are turned. The multipliers of such near copies are hardly told apart, and converge slowly.
Within one body both passes stay: a fold may bring nodes together whose faces look past each other.
"""

from __future__ import annotations

from replay.solver.kernels.contact_detect import SLOTS
from replay.solver.kernels.device import compiled

# a point with this share of a corner lies on it
_ON_CORNER = 0.9
# cosine between the normals of two passes, one of them turned round, above which they hold the pair the same way
_ALIKE = 0.9


def _corner_below(mesh, slots, point, slot):
    """Row in `nodal` of the corner that a point lies on, -1 where it lies on none."""
    for corner in range(4):
        if slots.shape[point, slot, corner] >= _ON_CORNER:
            return mesh.faces[slots.face[point, slot], corner]
    return -1


corner_below = compiled(_corner_below)


def _repeats(mesh, surface_row, slots, point, slot):
    """Whether the node that a node lies on is held by it in turn, the same way, and comes before it."""
    if mesh.body[slots.face[point, slot]] == mesh.point_body[point]:
        return False
    below = corner_below(mesh, slots, point, slot)
    if below < 0 or surface_row[below] >= point:
        return False
    other = surface_row[below]
    for back in range(SLOTS):
        if slots.active[other, back] and corner_below(mesh, slots, other, back) == mesh.nodes[point]:
            alike = 0.0
            for axis in range(3):
                alike -= slots.normal[point, slot, axis] * slots.normal[other, back, axis]
            if alike > _ALIKE:
                return True
    return False


repeats = compiled(_repeats)


def _thin(mesh, surface_row, slots):
    """Take repeated constraints out of ``slots.active``: of two that meet node on node the first stays.

    Only nodes are looked at, and a constraint is compared with those of lower rows alone, which are still as they were
    found when rows are gone through backwards.

    Parameters
    ----------
    mesh : contact_detect.Mesh
        The surface.
    surface_row : (n,) int64
        Row among ``mesh.nodes`` of each node, -1 off the surface.
    slots : contact_detect.Slots
        What holds each point; ``active`` is updated.
    """
    for point in range(mesh.nodes.shape[0] - 1, -1, -1):
        for slot in range(SLOTS):
            if slots.active[point, slot] and repeats(mesh, surface_row, slots, point, slot):
                slots.active[point, slot] = False


thin = compiled(_thin)
