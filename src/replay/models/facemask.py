"""The facemask: square bars swept over a surface before the face, one sheet of hexes conforming at every crossing.

Bars are rows (elevation) and columns (azimuth) of one structured sheet, so that a crossing is a cell of both. Each
mount is one flared hex whose wide end is a face of the shell's edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from replay.models.facemask_design import BROW, Facemask
from replay.models.helmet import standoff_m
from replay.models.helmet_design import HelmetShell
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
    nodes: np.ndarray,
    edge_quads: np.ndarray,
    scalp: RadialSurface,
    shell: HelmetShell,
    mask: Facemask,
    step_m: float,
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
    shell, mask
        The shell, and the bars before it.
    step_m
        Length aimed at for the hexes along a bar [m].
    """
    surface = _mask_surface(scalp, shell, mask)
    mounts = _choose_mounts(nodes, edge_quads, mask)
    place = {name: _angles(nodes[quad].mean(axis=0)) for name, quad in mounts.items() if name.endswith("_left")}
    columns = _columns(mask, place)
    rows = [
        place[f"{row.mount}_left"][1] if row.elevation_deg is None else row.elevation_deg for row in mask.rows.values()
    ]
    flap = [place[f"{r.mount}_left"] for r in mask.rows.values() if r.mount is not None]
    top = min(place[f"{name}_left"][1] for name in mask.mounts_at("brow")) - mask.mount_deg
    ends = np.interp([*rows, top], [e for _, e in flap], [a - mask.mount_deg for a, _ in flap])
    azimuth, elevation, bar_u, bar_v = _sheet(surface, [c.azimuth_deg for c in columns], rows, top, ends, mask, step_m)
    points = _thickened(surface, azimuth, elevation, mask.bar_m)
    index = len(nodes) + np.arange(points.shape[0] * points.shape[1] * 2).reshape(points.shape[:3])
    hexes = [_cell(index, i, j) for i, j in np.argwhere(_kept(bar_u, bar_v, columns, mask))]
    first_u = {number: i for i, number in reversed(list(enumerate(bar_u))) if number >= 0}
    first_v = {number: j for j, number in reversed(list(enumerate(bar_v))) if number >= 0}
    last_u, last_v = points.shape[0] - 1, points.shape[1] - 1
    ends_of_bars = {}
    for number, column in enumerate(columns):
        if column.mount is not None:
            side = "left" if column.azimuth_deg > 0 else "right"
            face = _face(index, (first_u[number], last_v), (first_u[number] + 1, last_v))
            ends_of_bars[f"{column.mount}_{side}"] = face
    for number, row in enumerate(mask.rows.values()):
        if row.mount is not None:
            for side, u in (("left", last_u), ("right", 0)):
                face = _face(index, (u, first_v[number]), (u, first_v[number] + 1))
                ends_of_bars[f"{row.mount}_{side}"] = face
    everything = np.vstack([nodes, points.reshape(-1, 3)])
    hexes += [_join(everything, ends_of_bars[name], quad) for name, quad in mounts.items()]
    stacked = np.array(hexes)
    backwards = hex_volumes(everything, stacked) < 0
    stacked[backwards] = stacked[backwards][:, [4, 5, 6, 7, 0, 1, 2, 3]]
    used = np.zeros(len(everything), dtype=bool)
    used[: len(nodes)] = True
    used[stacked] = True
    number_of = np.cumsum(used) - 1
    return FacemaskMesh(everything[used], number_of[stacked], {name: np.sort(quad) for name, quad in mounts.items()})


@dataclass(frozen=True)
class _Bar:
    """One bar down the face: its azimuth [degrees], the mount above it, the rows it spans."""

    azimuth_deg: float
    mount: str | None
    spans: tuple[tuple[str, str], ...]


def _columns(mask: Facemask, place: dict[str, tuple[float, float]]) -> list[_Bar]:
    """Every bar down the face, images included, from right to left."""
    bars = []
    for column in mask.columns:
        azimuth = column.azimuth_deg if column.mount is None else place[f"{column.mount}_left"][0]
        assert azimuth is not None
        for sign in (-1, 1) if azimuth > 0 else (1,):
            bars.append(_Bar(sign * float(azimuth), column.mount, column.spans))
    return sorted(bars, key=lambda bar: bar.azimuth_deg)


