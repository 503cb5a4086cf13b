"""The body's hexes: from a posed skin to nodes, segments and bones, with room left for head and helmet."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from replay.models.body.fit import Skin, fit_to_skin
from replay.models.body.posture import PosedBody, body_joints
from replay.models.body.segments import HEAD, MESHED, SEGMENTS, kind_of
from replay.models.body.shape import Shape
from replay.models.body.voxels import KEPT_SHARE, Grid, filled_share, parted_mesh
from replay.models.radial import RadialSurface

#: Edge of a voxel at each resolution [m].
STEPS_M = {"tiny": 0.040, "coarse": 0.030, "medium": 0.025, "fine": 0.020}
#: Coarser, a limb has no inside; finer, the build takes minutes and the run no more than before.
STEP_RANGE_M = (0.015, 0.045)
LEAST_QUALITY = 0.30
#: Radius about the joint within which a limb is grown to its parent, over the radius of the flesh there [m].
_GROWN_M = {
    "upper_arm": 0.13, "forearm": 0.09, "hand": 0.07, "thigh": 0.17, "shank": 0.11, "foot": 0.10, "neck": 0.16,
}  # fmt: skip
#: Where cells next to bones of the limbs are bone [m]; a bone is never thinner than one cell.
_BONE_RADIUS_M = 0.020
#: What rises from the trunk about the neck's line within this belongs to the neck [m].
_NECK_RADIUS_M = 0.11
#: Body cells keep off the helmet by this, over the step.
_CLEARANCE = 0.8


@dataclass(frozen=True)
class HeadRoom:
    """Where the head is, in the body's axes.

    Parameters
    ----------
    centre
        Star centre of the head, (3,) [m].
    axes
        Of the head, in rows, (3, 3).
    scalp
        Radius of its outside for directions in its own axes.
    helmet
        Nodes of the helmet, (k, 3) [m]; none for a bare head.
    """

    centre: np.ndarray
    axes: np.ndarray
    scalp: RadialSurface
    helmet: np.ndarray

    def gap_m(self, points: np.ndarray) -> np.ndarray:
        """Distance along the ray from the head's outside, negative within, (n,) [m]."""
        arm = (points - self.centre) @ self.axes.T
        length = np.sqrt(np.einsum("ij,ij->i", arm, arm))
        return length - self.scalp(arm / length[:, None])


@dataclass(frozen=True)
class BodyMesh:
    """A body without its head.

    Parameters
    ----------
    nodes
        (n, 3) [m], in the axes of `PosedBody`.
    hexes
        (m, 8).
    segment
        Index into `MESHED` of each hex, (m,).
    bone
        Whether a hex belongs to its segment's bone, (m,) bool.
    skull_nodes
        Nodes that the skull carries, (k,); none where the neck ends at its joint.
    """

    nodes: np.ndarray
    hexes: np.ndarray
    segment: np.ndarray
    bone: np.ndarray
    skull_nodes: np.ndarray


