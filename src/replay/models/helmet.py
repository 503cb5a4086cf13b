"""The helmet's hexes: comfort pads on the scalp, energy pads, shell, chin cup, in the columns of the lattice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.models.cubed_sphere import CubeLattice
from replay.models.helmet_design import HelmetDesign, HelmetShell
from replay.models.helmet_layout import HelmetLayout, boundary_edges
from replay.models.ogrid import HeadMesh, Resolution
from replay.models.radial import RadialSurface, Smoothed, ray_stretch


@dataclass(frozen=True)
class HelmetMesh:
    """Hexes of a helmet that stands on a head's scalp.

    Parameters
    ----------
    nodes
        Nodes of head and helmet, the head's first, (n, 3) [m].
    hexes
        Hexes of the helmet alone, rows of `nodes`, (m, 8).
    part
        Name of each hex's part, (m,) of ``comfort_pad_front``, ``energy_pad_front``, ``shell``, ``chin_cup``.
    edge_quads
        Faces along the shell's lower edge, (k, 4) rows of `nodes`: inner a, inner b, outer b, outer a.
    """

    nodes: np.ndarray
    hexes: np.ndarray
    part: np.ndarray
    edge_quads: np.ndarray


def helmet_surface(scalp: RadialSurface, shell: HelmetShell) -> RadialSurface:
    """The smoothed scalp from which a helmet's layers are offset."""
    return Smoothed(scalp, shell.liner_smoothing_deg)


def standoff_m(shell: HelmetShell, directions: np.ndarray) -> np.ndarray:
    """Distance from the smoothed scalp to the shell along the normal in each direction, (n,) [m].

    The squares of a direction's components weigh the values of front or back, side and crown: they sum to one.
    """
    along = np.where(directions[:, 0] > 0, shell.standoff_m.front, shell.standoff_m.back)
    values = np.stack([along, np.full(len(along), shell.standoff_m.side), np.full(len(along), shell.standoff_m.crown)])
    return np.einsum("ij,ji->i", directions**2, values)


def helmet_mesh(
    lattice: CubeLattice,
    layout: HelmetLayout,
    head: HeadMesh,
    scalp: RadialSurface,
    resolution: Resolution,
    design: HelmetDesign,
    seat: str,
) -> HelmetMesh:
    """Stand pads and shell on the scalp.

    Between pads a column is empty from scalp to shell.

    Parameters
    ----------
    lattice, layout
        The lattice and what its columns carry.
    head
        The head.
    scalp
        The scalp's surface.
    resolution
        Layers of comfort and energy pads.
    design
        Thicknesses and names.
    seat
        ``shared_nodes``: pads and chin cup stand on the scalp's nodes; ``contact``: each on nodes of its own there.
    """
    d = layout.directions
    skin = head.nodes[head.scalp_nodes]
    liner = helmet_surface(scalp, design.shell)
    start = np.sqrt(np.einsum("ij,ij->i", skin, skin))
    base = np.maximum(liner(d), start)
    stretch = ray_stretch(liner, d)
    inside = base + stretch * standoff_m(design.shell, d)
    comfort = base + stretch * _comfort_m(lattice, layout, design)
    builder = _Builder(head.nodes, lattice.quads)
    levels = [_sole(builder, head, seat)]
    outside = inside + stretch * design.shell.shell_m
    for end, layers in ((comfort, resolution.comfort), (inside, resolution.energy), (outside, 1)):
        for step in range(1, layers + 1):
            radius = start + (end - start) * (step / layers)
            levels.append(builder.level(d * radius[:, None]))
        start = end
    level = 0
    padded = layout.pad >= 0
    for role, layers in (("comfort_pad", resolution.comfort), ("energy_pad", resolution.energy)):
        names = np.array([f"{role}_{name}" for name in design.pads.pads])
        for _ in range(layers):
            builder.extrude(levels[level], levels[level + 1], padded, names[layout.pad[padded]])
            level += 1
    builder.extrude(levels[level], levels[level + 1], layout.shell, np.full(layout.shell.sum(), "shell"))
    rim = boundary_edges(lattice.quads[layout.covered])
    inner, outer = levels[level], levels[level + 1]
    edge_quads = np.stack([inner[rim[:, 0]], inner[rim[:, 1]], outer[rim[:, 1]], outer[rim[:, 0]]], axis=1)
    reach = ray_stretch(scalp, d) * design.chinstrap.cup.thickness_m
    below = _sole(builder, head, seat)
    # two layers: one alone is sheared by hourglass modes
    for share in (0.5, 1.0):
        above = builder.level(skin + d * (share * reach)[:, None])
        builder.extrude(below, above, layout.chin, np.full(layout.chin.sum(), "chin_cup"))
        below = above
    return builder.finish(edge_quads)


def _comfort_m(lattice: CubeLattice, layout: HelmetLayout, design: HelmetDesign) -> np.ndarray:
    """Thickness of the comfort pad at each surface point, (s,) [m]; pads that share one are as thick."""
    thickness = np.full(len(layout.directions), min(pad.comfort_m for pad in design.pads.pads.values()))
    for index, pad in enumerate(design.pads.pads.values()):
        thickness[lattice.quads[layout.pad == index]] = pad.comfort_m
    return thickness


def _sole(builder: _Builder, head: HeadMesh, seat: str) -> np.ndarray:
    """Nodes on which something stands on the scalp: the scalp's, or new ones at the same places."""
    return builder.level(head.nodes[head.scalp_nodes]) if seat == "contact" else head.scalp_nodes


class _Builder:
    """Collects sheets of nodes and the hexes between them, and drops the nodes that no hex uses."""

    def __init__(self, head_nodes: np.ndarray, quads: np.ndarray) -> None:
        self._head = len(head_nodes)
        self._sheets = [head_nodes]
        self._count = len(head_nodes)
        self._quads = quads
        self._hexes: list[np.ndarray] = []
        self._parts: list[np.ndarray] = []

    def level(self, points: np.ndarray) -> np.ndarray:
        """Add a sheet of nodes, one per surface point; return its rows."""
        rows = self._count + np.arange(len(points))
        self._sheets.append(points)
        self._count += len(points)
        return rows

    def extrude(self, inner: np.ndarray, outer: np.ndarray, chosen: np.ndarray, names: np.ndarray) -> None:
        """Add the hexes between two sheets over the chosen quads."""
        quads = self._quads[chosen]
        self._hexes.append(np.hstack([inner[quads], outer[quads]]))
        self._parts.append(names)

    def finish(self, edge_quads: np.ndarray) -> HelmetMesh:
        """Number the nodes that are used, the head's unchanged."""
        nodes, hexes = np.vstack(self._sheets), np.vstack(self._hexes)
        used = np.zeros(len(nodes), dtype=bool)
        used[: self._head] = True
        used[hexes] = True
        number = np.cumsum(used) - 1
        return HelmetMesh(nodes[used], number[hexes], np.concatenate(self._parts), number[edge_quads])