def _mask_surface(scalp: RadialSurface, shell: HelmetShell, mask: Facemask) -> RadialSurface:
    """Middle of the bars: the shell's middle surface continued over the face, a little further out in front."""
    smooth = Smoothed(scalp, mask.smoothing_deg)
    width = shell.edge_deg.flap[0][0]

    def surface(directions: np.ndarray) -> np.ndarray:
        azimuth, _ = angles_of(directions)
        bulge = np.cos(np.pi / 2 * np.clip(azimuth / width, -1, 1)) ** 2
        offset = standoff_m(shell, directions) + shell.shell_m / 2 + mask.standoff_m * bulge
        return smooth(directions) + ray_stretch(smooth, directions) * offset

    return surface


def _angles(point: np.ndarray) -> tuple[float, float]:
    azimuth, elevation = angles_of((point / np.sqrt(point @ point))[None])
    return float(azimuth[0]), float(elevation[0])


def _choose_mounts(nodes: np.ndarray, edge_quads: np.ndarray, mask: Facemask) -> dict[str, np.ndarray]:
    """Faces of the shell's edge nearest to where the mounts should be; those of the right are mirror images."""
    middle = nodes[edge_quads].mean(axis=1)
    azimuth, elevation = angles_of(middle / np.sqrt(np.einsum("ij,ij->i", middle, middle))[:, None])
    along = nodes[edge_quads[:, 1]] - nodes[edge_quads[:, 0]]
    flat = np.abs(along[:, 2]) < np.sqrt(along[:, 0] ** 2 + along[:, 1] ** 2)
    brow = flat & (np.abs(azimuth) < 55) & (elevation > -15)
    flap = ~flat & (azimuth < 90) & (azimuth > 0)
    chosen = {}
    for name, mount in mask.mounts.items():
        where, distance = (brow, azimuth) if mount.edge == "brow" else (flap, elevation)
        left = int(np.argmin(np.where(where, np.round(np.abs(distance - mount.at_deg), 6), np.inf)))
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
    mask: Facemask,
    step_m: float,
) -> tuple[np.ndarray, np.ndarray, list[int], list[int]]:
    """Azimuth and elevation of the sheet's points, and the bar of each interval (-1 between bars)."""
    lines_u = [(None, 0)] + [(k, s) for k in range(len(columns)) for s in (-1, 1)] + [(None, 0)]
    lines_v = [(k, s) for k in range(len(rows)) for s in (-1, 1)] + [(None, 0)]
    shape = (len(lines_u), len(lines_v))
    azimuth, elevation = np.empty(shape), np.empty(shape)
    for j, (row, sign_v) in enumerate(lines_v):
        e0, end = (rows[row], ends[row]) if row is not None else (top, ends[-1])
        for i, (column, sign_u) in enumerate(lines_u):
            a0 = columns[column] if column is not None else (-end if i == 0 else end)
            per_a, per_e = _metric(surface, a0, e0)
            azimuth[i, j] = a0 + sign_u * mask.bar_m / 2 / per_a
            elevation[i, j] = e0 + sign_v * mask.bar_m / 2 / per_e
    bar_u = [-1 if a[0] is None or a[0] != b[0] else a[0] for a, b in pairwise(lines_u)]
    bar_v = [-1 if a[0] is None or a[0] != b[0] else a[0] for a, b in pairwise(lines_v)]
    # measured in the middle of an interval: at an end, left and right would differ
    i, j = len(columns), 2 * (len(rows) // 2)
    reach_u = [
        abs(b - a) * _metric(surface, (a + b) / 2, rows[len(rows) // 2])[0] for a, b in pairwise(azimuth[:, j].tolist())
    ]
    reach_v = [
        abs(elevation[i, k + 1] - elevation[i, k]) * _metric(surface, azimuth[i, k], elevation[i, k])[1]
        for k in range(len(bar_v))
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


def _kept(bar_u: list[int], bar_v: list[int], columns: list[_Bar], mask: Facemask) -> np.ndarray:
    """Cells that are bars: rows from flap to flap or between their outermost columns, columns along their spans."""
    u, v = np.array(bar_u), np.array(bar_v)
    names = list(mask.rows)
    first = {name: int(np.argmax(v == k)) for k, name in enumerate(names)} | {BROW: len(v) - 1}
    keep = np.zeros((len(u), len(v)), dtype=bool)
    crossing: dict[str, list[int]] = {name: [] for name in [*names, BROW]}
    for number, column in enumerate(columns):
        for span in column.spans:
            keep[u == number, first[span[0]] : first[span[1]] + 1] = True
            for name in mask.crossed(span):
                crossing[name].append(int(np.argmax(u == number)))
    for name, row in mask.rows.items():
        low, high = (0, len(u) - 1) if row.mount else (min(crossing[name]), max(crossing[name]))
        keep[low : high + 1, first[name]] = True
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
