"""Postures: joint angles within their limits, the turn of every segment, the skin that follows.

Axes of a standing man: x anterior, y left, z up. In the anatomical position the arms hang and the legs stand straight
down; MakeHuman's man, who stands with his arms aside, is brought there first by the least turn of each limb. A joint
turns its child by ``Ry(flexion) Rx(lateral) Rz(rotation)`` in the axes of its parent. The skin follows by linear blend
skinning with the rig's weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from replay.models.body.segments import PARENT, SEGMENTS
from replay.models.body.shape import Shape
from replay.models.head_shape import load_data

AXES = ("flexion", "lateral", "rotation")
#: Joints about which positive flexion leads the child's free end backwards or, of the trunk, its upper end forwards.
_FLEXES_ABOUT_LEFT = ("chest", "waist", "neck", "skull_base", "knee")
#: Where each limb points to: the place at its other end.
_FAR_END = {
    "upper_arm": "elbow",
    "forearm": "hand",
    "hand": "finger-3-1",
    "thigh": "knee",
    "shank": "ankle",
}


@dataclass(frozen=True)
class BodyJoint:
    """A joint of the body.

    Parameters
    ----------
    name
        ``neck``, ``knee_left``.
    place
        Name of the rig's place it turns about.
    parent, child
        Segments.
    limits
        Angle to its least and largest value [degrees]; an angle that is not named has none of its own and stays 0.
    stiffness : (3, 2)
        About x, y and z of the joint for positive and negative angles [N m/rad].
    signs : (3,)
        Sign of the turn about x, y and z that makes an angle positive.
    """

    name: str
    place: str
    parent: str
    child: str
    limits: dict[str, tuple[float, float]]
    stiffness: np.ndarray
    signs: np.ndarray


def body_joints() -> tuple[BodyJoint, ...]:
    """All joints, from the pelvis outwards."""
    found = []
    for kind, facts in load_data("body.yaml")["joints"].items():
        paired = facts["place"].startswith("l-")
        for side in ("left", "right") if paired else ("",):
            end = f"_{side}" if side else ""
            mirror = -1.0 if side == "right" else 1.0
            about_left = kind in _FLEXES_ABOUT_LEFT
            # to the left is a turn about -x for what points up, about +x for what hangs down
            signs = np.array([mirror if paired else -1.0, 1.0 if about_left else -1.0, mirror])
            stiff = {_plain(key): value for key, value in facts["stiffness"].items()}
            by_axis = np.array([stiff[name] for name in ("lateral", "flexion", "rotation")], dtype=float)
            by_axis = np.where(signs[:, None] > 0, by_axis, by_axis[:, ::-1])
            found.append(
                BodyJoint(
                    name=kind + end,
                    place=facts["place"] if side != "right" else "r-" + facts["place"][2:],
                    parent=facts["parent"] + (end if facts["parent"] + end in PARENT else ""),
                    child=facts["child"] + end,
                    limits={_plain(key): (float(a), float(b)) for key, (a, b) in facts["limits"].items()},
                    stiffness=by_axis,
                    signs=signs,
                )
            )
    order = {name: k for k, name in enumerate(SEGMENTS)}
    return tuple(sorted(found, key=lambda joint: order[joint.child]))


def _plain(angle: str) -> str:
    """``abduction`` is the limbs' name of ``lateral``."""
    return "lateral" if angle == "abduction" else angle


@dataclass(frozen=True)
class Posture:
    """A posture by name or by angles.

    Parameters
    ----------
    name
        For outputs.
    angles_deg
        Joint to angle to degrees: ``{"knee_left": {"flexion": 40}}``; ``knee`` means both.
    """

    name: str
    angles_deg: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def turns(self) -> dict[str, np.ndarray]:
        """Turn of every joint's child in its parent's axes, (3, 3).

        Raises
        ------
        ValueError
            For a joint or an angle that does not exist, or one outside its limits.
        """
        joints = {joint.name: joint for joint in body_joints()}
        angles = {name: dict.fromkeys(AXES, 0.0) for name in joints}
        # a named side is said after both
        for name in sorted(self.angles_deg, key=lambda key: key in joints):
            sides = [name] if name in joints else [f"{name}_{side}" for side in ("left", "right")]
            for key, value in self.angles_deg[name].items():
                for each in sides:
                    if each not in joints:
                        message = f"posture {self.name}: no joint {name!r}; there are {', '.join(joints)}"
                        raise ValueError(message)
                    angles[each][self._checked(joints[each], key, float(value))] = float(value)
        turns = {}
        for name, joint in joints.items():
            about_x, about_y, about_z = joint.signs * [angles[name][a] for a in ("lateral", "flexion", "rotation")]
            # capital letters: each turn about the axes that the one before has turned
            turns[name] = Rotation.from_euler("YXZ", [about_y, about_x, about_z], degrees=True).as_matrix()
        return turns

    def _checked(self, joint: BodyJoint, angle: str, value: float) -> str:
        plain = _plain(angle)
        if plain not in joint.limits:
            known = ", ".join(joint.limits)
            message = f"posture {self.name}: joint {joint.name} has no angle {angle!r}; it has {known}"
            raise ValueError(message)
        low, high = joint.limits[plain]
        if not low <= value <= high:
            message = (
                f"posture {self.name}: {joint.name} {angle} is {value:g} degrees; "
                f"between {low:g} and {high:g} is possible"
            )
            raise ValueError(message)
        return plain


