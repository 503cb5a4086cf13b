"""Metals and stiff plastics: J2 plasticity with isotropic hardening along a measured curve, in rate form.

    trial:   sigma* as in `elastic`, deviator s*,    q* = sqrt(3/2 s*:s*)
    yield:   q <= sigma_y(e),                  e = equivalent plastic strain
    return:  q* - 3 mu (e - e_old) = sigma_y(e),    s = (q / q*) s*                 (Wilkins 1964; Simo and Taylor 1985)
    mean stress: that of the trial

sigma_y is the true stress over the logarithmic plastic strain, linear between its points. Then
``g(e) = sigma_y(e) + 3 mu e`` is linear between them too and always rises, so that its inverse is a sum of ramps
with the knots ``g(e_k)``, and the return is that sum at ``q* + 3 mu e_old``: no iteration, no branch, exact on every
curve. Below yield the sum stays under e_old, and the larger of the two is taken.

The dissipation of a step, ``sigma_y (e - e_old)``, cannot be negative; it is kept as a state. Hourglass forces yield
too: a wall one element thick bends by them alone, and elastic ones hold together a bar that its stress lets flow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from replay.solver.kernels.device import device
from replay.solver.kernels.element import YieldingModuli
from replay.solver.kernels.materials import elastic
from replay.solver.kernels.materials.elastic import elastic_step
from replay.solver.kernels.tensors import add_scaled_sym, contract, deviator

NAME = "elastic_plastic"
STATE: tuple[str, ...] = ("equivalent_plastic_strain", "plastic_work_j_per_m3")
FIELDS = {"equivalent_plastic_strain": "equivalent_plastic_strain"}
INITIAL_STRESS = True
TOTAL_FORM = False
HOURGLASS_YIELDS = True
#: Points of the hardening curve, the yield stress among them.
KNOTS = 8
N_CONSTANTS = 2 + 2 * KNOTS


@dataclass(frozen=True)
class Parameters:
    """Isotropic elasticity with a yield stress that grows with plastic strain.

    Parameters
    ----------
    youngs_modulus_pa
        Young's modulus [Pa].
    poisson_ratio
        Between -1 and 0.5, both excluded.
    yield_stress_pa
        True stress at first yield [Pa].
    hardening_modulus_pa
        Slope of true stress over plastic strain from the last point of the curve on; from first yield on where there is
        no curve [Pa].
    curve_strains, curve_stresses_pa
        Logarithmic plastic strain and true stress [Pa] at up to 7 further points of a measured curve, which begins at
        strain 0 with the yield stress. Stresses may not fall: softening would depend on the mesh.
    """

    youngs_modulus_pa: float
    poisson_ratio: float
    yield_stress_pa: float
    hardening_modulus_pa: float = 0.0
    curve_strains: tuple[float, ...] = ()
    curve_stresses_pa: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        elastic.Parameters(self.youngs_modulus_pa, self.poisson_ratio)
        if not self.yield_stress_pa > 0:
            message = f"yield_stress_pa is {self.yield_stress_pa!r}; it must be positive"
            raise ValueError(message)
        if not self.hardening_modulus_pa >= 0:
            message = f"hardening_modulus_pa is {self.hardening_modulus_pa!r}; it must not be negative"
            raise ValueError(message)
        if len(self.curve_strains) != len(self.curve_stresses_pa) or len(self.curve_strains) > KNOTS - 1:
            message = (
                f"the curve has {len(self.curve_strains)} strains and {len(self.curve_stresses_pa)} stresses; "
                f"there must be as many of the one as of the other, at most {KNOTS - 1}"
            )
            raise ValueError(message)
        strains, stresses = self.flow_curve()
        if any(b <= a for a, b in pairwise(strains)):
            message = "curve_strains must increase from above 0: the point at 0 is yield_stress_pa"
            raise ValueError(message)
        if any(b < a for a, b in pairwise(stresses)):
            message = "curve_stresses_pa must not fall, nor lie below yield_stress_pa"
            raise ValueError(message)

    def flow_curve(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Plastic strains and yield stresses [Pa] at the points of the curve."""
        return (0.0, *self.curve_strains), (self.yield_stress_pa, *self.curve_stresses_pa)

    def constants(self) -> tuple[float, ...]:
        """Lame's lambda and mu [Pa]; places [Pa] and slope changes [1/Pa] of the ramps that make the inverse of g."""
        lame, shear = elastic.Parameters(self.youngs_modulus_pa, self.poisson_ratio).constants()
        strains, stresses = self.flow_curve()
        slopes = [(b - a) / (t - s) for a, b, s, t in zip(stresses, stresses[1:], strains, strains[1:])]
        inverse = [0.0, *(1.0 / (3.0 * shear + h) for h in (*slopes, self.hardening_modulus_pa))]
        unused = [0.0] * (KNOTS - len(strains))
        places = [y + 3.0 * shear * e for e, y in zip(strains, stresses)]
        changes = [b - a for a, b in pairwise(inverse)]
        return (lame, shear, *places, *unused, *changes, *unused)

    def elastic_moduli(self) -> tuple[float, float]:
        """Bulk and shear modulus below yield [Pa]."""
        return elastic.Parameters(self.youngs_modulus_pa, self.poisson_ratio).elastic_moduli()


@device
def _returned_strain(reach, p):
    """Plastic strain e at which ``sigma_y(e) + 3 mu e`` is `reach`: a sum of eight ramps, in their order."""
    return (
        p[10] * max(reach - p[2], 0.0)
        + p[11] * max(reach - p[3], 0.0)
        + p[12] * max(reach - p[4], 0.0)
        + p[13] * max(reach - p[5], 0.0)
        + p[14] * max(reach - p[6], 0.0)
        + p[15] * max(reach - p[7], 0.0)
        + p[16] * max(reach - p[8], 0.0)
        + p[17] * max(reach - p[9], 0.0)
    )


@device
def update(motion, stress, state, dt, p):
    """Stress, equivalent plastic strain and plastic work per reference volume after the step."""
    lame, shear = p[0], p[1]
    before, work = state[0], state[1]
    trial = elastic_step(motion, stress, lame, shear)
    shearing = deviator(trial)
    equivalent = math.sqrt(1.5 * contract(shearing, shearing))
    growth = max(_returned_strain(equivalent + 3.0 * shear * before, p) - before, 0.0)
    excess = 3.0 * shear * growth
    share = excess / max(equivalent, 1e-300)
    new = add_scaled_sym(trial, -share, shearing)
    work = work + (equivalent - excess) * growth * motion.volume_ratio
    flow = max(equivalent - excess, p[2])
    return new, (before + growth, work), YieldingModuli(lame, shear, shear, flow)
