"""Where a helmet covers the head, on the lattice of the cubed sphere: shell, pads, chin cup, and its lower edge.

The edge of the shell is a path of lattice lines. The directions of the lattice are bent so that this path runs along
the coverage curve: the edge has no stair steps, and every surface of head and helmet is sampled on the bent grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from replay.models.cubed_sphere import CubeLattice
from replay.models.helmet_design import Cup, HelmetDesign, HelmetShell, Opening, PadSet

_FACES = {"front": (0, 1), "back": (0, -1), "left": (1, 1), "right": (1, -1), "crown": (2, 1)}


@dataclass(frozen=True)
class HelmetLayout:
    """Which columns of the lattice carry what.

    Parameters
    ----------
    covered
        Mask of the surface quads within the shell's edge, (q,) bool.
    shell
        Those of them that are not left open over the ears, (q,) bool.
    pad
        Index into the pads of the design of each quad, -1 where there is none, (q,).
    chin
        Mask of the quads of the chin cup, (q,) bool.
    directions
        The bent directions, (s, 3).
    """

    covered: np.ndarray
    shell: np.ndarray
    pad: np.ndarray
    chin: np.ndarray
    directions: np.ndarray


def helmet_layout(lattice: CubeLattice, design: HelmetDesign) -> HelmetLayout:
    """Lay a helmet on a lattice."""
    covered = _covered(lattice.quad_centres, design.shell)
    directions = _bent(lattice, covered, design.shell)
    open_ear = _opening(lattice, covered, design.shell.ear)
    if open_ear.any():
        directions = _rounded(lattice, open_ear, directions, covered)
    bare = _under(lattice, open_ear, design.shell.ear)
    pad = np.where(covered & ~bare, _pad_zones(lattice, design.pads), -1)
    return HelmetLayout(covered, covered & ~open_ear, pad, _chin(lattice, design.chinstrap.cup), directions)


def angles_of(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Azimuth from anterior, positive to the left, and elevation [degrees]."""
    azimuth = np.degrees(np.arctan2(directions[:, 1], directions[:, 0]))
    return azimuth, np.degrees(np.arcsin(np.clip(directions[:, 2], -1, 1)))


def direction_at(azimuth_deg: np.ndarray, elevation_deg: np.ndarray) -> np.ndarray:
    """Unit vectors (..., 3) of azimuth and elevation [degrees]."""
    a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e) + 0 * a], axis=-1)


def boundary_edges(quads: np.ndarray) -> np.ndarray:
    """Edges that belong to one quad only, (k, 2), in the quad's sense of rotation."""
    edges = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    key = np.sort(edges, axis=1)
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    return edges[np.sort(first[count == 1])]


def _covered(centres: np.ndarray, shell: HelmetShell) -> np.ndarray:
    x, y, z = centres.T
    top, bottom = z == 1, z == -1
    front = (x == 1) | ((np.abs(y) == 1) & (x > shell.coverage.flap_front))
    return top | (~bottom & np.where(front, z > shell.coverage.brow, z > shell.coverage.bottom))


def _pad_zones(lattice: CubeLattice, pads: PadSet) -> np.ndarray:
    """Pad of each quad; of two that would share a node the later one gives way, unless it continues the other."""
    centres, names = lattice.quad_centres, list(pads.pads)
    pad = np.full(len(centres), -1)
    for index, zone in enumerate(pads.pads.values()):
        axis, end = _FACES[zone.face]
        here = centres[:, axis] == end
        for value, (low, high) in zip(centres.T, (zone.x, zone.y, zone.z)):
            here &= (value >= low) & (value <= high)
        others = pad >= 0
        if zone.continues is not None:
            others &= pad != names.index(zone.continues)
        taken = np.zeros(len(lattice.surface), dtype=bool)
        taken[lattice.quads[others]] = True
        pad[here & (pad < 0) & ~taken[lattice.quads].any(axis=1)] = index
    return pad


def _opening(lattice: CubeLattice, covered: np.ndarray, ear: Opening | None) -> np.ndarray:
    """Quads of the openings over the ears; none on a lattice too coarse to close below them."""
    x, y, z = lattice.quad_centres.T
    if ear is None:
        return np.zeros(len(x), dtype=bool)
    chosen = (np.abs(y) == 1) & (x >= ear.x[0]) & (x <= ear.x[1]) & (z >= ear.z[0]) & (z <= ear.z[1])
    at_edge = np.zeros(len(lattice.surface), dtype=bool)
    at_edge[boundary_edges(lattice.quads[covered])] = True
    return chosen & ~at_edge[lattice.quads[chosen]].any()


def _under(lattice: CubeLattice, open_ear: np.ndarray, ear: Opening | None) -> np.ndarray:
    """Quads of the openings over the ears and below them: no pad is a bridge under the ear, one row of cells wide."""
    if ear is None or not open_ear.any():
        return open_ear
    x, y, z = lattice.quad_centres.T
    return (np.abs(y) == 1) & (x >= ear.x[0]) & (x <= ear.x[1]) & (z <= ear.z[1])


