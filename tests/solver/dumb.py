"""The element written as in a textbook, slowly, in plain numpy: the witness against the fast kernels.

Eight-node closed form of the mean B matrix (the volume's derivative with respect to each nodal
coordinate, here by differentiating a 27-point Gauss integral exactly), full matrices, one element at a time.
"""

from __future__ import annotations

import numpy as np

SIGNS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)
GAMMA = np.stack(
    [
        SIGNS[:, 1] * SIGNS[:, 2],
        SIGNS[:, 2] * SIGNS[:, 0],
        SIGNS[:, 0] * SIGNS[:, 1],
        SIGNS.prod(axis=1),
    ]
)
POINTS = np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 9.0


def mean_b(x: np.ndarray) -> tuple[np.ndarray, float]:
    """B (8, 3) = integral of the shape functions' gradients over the element, and the volume."""
    b, volume = np.zeros((8, 3)), 0.0
    for p, wp in zip(POINTS, WEIGHTS):
        for q, wq in zip(POINTS, WEIGHTS):
            for r, wr in zip(POINTS, WEIGHTS):
                xi = np.array([p, q, r])
                terms = 1 + xi * SIGNS
                slopes = np.stack(
                    [SIGNS[:, k] * np.delete(terms, k, axis=1).prod(axis=1) / 8 for k in range(3)], axis=1
                )
                jacobian = x.T @ slopes
                determinant = np.linalg.det(jacobian)
                b += wp * wq * wr * determinant * slopes @ np.linalg.inv(jacobian)
                volume += wp * wq * wr * determinant
    return b, volume


def symmetric(six: np.ndarray) -> np.ndarray:
    xx, yy, zz, xy, yz, zx = six
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def elastic_step(x, v, stress, hourglass, dt, mass, lame, shear, kappa, b1, b2):
    """One step of the elastic element; returns forces (8, 3), stress (3, 3), hourglass (4, 3)."""
    middle = x - 0.5 * dt * v
    b, volume = mean_b(middle)
    gradient = v.T @ b / volume
    rate, spin = 0.5 * (gradient + gradient.T), 0.5 * (gradient - gradient.T)
    eye = np.eye(3)
    turn = np.linalg.solve(eye - 0.5 * dt * spin, eye + 0.5 * dt * spin)
    half = 0.5 * dt * (lame * np.trace(rate) * eye + 2 * shear * rate)
    stress = turn @ (stress + half) @ turn.T + half
    shapes = GAMMA - (GAMMA @ middle) @ b.T / volume
    stiffness = kappa * 2 * shear * (b**2).sum() / (16 * volume)
    grown = 0.5 * dt * stiffness * (shapes @ v)
    hourglass = (hourglass + grown) @ turn.T + grown
    b_end, volume_end = mean_b(x)
    shapes_end = GAMMA - (GAMMA @ x) @ b_end.T / volume_end
    density = mass / volume_end
    speed = np.sqrt((max(lame, 0) + 2 * shear) / density)
    spread = b.T @ b
    mean = np.trace(spread) / 3
    deviator = spread - mean * eye
    bound = mean + np.sqrt(2 / 3 * (deviator**2).sum())
    omega = np.sqrt(8 / mass * ((max(lame, 0) * (b**2).sum() + 2 * shear * bound) / volume_end + 8 * stiffness))
    length = 2 * speed / omega
    closing = max(-np.trace(rate), 0.0)
    pressure = density * length * (b2**2 * length * closing + b1 * speed) * closing
    force = b_end @ (stress - pressure * eye) + shapes_end.T @ hourglass
    return force, stress, hourglass
