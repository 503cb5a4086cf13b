"""The facemask: square bars swept over a surface before the face, one sheet of hexes conforming at every crossing.

Bars are rows (elevation) and columns (azimuth) of one structured sheet, so that a crossing is a cell of both. Each
mount is one flared hex whose wide end is a face of the shell's edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from replay.models.helmet_layout import angles_of, direction_at
from replay.models.quality import hex_volumes
from replay.models.radial import RadialSurface, Smoothed, ray_stretch

_STEP_DEG = 0.05


@dataclass(frozen=True)
class FacemaskMesh:
    """Hexes of a facemask on a helmet's nodes.

    Parameters
    ----------
    nodes
        The nodes given and the facemask's own after them, (n, 3) [m].
    hexes
        Hexes of the facemask, rows of `nodes`, (m, 8).
    mounts
        Name of each mount to the four nodes that it shares with the shell.
    """

    nodes: np.ndarray
    hexes: np.ndarray
    mounts: dict[str, np.ndarray]


def facemask_mesh(
    nodes: np.ndarray, edge_quads: np.ndarray, scalp: RadialSurface, helmet: dict[str, Any], step_m: float
) -> FacemaskMesh:
    """Sweep the bars and join them to the shell.

    Parameters
    ----------
    nodes
        Nodes so far, (n, 3) [m].
    edge_quads
        Faces of the shell's lower edge, (k, 4).
    scalp
        The scalp's surface.
    helmet
        ``data/helmet.yaml``.
    step_m
        Length aimed at for the hexes along a bar [m].
    """
    mask = helmet["facemask"]
    surface = _mask_surface(scalp, helmet)
    mounts = _choose_mounts(nodes, edge_quads, mask)
    centre = {name: _angles(nodes[quad].mean(axis=0)) for name, quad in mounts.items()}
    inset = float(mask["mount_deg"])
    columns = [float(mask["outer_column_azimuth_deg"]), centre["brow_left"][0]]
    low = sorted(float(e) for e in mask["lower_bars_elevation_deg"])
    rows = [*low, centre["side_low_left"][1], centre["side_high_left"][1]]
    top = centre["brow_left"][1] - inset
    ends = np.interp([*rows, top], rows[-2:], [centre["side_low_left"][0] - inset, centre["side_high_left"][0] - inset])
    azimuth, elevation, bar_u, bar_v = _sheet(surface, columns, rows, top, ends, float(mask["bar_m"]), step_m)
    points = _thickened(surface, azimuth, elevation, float(mask["bar_m"]))
    index = len(nodes) + np.arange(points.shape[0] * points.shape[1] * 2).reshape(points.shape[:3])
    keep = _kept(bar_u, bar_v)
    hexes = [_cell(index, i, j) for i, j in np.argwhere(keep)]
    first_u = {number: i for i, number in reversed(list(enumerate(bar_u))) if number >= 0}
    first_v = {number: j for j, number in reversed(list(enumerate(bar_v))) if number >= 0}
    last_u, last_v = points.shape[0] - 1, points.shape[1] - 1
    ends_of_bars = {
        "brow_right": _face(index, (first_u[1], last_v), (first_u[1] + 1, last_v)),
        "brow_left": _face(index, (first_u[2], last_v), (first_u[2] + 1, last_v)),
        "side_low_right": _face(index, (0, first_v[2]), (0, first_v[2] + 1)),
        "side_low_left": _face(index, (last_u, first_v[2]), (last_u, first_v[2] + 1)),
        "side_high_right": _face(index, (0, first_v[3]), (0, first_v[3] + 1)),
        "side_high_left": _face(index, (last_u, first_v[3]), (last_u, first_v[3] + 1)),
    }
    everything = np.vstack([nodes, points.reshape(-1, 3)])
    hexes += [_join(everything, ends_of_bars[name], quad) for name, quad in mounts.items()]
    stacked = np.array(hexes)
    backwards = hex_volumes(everything, stacked) < 0
    stacked[backwards] = stacked[backwards][:, [4, 5, 6, 7, 0, 1, 2, 3]]
    used = np.zeros(len(everything), dtype=bool)
    used[: len(nodes)] = True
    used[stacked] = True
    number = np.cumsum(used) - 1
    return FacemaskMesh(everything[used], number[stacked], {name: np.sort(quad) for name, quad in mounts.items()})


def _mask_surface(scalp: RadialSurface, helmet: dict[str, Any]) -> RadialSurface:
    """Middle of the bars: the shell's middle surface continued over the face, a little further out in front."""
    mask, thickness = helmet["facemask"], helmet["thickness_m"]
    smooth = Smoothed(scalp, float(mask["smoothing_deg"]))
    offset = thickness["comfort_pad"] + thickness["energy_pad"] + thickness["shell"] / 2
    width = float(helmet["edge_deg"]["flap"][0][0])

    def surface(directions: np.ndarray) -> np.ndarray:
        azimuth, _ = angles_of(directions)
        bulge = np.cos(np.pi / 2 * np.clip(azimuth / width, -1, 1)) ** 2
        return smooth(directions) + ray_stretch(smooth, directions) * (offset + mask["standoff_m"] * bulge)

    return surface


