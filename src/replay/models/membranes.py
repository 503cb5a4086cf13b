"""Falx and tentorium as nets of cables: thin sheets of dura that pull and do not push, tied to skull and brain.

A sheet a millimetre thick between elements of several is no layer of hexes. It is a net here: along the sides and the
diagonals of the quads that lie in it, cables whose sections give a square of them the plane-stress stiffness of a sheet
with Poisson's ratio 1/3 (Hrennikoff's framework, J. Appl. Mech. 8, 1941):

    k = E A / L,   A = 3/8 t (area / L) of a quad's side,   A = 3/8 t (2 area / L) of its diagonal

A cable carries tension only, as a sheet that wrinkles. No node, element or time step changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.models.model import Model
from replay.models.quality import FACES
from replay.models.radial import to_atlas
from replay.models.regions import REGION_NAMES, label_regions

YOUNGS_MODULUS_PA = 31.5e6
"""Of dura in tension: Galford and McElhaney (1970), as in most head models."""
THICKNESS_M = 1.0e-3


@dataclass(frozen=True)
class CableNet:
    """A sheet of cables.

    Parameters
    ----------
    nodes
        The two ends of each cable, rows of the model's nodes, (n, 2).
    stiffness_n_per_m
        Tension per stretch of each, (n,) [N/m].
    area_m2
        Area of the sheet [m^2].
    """

    nodes: np.ndarray
    stiffness_n_per_m: np.ndarray
    area_m2: float


def falx(model: Model) -> CableNet:
    """The falx: the mid-sagittal plane above the corpus callosum, from the frontal skull to the tentorium."""
    quads, _ = _inner_quads(model)
    place = _atlas(model, model.nodes[quads].mean(axis=1))
    _, y, z = place.T
    middle = np.abs(model.nodes[quads][..., 1]).max(axis=1) < 1e-7
    above_callosum = np.hypot((y + 5) / 50, z / 34) > 1
    floor = np.where(y < -40, -11 + 0.4 * (y + 70), np.where(y > 15, -12.0, 1.0))
    return _net(model.nodes, quads[middle & above_callosum & (z > floor)])


def tentorium(model: Model) -> CableNet:
    """The tentorium: faces between the cerebellum and the lobes above it, on to the skull."""
    quads, owners = _inner_quads(model)
    centre = _atlas(model, model.nodes[model.hexes].mean(axis=1))
    below = label_regions(centre) == REGION_NAMES.index("cerebellum")
    above = ~below & (centre[:, 1] < -40) & (centre[:, 2] > np.minimum(-4.0, -11 + 0.4 * (centre[:, 1] + 70)))
    first, second = owners.T
    return _net(model.nodes, quads[(below[first] & above[second]) | (above[first] & below[second])])


def _inner_quads(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Faces between two hexes of brain or fluid, (k, 4), and the two hexes of each, (k, 2)."""
    rows = np.flatnonzero(model.elements_of(role="brain") | model.elements_of(role="csf"))
    faces = model.hexes[rows][:, FACES].reshape(-1, 4)
    _, inverse = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    order = np.argsort(inverse.ravel(), kind="stable")
    same = np.flatnonzero(np.diff(inverse.ravel()[order]) == 0)
    first, second = order[same], order[same + 1]
    return faces[first], np.stack([rows[first // 6], rows[second // 6]], axis=1)


def _atlas(model: Model, points: np.ndarray) -> np.ndarray:
    info = model.info
    return to_atlas(
        points - np.array(info["star_centre_m"]),
        info["atlas_centre_mm"], info["atlas_mm_per_m"], info["atlas_pitch_rad"],
    )  # fmt: skip


def _net(nodes: np.ndarray, quads: np.ndarray) -> CableNet:
    """Cables of a sheet of quads; those of two quads along a common side are one."""
    across = np.cross(nodes[quads[:, 2]] - nodes[quads[:, 0]], nodes[quads[:, 3]] - nodes[quads[:, 1]])
    area = 0.5 * np.sqrt(np.einsum("ij,ij->i", across, across))
    ends = quads[:, [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]]]
    span = nodes[ends[..., 1]] - nodes[ends[..., 0]]
    squared = np.einsum("eij,eij->ei", span, span)
    stiffness = 3 / 8 * YOUNGS_MODULUS_PA * THICKNESS_M * area[:, None] * [1, 1, 1, 1, 2, 2] / squared
    pairs, inverse = np.unique(np.sort(ends.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    total = np.bincount(inverse.ravel(), weights=stiffness.ravel(), minlength=len(pairs))
    return CableNet(pairs, total, float(area.sum()))
