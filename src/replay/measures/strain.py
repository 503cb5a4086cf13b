"""Strain and stress of elements, and their volume-weighted statistics over a region."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def principal_stretches(deformation_gradient: ArrayLike) -> NDArray[np.float64]:
    """Principal stretches, greatest first.

    Parameters
    ----------
    deformation_gradient : (m, 3, 3)
        F = dx/dX, dimensionless.

    Returns
    -------
    (m, 3) float64
        Square roots of the eigenvalues of F^T F.
    """
    gradient = np.asarray(deformation_gradient, dtype=float)
    squared = np.linalg.eigvalsh(np.swapaxes(gradient, -1, -2) @ gradient)[..., ::-1]
    return np.sqrt(np.maximum(squared, 0.0))


def green_lagrange(stretches: NDArray) -> NDArray[np.float64]:
    """Green-Lagrange strain of principal stretches: (lambda^2 - 1) / 2."""
    return 0.5 * (stretches * stretches - 1.0)


def logarithmic(stretches: NDArray) -> NDArray[np.float64]:
    """Logarithmic (Hencky) strain of principal stretches: ln lambda."""
    with np.errstate(divide="ignore"):
        return np.log(stretches)


def maximum_shear_strain(stretches: NDArray) -> NDArray[np.float64]:
    """Maximum shear strain, tensor form, Green-Lagrange: (E_1 - E_3) / 2, (m,)."""
    return 0.25 * (stretches[..., 0] ** 2 - stretches[..., 2] ** 2)


def tensile_pressure(stress: ArrayLike) -> NDArray[np.float64]:
    """Tensile pressure: max(tr sigma / 3, 0) [Pa], (m,).

    Parameters
    ----------
    stress : (m, 6) or (m, 3, 3)
        Cauchy stress [Pa]; six components are xx, yy, zz, xy, yz, zx.
    """
    return np.maximum(_six(stress)[:, :3].sum(axis=1) / 3.0, 0.0)


def von_mises(stress: ArrayLike) -> NDArray[np.float64]:
    """Von Mises stress sqrt(3/2 s:s) [Pa], (m,).

    Parameters
    ----------
    stress : (m, 6) or (m, 3, 3)
        Cauchy stress [Pa]; six components are xx, yy, zz, xy, yz, zx.
    """
    xx, yy, zz, xy, yz, zx = _six(stress).T
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.sqrt(0.5 * normal + 3.0 * (xy**2 + yz**2 + zx**2))


def weighted_percentile(values: ArrayLike, weights: ArrayLike, percent: float) -> float:
    """Smallest value that at least `percent` of the weight does not exceed; no interpolation.

    Parameters
    ----------
    values, weights : (m,)
        A value and a volume [m^3] per element.
    percent
        0 to 100.

    Returns
    -------
    float
        NaN for an empty region or one whose values are not finite.
    """
    value, weight = np.asarray(values, dtype=float), np.asarray(weights, dtype=float)
    if value.size == 0 or not np.isfinite(value).all():
        return float("nan")
    order = np.argsort(value, kind="stable")
    below = np.cumsum(weight[order])
    at = int(np.searchsorted(below, percent / 100.0 * below[-1] * (1 - 1e-12)))
    return float(value[order[min(at, value.size - 1)]])


def volume_fraction_at_least(values: ArrayLike, weights: ArrayLike, threshold: float) -> float:
    """Share of the volume whose value is `threshold` or more.

    Of the maximum principal strain reached so far, with 0.15 or 0.25: the cumulative strain
    damage measure CSDM15, CSDM25 (Takhounts et al. 2003).
    """
    value, weight = np.asarray(values, dtype=float), np.asarray(weights, dtype=float)
    if value.size == 0:
        return float("nan")
    return float(weight[value >= threshold].sum() / weight.sum())


def _six(stress: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(stress, dtype=float)
    if array.ndim == 3:
        rows, columns = [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]
        return array[:, rows, columns]
    return array
