"""The head's four surfaces from the derived anatomy: brain and scalp as measured, the skull between them by a rule.

The derived file holds no bone: no open source in a wheel does. The inner table of the skull stands a layer of fluid off
the brain; the outer table a thickness off the inner one over the calvaria, and a share of what tissue there is beyond
that in the directions of the face and the base, where bone, sinuses and muscle alternate along a ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from replay.models.anatomy.harmonics import HarmonicSurface
from replay.models.anatomy.labels import LabelVolume
from replay.models.radial import RadialSurface


@dataclass(frozen=True)
class Anatomy:
    """What the derived file holds.

    Parameters
    ----------
    brain_m, scalp_m
        Harmonic coefficients of a man's brain and scalp about the star centre [m].
    labels
        Tissue inside the brain, in MNI millimetres.
    star_centre_mni_mm
        The star centre in MNI coordinates.
    pitch_rad
        Angle by which the head's x axis falls below the y axis of MNI space [rad].
    brain_scale
        Size of the man's brain over the MNI template's.
    fit_mm
        Root mean squares of what the harmonics miss of brain and scalp, and the registration of the calvaria [mm].
    """

    brain_m: np.ndarray
    scalp_m: np.ndarray
    labels: LabelVolume
    star_centre_mni_mm: np.ndarray
    pitch_rad: float
    brain_scale: float
    fit_mm: tuple[float, float, float]


@cache
def load_anatomy() -> Anatomy:
    """Read ``models/data/anatomy.npz``."""
    with (resources.files("replay.models") / "data" / "anatomy.npz").open("rb") as stream, np.load(stream) as data:
        volume = LabelVolume(
            data["labels"], tuple(data["label_shape"].tolist()), data["label_origin_mm"], float(data["label_step_mm"])
        )
        brain, scalp, cover = data["fit_mm"].tolist()
        return Anatomy(
            data["brain_m"], data["scalp_m"], volume, data["star_centre_mni_mm"], float(data["pitch_rad"]),
            float(data["brain_scale"]), (brain, scalp, cover),
        )  # fmt: skip


@dataclass(frozen=True)
class Offset:
    """A surface a distance outside another.

    Parameters
    ----------
    surface
        The surface.
    distance_m
        Along the ray [m].
    """

    surface: RadialSurface
    distance_m: float

    def __call__(self, directions: np.ndarray) -> np.ndarray:
        """Radius [m]."""
        return self.surface(directions) + self.distance_m


@dataclass(frozen=True)
class OuterSkull:
    """The outer table of the skull.

    Parameters
    ----------
    inner, scalp
        What it lies between.
    calvaria_m
        Thickness of the calvaria [m].
    face_share
        Share of the tissue beyond it that counts as bone in the directions of the face and the base.
    skin_m
        Least cover by soft tissue [m].
    """

    inner: RadialSurface
    scalp: RadialSurface
    calvaria_m: float
    face_share: float
    skin_m: float

    def __call__(self, directions: np.ndarray) -> np.ndarray:
        """Radius [m]."""
        inner, scalp = self.inner(directions), self.scalp(directions)
        beyond = np.maximum(scalp - inner - self.calvaria_m - self.skin_m, 0.0)
        bone = inner + self.calvaria_m + self.face_share * face_weight(directions) * beyond
        return np.maximum(np.minimum(bone, scalp - self.skin_m), inner)


def face_weight(directions: np.ndarray) -> np.ndarray:
    """1 in the directions of the face and the skull's base, 0 over the calvaria and the nape, smooth between, (n,)."""
    forward, up = directions[:, 0], directions[:, 2]
    below = np.clip((0.55 * np.maximum(forward, 0.0) - 0.05 - up) / 0.35, 0.0, 1.0)
    ahead = np.clip((forward + 0.35) / 0.4, 0.0, 1.0)
    return below * ahead


def brain_surface(scale: float) -> HarmonicSurface:
    """The brain with its sulci filled; `scale` over a man's."""
    return HarmonicSurface(load_anatomy().brain_m, scale)


def scalp_surface(scale: float) -> HarmonicSurface:
    """Skin of head and face down to the neck's cut; `scale` over a man's."""
    return HarmonicSurface(load_anatomy().scalp_m, scale)
