"""Where a helmet covers the head, on the lattice of the cubed sphere: shell, pads, chin cup, and its lower edge.

The edge of the shell is a path of lattice lines. The directions of the lattice are bent so that this path runs along
the coverage curve: the edge has no stair steps, and every surface of head and helmet is sampled on the bent grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from replay.models.cubed_sphere import CubeLattice

PADS = ("crown", "front", "back", "side_left", "side_right", "jaw_left", "jaw_right")


@dataclass(frozen=True)
class HelmetLayout:
    """Which columns of the lattice carry what.

    Parameters
    ----------
    shell
        Mask of the surface quads, (q,) bool.
    pad
        Index into `PADS` of each quad, -1 where there is none, (q,).
    chin
        Mask of the quads of the chin cup, (q,) bool.
    directions
        The bent directions, (s, 3).
    """

    shell: np.ndarray
    pad: np.ndarray
    chin: np.ndarray
    directions: np.ndarray


def helmet_layout(lattice: CubeLattice, helmet: dict[str, Any]) -> HelmetLayout:
    """Lay the helmet of ``data/helmet.yaml`` on a lattice."""
    shell = _covered(lattice.quad_centres, helmet["coverage"])
    directions = _bent(lattice, shell, helmet)
    pad = np.where(shell, _pad_zones(lattice, helmet), -1)
    return HelmetLayout(shell, pad, _chin(lattice, helmet["chin"]), directions)


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


def _covered(centres: np.ndarray, coverage: dict[str, float]) -> np.ndarray:
    x, y, z = centres.T
    top, bottom = z == 1, z == -1
    front = (x == 1) | ((np.abs(y) == 1) & (x > coverage["flap_front"]))
    return top | (~bottom & np.where(front, z > coverage["brow"], z > coverage["bottom"]))


def _pad_zones(lattice: CubeLattice, helmet: dict[str, Any]) -> np.ndarray:
    x, y, z = lattice.quad_centres.T
    zones = helmet["zones"]
    free = 1 - max(2 / lattice.divisions, helmet["gap_width"])
    side = (np.abs(y) == 1) & (np.abs(x) < free)
    upper = side & (z > zones["side_above"])
    jaw = side & (z < zones["jaw_below"]) & (x > zones["jaw_before"])
    chosen = {
        "crown": (z == 1) & (np.abs(x) < free) & (np.abs(y) < free),
        "front": x == 1,
        "back": x == -1,
        "side_left": upper & (y > 0),
        "side_right": upper & (y < 0),
        "jaw_left": jaw & (y > 0),
        "jaw_right": jaw & (y < 0),
    }
    pad = np.full(len(x), -1)
    for index, name in enumerate(PADS):
        pad[chosen[name]] = index
    return pad


def _chin(lattice: CubeLattice, chin: dict[str, float]) -> np.ndarray:
    x, y, z = lattice.quad_centres.T
    front, bottom = (x == 1) & (z < chin["front_below"]), (z == -1) & (x > chin["bottom_before"])
    return (front | bottom) & (np.abs(y) < chin["half_width"])


def _bent(lattice: CubeLattice, shell: np.ndarray, helmet: dict[str, Any]) -> np.ndarray:
    """Directions moved so that the shell's boundary lies on the coverage curve, everything else following smoothly."""
    edges = boundary_edges(lattice.quads[shell])
    path = np.unique(edges)
    target = _edge_targets(lattice.surface_cube[path], lattice.directions[path], helmet)
    count = len(lattice.directions)
    sides = np.sort(np.stack([lattice.quads, np.roll(lattice.quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    sides = np.unique(sides, axis=0)
    ones = np.ones(2 * len(sides))
    rows, columns = np.concatenate([sides[:, 0], sides[:, 1]]), np.concatenate([sides[:, 1], sides[:, 0]])
    graph = sparse.csr_matrix((ones, (rows, columns)), shape=(count, count))
    decay = float(helmet["edge_decay_cells"]) ** -2
    matrix = sparse.diags(np.asarray(graph.sum(axis=1)).ravel() + decay) - graph
    free = np.setdiff1d(np.arange(count), path)
    moved = np.zeros((count, 3))
    moved[path] = target - lattice.directions[path]
    block = matrix[free].tocsc()
    right = -(block[:, path] @ moved[path])
    moved[free] = np.stack([spsolve(block[:, free], right[:, k]) for k in range(3)], axis=1)
    bent = _unit(lattice.directions + moved)
    mirror = lattice.mirrored()
    return _unit((bent + bent[mirror] * [1, -1, 1]) / 2)


def _edge_targets(cube: np.ndarray, directions: np.ndarray, helmet: dict[str, Any]) -> np.ndarray:
    """Where each point of the edge path belongs: by azimuth on brow and bottom, by elevation on the flap's front."""
    curves = {name: np.array(points) for name, points in helmet["edge_deg"].items()}
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