def _angles(point: np.ndarray) -> tuple[float, float]:
    azimuth, elevation = angles_of((point / np.sqrt(point @ point))[None])
    return float(azimuth[0]), float(elevation[0])


def _choose_mounts(nodes: np.ndarray, edge_quads: np.ndarray, mask: dict[str, Any]) -> dict[str, np.ndarray]:
    """Faces of the shell's edge nearest to where the mounts should be; those of the right are mirror images."""
    middle = nodes[edge_quads].mean(axis=1)
    azimuth, elevation = angles_of(middle / np.sqrt(np.einsum("ij,ij->i", middle, middle))[:, None])
    along = nodes[edge_quads[:, 1]] - nodes[edge_quads[:, 0]]
    flat = np.abs(along[:, 2]) < np.sqrt(along[:, 0] ** 2 + along[:, 1] ** 2)
    brow, flap = flat & (np.abs(azimuth) < 55) & (elevation > -15), ~flat & (np.abs(azimuth) < 90)
    chosen = {}
    high, low = mask["side_mount_elevation_deg"]
    for name, where, distance in (
        ("brow", brow, np.abs(azimuth - mask["brow_mount_azimuth_deg"])),
        ("side_high", flap & (azimuth > 0), np.abs(elevation - high)),
        ("side_low", flap & (azimuth > 0), np.abs(elevation - low)),
    ):
        left = int(np.argmin(np.where(where, np.round(distance, 6), np.inf)))
        away = middle - middle[left] * [1, -1, 1]
        chosen[f"{name}_left"] = edge_quads[left]
        chosen[f"{name}_right"] = edge_quads[int(np.argmin(np.einsum("ij,ij->i", away, away)))]
    return chosen


def _sheet(
    surface: RadialSurface,
    columns: list[float],
    rows: list[float],
    top: float,
    ends: np.ndarray,
    bar_m: float,
    step_m: float,
) -> tuple[np.ndarray, np.ndarray, list[int], list[int]]:
    """Azimuth and elevation of the sheet's points, and the bar of each interval (-1 between bars)."""
    lines_u = [(None, 0)] + [(k, s) for k in range(4) for s in (-1, 1)] + [(None, 0)]
    centre_u = [-columns[0], -columns[1], columns[1], columns[0]]
    lines_v = [(k, s) for k in range(4) for s in (-1, 1)] + [(None, 0)]
    shape = (len(lines_u), len(lines_v))
    azimuth, elevation = np.empty(shape), np.empty(shape)
    for j, (row, sign_v) in enumerate(lines_v):
        e0, end = (rows[row], ends[row]) if row is not None else (top, ends[-1])
        for i, (column, sign_u) in enumerate(lines_u):
            a0 = centre_u[column] if column is not None else (-end if i == 0 else end)
            per_a, per_e = _metric(surface, a0, e0)
            azimuth[i, j] = a0 + sign_u * bar_m / 2 / per_a
            elevation[i, j] = e0 + sign_v * bar_m / 2 / per_e
    bar_u = [-1 if a[0] is None or a[0] != b[0] else a[0] for a, b in pairwise(lines_u)]
    bar_v = [-1 if a[0] is None or a[0] != b[0] else a[0] for a, b in pairwise(lines_v)]
    # measured in the middle of an interval: at an end, left and right would differ
    reach_u = [abs(b - a) * _metric(surface, (a + b) / 2, rows[2])[0] for a, b in pairwise(azimuth[:, 4].tolist())]
    reach_v = [
        abs(elevation[4, j + 1] - elevation[4, j]) * _metric(surface, azimuth[4, j], elevation[4, j])[1]
        for j in range(len(bar_v))
    ]
    azimuth, elevation, bar_u = _refined(azimuth, elevation, bar_u, reach_u, step_m)
    right, left, bar_v = _refined(azimuth.T, elevation.T, bar_v, reach_v, step_m)
    return right.T, left.T, bar_u, bar_v


