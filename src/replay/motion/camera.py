"""Pinhole projection with optional Brown distortion, and its derivatives, for many frames at once.

Camera axes: x right, y down, z forward. A pose is a rotation (template to camera) and a translation
written as ``(x/z, y/z, log z)``: at long range these three are nearly uncorrelated, metres are not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Lens:
    """What is known of the camera but its focal length.

    Parameters
    ----------
    principal_point
        ``(cx, cy)`` [px].
    distortion
        k1, k2, p1, p2, k3 of the Brown model (the order of OpenCV).
    """

    principal_point: tuple[float, float]
    distortion: tuple[float, float, float, float, float] = NO_DISTORTION


def translation(shift: np.ndarray) -> np.ndarray:
    """``(..., 3)`` metres from ``(x/z, y/z, log z)``."""
    z = np.exp(shift[..., 2])
    return np.stack([shift[..., 0] * z, shift[..., 1] * z, z], axis=-1)


def shift_of(position: np.ndarray) -> np.ndarray:
    """``(x/z, y/z, log z)`` of ``(..., 3)`` metres in front of the camera."""
    z = position[..., 2]
    return np.stack([position[..., 0] / z, position[..., 1] / z, np.log(z)], axis=-1)


def project(
    points: np.ndarray, rotation: np.ndarray, shift: np.ndarray, log_f: np.ndarray, lens: Lens
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of template points in every frame, with their derivatives.

    Parameters
    ----------
    points
        ``(n, 3)`` template [m].
    rotation
        ``(k, 3, 3)`` template to camera.
    shift
        ``(k, 3)`` x/z, y/z, log z.
    log_f
        ``(k,)`` logarithm of the focal length [px].
    lens
        Principal point and distortion.

    Returns
    -------
    pixels
        ``(k, n, 2)``; NaN for points behind the camera.
    jacobian
        ``(k, n, 2, 7)`` with respect to a left rotation vector (3), x/z, y/z, log z, log f.
    """
    turned = np.einsum("kij,nj->kni", rotation, points)
    t = translation(shift)
    p = turned + t[:, None, :]
    z = p[..., 2]
    ahead = z > 1e-6
    inverse = 1.0 / np.where(ahead, z, np.nan)
    x, y = p[..., 0] * inverse, p[..., 1] * inverse
    f = np.exp(log_f)[:, None]
    xd, yd, slope = _distort(x, y, lens.distortion)
    pixels = np.stack([lens.principal_point[0] + f * xd, lens.principal_point[1] + f * yd], axis=-1)

    # d(x, y)/dp, then the chain through distortion and focal length
    to_point = np.zeros((*x.shape, 2, 3))
    to_point[..., 0, 0] = inverse
    to_point[..., 1, 1] = inverse
    to_point[..., 0, 2] = -x * inverse
    to_point[..., 1, 2] = -y * inverse
    to_point = f[..., None, None] * np.einsum("knab,knbc->knac", slope, to_point)

    jacobian = np.empty((*x.shape, 2, 7))
    # d(w x r) / dw = -[r]x
    rx, ry, rz = turned[..., 0], turned[..., 1], turned[..., 2]
    gx, gy, gz = to_point[..., 0], to_point[..., 1], to_point[..., 2]
    jacobian[..., 0] = gz * ry[..., None] - gy * rz[..., None]
    jacobian[..., 1] = gx * rz[..., None] - gz * rx[..., None]
    jacobian[..., 2] = gy * rx[..., None] - gx * ry[..., None]
    depth = t[:, None, 2:3]
    jacobian[..., 3] = gx * depth
    jacobian[..., 4] = gy * depth
    jacobian[..., 5] = np.einsum("knac,kc->kna", to_point, t)
    jacobian[..., 6] = np.stack([f * xd, f * yd], axis=-1)
    return pixels, jacobian


def _distort(
    x: np.ndarray, y: np.ndarray, coefficients: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Brown distortion of normalised coordinates and its ``(..., 2, 2)`` derivative."""
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    growth = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
    xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    slope = np.empty((*x.shape, 2, 2))
    slope[..., 0, 0] = radial + x * x * growth + 2.0 * p1 * y + 6.0 * p2 * x
    slope[..., 0, 1] = x * y * growth + 2.0 * p1 * x + 2.0 * p2 * y
    slope[..., 1, 0] = slope[..., 0, 1]
    slope[..., 1, 1] = radial + y * y * growth + 6.0 * p1 * y + 2.0 * p2 * x
    return xd, yd, slope
