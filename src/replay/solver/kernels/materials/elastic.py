"""Linear isotropic elasticity in rate form: ``sigma <- R sigma R^T + lambda tr(D dt) I + 2 mu D dt``."""

from __future__ import annotations

from dataclasses import dataclass

from replay.solver.kernels.device import device
from replay.solver.kernels.element import Moduli
from replay.solver.kernels.tensors import add_scaled_sym, add_trace, congruence, trace

NAME = "elastic"
STATE: tuple[str, ...] = ()
INITIAL_STRESS = True
TOTAL_FORM = False
N_CONSTANTS = 2


@dataclass(frozen=True)
class Parameters:
    """Isotropic elasticity.

    Parameters
    ----------
    youngs_modulus_pa
        Young's modulus [Pa].
    poisson_ratio
        Between -1 and 0.5, both excluded.
    """

    youngs_modulus_pa: float
    poisson_ratio: float

    def __post_init__(self) -> None:
        if not self.youngs_modulus_pa > 0:
            message = f"youngs_modulus_pa is {self.youngs_modulus_pa!r}; it must be positive"
            raise ValueError(message)
        if not -1 < self.poisson_ratio < 0.5:
            message = f"poisson_ratio is {self.poisson_ratio!r}; it must lie between -1 and 0.5, both excluded"
            raise ValueError(message)

    def constants(self) -> tuple[float, ...]:
        """Lame's lambda and mu [Pa]."""
        e, nu = self.youngs_modulus_pa, self.poisson_ratio
        return e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))

    def elastic_moduli(self) -> tuple[float, float]:
        """Bulk and shear modulus at small strain [Pa]."""
        lame, shear = self.constants()
        return lame + 2 * shear / 3, shear


@device
def update(motion, stress, state, dt, p):
    """Stress after the step; the rotation is exact, the strain that of mid-step."""
    lame, shear = p
    turned = congruence(motion.rotation, stress)
    grown = add_scaled_sym(turned, 2.0 * shear, motion.strain)
    return add_trace(grown, lame * trace(motion.strain)), state, Moduli(lame, shear, shear)
