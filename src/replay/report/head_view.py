"""Pictures of the model: sections by role, the outer surface, and strain and damage in the cut head."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.patches import Patch
from numpy.typing import NDArray

from replay.report.charts import plain_axes
from replay.report.figure import Picture, finish, house_style, new_figure
from replay.report.model import MeshView, Snapshots

ROLE_COLOURS = {
    "brain": "#e8b4a0",
    "csf": "#9fd0ea",
    "skull": "#efe3bf",
    "scalp": "#d9b48f",
    "face": "#e3c4a2",
    "comfort_pad": "#b7d7a8",
    "energy_pad": "#7fb77e",
    "shell": "#5f7ea3",
    "facemask": "#4a4f57",
    "chin_cup": "#a58ab8",
    "bone": "#efe3bf",
    "flesh": "#d9a98a",
}
_OTHER = "#c9ced6"
# Faces of a hexahedron, each seen counter-clockwise from outside.
HEX_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])
# Normal axis, then the axes drawn to the right and up.
SECTIONS = {"sagittal": (1, 0, 2), "coronal": (0, 1, 2), "axial": (2, 0, 1)}
_LIGHT = np.array([0.55, 0.45, 0.70]) / np.linalg.norm([0.55, 0.45, 0.70])


def section(mesh: MeshView, plane: str, at_m: float = 0.0) -> tuple[list[NDArray[np.float64]], NDArray[np.int64]]:
    """Cut the mesh by a plane of the head frame.

    Parameters
    ----------
    mesh
        The model.
    plane
        ``sagittal`` (y), ``coronal`` (x) or ``axial`` (z).
    at_m
        Place of the plane along its normal [m]; moved by a ten-thousandth of the model's
        size, so that it never runs along a face shared by two elements.

    Returns
    -------
    polygons : list of (k, 2) float64
        The cut of each element [mm], corners in turn.
    rows : (c,) int64
        The element of each polygon.
    """
    normal, right, up = SECTIONS[plane]
    size = float(np.ptp(mesh.nodes, axis=0).max())
    height = mesh.nodes[:, normal] - at_m - 1.03e-4 * size
    corner = height[mesh.hexes]
    rows = np.flatnonzero((corner.min(axis=1) < 0) & (corner.max(axis=1) > 0))
    polygons = []
    for row in rows:
        ends = mesh.hexes[row][_EDGES]
        low, high = height[ends[:, 0]], height[ends[:, 1]]
        crossed = (low < 0) != (high < 0)
        share = (low / (low - high + (low == high)))[crossed, None]
        a, b = mesh.nodes[ends[crossed, 0]], mesh.nodes[ends[crossed, 1]]
        points = 1e3 * (a + share * (b - a))[:, [right, up]]
        middle = points.mean(axis=0)
        turn = np.argsort(np.arctan2(points[:, 1] - middle[1], points[:, 0] - middle[0]), kind="stable")
        polygons.append(points[turn])
    return polygons, rows


def surface(hexes: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the outer faces ``(f, 4)`` of a mesh, seen counter-clockwise from outside, and their elements."""
    faces = np.asarray(hexes, dtype=np.int64)[:, HEX_FACES].reshape(-1, 4)
    _, where, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = np.sort(where[count == 1])
    return faces[outer], outer // len(HEX_FACES)


def model_picture(mesh: MeshView) -> Picture:
    """Show the assembled model from outside and in two sections, by role."""
    with house_style():
        figure, axes = new_figure((10.0, 3.7), columns=3)
        _draw_surface(axes[0], mesh)
        axes[0].set_title("Outside, from the front left")
        for place, plane, title in ((1, "sagittal", "Sagittal section"), (2, "coronal", "Coronal section")):
            polygons, rows = section(mesh, plane)
            colours = [ROLE_COLOURS.get(role, _OTHER) for role in mesh.element_role[rows]]
            axes[place].add_collection(
                PolyCollection(polygons, facecolors=colours, edgecolors="#ffffff", linewidths=0.35)
            )
            _frame(axes[place], polygons)
            axes[place].set_title(title)
        present = [role for role in ROLE_COLOURS if (mesh.element_role == role).any()]
        handles = [Patch(color=ROLE_COLOURS[role], label=role.replace("_", " ")) for role in present]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handlelength=1.0)
        alt = f"The model from outside and cut through the middle: {', '.join(r.replace('_', ' ') for r in present)}."
        caption = f"The assembled model: {len(mesh.hexes)} hexahedra, {len(mesh.nodes)} nodes."
        return finish(figure, "model", alt, caption, ending="png")


