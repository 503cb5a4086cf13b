"""Crushable foam: a measured compression curve, no lateral strain, hysteresis, tension cut-off, rate.

Total form in the Biot strain ``B = U - I`` of the polar decomposition ``F = R U``, whose lateral
components vanish in uniaxial compression: Poisson's ratio is zero at any compression. With the measure
``s = |B|``, which in uniaxial compression is the nominal strain itself,

    W(s) = integral of phi ds,      T = eta r phi(s) B / s,      sigma = (1/J) R T U R^T

and phi is the measured nominal stress over nominal strain, linear between its points and beyond the last one.
Past the end of the curve, at the volume ratio J_b, the foam is solid: a pressure ``B (J_b / J - 1)``
with twice the last stress for B keeps elements from being crushed flat.

- Hysteresis: on unloading and reloading below the largest energy so far, ``eta = u + (1 - u) W / W_max``
  (pseudo-elastic, as in low-density foam laws); a closed cycle never returns more than it took.
- Tension: with x = tr B / s between 0 (shear) and 1 (uniaxial extension), the energy goes from W to W_c, whose slope
  is limited to the cut-off: ``W + w(x) (W_c - W)``, w = x^2 (3 - 2 x). T is its derivative in B, the turn of the
  direction included, so that no closed path gives energy.
- Rate: ``r = 1 + c ln(1 + x / x_0)`` with the closing rate x = max(-tr D, 0) averaged over a time, so that the noise
  of a single step is not amplified; unloading is not stiffened.

The hourglass stiffness takes half of the curve's secant at 10 % strain, or of the initial slope where that is less: a
constant, so that hourglass forces store and return energy whatever the foam does.

The foam recovers its shape. Permanent set is not modelled: over an impact of some 30 ms, hysteresis is
what decides the rebound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from replay.solver.kernels.device import device
from replay.solver.kernels.element import Moduli
from replay.solver.kernels.mathx import exp, log, select
from replay.solver.kernels.tensors import (
    add_trace,
    commuting_product,
    congruence,
    contract,
    largest_eigenvalue_bound,
    left_cauchy_green,
    polar_rotation,
    scale_sym,
    trace,
    transposed_product,
)

NAME = "crushable_foam"
STATE: tuple[str, ...] = ("largest_energy", "closing_rate")
INITIAL_STRESS = False
TOTAL_FORM = True
#: Ramps that make up the curve.
KNOTS = 12
_SETTINGS = 11
N_CONSTANTS = _SETTINGS + 2 * KNOTS
_YIELD_KNOTS = (0.4, 1.0, 2.5)
_CRUSH_KNOTS = (0.2, 0.35, 0.5, 0.6, 0.7, 0.8, 0.87, 0.93)
_SOLID = 2.0
_HOURGLASS_STRAIN = 0.1


@dataclass(frozen=True)
class Parameters:
    """Foam of pads.

    Parameters
    ----------
    youngs_modulus_pa
        Initial slope [Pa].
    plateau_stress_pa
        Nominal stress of the plateau [Pa].
    densification_strain
        Nominal compressive strain at which the stress has doubled over the plateau.
    curve_strains, curve_stresses_pa
        Nominal compressive strain and stress [Pa] of a measured curve from (0, 0), at most 12 points, which then
        takes the place of the formula; neither may fall.
    tension_cutoff_pa
        Largest nominal tension [Pa]; as strong as the plateau by default.
    unloading_factor
        u: share of the loading stress that is left at the start of reloading from zero, 0 to 1; 1 is
        elastic.
    rate_coefficient
        c; 0 turns the rate off.
    rate_reference_per_s
        x_0 [1/s].
    rate_average_s
        Averaging time of the rate [s].
    """

    youngs_modulus_pa: float
    plateau_stress_pa: float
    densification_strain: float
    curve_strains: tuple[float, ...] = ()
    curve_stresses_pa: tuple[float, ...] = ()
    tension_cutoff_pa: float | None = None
    unloading_factor: float = 0.2
    rate_coefficient: float = 0.0
    rate_reference_per_s: float = 10.0
    rate_average_s: float = 1e-3

    def __post_init__(self) -> None:
        def refuse(message: str) -> None:
            raise ValueError(message)

        for name in ("youngs_modulus_pa", "plateau_stress_pa", "rate_reference_per_s", "rate_average_s"):
            if not getattr(self, name) > 0:
                refuse(f"{name} is {getattr(self, name)!r}; it must be positive")
        if not 0.05 < self.densification_strain < 0.95:
            refuse(f"densification_strain is {self.densification_strain!r}; it must lie between 0.05 and 0.95")
        if not 0 <= self.unloading_factor <= 1:
            refuse(f"unloading_factor is {self.unloading_factor!r}; it must lie between 0 and 1")
        if not self.rate_coefficient >= 0:
            refuse(f"rate_coefficient is {self.rate_coefficient!r}; it must not be negative")
        if self.tension_cutoff_pa is not None and not self.tension_cutoff_pa >= 0:
            refuse(f"tension_cutoff_pa is {self.tension_cutoff_pa!r}; it must not be negative")
        strains, stresses = self.curve_strains, self.curve_stresses_pa
        if len(strains) != len(stresses):
            refuse(f"the curve has {len(strains)} strains and {len(stresses)} stresses")
        if strains:
            if not 2 <= len(strains) <= KNOTS:
                refuse(f"the curve has {len(strains)} points; 2 to {KNOTS} can be used")
            if strains[0] != 0 or stresses[0] != 0:
                refuse(f"the curve starts at ({strains[0]!r}, {stresses[0]!r}); it must start at (0, 0)")
            if any(b <= a for a, b in pairwise(strains)) or not strains[-1] < 1:
                refuse("curve_strains must increase and stay below 1")
            if any(b < a for a, b in pairwise(stresses)) or not stresses[1] > 0:
                refuse("curve_stresses_pa must not fall, and must rise from the start")

    def loading_curve(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Nominal compressive strains and stresses [Pa] at the knots."""
        if self.curve_strains:
            return self.curve_strains, self.curve_stresses_pa
        first = self.plateau_stress_pa / self.youngs_modulus_pa
        begin = [k * first for k in _YIELD_KNOTS if k * first < _CRUSH_KNOTS[0]]
        strains = (0.0, *begin, *(e for e in _CRUSH_KNOTS if not begin or e > 1.2 * begin[-1]))
        return strains, tuple(self._stress(e) for e in strains)

    def _nominal(self, e: float) -> float:
        """Nominal stress [Pa] at a strain, linear between the points of the curve."""
        strains, stresses = self.loading_curve()
        for (a, f), (b, g) in pairwise(zip(strains, stresses)):
            if e <= b:
                return f + (g - f) * (e - a) / (b - a)
        return stresses[-1]

    def _stress(self, e: float) -> float:
        """Plateau that begins with Young's modulus, plus densification that doubles it at the strain asked for."""
        elastic = self.youngs_modulus_pa * e
        plateau = elastic / math.sqrt(1.0 + (elastic / self.plateau_stress_pa) ** 2)
        e_d = self.densification_strain
        dense = self.plateau_stress_pa * (e / e_d) ** 6 * (1.0 - e_d) / (1.0 - e)
        return plateau + dense

    def constants(self) -> tuple[float, ...]:
        """Settings of the kernel, then the places and the slope changes of the ramps that make phi [Pa]."""
        strains, stresses = self.loading_curve()
        slopes = [(b - a) / (t - s) for a, b, s, t in zip(stresses, stresses[1:], strains, strains[1:])]
        changes = [slopes[0], *(b - a for a, b in pairwise(slopes))]
        places = list(strains[:-1])
        places += [0.0] * (KNOTS - len(places))
        changes += [0.0] * (KNOTS - len(changes))
        cutoff = self.plateau_stress_pa if self.tension_cutoff_pa is None else self.tension_cutoff_pa
        settings = (
            self.unloading_factor,
            cutoff,
            self.rate_coefficient,
            1.0 / self.rate_reference_per_s,
            1.0 / self.rate_average_s,
            slopes[0],
            1.0 - strains[-1],
            _SOLID * stresses[-1],
            *self._limit_of_tension(slopes, cutoff),
            0.5 * min(slopes[0], self._nominal(_HOURGLASS_STRAIN) / _HOURGLASS_STRAIN),
        )
        return (*settings, *places, *changes)

    def _limit_of_tension(self, slopes: list[float], cutoff: float) -> tuple[float, float]:
        """Strain at which the curve exceeds the cut-off, and its energy there [J/m^3]."""
        below = [point for point in zip(*self.loading_curve()) if point[1] <= cutoff]
        strain, stress = below[-1]
        slope = slopes[min(len(below), len(slopes)) - 1]
        end = strain + (cutoff - stress) / slope if slope > 0 else strain
        path = [*below, (end, cutoff)]
        return end, sum(0.5 * (f + g) * (b - a) for (a, f), (b, g) in pairwise(path))

    def elastic_moduli(self) -> tuple[float, float]:
        """Bulk and shear modulus at small strain, nu = 0 [Pa]."""
        strains, stresses = self.loading_curve()
        e = stresses[1] / strains[1]
        return e / 3, e / 2


