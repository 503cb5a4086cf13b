"""A small step of the brain's law: series in place of functions, one look at the scalar equation in place of five.

In a run gamma grows by 1e-3 a step or less, and the driving stress that a step takes away is a small share of itself.
Then nearly all that `plastic_flow` and `pore_growth` do for steps of any size is spent on nothing:

- the exponentials of N are short series, and exp(bN), exp(-bN) share theirs;
- the unknown is the viscous stress Y (v + x), v known, with ``dgamma(x) = dgamma_0 (1 + rho(x))^m`` by the addition
  theorem of sinh: no function is evaluated beside those of the start v;
- the rest of the equation is evaluated once, where a tangent at the start of the step leads, with its slope there, and
  is straight over the little that is left: two Newton steps in x;
- pores grow by the series of the same formulas.

The step itself finds out whether it was small. What it leaves of the scalar equation is the curvature of the rest,
measured between the start and the evaluation, times half the square of the way from the evaluation to the end; the last
Newton step leaves its own square; the terms that the series drop are known. With all of them below 1e-10 of the larger
of Y and the trial stress the step holds; else it says so, and the lane loop takes the law's `update` for that element.
"""

from __future__ import annotations

import math

from replay.solver.kernels.device import device
from replay.solver.kernels.mathx import exp, log, select
from replay.solver.kernels.plastic_flow import flow_residual, network_modulus
from replay.solver.kernels.pore_growth import SOLID, lode_function
from replay.solver.kernels.tensors import add_trace, contract, trace

#: What a step may leave of its equations.
LEFT = 1e-10
#: Largest dgamma, and share of the solid that a step turns into pores, over which the series are right to 1e-12.
_SHORT = 0.02
#: Largest change of the viscous stress over Y that the addition theorem's series reach (1e-12).
_NEAR = 0.2
#: Largest viscous stress over Y.
_FAST = 20.0
_ROOT_2 = 1.4142135623730951
_PER_ROOT_2 = 0.7071067811865476


@device
def _power_less_one(x, a):
    """``(1 + x)^a - 1``, by six terms of the binomial series."""
    series = 1.0 + (a - 4.0) * (1.0 / 5.0) * x * (1.0 + (a - 5.0) * (1.0 / 6.0) * x)
    series = 1.0 + (a - 2.0) * (1.0 / 3.0) * x * (1.0 + (a - 3.0) * (1.0 / 4.0) * x * series)
    return a * x * (1.0 + (a - 1.0) * (1.0 / 2.0) * x * series)


@device
def short_exponentials(b, det):
    """Coefficients of ``exp(-b N)`` and ``exp(b N)``, to the sixth power of b."""
    b2 = b * b
    b3 = b * b2
    b4 = b2 * b2
    even0 = 1.0 + b3 * b3 * (det * det * (1.0 / 720.0))
    even1 = b4 * det * (1.0 / 24.0 + b2 * (1.0 / 720.0))
    even2 = b2 * (0.5 + b2 * (1.0 / 48.0) + b4 * (1.0 / 2880.0))
    odd0 = b3 * det * (1.0 / 6.0 + b2 * (1.0 / 240.0))
    odd1 = b + b3 * (1.0 / 12.0 + b2 * (1.0 / 480.0))
    odd2 = b4 * b * det * (1.0 / 120.0)
    return (even0 - odd0, even1 - odd1, even2 - odd2), (even0 + odd0, even1 + odd1, even2 + odd2)


@device
def _beside(v, x, exponent):
    """Find sinh, cosh, dgamma and rho at v + x; `v` holds sinh, cosh, coth and dgamma at v."""
    sine, cosine, cotangent, dgamma = v
    x2 = x * x
    even = x2 * (0.5 + x2 * (1.0 / 24.0 + x2 * (1.0 / 720.0 + x2 * (1.0 / 40320.0))))
    odd = x * (1.0 + x2 * (1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (1.0 / 5040.0))))
    rho = even + cotangent * odd
    return (
        sine + (sine * even + cosine * odd),
        cosine + (cosine * even + sine * odd),
        dgamma + dgamma * _power_less_one(rho, exponent),
        rho,
    )


