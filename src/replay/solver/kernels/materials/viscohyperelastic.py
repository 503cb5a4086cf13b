"""Soft, nearly incompressible tissue at large strain: neo-Hookean with a Prony series, in total form.

    J = V / V0,   C = F^T F,   Cbar = det(C)^(-1/3) C
    elastic:      S0 = mu0 det(C)^(-1/3) (I - tr(C)/3 C^-1)             (isochoric second Piola-Kirchhoff stress)
    viscous:      h_i' + h_i / tau_i = g_i S0'                          (Simo 1987)
    sigma = (1/J) F [(1 - g_1 - g_2) S0 + h_1 + h_2] F^T + K/2 (J - 1/J) I

F is the mean gradient of the element, J its volume ratio: the two differ in a distorted element, and
the forces are exact derivatives of V, so the pressure stores and returns energy exactly. Everything
lives in the reference frame and is objective by construction. The recursion over a step
(``h <- e^(-dt/tau) h + g e^(-dt/2tau) dS0``) is second-order and finite for any step.
"""

from __future__ import annotations

from dataclasses import dataclass

from replay.solver.kernels.device import device
from replay.solver.kernels.element import Moduli
from replay.solver.kernels.mathx import exp, log
from replay.solver.kernels.tensors import (
    add_scaled_sym,
    add_sym,
    add_trace,
    adjugate,
    congruence,
    right_cauchy_green,
    scale_sym,
    trace,
)

NAME = "viscohyperelastic"
_TENSORS = ("elastic", "viscous_1", "viscous_2")
STATE: tuple[str, ...] = tuple(f"{name}_{k}" for name in _TENSORS for k in ("xx", "yy", "zz", "xy", "yz", "zx"))
INITIAL_STRESS = False
TOTAL_FORM = True
N_CONSTANTS = 6
_TERMS = 2


@dataclass(frozen=True)
class Parameters:
    """Neo-Hookean isochoric response with up to two Prony terms.

    Parameters
    ----------
    bulk_modulus_pa
        K [Pa].
    shear_modulus_pa
        Instantaneous mu0; the long-term modulus is ``mu0 (1 - sum g)`` [Pa].
    prony_ratios
        Shares g of the instantaneous modulus that relax, at most two.
    prony_times_s
        Their relaxation times [s].
    """

    bulk_modulus_pa: float
    shear_modulus_pa: float
    prony_ratios: tuple[float, ...] = ()
    prony_times_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for name in ("prony_ratios", "prony_times_s"):
            if not isinstance(getattr(self, name), tuple):
                object.__setattr__(self, name, (getattr(self, name),))
        if not self.shear_modulus_pa > 0:
            message = f"shear_modulus_pa is {self.shear_modulus_pa!r}; it must be positive"
            raise ValueError(message)
        if not self.bulk_modulus_pa > self.shear_modulus_pa / 3:
            message = f"bulk_modulus_pa is {self.bulk_modulus_pa!r}; it must exceed a third of the shear modulus"
            raise ValueError(message)
        if len(self.prony_ratios) != len(self.prony_times_s) or len(self.prony_ratios) > _TERMS:
            message = (
                f"there are {len(self.prony_ratios)} prony_ratios and {len(self.prony_times_s)} prony_times_s; "
                f"there must be as many of the one as of the other, at most {_TERMS}"
            )
            raise ValueError(message)
        if any(g < 0 for g in self.prony_ratios) or sum(self.prony_ratios) >= 1:
            message = f"prony_ratios are {self.prony_ratios!r}; none may be negative and their sum must stay below 1"
            raise ValueError(message)
        if any(not t > 0 for t in self.prony_times_s):
            message = f"prony_times_s are {self.prony_times_s!r}; they must be positive"
            raise ValueError(message)

    def constants(self) -> tuple[float, ...]:
        """K, mu0 [Pa], g1, 1/tau1 [1/s], g2, 1/tau2."""
        missing = _TERMS - len(self.prony_ratios)
        ratios = (*self.prony_ratios, *(0.0,) * missing)
        rates = (*(1.0 / t for t in self.prony_times_s), *(0.0,) * missing)
        return self.bulk_modulus_pa, self.shear_modulus_pa, ratios[0], rates[0], ratios[1], rates[1]

    def elastic_moduli(self) -> tuple[float, float]:
        """Bulk and instantaneous shear modulus at small strain [Pa]."""
        return self.bulk_modulus_pa, self.shear_modulus_pa


@device
def _relax(old, change, share, rate, dt):
    """Overstress of one Prony term after the step."""
    half = exp(-0.5 * dt * rate)
    return add_scaled_sym(scale_sym(half * half, old), share * half, change)


@device
def update(motion, stress, state, dt, p):
    """Stress and overstresses after the step."""
    bulk, shear, share_1, rate_1, share_2, rate_2 = p
    before = (state[0], state[1], state[2], state[3], state[4], state[5])
    viscous_1 = (state[6], state[7], state[8], state[9], state[10], state[11])
    viscous_2 = (state[12], state[13], state[14], state[15], state[16], state[17])

    f = motion.deformation
    c = right_cauchy_green(f)
    a = adjugate(c)
    det = c[0] * a[0] + c[3] * a[3] + c[5] * a[5]
    factor = shear * exp(log(det) * (-1.0 / 3.0))
    # S0 = factor (I - tr(C)/3 C^-1)
    elastic = add_trace(scale_sym(-factor * trace(c) / (3.0 * det), a), factor)
    change = add_scaled_sym(elastic, -1.0, before)
    viscous_1 = _relax(viscous_1, change, share_1, rate_1, dt)
    viscous_2 = _relax(viscous_2, change, share_2, rate_2, dt)
    total = add_scaled_sym(add_sym(viscous_1, viscous_2), 1.0 - share_1 - share_2, elastic)

    ratio = motion.volume_ratio
    inverse = 1.0 / ratio
    new = add_trace(scale_sym(inverse, congruence(f, total)), 0.5 * bulk * (ratio - inverse))

    # bound of the isochoric tangent in space: mu0 times the mean squared isochoric stretch, never below mu0
    stiff = shear * max(1.0, factor / shear * trace(c) * (1.0 / 3.0)) * max(inverse, 1.0)
    tangent = 0.5 * bulk * (ratio + inverse)
    return new, (*elastic, *viscous_1, *viscous_2), Moduli(tangent - (2.0 / 3.0) * shear, stiff, shear)