def posture_names() -> tuple[str, ...]:
    """Names of the postures of ``data/body.yaml``."""
    return tuple(load_data("body.yaml")["postures"])


def named_posture(name: str) -> Posture:
    """One of the postures of ``data/body.yaml``.

    Raises
    ------
    ValueError
        When there is no such posture.
    """
    known = load_data("body.yaml")["postures"]
    if name not in known:
        message = f"no posture {name!r}; there are {', '.join(known)}"
        raise ValueError(message)
    return Posture(name, known[name]["angles"])


@dataclass(frozen=True)
class PosedBody:
    """A man in a posture.

    Parameters
    ----------
    skin : (n, 3)
        Lower trunk upright, hips' middle at the origin [m].
    axes
        Segment to its axes, in rows, turned from the anatomical position, (3, 3).
    turns
        Segment to the matrix that turned it from MakeHuman's stand, (3, 3).
    places
        Names of the rig's places to where they are now, carried by the segment that they begin, (3,) [m].
    ends
        Segment to the line of its bone, (k, 3) [m].
    """

    skin: np.ndarray
    axes: dict[str, np.ndarray]
    turns: dict[str, np.ndarray]
    places: dict[str, np.ndarray]
    ends: dict[str, np.ndarray]


def pose(shape: Shape, posture: Posture) -> PosedBody:
    """Pose a man.

    Parameters
    ----------
    shape
        The man.
    posture
        Joint angles.
    """
    joints = {joint.child: joint for joint in body_joints()}
    hips = 0.5 * (shape.joints["l-upper-leg"] + shape.joints["r-upper-leg"])
    turn_of = posture.turns()
    axes, turns, shift = {}, {}, {}
    hanging = _hanging(shape)
    for segment in SEGMENTS:
        parent = PARENT[segment]
        if parent is None:
            axes[segment], turns[segment], shift[segment] = np.eye(3), np.eye(3), -hips
            continue
        joint = joints[segment]
        turned = axes[parent] @ turn_of[joint.name]
        axes[segment], turns[segment] = turned, turned @ hanging.get(segment, np.eye(3))
        centre = shape.joints[joint.place]
        shift[segment] = turns[parent] @ centre + shift[parent] - turns[segment] @ centre
    moved = np.zeros_like(shape.skin)
    for k, segment in enumerate(SEGMENTS):
        moved += shape.weights[:, k : k + 1] * (shape.skin @ turns[segment].T + shift[segment])
    places = {}
    for joint in body_joints():
        places[joint.name] = turns[joint.child] @ shape.joints[joint.place] + shift[joint.child]
    lines = {
        segment: np.array([shape.joints[name] for name in names]) @ turns[segment].T + shift[segment]
        for segment, names in _bone_lines().items()
    }
    return PosedBody(moved, {s: a.T for s, a in axes.items()}, turns, places, lines)


def _hanging(shape: Shape) -> dict[str, np.ndarray]:
    """Least turn of each limb from MakeHuman's stand to the anatomical position, (3, 3)."""
    turns = {}
    for side, letter in (("left", "l"), ("right", "r")):
        for kind, far in _FAR_END.items():
            segment = f"{kind}_{side}"
            start = shape.joints[next(j.place for j in body_joints() if j.child == segment)]
            along = shape.joints[f"{letter}-{far}"] - start
            turns[segment] = _least_turn(along / np.linalg.norm(along), np.array([0.0, 0.0, -1.0]))
    return turns


def _least_turn(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    axis = np.cross(start, end)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return np.eye(3)
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, start @ end)).as_matrix()


def _bone_lines() -> dict[str, tuple[str, ...]]:
    """Places of the rig along the bone of each meshed segment."""
    lines: dict[str, tuple[str, ...]] = {
        "lower_trunk": ("r-upper-leg", "pelvis", "l-upper-leg", "pelvis", "spine-4", "spine-3"),
        "mid_trunk": ("spine-3", "spine-2", "spine-1"),
        "upper_trunk": ("spine-1", "neck", "r-clavicle", "r-shoulder", "r-clavicle", "l-clavicle", "l-shoulder"),
        "neck": ("neck", "head"),
    }
    for side, letter in (("left", "l"), ("right", "r")):
        lines |= {
            f"upper_arm_{side}": (f"{letter}-shoulder", f"{letter}-elbow"),
            f"forearm_{side}": (f"{letter}-elbow", f"{letter}-hand"),
            f"hand_{side}": (f"{letter}-hand", f"{letter}-finger-3-1", f"{letter}-finger-3-2"),
            f"thigh_{side}": (f"{letter}-upper-leg", f"{letter}-knee"),
            f"shank_{side}": (f"{letter}-knee", f"{letter}-ankle"),
            f"foot_{side}": (f"{letter}-ankle", f"{letter}-foot-1", f"{letter}-foot-2"),
        }
    return lines
