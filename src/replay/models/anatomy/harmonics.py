"""Real spherical harmonics that are even in y: a radius for every direction of a symmetric head in 153 numbers.

``r(d) = sum_lm a_lm P_lm(z) cos(m phi)`` up to degree 16, phi from x towards y, with associated Legendre functions
normalised so that every term has a mean square of one over the sphere. Terms in sin(m phi) are odd in y: a symmetric
head has none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DEGREE = 16


def basis(directions: np.ndarray, degree: int = DEGREE) -> np.ndarray:
    """Values of the harmonics, (n, (degree + 1) (degree + 2) / 2), by l and then m.

    Parameters
    ----------
    directions
        Unit vectors, (n, 3).
    degree
        Largest l.
    """
    z = np.clip(directions[:, 2], -1.0, 1.0)
    across = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    phi = np.arctan2(directions[:, 1], directions[:, 0])
    legendre: dict[tuple[int, int], np.ndarray] = {(0, 0): np.ones(len(z))}
    # stable recurrences of the normalised functions: up the diagonal, then up in l
    for m in range(1, degree + 1):
        legendre[m, m] = np.sqrt((2 * m + 1) / (2 * m)) * across * legendre[m - 1, m - 1]
    for m in range(degree + 1):
        if m < degree:
            legendre[m + 1, m] = np.sqrt(2 * m + 3) * z * legendre[m, m]
        for k in range(m + 2, degree + 1):
            a = np.sqrt((4 * k * k - 1) / (k * k - m * m))
            b = np.sqrt(((k - 1) ** 2 - m * m) / (4 * (k - 1) ** 2 - 1))
            legendre[k, m] = a * (z * legendre[k - 1, m] - b * legendre[k - 2, m])
    columns = [
        legendre[k, m] * (np.sqrt(2.0) * np.cos(m * phi) if m else 1.0) for k in range(degree + 1) for m in range(k + 1)
    ]
    return np.stack(columns, axis=1)


@dataclass(frozen=True)
class HarmonicSurface:
    """A star-shaped surface by its coefficients.

    Parameters
    ----------
    coefficients_m : (n,) float64
        In the order of `basis` [m].
    scale
        Factor of the radius.
    """

    coefficients_m: np.ndarray
    scale: float = 1.0

    def __call__(self, directions: np.ndarray) -> np.ndarray:
        """Radius [m] of unit directions (n, 3)."""
        return self.scale * np.einsum("ij,j->i", basis(directions, self.degree), self.coefficients_m)

    @property
    def degree(self) -> int:
        """Largest l."""
        return round((np.sqrt(8 * len(self.coefficients_m) + 1) - 3) / 2)

    def smoothed(self, sigma_deg: float) -> HarmonicSurface:
        """The surface after diffusion over the sphere, ``exp(-l (l+1) s^2 / 2)``: a Gaussian mean of this width."""
        order = np.concatenate([np.full(k + 1, k) for k in range(self.degree + 1)])
        damping = np.exp(-0.5 * order * (order + 1) * np.radians(sigma_deg) ** 2)
        return HarmonicSurface(self.coefficients_m * damping, self.scale)
