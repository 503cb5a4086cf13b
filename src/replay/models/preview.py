"""A picture of the model: from outside, and cut along the mid-sagittal plane. Painted face by face, no 3-D library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from replay.files import atomic_path
from replay.models.model import Model, Part
from replay.models.quality import FACES

_COLOURS = {
    "brain": "#e8a0a8",
    "grey_matter": "#dd8f9a",
    "white_matter": "#f5dfe0",
    "csf": "#5aa9e6",
    "skull": "#efe6cf",
    "scalp": "#d9a87c",
    "face": "#e6bd97",
    "comfort_pad": "#9bc995",
    "energy_pad": "#3f8f7b",
    "shell": "#2f4b7c",
    "facemask": "#8d99ae",
    "chin_cup": "#e07a3f",
    "bone": "#e9dcc0",
    "flesh": "#c98f78",
    "cap": "#d8cfa8",
    "cushion": "#5f7f5a",
    "mount": "#70757d",
}
_LIGHT = np.array([-0.35, 0.45, 0.82])


def write_preview(path: str | Path, model: Model, *, dots_per_inch: int = 100) -> None:
    """Draw the model as PNG; the same model gives the same bytes.

    Parameters
    ----------
    path
        File to write.
    model
        The model.
    dots_per_inch
        Resolution; the picture is 12 by 6.6 inches.
    """
    figure = Figure(figsize=(12, 6.6), facecolor="white")
    FigureCanvasAgg(figure)
    centroid = model.nodes[model.hexes].mean(axis=1)
    everything = np.ones(len(model.hexes), dtype=bool)
    plane = "axis" if "apparatus" in model.info else "mid-sagittal plane"
    views = (
        ("outside", everything, 38.0, 14.0),
        (f"cut along the {plane}", centroid[:, 1] < 0, 90.0, 0.0),
    )
    for k, (title, shown, azimuth, elevation) in enumerate(views):
        axes = figure.add_axes((0.01 + 0.5 * k, 0.12, 0.48, 0.78))
        _paint(axes, model, shown, azimuth, elevation)
        axes.set_title(title, fontsize=11, color="#333333")
    name = f"{model.info.get('preset', 'model')}, {model.info.get('resolution', '')}"
    chosen = model.info.get("helmet", {}).get("chosen")
    if chosen:
        name += f", helmet {chosen['helmet']}, facemask {chosen['facemask']}"
    figure.suptitle(f"{name}: {len(model.hexes):,} hexahedra, {len(model.nodes):,} nodes", fontsize=14, y=0.975)
    looks = {_look(part) for part in model.parts}
    present = [look for look in _COLOURS if look in looks]
    columns = len(present) if len(present) < 12 else 7
    figure.legend(
        handles=[Patch(facecolor=_COLOURS[r], edgecolor="#555555", label=r.replace("_", " ")) for r in present],
        loc="lower center", ncol=columns, frameon=False, fontsize=10, handlelength=1.2, columnspacing=1.4,
    )  # fmt: skip
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dots_per_inch, format="png", metadata={"Software": None})


def _look(part: Part) -> str:
    """Key of a part's colour: its own name where there is one, as of the first player; its role elsewhere."""
    name = part.name.removesuffix("_2")
    return name if name in _COLOURS else part.role


def outer_faces(hexes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces that belong to one hex only.

    Parameters
    ----------
    hexes
        (m, 8).

    Returns
    -------
    tuple
        Faces (k, 4), counter-clockwise from outside, and the hex of each, (k,).
    """
    faces = hexes[:, FACES].reshape(-1, 4)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    single = np.sort(first[count == 1])
    return faces[single], single // len(FACES)


def _paint(axes: Axes, model: Model, shown: np.ndarray, azimuth_deg: float, elevation_deg: float) -> None:
    """Project, drop what faces away, sort from far to near, shade by a light over the viewer's left shoulder."""
    a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
    toward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.cross(toward, right)
    rows = np.flatnonzero(shown)
    faces, owner = outer_faces(model.hexes[rows])
    corners = model.nodes[faces]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.sqrt(np.einsum("ij,ij->i", normal, normal))[:, None]
    seen = np.flatnonzero(np.einsum("ij,j->i", normal, toward) > 1e-3)
    depth = np.einsum("ijk,k->ij", corners[seen], toward).mean(axis=1)
    seen = seen[np.argsort(np.round(depth, 9), kind="stable")]
    base = np.array([to_rgb(_COLOURS[_look(part)]) for part in model.parts])[model.element_part[rows][owner[seen]]]
    light = _LIGHT[0] * right + _LIGHT[1] * up + _LIGHT[2] * toward
    shade = 0.58 + 0.42 * np.clip(np.einsum("ij,j->i", normal[seen], light / np.sqrt(light @ light)), 0, 1)
    colours = np.clip(base * shade[:, None], 0, 1)
    flat = np.stack([np.einsum("ijk,k->ij", corners[seen], v) for v in (right, up)], axis=-1)
    axes.add_collection(PolyCollection(list(flat), facecolors=colours, edgecolors=colours * 0.62, linewidths=0.35))
    low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    span = 0.05 if high[1] - low[1] < 0.8 else 0.2
    bar = np.array([low[0], low[1] - 0.24 * span])
    axes.plot([bar[0], bar[0] + span], [bar[1]] * 2, color="#333333", linewidth=2.5, solid_capstyle="butt")
    axes.text(bar[0] + 1.1 * span, bar[1], f"{1e3 * span:.0f} mm", fontsize=9, va="center", color="#333333")
    axes.set_xlim(low[0] - 0.01, high[0] + 0.01)
    axes.set_ylim(low[1] - 0.4 * span, high[1] + 0.01)
    axes.set_aspect("equal")
    axes.axis("off")