def _refined(
    azimuth: np.ndarray, elevation: np.ndarray, bars: list[int], reach_m: list[float], step_m: float
) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Divide the intervals between bars into cells of about the step; a bar stays one cell wide."""
    shares, owners = [], []
    for i, bar in enumerate(bars):
        cells = 1 if bar >= 0 else max(1, round(reach_m[i] / step_m))
        shares += [i + k / cells for k in range(cells)]
        owners += [bar] * cells
    at = np.array([*shares, len(bars)])
    low = np.minimum(at.astype(int), len(bars) - 1)
    share = (at - low)[:, None]
    return (
        (1 - share) * azimuth[low] + share * azimuth[low + 1],
        (1 - share) * elevation[low] + share * elevation[low + 1],
        owners,
    )


def _points(surface: RadialSurface, azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    d = direction_at(azimuth, elevation)
    return d * surface(d.reshape(-1, 3)).reshape(azimuth.shape)[..., None]


def _tangents(surface: RadialSurface, azimuth: np.ndarray, elevation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Change of position per degree of azimuth and of elevation [m]."""
    h = _STEP_DEG
    along = _points(surface, azimuth + h, elevation) - _points(surface, azimuth - h, elevation)
    up = _points(surface, azimuth, elevation + h) - _points(surface, azimuth, elevation - h)
    return along / (2 * h), up / (2 * h)


def _metric(surface: RadialSurface, azimuth: float, elevation: float) -> tuple[float, float]:
    """Length of a degree of azimuth and of elevation [m]."""
    along, up = _tangents(surface, np.array([azimuth]), np.array([elevation]))
    return float(np.sqrt(along[0] @ along[0])), float(np.sqrt(up[0] @ up[0]))


def _thickened(surface: RadialSurface, azimuth: np.ndarray, elevation: np.ndarray, bar_m: float) -> np.ndarray:
    """Points half a bar inside and outside the surface along its normal, (u, v, 2, 3)."""
    middle = _points(surface, azimuth, elevation)
    along, up = _tangents(surface, azimuth, elevation)
    normal = np.cross(along, up)
    normal /= np.sqrt(np.einsum("ijk,ijk->ij", normal, normal))[..., None]
    return np.stack([middle - normal * bar_m / 2, middle + normal * bar_m / 2], axis=2)


def _kept(bar_u: list[int], bar_v: list[int]) -> np.ndarray:
    """Cells that are bars: four rows, the columns between the lower three, and from the highest row to the brow."""
    u, v = np.array(bar_u), np.array(bar_v)
    first = [int(np.argmax(v == k)) for k in range(4)]
    inner = np.arange(len(u))
    inside = (inner >= np.argmax(u == 0)) & (inner <= np.argmax(u == 3))
    keep = np.zeros((len(u), len(v)), dtype=bool)
    for row in range(4):
        keep[:, first[row]] = inside if row < 2 else True
    rows = np.arange(len(v))
    lower, upper = rows <= first[2], rows >= first[3]
    between = (rows >= first[0]) & lower
    for column in range(4):
        keep[u == column] |= between | (upper if column in (1, 2) else np.zeros_like(upper))
    return keep


def _cell(index: np.ndarray, i: int, j: int) -> np.ndarray:
    corner = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
    return np.array([index[a, b, 0] for a, b in corner] + [index[a, b, 1] for a, b in corner])


def _face(index: np.ndarray, first: tuple[int, int], second: tuple[int, int]) -> np.ndarray:
    """Face of the sheet's rim over two neighbouring points: inner, inner, outer, outer."""
    return np.array([index[(*first, 0)], index[(*second, 0)], index[(*second, 1)], index[(*first, 1)]])


def _join(nodes: np.ndarray, face: np.ndarray, quad: np.ndarray) -> np.ndarray:
    """Hex between two quads, their corners paired so that the ties are shortest."""
    turns: list[Callable[[np.ndarray], np.ndarray]] = [lambda q, k=k: np.roll(q, k) for k in range(4)]  # type: ignore[misc]
    turns += [lambda q, k=k: np.roll(q[::-1], k) for k in range(4)]  # type: ignore[misc]
    options = [turn(quad) for turn in turns]
    lengths = [np.sum((nodes[face] - nodes[option]) ** 2) for option in options]
    return np.concatenate([face, options[int(np.argmin(lengths))]])