@device
def _ramp(s, place, change):
    """Value, slope and integral of one ramp ``change max(s - place, 0)``."""
    over = max(s - place, 0.0)
    return change * over, select(over > 0.0, change, 0.0), 0.5 * change * over * over


@device
def _phi(s, p):
    """The curve at `s`: value, slope, integral; a sum of twelve ramps, in their order."""
    v0, d0, w0 = _ramp(s, p[11], p[23])
    v1, d1, w1 = _ramp(s, p[12], p[24])
    v2, d2, w2 = _ramp(s, p[13], p[25])
    v3, d3, w3 = _ramp(s, p[14], p[26])
    v4, d4, w4 = _ramp(s, p[15], p[27])
    v5, d5, w5 = _ramp(s, p[16], p[28])
    v6, d6, w6 = _ramp(s, p[17], p[29])
    v7, d7, w7 = _ramp(s, p[18], p[30])
    v8, d8, w8 = _ramp(s, p[19], p[31])
    v9, d9, w9 = _ramp(s, p[20], p[32])
    va, da, wa = _ramp(s, p[21], p[33])
    vb, db, wb = _ramp(s, p[22], p[34])
    return (
        v0 + v1 + v2 + v3 + v4 + v5 + v6 + v7 + v8 + v9 + va + vb,
        d0 + d1 + d2 + d3 + d4 + d5 + d6 + d7 + d8 + d9 + da + db,
        w0 + w1 + w2 + w3 + w4 + w5 + w6 + w7 + w8 + w9 + wa + wb,
    )