def body_mesh(shape: Shape, posed: PosedBody, step_m: float, room: HeadRoom, tissue: str) -> BodyMesh:
    """Mesh a posed man below his head.

    Parameters
    ----------
    shape, posed
        The man.
    step_m
        Edge of the voxels [m].
    room
        What the head takes.
    tissue
        ``rigid``: each segment is bone through and through and has nodes of its own; ``deformable``: thin bones in
        flesh that goes on over the joints.
    """
    skin = Skin.sampled(posed.skin, shape.triangles, shape.weights.argmax(axis=1))
    grid = Grid.around(posed.skin, step_m)
    share = filled_share(grid, posed.skin, shape.triangles)
    cells = np.argwhere((share > KEPT_SHARE) | _along_bones(grid, posed))
    centre = grid.centres(cells)
    _, near = cKDTree(skin.points).query(centre)
    segment = skin.label[near]
    cells, centre, segment = _below_head(cells, centre, segment, room, step_m)
    segment = _cut_at_joints(centre, segment, posed)
    growth = _Growth(posed, centre, segment, step_m, shape.stature_m / 1.85)
    nodes, hexes, piece = parted_mesh(grid, cells, growth)
    trunk = np.bincount(piece[segment == SEGMENTS.index("upper_trunk")]).argmax()
    kept = piece == trunk
    used, row = np.unique(hexes[kept], return_inverse=True)
    nodes, hexes = nodes[used], row.reshape(-1, 8)
    segment = np.array([MESHED.index(SEGMENTS[k]) for k in segment[kept].tolist()])
    place, boundary = fit_to_skin(nodes, hexes, _with_head(skin, room), step_m, least_quality=LEAST_QUALITY)
    if tissue == "rigid":
        own, row = np.unique(hexes.ravel() * len(MESHED) + np.repeat(segment, 8), return_inverse=True)
        rigid = np.ones(len(hexes), dtype=bool)
        return BodyMesh(place[own // len(MESHED)], row.reshape(-1, 8), segment, rigid, np.zeros(0, dtype=int))
    skull = boundary[np.isin(boundary, hexes[segment == MESHED.index("neck")])]
    skull = skull[room.gap_m(place[skull]) < 0.45 * step_m]
    return BodyMesh(place, hexes, segment, _bones(place, hexes, segment, posed, skull), skull)


def _along_bones(grid: Grid, posed: PosedBody) -> np.ndarray:
    """Cells that the line of a limb's bone passes, of the grid's shape."""
    out = np.zeros(grid.shape, dtype=bool)
    reach = np.arange(-2, 3)
    around = np.stack(np.meshgrid(reach, reach, reach, indexing="ij"), axis=-1).reshape(-1, 3)
    for segment, line in posed.ends.items():
        if segment == "neck":
            continue
        for point in _dense(line, 0.25 * grid.step_m):
            cells = np.floor((point - grid.origin) / grid.step_m).astype(int) + around
            cells = cells[(cells >= 0).all(axis=1) & (cells < grid.shape).all(axis=1)]
            near = np.abs(grid.centres(cells) - point).max(axis=1) < 0.51 * grid.step_m
            out[tuple(cells[near].T)] = True
    return out


def _dense(line: np.ndarray, step_m: float) -> np.ndarray:
    pieces = []
    for a, b in pairwise(line):
        count = max(int(np.ceil(np.sqrt(np.sum((b - a) ** 2)) / step_m)), 1)
        pieces.append(a + (b - a) * (np.arange(count + 1) / count)[:, None])
    return np.concatenate(pieces)


def _below_head(
    cells: np.ndarray, centre: np.ndarray, segment: np.ndarray, room: HeadRoom, step_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Take out what the head and the helmet fill; what of MakeHuman's head is left below is neck."""
    head, neck = SEGMENTS.index(HEAD), SEGMENTS.index("neck")
    keep = room.gap_m(centre) > 0.25 * step_m
    arm = (centre - room.centre) @ room.axes.T
    # above the level of the skull base nothing of the body is left, whatever it sticks out of
    keep &= ~((segment == head) & (arm[:, 2] > -0.08))
    if len(room.helmet):
        distance, _ = cKDTree(room.helmet).query(centre)
        keep &= ~((distance < _CLEARANCE * step_m) & np.isin(segment, [head, neck, SEGMENTS.index("upper_trunk")]))
    segment = np.where(segment == head, neck, segment)
    return cells[keep], centre[keep], segment[keep]


def _cut_at_joints(centre: np.ndarray, segment: np.ndarray, posed: PosedBody) -> np.ndarray:
    """Segments as de Leva cuts them: an arm begins at its joint, the neck above the last vertebra of the neck."""
    out, trunk = segment.copy(), SEGMENTS.index("upper_trunk")
    for name, back in (("upper_arm_left", 0.0), ("upper_arm_right", 0.0), ("neck", 0.0)):
        k, (start, end) = SEGMENTS.index(name), posed.ends[name][:2]
        along = (end - start) / np.sqrt(np.sum((end - start) ** 2))
        arm = centre - start
        beyond = arm @ along
        if name == "neck":
            aside = np.sqrt(np.maximum(np.einsum("ij,ij->i", arm, arm) - beyond**2, 0.0))
            out[(segment == trunk) & (beyond > back) & (aside < _NECK_RADIUS_M)] = k
        else:
            out[(segment == k) & (beyond < back)] = trunk
    return out


def _with_head(skin: Skin, room: HeadRoom) -> Skin:
    """The body's skin, and the outside of the head facing it: the neck's end lies on the skull's base."""
    body = skin.label != SEGMENTS.index(HEAD)
    k = np.arange(4000) + 0.5
    z, phi = 1 - 2 * k / 4000, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z * z)
    direction = np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=1)
    points = room.centre + (direction * room.scalp(direction)[:, None]) @ room.axes
    low = direction[:, 2] < -0.3
    return Skin(
        np.concatenate([skin.points[body], points[low]]),
        np.concatenate([skin.normals[body], -(direction @ room.axes)[low]]),
        np.concatenate([skin.label[body], np.full(int(low.sum()), SEGMENTS.index(HEAD))]),
    )


class _Growth:
    """Which neighbouring cells are grown together."""

    def __init__(self, posed: PosedBody, centre: np.ndarray, segment: np.ndarray, step_m: float, scale: float) -> None:
        self._centre, self._segment = centre, segment
        count = len(SEGMENTS)
        self._joint = np.zeros((count, count, 3))
        self._reach = np.full((count, count), -1.0)
        np.fill_diagonal(self._reach, np.inf)
        for joint in body_joints():
            a, b = SEGMENTS.index(joint.parent), SEGMENTS.index(joint.child)
            reach = _GROWN_M.get(kind_of(joint.child), np.inf)
            self._reach[a, b] = self._reach[b, a] = reach * scale + 0.5 * step_m
            self._joint[a, b] = self._joint[b, a] = posed.places[joint.name]

    def __call__(self, here: np.ndarray, there: np.ndarray) -> np.ndarray:
        a, b = self._segment[here], self._segment[there]
        middle = 0.5 * (self._centre[here] + self._centre[there])
        away = middle - self._joint[a, b]
        return np.sqrt(np.einsum("ij,ij->i", away, away)) <= self._reach[a, b]


def _bones(
    nodes: np.ndarray, hexes: np.ndarray, segment: np.ndarray, posed: PosedBody, skull: np.ndarray
) -> np.ndarray:
    """Hexes along the bones' lines, none of which has a node of another bone.

    Neck, hands and feet choose first, so that they are not left without; then all from the trunk outwards.
    """
    centre = nodes[hexes].mean(axis=1)
    owner = np.full(len(nodes), -1)
    owner[skull] = len(MESHED)
    bone = np.zeros(len(hexes), dtype=bool)
    first = [n for n in MESHED if n.startswith(("neck", "hand", "foot"))]
    for name in [*first, *(n for n in MESHED if n not in first)]:
        k = MESHED.index(name)
        own = np.flatnonzero(segment == k)
        if not len(own):
            continue
        free = np.isin(owner[hexes[own]], [-1, k]).all(axis=1)
        distance, _ = cKDTree(_dense(posed.ends[name], 0.004)).query(centre[own])
        chosen = free & (distance <= _BONE_RADIUS_M)
        if free.any() and not chosen.any():  # no voxel lies that near: the middle one
            away = np.sqrt(np.sum((centre[own] - posed.ends[name].mean(axis=0)) ** 2, axis=1))
            chosen = free & (away <= away[free].min() + 1e-9)
        bone[own[chosen]] = True
        owner[hexes[own[chosen]]] = k
    return bone
