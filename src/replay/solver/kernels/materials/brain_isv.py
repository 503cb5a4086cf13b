"""Brain: internal-state-variable viscoplasticity at large strain, with pore growth as a diagnostic.

The polymer model of Bouvard et al. (2010, 2013) and Francis et al. (2014), as it is used for brain, in Kirchhoff stress
and in the frame of the plastic deformation (``F = Fe Fp``, no plastic spin), where all tensors are symmetric and
have plain time derivatives:

    M = mu dev(Ce),  Ce = det(F)^(-2/3) Fe^T Fe,      sigma = (mu/J) dev(Fe Fe^T) + K/2 (J - 1/J) I
    alpha = mu_B dev(Bp) + beta,  Bp = Fp Fp^T,  lambda_p^2 = tr(Bp)/3,  y = lambda_p/lambda_L
    mu_B = (mu_R/3) (3 - y^2)/(1 - y^2)               (inverse Langevin function by Cohen 1991; y^2 <= 0.9)
    Dp = gdot N/sqrt2,  N = (M - dev alpha)/|..|,     gdot = gdot0 sinh(<tau - kappa1 - kappa2 - alpha_p <p>>/Y)^m
    tau = |M - dev alpha|/sqrt2,                      beta' = R_s1 (lambda_p^2 + 1/lambda_p) Dp
    xi1' = h0 (1 - xi1/xi*) gdot,  xi*' = g0 (1 - xi*/xi*_sat) gdot,  kappa1 = C_kappa1 mu xi1
    xi2' = h1 (lambda_p - 1)(1 - xi2/xi2_sat) gdot,   kappa2 = C_kappa2 mu xi2

p is the pressure, compression positive; tension does not help flow, which would let it begin without stress. Pores
grow without weakening the stress (`pore_growth`).

A step keeps the direction N of the elastic trial, so ``Fp <- exp(b N) Fp`` with ``b = dgamma/sqrt2``, of determinant
one. The exponential is a quadratic polynomial in N by its characteristic equation, hence the stress along N at
the *end* of the step is a scalar function of b, and with the other variables by backward Euler one scalar equation
is left, whose unknown is ``u = ln(dgamma/(gdot0 dt))/m``:

    tau(dgamma) - kappa(dgamma) - alpha_p <p> = Y asinh(e^u)

(`plastic_flow`). Five Newton steps solve it for a step of any size, two for a small one (`small_step`). What they can
have left, over the larger of Y and the trial stress, is kept at its greatest and shown as ``flow_residual``.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import NamedTuple

from replay.solver.kernels.device import device
from replay.solver.kernels.element import Moduli
from replay.solver.kernels.lanes import specialise
from replay.solver.kernels.mathx import inverse_cube_root, select
from replay.solver.kernels.plastic_flow import (
    Flow,
    exponentials,
    internal_strains,
    moments,
    network_modulus,
    product,
    solve_flow,
    squared,
)
from replay.solver.kernels.pore_growth import grow_pores
from replay.solver.kernels.small_step import grow_few_pores, short_exponentials, small_flow
from replay.solver.kernels.tensors import (
    add_scaled_sym,
    add_trace,
    commuting_product,
    contract,
    cross,
    deviator,
    dot,
    left_cauchy_green,
    right_cauchy_green,
    scale,
    scale_sym,
    trace,
)

NAME = "brain_isv"
_MATRIX = tuple(a + b for a in "xyz" for b in "xyz")
_SYMMETRIC = ("xx", "yy", "zz", "xy", "yz", "zx")
STATE: tuple[str, ...] = (
    *(f"plastic_inverse_{k}" for k in _MATRIX),
    *(f"back_{k}" for k in _SYMMETRIC),
    "xi1",
    "xi_star",
    "xi2",
    "equivalent_plastic_strain",
    "phi",
    "w",
    "flow_residual",
)
FIELDS = {
    "HV57": "phi",
    "equivalent_plastic_strain": "equivalent_plastic_strain",
    "xi1": "xi1",
    "xi_star": "xi_star",
    "xi2": "xi2",
    "flow_residual": "flow_residual",
}
INITIAL_STRESS = False
TOTAL_FORM = True


class Constants(NamedTuple):
    """The numbers that the kernel takes, divisions done."""

    shear: float
    bulk: float
    reference_rate: float
    exponent: float
    per_exponent: float
    yield_: float
    pressure_sensitivity: float
    per_locking_square: float
    network: float
    back_rate: float
    first_rate: float
    star_rate: float
    per_star_saturation: float
    first_stress: float
    second_rate: float
    per_second_saturation: float
    second_stress: float
    pore_exponent: float
    pore_shear: float
    pore_cap: float


N_CONSTANTS = len(Constants._fields)
_PER_ROOT_2 = 0.7071067811865476
_PER_ROOT_3 = 0.5773502691896258


@dataclass(frozen=True)
class Parameters:
    """The 22 parameters of the article's Table 2 in its own grouping, and the cap.

    Parameters
    ----------
    shear_modulus_pa, bulk_modulus_pa
        mu, K [Pa].
    reference_rate_per_s, rate_exponent, yield_stress_pa
        gdot0 [1/s], m, Y [Pa].
    pressure_sensitivity
        alpha_p: resistance to flow a pascal of pressure.
    locking_stretch, network_modulus_pa, back_stress_modulus_pa
        lambda_L of the chain network, mu_R and R_s1 [Pa].
    softening_rate, initial_xi1, initial_xi_star, xi_star_saturation, xi_star_rate, softening_factor
        h0, xi1 and xi* at the start, xi*_sat, g0, C_kappa1.
    hardening_rate, initial_xi2, xi2_saturation, hardening_factor
        h1, xi2 at the start, xi2_sat, C_kappa2.
    pore_growth_exponent, pore_shear_sensitivity, initial_porosity
        m_CA, K_pore, phi_0.
    triaxiality_cap
        Largest argument of the hyperbolic sine of Cocks and Ashby.
    """

    shear_modulus_pa: float
    bulk_modulus_pa: float
    reference_rate_per_s: float
    rate_exponent: float
    yield_stress_pa: float
    pressure_sensitivity: float
    locking_stretch: float
    network_modulus_pa: float
    back_stress_modulus_pa: float
    softening_rate: float
    initial_xi1: float
    initial_xi_star: float
    xi_star_saturation: float
    xi_star_rate: float
    softening_factor: float
    hardening_rate: float
    initial_xi2: float
    xi2_saturation: float
    hardening_factor: float
    pore_growth_exponent: float
    pore_shear_sensitivity: float
    initial_porosity: float
    triaxiality_cap: float = 3.0

    def __post_init__(self) -> None:
        for f in dataclasses.fields(self):
            value = getattr(self, f.name)
            if not value >= 0:
                message = f"{f.name} is {value!r}; it must not be negative"
                raise ValueError(message)
        for name in (
            "shear_modulus_pa", "reference_rate_per_s", "rate_exponent", "yield_stress_pa", "initial_xi_star",
            "xi_star_saturation", "xi2_saturation", "pore_growth_exponent",
        ):  # fmt: skip
            if not getattr(self, name) > 0:
                message = f"{name} is {getattr(self, name)!r}; it must be positive"
                raise ValueError(message)
        if not self.bulk_modulus_pa > self.shear_modulus_pa / 3:
            message = f"bulk_modulus_pa is {self.bulk_modulus_pa!r}; it must exceed a third of the shear modulus"
            raise ValueError(message)
        if not self.locking_stretch > 1:
            message = f"locking_stretch is {self.locking_stretch!r}; it must exceed 1"
            raise ValueError(message)
        if not self.pore_growth_exponent >= 0.5:
            message = f"pore_growth_exponent is {self.pore_growth_exponent!r}; below 0.5 pores would close in tension"
            raise ValueError(message)
        if not self.initial_porosity < 1:
            message = f"initial_porosity is {self.initial_porosity!r}; it must lie between 0 and 1"
            raise ValueError(message)
        if not self.triaxiality_cap <= 20:
            message = f"triaxiality_cap is {self.triaxiality_cap!r}; it must lie between 0 and 20"
            raise ValueError(message)

    def constants(self) -> Constants:
        """Numbers of the kernel, by name."""
        mu = self.shear_modulus_pa
        return Constants(
            shear=mu,
            bulk=self.bulk_modulus_pa,
            reference_rate=self.reference_rate_per_s,
            exponent=self.rate_exponent,
            per_exponent=1.0 / self.rate_exponent,
            yield_=self.yield_stress_pa,
            pressure_sensitivity=self.pressure_sensitivity,
            per_locking_square=self.locking_stretch**-2,
            network=self.network_modulus_pa,
            back_rate=self.back_stress_modulus_pa,
            first_rate=self.softening_rate,
            star_rate=self.xi_star_rate,
            per_star_saturation=1.0 / self.xi_star_saturation,
            first_stress=self.softening_factor * mu,
            second_rate=self.hardening_rate,
            per_second_saturation=1.0 / self.xi2_saturation,
            second_stress=self.hardening_factor * mu,
            pore_exponent=self.pore_growth_exponent,
            pore_shear=self.pore_shear_sensitivity,
            pore_cap=self.triaxiality_cap,
        )

    def initial_state(self) -> tuple[float, ...]:
        """State at rest: Fp the identity, internal variables at their initial values."""
        identity = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        strains = (self.initial_xi1, self.initial_xi_star, self.initial_xi2)
        w = -math.expm1((self.pore_growth_exponent + 1.0) * math.log1p(-self.initial_porosity))
        return (*identity, *(0.0,) * 6, *strains, 0.0, self.initial_porosity, w, 0.0)

    def elastic_moduli(self) -> tuple[float, float]:
        """Bulk and shear modulus at small strain [Pa]."""
        return self.bulk_modulus_pa, self.shear_modulus_pa


@device
def _times(m, s):
    """Matrix (three rows) times symmetric tensor."""
    x, y, z = (s[0], s[3], s[5]), (s[3], s[1], s[4]), (s[5], s[4], s[2])
    return (
        (dot(m[0], x), dot(m[0], y), dot(m[0], z)),
        (dot(m[1], x), dot(m[1], y), dot(m[1], z)),
        (dot(m[2], x), dot(m[2], y), dot(m[2], z)),
    )


@device
def _matrix_product(a, b):
    x, y, z = (b[0][0], b[1][0], b[2][0]), (b[0][1], b[1][1], b[2][1]), (b[0][2], b[1][2], b[2][2])
    return (
        (dot(a[0], x), dot(a[0], y), dot(a[0], z)),
        (dot(a[1], x), dot(a[1], y), dot(a[1], z)),
        (dot(a[2], x), dot(a[2], y), dot(a[2], z)),
    )


@device
def _cofactors(m):
    """Rows of the cofactor matrix; for a matrix of determinant one its inverse transposed."""
    return cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])


def _step(motion, stress, state, dt, p):
    """Stress and state after the step; a negative ``flow_residual`` says that the step was not small enough."""
    p = Constants(*p)
    inverse = ((state[0], state[1], state[2]), (state[3], state[4], state[5]), (state[6], state[7], state[8]))
    beta = (state[9], state[10], state[11], state[12], state[13], state[14])

    # elastic trial: the step deforms, nothing flows
    f = motion.deformation
    shrink = inverse_cube_root(dot(f[0], cross(f[1], f[2])))
    trial = _matrix_product((scale(shrink, f[0]), scale(shrink, f[1]), scale(shrink, f[2])), inverse)
    elastic = right_cauchy_green(trial)
    # Bp = Fp Fp^T with Fp the cofactors transposed
    plastic = right_cauchy_green(_cofactors(inverse))
    network = network_modulus(trace(plastic) * (1.0 / 3.0), p)
    driving = add_scaled_sym(scale_sym(p.shear, deviator(elastic)), -network, deviator(plastic))
    driving = add_scaled_sym(driving, -1.0, beta)
    size = math.sqrt(contract(driving, driving))
    n = scale_sym(1.0 / max(size, 1e-300), driving)
    n2 = commuting_product(n, n)
    ratio = motion.volume_ratio
    per_ratio = 1.0 / ratio
    mean = 0.5 * p.bulk * (ratio - per_ratio)

    det = contract(n, n2) * (1.0 / 3.0)
    flow = Flow(
        det, moments(n, n2, elastic), moments(n, n2, plastic), contract(n, beta), state[15], state[16], state[17],
        p.pressure_sensitivity * max(-mean, 0.0), p.reference_rate * dt,
    )  # fmt: skip
    dgamma, residual, flow_holds = solve_flow(flow, p, size)

    # Fp <- exp(b N) Fp; what rounding did to its determinant is taken out
    b = dgamma * _PER_ROOT_2
    c, grown = exponentials(b, det)
    flown = add_trace(add_scaled_sym(scale_sym(c[1], n), c[2], n2), c[0])
    inverse = _times(inverse, flown)
    keep = 1.0 - (dot(inverse[0], cross(inverse[1], inverse[2])) - 1.0) * (1.0 / 3.0)
    x, y, z = scale(keep, inverse[0]), scale(keep, inverse[1]), scale(keep, inverse[2])
    stretched = left_cauchy_green(_times(trial, flown))
    new = add_trace(scale_sym(p.shear * per_ratio, deviator(stretched)), mean)

    square = product(squared(grown, det), flow.plastic) * (1.0 / 3.0)
    stretch = math.sqrt(square)
    beta = add_scaled_sym(beta, p.back_rate * (square + 1.0 / stretch) * b, n)
    xi1, xi_star, xi2 = internal_strains(flow, p, dgamma, max(stretch - 1.0, 0.0))
    plastic_strain = dgamma * _PER_ROOT_3
    w, phi, growth_holds = grow_pores(
        state[20], state[19], new, motion.strain, plastic_strain, p.pore_exponent, p.pore_shear, p.pore_cap
    )

    # bound of the isochoric tangent in space, as of a neo-Hookean solid; flow only softens it
    stiff = p.shear * max(1.0, trace(stretched) * (1.0 / 3.0)) * max(per_ratio, 1.0)
    tangent = 0.5 * p.bulk * (ratio + per_ratio)
    residual = select(flow_holds & growth_holds, max(state[21], residual), -1.0)
    return (
        new,
        (*x, *y, *z, *beta, xi1, xi_star, xi2, state[18] + plastic_strain, phi, w, residual),
        Moduli(tangent - (2.0 / 3.0) * p.shear, stiff, p.shear),
    )


#: For steps of any size.
update = device(_step)
#: For those of a run.
small_update = device(
    specialise(_step, "small_update", solve_flow=small_flow, exponentials=short_exponentials, grow_pores=grow_few_pores)
)