def _chin(lattice: CubeLattice, cup: Cup) -> np.ndarray:
    x, y, z = lattice.quad_centres.T
    front, bottom = (x == 1) & (z < cup.front_below), (z == -1) & (x > cup.bottom_before)
    return (front | bottom) & (np.abs(y) < cup.half_width)


def _bent(lattice: CubeLattice, covered: np.ndarray, shell: HelmetShell) -> np.ndarray:
    """Directions moved so that the shell's boundary lies on the coverage curve, everything else following smoothly."""
    path = np.unique(boundary_edges(lattice.quads[covered]))
    target = _edge_targets(lattice.surface_cube[path], lattice.directions[path], shell)
    return _following(lattice, lattice.directions, path, target, shell.edge_decay_deg)


def _rounded(lattice: CubeLattice, ear: np.ndarray, directions: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Directions moved so that the openings over the ears have round corners; the shell's edge stays."""
    edge = np.unique(boundary_edges(lattice.quads[covered]))
    left = ear & (lattice.quad_centres[:, 1] == 1)
    rim = np.unique(boundary_edges(lattice.quads[left]))
    place = lattice.surface_cube[rim][:, [0, 2]]
    low, high = place.min(axis=0), place.max(axis=0)
    across = (2 * place - low - high) / (high - low)
    # a superellipse of the fourth order through the middles of the sides: corners move inwards by a sixth
    share = (across**4).sum(axis=1) ** -0.25
    middle = _unit(directions[rim].mean(axis=0)[None])
    target = _unit(middle + share[:, None] * (directions[rim] - middle))
    mirror = lattice.mirrored()
    path = np.concatenate([edge, rim, mirror[rim]])
    targets = np.vstack([directions[edge], target, target * [1, -1, 1]])
    return _following(lattice, directions, path, targets, 0.0)


def _following(
    lattice: CubeLattice, directions: np.ndarray, path: np.ndarray, target: np.ndarray, decay_deg: float
) -> np.ndarray:
    """Directions of which some move to a target, the others following over an angle, or 1.5 cells; left as right."""
    decay_cells = max(1.5, decay_deg * lattice.divisions / 90)
    count = len(directions)
    sides = np.sort(np.stack([lattice.quads, np.roll(lattice.quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    sides = np.unique(sides, axis=0)
    ones = np.ones(2 * len(sides))
    rows, columns = np.concatenate([sides[:, 0], sides[:, 1]]), np.concatenate([sides[:, 1], sides[:, 0]])
    graph = sparse.csr_matrix((ones, (rows, columns)), shape=(count, count))
    matrix = sparse.diags(np.asarray(graph.sum(axis=1)).ravel() + decay_cells**-2) - graph
    free = np.setdiff1d(np.arange(count), path)
    moved = np.zeros((count, 3))
    moved[path] = target - directions[path]
    block = matrix[free].tocsc()
    right = -(block[:, path] @ moved[path])
    moved[free] = np.stack([spsolve(block[:, free], right[:, k]) for k in range(3)], axis=1)
    bent = _unit(directions + moved)
    mirror = lattice.mirrored()
    return _unit((bent + bent[mirror] * [1, -1, 1]) / 2)


def _edge_targets(cube: np.ndarray, directions: np.ndarray, shell: HelmetShell) -> np.ndarray:
    """Where each point of the edge path belongs: by azimuth on brow and bottom, by elevation on the flap's front."""
    curves = {name: np.array(getattr(shell.edge_deg, name)) for name in ("brow", "flap", "bottom")}
    azimuth, elevation = angles_of(directions)
    side = np.where(azimuth < 0, -1.0, 1.0)
    azimuth = np.abs(azimuth)
    low, high = cube[:, 2].min(), cube[:, 2].max()
    on_side = np.abs(cube[:, 1]) == 1
    flap_x = cube[on_side & (cube[:, 2] > low) & (cube[:, 2] < high), 0].max(initial=-1.0)
    bottom, brow = cube[:, 2] == low, cube[:, 2] == high
    flap = on_side & (cube[:, 0] == flap_x) & ~bottom & ~brow
    corner = 90 - 45 * flap_x
    to_azimuth, to_elevation = azimuth.copy(), elevation.copy()
    to_azimuth[brow] = azimuth[brow] * curves["brow"][-1, 0] / corner
    to_elevation[brow] = np.interp(to_azimuth[brow], *curves["brow"].T)
    start = curves["bottom"][0, 0]
    to_azimuth[bottom] = start + (azimuth[bottom] - corner) * (180 - start) / (180 - corner)
    to_elevation[bottom] = np.interp(to_azimuth[bottom], *curves["bottom"].T)
    share = (high - cube[flap, 2]) / (high - low)
    to_elevation[flap] = curves["flap"][0, 1] + share * (curves["flap"][-1, 1] - curves["flap"][0, 1])
    to_azimuth[flap] = np.interp(-to_elevation[flap], -curves["flap"][:, 1], curves["flap"][:, 0])
    return direction_at(side * to_azimuth, to_elevation)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
