"""A nearly inviscid liquid: pressure from the volume, and a small shear stiffness that keeps the mesh in shape.

    sigma = dev(s) + K/2 (J - 1/J) I,     s in rate form with the shear modulus,     J = V / V0

The pressure is a function of the volume alone, so it cannot drift, and it grows without bound as J -> 0.
"""

from __future__ import annotations

from dataclasses import dataclass

from replay.solver.kernels.device import device
from replay.solver.kernels.element import Moduli
from replay.solver.kernels.materials.elastic import elastic_step
from replay.solver.kernels.tensors import add_trace, deviator

NAME = "fluid"
STATE: tuple[str, ...] = ()
INITIAL_STRESS = False
TOTAL_FORM = False
N_CONSTANTS = 2


@dataclass(frozen=True)
class Parameters:
    """A liquid such as cerebrospinal fluid or water.

    Parameters
    ----------
    bulk_modulus_pa
        K [Pa].
    shear_modulus_pa
        Small; also scales the hourglass stiffness. At 0 nothing resists hourglass modes [Pa].
    """

    bulk_modulus_pa: float
    shear_modulus_pa: float

    def __post_init__(self) -> None:
        if not self.bulk_modulus_pa > 0:
            message = f"bulk_modulus_pa is {self.bulk_modulus_pa!r}; it must be positive"
            raise ValueError(message)
        if not 0 <= self.shear_modulus_pa <= self.bulk_modulus_pa:
            message = f"shear_modulus_pa is {self.shear_modulus_pa!r}; it must lie between 0 and the bulk modulus"
            raise ValueError(message)

    def constants(self) -> tuple[float, ...]:
        """K and mu [Pa]."""
        return self.bulk_modulus_pa, self.shear_modulus_pa

    def elastic_moduli(self) -> tuple[float, float]:
        """Bulk and shear modulus at small strain [Pa]."""
        return self.bulk_modulus_pa, self.shear_modulus_pa


@device
def update(motion, stress, state, dt, p):
    """Stress after the step."""
    bulk, shear = p
    ratio = motion.volume_ratio
    inverse = 1.0 / ratio
    shearing = deviator(elastic_step(motion, stress, 0.0, shear))
    # d(mean stress)/d(ln J)
    tangent = 0.5 * bulk * (ratio + inverse)
    return (
        add_trace(shearing, 0.5 * bulk * (ratio - inverse)),
        state,
        Moduli(tangent - (2.0 / 3.0) * shear, shear, shear),
    )
