"""Hexes between radial surfaces: a core inside the innermost one, layers of hexes from one to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.models.cubed_sphere import CubeLattice, inflated_core
from replay.models.radial import RadialSurface, RadialSurfaces, Smoothed


@dataclass(frozen=True)
class Resolution:
    """How finely a head is divided.

    Parameters
    ----------
    divisions
        Cells along an edge of the cube (6 n^2 columns of hexes).
    brain, csf, skull, scalp
        Layers between core and brain surface, and in the tissues outside.
    comfort, energy
        Layers of the helmet's pads.
    facemask_step_m
        Length aimed at for the hexes along a facemask bar [m].
    """

    divisions: int
    brain: int
    csf: int
    skull: int
    scalp: int
    comfort: int
    energy: int
    facemask_step_m: float


RESOLUTIONS = {
    "tiny": Resolution(6, brain=2, csf=1, skull=1, scalp=1, comfort=2, energy=4, facemask_step_m=0.020),
    "coarse": Resolution(10, brain=4, csf=1, skull=1, scalp=2, comfort=1, energy=2, facemask_step_m=0.013),
    "medium": Resolution(18, brain=11, csf=1, skull=3, scalp=3, comfort=1, energy=3, facemask_step_m=0.008),
    "fine": Resolution(32, brain=18, csf=2, skull=4, scalp=4, comfort=2, energy=5, facemask_step_m=0.006),
}


@dataclass(frozen=True)
class HeadMesh:
    """A head as nodes and hexes about the star centre.

    Parameters
    ----------
    nodes
        (n, 3) [m].
    hexes
        (m, 8).
    tissue
        Index into `TISSUES` of each hex, (m,).
    scalp_nodes
        Rows of `nodes` that lie on the scalp, one per surface point of the lattice, (s,).
    """

    nodes: np.ndarray
    hexes: np.ndarray
    tissue: np.ndarray
    scalp_nodes: np.ndarray


TISSUES = ("brain", "csf", "skull", "scalp")


def head_mesh(
    lattice: CubeLattice,
    surfaces: RadialSurfaces,
    resolution: Resolution,
    directions: np.ndarray,
    least_thickness_m: dict[str, float],
    core_radius: float = 0.6,
) -> HeadMesh:
    """Fill a head with hexes.

    Parameters
    ----------
    lattice
        The lattice.
    surfaces
        The four surfaces.
    resolution
        Numbers of layers.
    directions
        Direction of each surface point from the brain's surface outwards, (s, 3); between core and brain
        surface the lattice's own directions turn into these.
    least_thickness_m
        Least thickness of ``csf``, ``skull`` and ``scalp`` [m].
    core_radius
        Radius of the core over that of the brain.
    """
    nodes = _core_nodes(lattice, surfaces.brain, core_radius)
    sheets, hexes, tissue = [nodes], [lattice.cells], [np.zeros(len(lattice.cells), dtype=np.int64)]
    current, count = lattice.surface, len(nodes)
    radii = layer_radii(surfaces, directions, least_thickness_m)
    inner = nodes[lattice.surface]
    for index, (radius, layers) in enumerate(
        zip(radii, (resolution.brain, resolution.csf, resolution.skull, resolution.scalp))
    ):
        outer = directions * radius[:, None]
        for step in range(1, layers + 1):
            sheets.append(inner + (outer - inner) * (step / layers))
            new = count + np.arange(len(outer))
            hexes.append(np.hstack([current[lattice.quads], new[lattice.quads]]))
            tissue.append(np.full(len(lattice.quads), index))
            current, count = new, count + len(new)
        inner = outer
    return HeadMesh(np.vstack(sheets), np.vstack(hexes), np.concatenate(tissue), current)


def layer_radii(
    surfaces: RadialSurfaces, directions: np.ndarray, least_thickness_m: dict[str, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Radii of brain, inner skull, outer skull and scalp, each at least the least thickness outside the one before."""
    brain = surfaces.brain(directions)
    inner = np.maximum(surfaces.inner_skull(directions), brain + least_thickness_m["csf"])
    outer = np.maximum(surfaces.outer_skull(directions), inner + least_thickness_m["skull"])
    scalp = np.maximum(surfaces.scalp(directions), outer + least_thickness_m["scalp"])
    return brain, inner, outer, scalp


def _core_nodes(lattice: CubeLattice, brain: RadialSurface, core_radius: float) -> np.ndarray:
    """Core points: the inflated cube, stretched to the brain's shape towards its surface."""
    points = inflated_core(lattice) * core_radius
    distance = np.sqrt(np.einsum("ij,ij->i", points, points))
    away = distance > 0
    radius = np.full(len(points), float(brain(lattice.directions).mean()))
    shape = Smoothed(brain, 6.0)(points[away] / distance[away, None])
    blend = np.clip(distance[away] / core_radius, 0, 1)
    radius[away] = (1 - blend) * radius[away] + blend * shape
    return points * radius[:, None]