@device
def small_flow(flow, p, trial):
    """Solve the scalar equation of a small step; arguments and returns as of `plastic_flow.solve_flow`."""
    drive = trial * _PER_ROOT_2 - p.first_stress * flow.xi1 - p.second_stress * flow.xi2 - flow.resistance
    flows = (drive > 0.0) & (flow.reach > 0.0)
    start = min(max(drive / p.yield_, 0.0), _FAST)
    # sinh, cosh and coth with one division; what sinh loses near zero is nothing beside Y
    e = exp(start)
    square = e * e - 1.0
    inverse = 1.0 / (e * max(square, 1e-14))
    sine = 0.5 * square * (square * inverse)
    cosine = sine + square * inverse
    cotangent = (e * e + 1.0) * e * inverse
    v = (sine, cosine, cotangent, flow.reach * exp(p.exponent * log(max(sine, 1e-15))))

    # slope at the start, all but a part of what the back stresses harden
    stretching = math.sqrt(flow.plastic[0] * (1.0 / 3.0)) - 1.0
    slope = -(
        p.shear * flow.elastic[2]
        + network_modulus(flow.plastic[0] * (1.0 / 3.0), p) * flow.plastic[2]
        + p.back_rate
        + p.first_stress * p.first_rate * (1.0 - flow.xi1 / flow.xi_star)
        + p.second_stress * p.second_rate * stretching * (1.0 - flow.xi2 * p.per_second_saturation)
    )
    fall = slope * v[3]
    x = fall * sine / (p.yield_ * sine - p.exponent * fall * cosine)
    s, c, guess, _ = _beside(v, x, p.exponent)
    shrunk, grown = short_exponentials(guess * _ROOT_2, flow.det)
    rest, new_slope = flow_residual(flow, p, guess, shrunk, grown)

    left = rest - p.yield_ * (start + x)
    x = x + left * s / (p.yield_ * s - p.exponent * guess * new_slope * c)
    s, c, dgamma, _ = _beside(v, x, p.exponent)
    left = rest + new_slope * (dgamma - guess) - p.yield_ * (start + x)
    change = left * s / (p.yield_ * s - p.exponent * dgamma * new_slope * c)
    x = x + change
    _, _, dgamma, rho = _beside(v, x, p.exponent)

    way = dgamma - guess
    curved = 0.5 * (new_slope - slope) * way * way / max(guess, 1e-300)
    residual = (abs(curved) + abs(left * change) * cotangent) / max(trial, p.yield_)
    dropped = (p.exponent - 1.0) * rho * rho
    small = (
        (residual <= LEFT)
        & (abs(dropped * dropped * dropped) <= LEFT)
        & (abs(x) <= _NEAR)
        & (dgamma > 0.0)
        & (max(guess, dgamma) <= _SHORT)
        & (start < _FAST)
    )
    return select(flows, dgamma, 0.0), select(flows, residual, 0.0), small | (not flows)


@device
def grow_few_pores(w, phi, stress, strain, plastic_strain, exponent, shear_sensitivity, cap):
    """Advance w and phi by a small step; arguments and returns as of `pore_growth.grow_pores`."""
    mean = trace(stress) * (1.0 / 3.0)
    deviator = add_trace(stress, -mean)
    per_mises = 1.0 / math.sqrt(1.5 * contract(deviator, deviator) + 1e-60)
    power = exponent + 1.0
    argument = 2.0 * (2.0 * exponent - 1.0) / (2.0 * exponent + 1.0) * max(mean, 0.0) * per_mises
    e = exp(min(argument, cap))
    pulled = power * (0.5 * (e - 1.0 / e)) * plastic_strain
    growth = pulled * (1.0 + pulled * (0.5 + pulled * (1.0 / 6.0 + pulled * (1.0 / 24.0 + pulled * (1.0 / 120.0)))))
    work = max(contract(deviator, strain), 0.0) * per_mises
    sheared = shear_sensitivity * lode_function(deviator, per_mises) * work
    # both as shares of what is still solid: dw/(1 - w) = (m + 1) dphi/(1 - phi)
    solid, matrix = 1.0 - w, 1.0 - phi
    whole = 1.0 / (solid * matrix)
    share = select(solid > SOLID, w * growth * (matrix * whole) + power * sheared * (solid * whole), 0.0)
    return (
        min(w + share * solid, 1.0 - SOLID),
        phi - matrix * _power_less_one(-share, 1.0 / power),
        (pulled <= _SHORT) & (share <= _SHORT),
    )
