"""Mass, centre of gravity and inertia of hexes, exact for uniform density, and the helmet's three-point datum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.models.quality import jacobian_determinants, shape_functions

_GAUSS = ((-np.sqrt(0.6), 5 / 9), (0.0, 8 / 9), (np.sqrt(0.6), 5 / 9))


@dataclass(frozen=True)
class MassProperties:
    """Mass properties of a body.

    Parameters
    ----------
    mass_kg
        Mass.
    cg_m
        Centre of gravity, (3,) [m].
    inertia_kg_m2
        Inertia about the centre of gravity along the frame's axes, (3, 3).
    """

    mass_kg: float
    cg_m: np.ndarray
    inertia_kg_m2: np.ndarray

    @property
    def principal_kg_m2(self) -> np.ndarray:
        """Principal moments, ascending, (3,)."""
        return np.linalg.eigvalsh(self.inertia_kg_m2)


def mass_properties(nodes: np.ndarray, hexes: np.ndarray, density_kg_per_m3: np.ndarray) -> MassProperties:
    """Integrate over trilinear hexes; three Gauss points a direction are exact for the second moments.

    Parameters
    ----------
    nodes
        (n, 3) [m].
    hexes
        (m, 8).
    density_kg_per_m3
        (m,).

    Raises
    ------
    ValueError
        When there is no hex.
    """
    if not len(hexes):
        message = "mass properties of nothing"
        raise ValueError(message)
    corners = nodes[hexes]
    reference = corners.mean(axis=(0, 1))
    corners = corners - reference
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for u, weight_u in _GAUSS:
        for v, weight_v in _GAUSS:
            for w, weight_w in _GAUSS:
                point = np.array([u, v, w])
                share = density_kg_per_m3 * jacobian_determinants(corners, point) * weight_u * weight_v * weight_w
                x = np.einsum("n,enk->ek", shape_functions(point), corners)
                mass += float(share.sum())
                first += (share[:, None] * x).sum(axis=0)
                second += np.einsum("e,ei,ej->ij", share, x, x)
    cg = first / mass
    second -= mass * np.outer(cg, cg)
    return MassProperties(mass, cg + reference, np.trace(second) * np.eye(3) - second)


@dataclass(frozen=True)
class Datum:
    """Frame of three points on a helmet: the article's step 1.3 states the CG relative to it.

    Parameters
    ----------
    origin_m
        Centre of the circle through the three points, (3,) [m].
    axes
        Rows x (towards the first point), y, z (normal of their plane, upwards), (3, 3).
    radius_m
        Radius of the circle [m].
    """

    origin_m: np.ndarray
    axes: np.ndarray
    radius_m: float

    def relative(self, point_m: np.ndarray) -> np.ndarray:
        """Coordinates of a point in the datum, (3,) [m]."""
        return np.einsum("ij,j->i", self.axes, point_m - self.origin_m)


def three_point_datum(first: np.ndarray, second: np.ndarray, third: np.ndarray) -> Datum:
    """Frame and radius of the circle through three points.

    Raises
    ------
    ValueError
        When the points lie on a line.
    """
    a, b = second - first, third - first
    normal = np.cross(a, b)
    area = float(normal @ normal)
    if area <= 1e-16 * float(a @ a) * float(b @ b):
        message = "the three points of the datum lie on a line"
        raise ValueError(message)
    centre = first + (np.cross(normal, a) * (b @ b) + np.cross(b, normal) * (a @ a)) / (2 * area)
    z = normal / np.sqrt(area)
    if z[2] < 0:
        z = -z
    x = first - centre
    radius = float(np.sqrt(x @ x))
    x = x / radius
    return Datum(centre, np.stack([x, np.cross(z, x), z]), radius)