@device
def update(motion, stress, state, dt, p):
    """Stress, largest energy and mean closing rate after the step."""
    unloading, cutoff, rate_coefficient, per_reference, per_average, initial = p[0], p[1], p[2], p[3], p[4], p[5]
    solid_ratio, solid, cut_strain, cut_energy, keeping = p[6], p[7], p[8], p[9], p[10]
    largest, rate = state[0], state[1]

    f = motion.deformation
    turned = polar_rotation(f)
    stretch = transposed_product(turned, f)
    biot = add_trace(stretch, -1.0)
    s = math.sqrt(contract(biot, biot))
    phi, slope, energy = _phi(s, p)

    # extension: x is 0 in shear and compression, 1 from uniaxial extension on
    per_strain = 1.0 / max(s, 1e-9)
    x = min(max(trace(biot) * per_strain, 0.0), 1.0)
    weight = x * x * (3.0 - 2.0 * x)
    excess = max(phi - cutoff, 0.0)
    gap = select(excess > 0.0, cut_energy + cutoff * (s - cut_strain) - energy, 0.0)
    turning = 6.0 * x * (1.0 - x) * gap * per_strain
    phi = phi - weight * excess
    energy = energy + weight * gap

    # hysteresis
    largest = max(largest, energy)
    eta = unloading + (1.0 - unloading) * energy / max(largest, 1e-30)

    # rate, averaged
    keep = exp(-dt * per_average)
    closing = max(-trace(motion.strain), 0.0)
    gain = select(dt > 0.0, closing / max(dt, 1e-30), 0.0)
    rate = rate * keep + (1.0 - keep) * gain
    stiffening = 1.0 + rate_coefficient * log(1.0 + rate * per_reference)

    # phi/s -> initial slope as s -> 0
    secant = select(s > 1e-9, phi / max(s, 1e-9), initial)
    inverse = 1.0 / motion.volume_ratio
    # T = phi B/s + w' (W_c - W) (I - x B/s)/s
    share = eta * stiffening * inverse
    nominal = add_trace(scale_sym(share * (secant - turning * x * per_strain), biot), share * turning)
    crushed = congruence(turned, commuting_product(nominal, stretch))
    squeezed = solid_ratio * inverse
    new = add_trace(crushed, -solid * max(squeezed - 1.0, 0.0))

    # bound of the tangent in space: reference moduli carried by two stretches; the averaged rate is a spring too
    longest = largest_eigenvalue_bound(left_cauchy_green(f))
    hurried = rate_coefficient * phi * per_reference * per_average / (1.0 + rate * per_reference)
    # while the direction turns towards extension, w and its derivatives add to it
    bent = select((x > 0.0) & (x < 1.0), (6.0 * excess - 18.0 * gap * per_strain) * per_strain, 0.0)
    modulus = ((max(slope, secant) + bent) * stiffening + 2.0 * hurried) * longest * max(inverse, 1.0)
    return new, (largest, rate), Moduli(select(squeezed > 1.0, solid * squeezed, 0.0), 0.5 * modulus, keeping)