def sections_picture(mesh: MeshView, snapshots: Snapshots, name: str, columns: int = 4) -> Picture:
    """Show the head cut open at several times, the brain coloured by a value on the undeformed geometry.

    Parameters
    ----------
    mesh, snapshots
        The model, and the value of its elements.
    name
        File name.
    columns
        How many times, at most.
    """
    chosen = _spread(snapshots, columns)
    values = np.full(len(mesh.hexes), np.nan)
    # Cut the scale at the 99.5th percentile: one bad element must not turn the rest dark.
    top = float(np.nanpercentile(snapshots.values[chosen], 99.5)) or 1.0
    scale, colour_map = Normalize(0, top), colormaps["viridis"]
    head = np.isin(mesh.element_role, ["brain", "csf", "skull", "scalp", "face"])
    with house_style():
        figure, axes = new_figure((10.0, 4.7), rows=2, columns=len(chosen))
        for row, plane in enumerate(("sagittal", "axial")):
            polygons, elements = section(mesh, plane, 0.0 if plane == "sagittal" else _brain_middle(mesh))
            keep = head[elements]
            polygons = [p for p, k in zip(polygons, keep) if k]
            elements = elements[keep]
            for column, at in enumerate(chosen):
                values[snapshots.rows] = snapshots.values[at]
                colours = [
                    colour_map(scale(values[e]))
                    if np.isfinite(values[e])
                    else (*_pale(ROLE_COLOURS.get(str(mesh.element_role[e]), _OTHER)), 1.0)
                    for e in elements
                ]
                picture = axes[row * len(chosen) + column]
                picture.add_collection(PolyCollection(polygons, facecolors=colours, edgecolors="face", linewidths=0.2))
                _frame(picture, polygons)
                if row == 0:
                    picture.set_title(f"{1e3 * snapshots.time_s[at]:.1f} ms", loc="center")
                if column == 0:
                    picture.text(
                        -0.04,
                        0.5,
                        plane,
                        transform=picture.transAxes,
                        rotation=90,
                        va="center",
                        ha="right",
                        color="#5b626b",
                    )
        bar = figure.colorbar(
            ScalarMappable(scale, colour_map), ax=axes, location="right", shrink=0.75, extend="max", pad=0.01
        )
        bar.set_label(f"{snapshots.name} (1)")
        bar.outline.set_visible(False)
        times = ", ".join(f"{1e3 * snapshots.time_s[k]:.1f}" for k in chosen)
        peak = [float(np.nanmax(snapshots.values[k])) for k in chosen]
        alt = f"Head cut open at {times} ms; greatest {snapshots.name} {', '.join(f'{p:.3g}' for p in peak)}."
        caption = (
            "Sagittal (anterior to the right) and axial sections of the head; the brain is coloured by "
            f"{snapshots.name}, drawn on the undeformed geometry."
        )
        return finish(figure, name, alt, caption, ending="png")


def _spread(snapshots: Snapshots, columns: int) -> list[int]:
    """Choose snapshots from the first rise to the end, the one of the greatest value among them."""
    greatest = np.nanmax(snapshots.values, axis=1)
    count = len(snapshots.time_s)
    if count <= columns:
        return list(range(count))
    peak = int(np.argmax(greatest))
    risen = np.flatnonzero(greatest >= 0.1 * greatest[peak])
    wanted = np.linspace(int(risen[0]), count - 1, columns).round().astype(int)
    wanted[int(np.argmin(np.abs(wanted - peak)))] = peak
    return sorted({int(k) for k in wanted})


def _brain_middle(mesh: MeshView) -> float:
    brain = mesh.hexes[mesh.element_role == "brain"]
    return float(mesh.nodes[brain, 2].mean()) if len(brain) else 0.0


def _draw_surface(axes: Axes, mesh: MeshView, azimuth_deg: float = 38.0, elevation_deg: float = 14.0) -> None:
    """Draw the outer faces, far ones first, shaded by their slope to the light."""
    az, el = np.radians([azimuth_deg, elevation_deg])
    toward = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    right = np.array([-np.sin(az), np.cos(az), 0.0])
    up = np.cross(toward, right)
    faces, elements = surface(mesh.hexes)
    corner = mesh.nodes[faces]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    seen = normal @ toward > 0
    depth = corner.mean(axis=1) @ toward
    order = np.flatnonzero(seen)[np.argsort(depth[seen], kind="stable")]
    shade = 0.55 + 0.45 * np.clip(normal @ _LIGHT, 0, 1)
    base = np.array([to_rgb(ROLE_COLOURS.get(str(role), _OTHER)) for role in mesh.element_role[elements]])
    colours = np.clip(base * shade[:, None] * 1.12, 0, 1)
    flat = 1e3 * np.stack([corner @ right, corner @ up], axis=-1)
    axes.add_collection(
        PolyCollection(list(flat[order]), facecolors=colours[order], edgecolors=colours[order] * 0.8, linewidths=0.25)
    )
    _frame(axes, list(flat))


def _frame(axes: Axes, polygons: list[NDArray[np.float64]]) -> None:
    plain_axes(axes)
    if polygons:
        points = np.concatenate([p.reshape(-1, 2) for p in polygons])
        low, high = points.min(axis=0), points.max(axis=0)
        margin = 0.03 * float((high - low).max())
        axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))


def _pale(colour: str) -> tuple[float, float, float]:
    red, green, blue = (0.45 * part + 0.55 * 0.94 for part in to_rgb(colour))
    return red, green, blue
