"""A helmet that somebody else meshed: its arrays in SI and head axes, and what its names say about its parts."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from replay.models.mass import Datum, three_point_datum
from replay.models.surrogate_settings import Frame, HelmetSettings

# The first word that a name holds decides; a facemask's mount is no shell, a chin strap no chin cup.
_ROLE_WORDS = (
    ("facemask", ("facemask", "faceguard", "face_mask", "face_guard", "cage", "grill", "fcmask")),
    ("chin_cup", ("chin_cup", "chincup", "chin_pad")),
    ("strap", ("strap", "buckle", "webbing")),
    ("comfort_pad", ("comfort", "fit_pad", "fitting", "inner_pad", "liner_inner")),
    ("energy_pad", ("energy", "pad", "liner", "foam", "bumper", "absorber", "cushion")),
    ("shell", ("shell", "polycarbonate")),
)
_PLACES = ("brow", "crown", "high", "low", "upper", "lower", "side", "jaw", "front", "rear", "back")


@dataclass(frozen=True)
class SurrogatePart:
    """A part of a foreign deck.

    Parameters
    ----------
    pid, name, role
        Number, title, what it is.
    law
        Our law; empty where there is none.
    density_kg_per_m3
        NaN where the deck gives none.
    problem
        Why the part cannot be simulated; empty where it can.
    has_material
        Whether a ``*PART`` with a ``*MAT`` card, or the settings, give it a material.
    """

    pid: int
    name: str
    role: str
    law: str
    density_kg_per_m3: float
    problem: str = ""
    has_material: bool = True


@dataclass(frozen=True)
class Surrogate:
    """A helmet's mesh.

    Parameters
    ----------
    nodes, node_ids
        (n, 3) [m] in head axes, (n,).
    solids, solid_ids, solid_part
        Rows of nodes (m, 10), -1 where there is none; numbers; index into `parts`.
    shells, shell_ids, shell_part, shell_thickness_m
        The same for shells, (k, 4).
    parts
        Parts that elements name.
    pad_sets
        Parts of the two pad sets: against the head, against the shell.
    node_sets, mounts, anchors
        Name to rows of nodes: every set of the deck, and those that are facemask mounts and strap anchors.
    tied
        Groups of parts that the deck's contacts and ties name together.
    datum
        Three-point datum; None where it is not given.
    """

    nodes: np.ndarray
    node_ids: np.ndarray
    solids: np.ndarray
    solid_ids: np.ndarray
    solid_part: np.ndarray
    shells: np.ndarray
    shell_ids: np.ndarray
    shell_part: np.ndarray
    shell_thickness_m: np.ndarray
    parts: tuple[SurrogatePart, ...]
    pad_sets: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())
    node_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    mounts: Mapping[str, np.ndarray] = field(default_factory=dict)
    anchors: Mapping[str, np.ndarray] = field(default_factory=dict)
    tied: tuple[frozenset[int], ...] = ()
    datum: Datum | None = None


def role_of(title: str) -> str:
    """Role that a part's title says, ``other`` where it says none."""
    plain = plain_name(title)
    return next((role for role, words in _ROLE_WORDS if any(word in plain for word in words)), "other")


def plain_name(title: str) -> str:
    """A title as a name: lower case, words joined by underscores."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")


def interface_of(title: str) -> tuple[str, str]:
    """``mount`` or ``anchor`` and the place that a node set's title says; empty where it says neither.

    ``facemask_mount_brow_left`` is the mount ``brow_left``, ``Strap anchor, rear, R`` the anchor ``rear_right``.
    """
    words = plain_name(title).split("_")
    kind = "mount" if "mount" in words or "mounts" in words else ""
    if "anchor" in words or "anchors" in words or ("strap" in words and not kind):
        kind = "anchor"
    side = next((s for s in ("left", "right") if s in words or s[0] in words), "")
    place = [word for word in words if word in _PLACES]
    place += ["cup"] if "cup" in words else []
    return (kind, "_".join([*place, side] if side else place)) if kind else ("", "")


def head_axes(frame: Frame) -> np.ndarray:
    """Rows x (forward), y (left), z (up) of the head in the deck's axes, (3, 3)."""

    def vector(axis: str) -> np.ndarray:
        row = np.zeros(3)
        row["xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
        return row

    x, z = vector(frame.forward), vector(frame.up)
    return np.stack([x, np.cross(z, x), z])


def to_head(points_m: np.ndarray, frame: Frame) -> np.ndarray:
    """Points of the deck, (n, 3) [m], in head axes with the head's centre of gravity as origin."""
    return np.einsum("ij,nj->ni", head_axes(frame), points_m - np.array(frame.origin_m))


def datum_of(settings: HelmetSettings, nodes: np.ndarray, node_ids: np.ndarray, length_m: float) -> Datum | None:
    """Three-point datum that the settings name.

    Parameters
    ----------
    settings
        With node numbers, or points in the deck's unit and axes.
    nodes, node_ids
        In head axes, (n, 3) [m]; numbers.
    length_m
        The deck's unit of length.

    Raises
    ------
    ValueError
        For a node that is not there, or three points on a line.
    """
    if settings.datum is None:
        return None
    points = []
    for name in ("brow", "left", "right"):
        point = getattr(settings.datum, name)
        if isinstance(point, int):
            rows = np.flatnonzero(node_ids == point)
            if not len(rows):
                message = f"datum.{name}: node {point} is not in the deck"
                raise ValueError(message)
            points.append(nodes[rows[0]])
        else:
            points.append(to_head(np.array([point]) * length_m, settings.frame)[0])
    return three_point_datum(*points)


def found_datum(nodes: np.ndarray, shell: np.ndarray) -> Datum | None:
    """Datum found on the shell's nodes: middle of the front edge, and the widest points at its height.

    Parameters
    ----------
    nodes
        In head axes, (n, 3) [m].
    shell
        Rows of the shell's nodes.
    """
    if len(shell) < 3:
        return None
    points = nodes[shell]
    size = points.max(axis=0) - points.min(axis=0)
    middle = 0.5 * (points[:, 1].max() + points[:, 1].min())
    front = points[(np.abs(points[:, 1] - middle) < 0.02 * size[1]) & (points[:, 0] > points[:, 0].mean())]
    if not len(front):
        return None
    brow = front[np.argmin(np.round(front[:, 2], 9))]
    near = points[np.abs(points[:, 2] - brow[2]) < 0.07 * size[2]]
    left, right = near[np.argmax(np.round(near[:, 1], 9))], near[np.argmin(np.round(near[:, 1], 9))]
    try:
        return three_point_datum(brow, left, right)
    except ValueError:
        return None
