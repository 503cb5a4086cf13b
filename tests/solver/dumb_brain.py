"""The brain's law as a textbook writes it: Fp itself, matrices, an explicit Runge-Kutta integrator, many small steps.

The witness against `replay.solver.kernels.materials.brain_isv`; nothing is shared with it but the equations.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import expm

EYE = np.eye(3)


def dev(a: np.ndarray) -> np.ndarray:
    return a - np.trace(a) / 3 * EYE


class DumbBrain:
    """State: Fp, beta, xi1, xi*, xi2, equivalent plastic strain, phi."""

    def __init__(self, p: Any) -> None:
        self.p = p
        self.y = np.concatenate(
            [EYE.ravel(), np.zeros(9), [p.initial_xi1, p.initial_xi_star, p.initial_xi2, 0.0, p.initial_porosity]]
        )

    def stresses(self, y: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Mandel stress and back stress (deviators), Cauchy stress, plastic stretch."""
        p, fp, beta = self.p, y[:9].reshape(3, 3), y[9:18].reshape(3, 3)
        j = np.linalg.det(f)
        fe = j ** (-1 / 3) * f @ np.linalg.inv(fp)
        bp = fp @ fp.T
        stretch = np.sqrt(np.trace(bp) / 3)
        share = min((stretch / p.locking_stretch) ** 2, 0.9)
        network = p.network_modulus_pa / 3 * (3 - share) / (1 - share)
        mandel = p.shear_modulus_pa * dev(fe.T @ fe)
        cauchy = p.shear_modulus_pa / j * dev(fe @ fe.T) + p.bulk_modulus_pa / 2 * (j - 1 / j) * EYE
        return mandel, dev(network * bp + beta), cauchy, stretch

    def rate(self, y: np.ndarray, f: np.ndarray, velocity_gradient: np.ndarray) -> np.ndarray:
        p = self.p
        mandel, back, cauchy, stretch = self.stresses(y, f)
        xi1, xi_star, xi2, _, phi = y[18:]
        driving = mandel - back
        tau = np.sqrt((driving**2).sum() / 2)
        mean = np.trace(cauchy) / 3
        kappa = p.shear_modulus_pa * (p.softening_factor * xi1 + p.hardening_factor * xi2)
        over = max(tau - kappa - p.pressure_sensitivity * max(-mean, 0.0), 0.0) / p.yield_stress_pa
        gdot = p.reference_rate_per_s * np.sinh(over) ** p.rate_exponent
        d_p = gdot / np.sqrt(2) * driving / max(np.sqrt((driving**2).sum()), 1e-300)
        s = dev(cauchy)
        mises = max(np.sqrt(1.5 * (s**2).sum()), 1e-12)
        m = p.pore_growth_exponent
        pull = min(2 * (2 * m - 1) / (2 * m + 1) * max(mean, 0.0) / mises, p.triaxiality_cap)
        equivalent = np.sqrt(2 / 3 * (d_p**2).sum())
        lode = 1 - (27 * np.linalg.det(s) / (2 * mises**3)) ** 2
        d = 0.5 * (velocity_gradient + velocity_gradient.T)
        pores = ((1 - phi) ** -m - (1 - phi)) * np.sinh(pull) * equivalent
        pores += p.pore_shear_sensitivity * lode * max((s * dev(d)).sum(), 0.0) / mises
        return np.concatenate(
            [
                (d_p @ y[:9].reshape(3, 3)).ravel(),
                (p.back_stress_modulus_pa * (stretch**2 + 1 / stretch) * d_p).ravel(),
                [
                    p.softening_rate * (1 - xi1 / xi_star) * gdot,
                    p.xi_star_rate * (1 - xi_star / p.xi_star_saturation) * gdot,
                    p.hardening_rate * (stretch - 1) * (1 - xi2 / p.xi2_saturation) * gdot,
                    equivalent,
                    pores,
                ],
            ]
        )

    def along(self, path: Callable[[float], np.ndarray], end: float, steps: int) -> np.ndarray:
        """Follow F(t) from 0 to `end`; return the Cauchy stress there."""
        h = end / steps

        def slope(t: float, y: np.ndarray) -> np.ndarray:
            e = 1e-4 * h
            return self.rate(y, path(t), (path(t + e) - path(t - e)) / (2 * e) @ np.linalg.inv(path(t)))

        for k in range(steps):
            t = k * h
            a = slope(t, self.y)
            b = slope(t + h / 2, self.y + h / 2 * a)
            c = slope(t + h / 2, self.y + h / 2 * b)
            d = slope(t + h, self.y + h * c)
            self.y = self.y + h / 6 * (a + 2 * b + 2 * c + d)
        return self.stresses(self.y, path(end))[2]


def random_path(rng: np.random.Generator, end: float, size: float = 0.35) -> Callable[[float], np.ndarray]:
    """Smooth multi-axial path: two generators that do not commute, one there and back, and a little volume."""
    first, second = (dev(rng.uniform(-1, 1, (3, 3))) for _ in range(2))
    first, second = (size * a / np.linalg.norm(a) for a in (first, second))
    swell = rng.uniform(-1, 1) * 2e-3

    def path(t: float) -> np.ndarray:
        x = t / end
        return (1 + swell * np.sin(2 * np.pi * x)) * expm(x * first) @ expm(np.sin(3 * x) * second)

    return path
