"""Plastic flow along a fixed direction N over one step: its exponential, the stress along N, the scalar equation.

N is a symmetric unit tensor without trace, so its characteristic equation reads ``N^3 = N/2 + d I`` with
``d = det N``, and every function of N is ``c0 I + c1 N + c2 N^2``: a triple of numbers here. Likewise a symmetric
tensor S meets functions of N only through ``tr S``, ``N:S`` and ``N^2:S``: its moments, a triple too.

Divisions are gathered: they are what the scalar equation costs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from replay.solver.kernels.device import device
from replay.solver.kernels.mathx import exp, log, select, sinh
from replay.solver.kernels.tensors import contract, deviator, trace

#: Largest square of the chain stretch over its locking stretch: beyond, the network hardens linearly.
LOCKED = 0.9
#: Most that gamma can grow in a step, an elongation of 30: keeps the first guesses of the solution in range.
MOST = 6.0
_LOG_MOST = 1.791759469228055
_PER_ROOT_2 = 0.7071067811865476
#: Range of the unknown.
_LEAST, _GREATEST = -300.0, 300.0


class Flow(NamedTuple):
    """What the scalar equation of a step depends on.

    Parameters
    ----------
    det
        det N.
    elastic, plastic
        Moments of the elastic trial ``Ce`` and of ``Bp``.
    back
        ``N : beta`` at the start [Pa].
    xi1, xi_star, xi2
        Internal strains at the start.
    resistance
        ``alpha_p <p>`` [Pa].
    reach
        ``gdot0 dt``.
    """

    det: float
    elastic: tuple
    plastic: tuple
    back: float
    xi1: float
    xi_star: float
    xi2: float
    resistance: float
    reach: float


@device
def moments(n, n2, s):
    """``tr S``, ``N:S``, ``N^2:S``; the second by the deviator, for N has no trace but that of its rounding.

    Near rest S is nearly I and N the direction of what is left of it, and ``N:I`` would be the greater part.
    """
    return trace(s), contract(n, deviator(s)), contract(n2, s)


@device
def times_n(c, det):
    """Coefficients of N times the polynomial `c`."""
    return (det * c[2], c[0] + 0.5 * c[2], c[1])


@device
def product(c, s):
    """Trace of the polynomial `c` times the tensor whose moments are `s`."""
    return c[0] * s[0] + c[1] * s[1] + c[2] * s[2]


@device
def squared(c, det):
    """Coefficients of the square."""
    a0, a1, a2 = c
    twice = 2.0 * a0 + 0.5 * a2
    return (a0 * a0 + 2.0 * det * (a1 * a2), a2 * a2 * det + a1 * (twice + 0.5 * a2), a1 * a1 + a2 * twice)


@device
def inverted(c, det):
    """Coefficients of the inverse of a polynomial of determinant one: its adjugate, by the characteristic equation."""
    q = squared(c, det)
    total = 3.0 * c[0] + c[2]
    constant = 0.5 * (total * total - (3.0 * q[0] + q[2]))
    return (q[0] - total * c[0] + constant, q[1] - total * c[1], q[2] - total * c[2])


@device
def exponential(b, det):
    """Coefficients of ``exp(b N)``.

    Taylor's series to the eighth power of a quarter of the argument with the powers of N written out (``N^4 = d N +
    N^2/2`` and so on), squared twice: rounding for |b| <= 0.3, 1e-6 for |b| = 4, an elongation of 26 in one step.
    """
    x = 0.25 * b
    x2 = x * x
    x3 = x * x2
    x4 = x2 * x2
    seventh = (det * det + 0.125) * (1.0 / 5040.0)
    eighth = (det * det + 0.125) * (1.0 / 40320.0)
    c0 = 1.0 + x3 * (
        det * (1.0 / 6.0 + x2 * (1.0 / 240.0 + x2 * (1.0 / 20160.0)))
        + x3 * det * det * (1.0 / 720.0 + x2 * (1.0 / 40320.0))
    )
    c1 = (
        x
        + x3 * (1.0 / 12.0 + x2 * (1.0 / 480.0) + x4 * seventh)
        + x4 * det * (1.0 / 24.0 + x2 * (1.0 / 720.0) + x4 * (0.75 / 40320.0))
    )
    c2 = (
        x2 * (0.5 + x2 * (1.0 / 48.0) + x4 * (0.25 / 720.0))
        + x3 * x2 * det * (1.0 / 120.0 + x2 * (1.0 / 5040.0))
        + x4 * x4 * eighth
    )
    return squared(squared((c0, c1, c2), det), det)


@device
def exponentials(b, det):
    """Coefficients of ``exp(-b N)`` and ``exp(b N)``."""
    shrunk = exponential(-b, det)
    return shrunk, inverted(shrunk, det)


@device
def network_modulus(square, p):
    """mu_B of the mean squared plastic stretch."""
    y2 = min(square * p.per_locking_square, LOCKED)
    return p.network * (1.0 / 3.0) * (3.0 - y2) / (1.0 - y2)


@device
def internal_strains(flow, p, dgamma, stretching):
    """xi1, xi*, xi2 after `dgamma` by backward Euler, ``stretching = lambda_p - 1`` at the end."""
    star = flow.xi_star + p.star_rate * dgamma
    star_part = 1.0 + p.star_rate * p.per_star_saturation * dgamma
    first_part = star + p.first_rate * dgamma * star_part
    second_rate = p.second_rate * stretching * dgamma
    second_part = 1.0 + second_rate * p.per_second_saturation
    # one division for all
    both = first_part * second_part
    whole = 1.0 / (both * star_part)
    return (
        (flow.xi1 + p.first_rate * dgamma) * star * (whole * second_part * star_part),
        star * (whole * both),
        (flow.xi2 + second_rate) * (whole * first_part * star_part),
    )


@device
def flow_residual(flow, p, dgamma, shrunk, grown):
    """``tau - kappa - alpha_p <p>`` [Pa] after `dgamma`, and its derivative by dgamma.

    `shrunk` and `grown` are the coefficients of ``exp(-2bN)`` and ``exp(2bN)``.
    ``M = mu exp(-bN) Ce exp(-bN)`` and ``Bp = exp(bN) Bp exp(bN)`` commute with N under the trace, so both enter by
    their moments. M:N falls and Bp:N rises with b, whatever the axes of Ce and Bp.
    """
    det = flow.det
    b = dgamma * _PER_ROOT_2
    fall, rise = times_n(shrunk, det), times_n(grown, det)
    pulled = product(rise, flow.plastic)
    square = product(grown, flow.plastic) * (1.0 / 3.0)
    square_slope = (2.0 / 3.0) * pulled
    stretch = math.sqrt(square)

    # numerators and denominators, then one division for all
    star = flow.xi_star + p.star_rate * dgamma
    star_part = 1.0 + p.star_rate * p.per_star_saturation * dgamma
    first = (flow.xi1 + p.first_rate * dgamma) * star
    first_part = star + p.first_rate * dgamma * star_part
    second_rate = p.second_rate * (stretch - 1.0) * dgamma
    second_part = 1.0 + second_rate * p.per_second_saturation
    y2 = min(square * p.per_locking_square, LOCKED)
    loose = 1.0 - y2
    first_second, loose_stretch = first_part * second_part, loose * stretch
    whole = 1.0 / (first_second * loose_stretch)
    per_stretch, per_loose = whole * first_second * loose, whole * first_second * stretch
    per_first, per_second = whole * loose_stretch * second_part, whole * loose_stretch * first_part

    first = first * per_first
    first_slope = per_first * (
        p.first_rate * star
        + p.star_rate * (flow.xi1 + p.first_rate * dgamma)
        - first * (p.star_rate + p.first_rate * (2.0 * star_part - 1.0))
    )
    second = (flow.xi2 + second_rate) * per_second
    stretch_slope = 0.5 * square_slope * per_stretch
    second_slope = (
        p.second_rate * (stretch - 1.0 + b * stretch_slope) * per_second * (1.0 - second * p.per_second_saturation)
    )
    modulus = p.network * (1.0 / 3.0) * (3.0 - y2) * per_loose
    modulus_slope = select(y2 < LOCKED, p.network * (2.0 / 3.0) * per_loose * per_loose * p.per_locking_square, 0.0)
    hardening = p.back_rate * (square + per_stretch)

    stress = p.shear * product(fall, flow.elastic) - modulus * pulled - flow.back - hardening * b
    slope = (
        2.0 * p.shear * product(times_n(fall, det), flow.elastic)
        + 2.0 * modulus * product(times_n(rise, det), flow.plastic)
        + modulus_slope * square_slope * pulled
        + hardening
        + b * p.back_rate * (square_slope - stretch_slope * per_stretch * per_stretch)
    )
    return (
        _PER_ROOT_2 * stress - p.first_stress * first - p.second_stress * second - flow.resistance,
        -0.5 * slope - p.first_stress * first_slope - p.second_stress * second_slope,
    )


@device
def _newton(flow, p, u, most):
    """One safeguarded Newton step; the slope is never less than half of the viscous part's."""
    size = exp(u)
    cosine = math.sqrt(size * size + 1.0)
    s = select(size < 1e-3, size * (1.0 - size * size * (1.0 / 6.0)), log(size + cosine))
    dgamma = flow.reach * exp(p.exponent * u)
    shrunk = squared(exponential(-dgamma * _PER_ROOT_2, flow.det), flow.det)
    rest, slope = flow_residual(flow, p, dgamma, shrunk, inverted(shrunk, flow.det))
    residual = rest - p.yield_ * s
    viscous = p.yield_ * size / cosine
    downward = max(viscous - p.exponent * dgamma * slope, 0.5 * viscous)
    return min(max(u + residual / downward, _LEAST), most), abs(residual)


