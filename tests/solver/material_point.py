"""A material point driven along any path, in exactly the steps that the element takes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from replay.solver import LAWS
from replay.solver.kernels.element import Motion

#: Of every law that deforms: what the tests of all laws use.
PARAMETERS: dict[str, dict[str, Any]] = {
    "elastic": {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3},
    "elastic_plastic": {
        "youngs_modulus_pa": 1e6, "poisson_ratio": 0.3, "yield_stress_pa": 2e4, "hardening_modulus_pa": 1e4,
    },
    "viscohyperelastic": {
        "bulk_modulus_pa": 2e6, "shear_modulus_pa": 6e3, "prony_ratios": (0.5, 0.3), "prony_times_s": (0.01, 0.1),
    },
    "brain_isv": {
        "shear_modulus_pa": 14.06e3, "bulk_modulus_pa": 2.19e9, "reference_rate_per_s": 100.0, "rate_exponent": 1.0,
        "yield_stress_pa": 6.53e3, "pressure_sensitivity": 0.0, "locking_stretch": 2.3, "network_modulus_pa": 471.0,
        "back_stress_modulus_pa": 45.0, "softening_rate": 14.3, "initial_xi1": 0.0, "initial_xi_star": 0.036,
        "xi_star_saturation": 0.0062, "xi_star_rate": 7.2, "softening_factor": 0.0185, "hardening_rate": 15.9,
        "initial_xi2": 0.0, "xi2_saturation": 1.99, "hardening_factor": 0.158, "pore_growth_exponent": 1.5,
        "pore_shear_sensitivity": 1e-6, "initial_porosity": 1e-6,
    },
    "fluid": {"bulk_modulus_pa": 2e6, "shear_modulus_pa": 1e3},
    "crushable_foam": {"youngs_modulus_pa": 1e6, "plateau_stress_pa": 1e5, "densification_strain": 0.6},
}  # fmt: skip


class Point:
    """A material point driven by deformation gradients, in exactly the steps of the element."""

    def __init__(self, law: str, **parameters: Any) -> None:
        self.module = LAWS[law]
        self.parameters = self.module.Parameters(**parameters)
        self.constants = tuple(float(c) for c in self.parameters.constants())
        self.stress = (0.0,) * 6
        rest = getattr(self.parameters, "initial_state", lambda: (0.0,) * max(len(self.module.STATE), 1))
        self.state = tuple(float(v) for v in rest())
        self.moduli = (0.0, 0.0, 0.0)
        self.f = np.eye(3)
        self.work = 0.0

    def to(self, f: Any, dt: float = 1e-4) -> np.ndarray:
        f = np.array(f, float)
        middle = 0.5 * (f + self.f)
        gradient = (f - self.f) @ np.linalg.inv(middle)
        rate, spin = 0.5 * (gradient + gradient.T), 0.5 * (gradient - gradient.T)
        turn = np.linalg.solve(np.eye(3) - 0.5 * spin, np.eye(3) + 0.5 * spin)
        strain = (rate[0, 0], rate[1, 1], rate[2, 2], rate[0, 1], rate[1, 2], rate[2, 0])
        motion = Motion(strain, tuple(map(tuple, turn)), tuple(map(tuple, f)), float(np.linalg.det(f)))
        before = self.matrix()
        self.stress, self.state, self.moduli = self.module.update(motion, self.stress, self.state, dt, self.constants)
        self.work += 0.5 * float(((before + self.matrix()) * rate).sum()) * np.linalg.det(middle)
        self.f = f
        return self.matrix()

    def matrix(self) -> np.ndarray:
        xx, yy, zz, xy, yz, zx = self.stress
        return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def turned(angle: float, axis: Any = (1.0, 2.0, -1.0)) -> np.ndarray:
    a = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