@device
def solve_flow(flow, p, trial):
    """Solve the scalar equation of a step.

    Parameters
    ----------
    flow, p
        Start of the step, `Constants` of the law.
    trial
        ``|M - dev alpha|`` of the elastic trial [Pa].

    Returns
    -------
    dgamma, residual, holds
        The second before the last Newton step, over the larger of Y and `trial`: a bound of what is left. The third
        is true: steps of any size are solved.

    Notes
    -----
    The first guess is the lesser of two: no elastic unloading (all of the driving stress is viscous), and unloading
    to no stress along the tangent. From there five steps leave less than 1e-9 for any jump of the stretch between 0.3
    and 3, any step, and m from 0.5 to 2 (`tests/solver/test_brain_isv.py`).
    """
    drive = trial * _PER_ROOT_2 - p.first_stress * flow.xi1 - p.second_stress * flow.xi2 - flow.resistance
    flows = (drive > 0.0) & (flow.reach > 0.0)
    viscous = log(max(sinh(min(drive / p.yield_, _GREATEST)), 1e-100))
    modulus = network_modulus(flow.plastic[0] * (1.0 / 3.0), p)
    unloading = max(drive, 0.0) / max(p.shear * flow.elastic[2] + modulus * flow.plastic[2], 1e-300)
    per_reach = p.per_exponent * log(max(flow.reach, 1e-300))
    elastic = p.per_exponent * log(min(max(unloading, 1e-100), MOST)) - per_reach
    most = min(viscous, p.per_exponent * _LOG_MOST - per_reach)
    u = max(min(viscous, elastic), _LEAST)
    u, _ = _newton(flow, p, u, most)
    u, _ = _newton(flow, p, u, most)
    u, _ = _newton(flow, p, u, most)
    u, _ = _newton(flow, p, u, most)
    u, residual = _newton(flow, p, u, most)
    dgamma = flow.reach * exp(p.exponent * u)
    return select(flows, dgamma, 0.0), select(flows, residual / max(trial, p.yield_), 0.0), True
