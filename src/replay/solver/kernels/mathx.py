"""Exponential, logarithm and their kin in plain arithmetic: branch-free, vectorisable, the same on every machine.

A call of the C library inside the lane loop would stop LLVM from vectorising it and would
give other bits with another library. All functions stay within 2 units in the last place
of the exact result over the range that a material can meet (tested against mpmath).
"""

from __future__ import annotations

import math

import numpy as np

from replay.solver.kernels.device import device

#: Adding this to a double of magnitude below 2^51 rounds it to the nearest whole number,
#: which then stands in the low bits of the sum.
_ROUND = 1.5 * 2.0**52
_ROUND_BITS = 0x4338000000000000
_EXPONENT_BIAS = 1023
_MANTISSA = (1 << 52) - 1
_ONE_BITS = _EXPONENT_BIAS << 52

_LOG2_E = 1.4426950408889634
#: ln 2 in two parts; the first has 21 trailing zero bits, so that k * _LN2_HIGH is exact.
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
_SQRT_HALF_BITS = 0x3FE6A09E667F3BCD
#: 4/3 of the exponent's bias, less what balances the guess's error, in units of 2^-20.
_CUBE_ROOT_START = 1430186360.0


@device
def select(condition, yes, no):
    """One of two values, both already computed: a blend of lanes, not a jump."""
    return yes if condition else no


@device
def _reduced_exponential(x):
    """``exp(r) - 1`` and 2^k in two factors, so that their product with it stays normal to the end of the range.

    x = k ln 2 + r with |r| <= ln 2 / 2, and exp(r) by its Taylor series to r^13 (remainder 4e-18).
    """
    shifted = x * _LOG2_E + _ROUND
    k = shifted - _ROUND
    r = (x - k * _LN2_HIGH) - k * _LN2_LOW
    r2 = r * r
    r4 = r2 * r2
    # in pairs rather than one term after the other: a third of the waiting
    low = (1.0 / 2.0 + r * (1.0 / 6.0)) + r2 * (1.0 / 24.0 + r * (1.0 / 120.0))
    middle = (1.0 / 720.0 + r * (1.0 / 5040.0)) + r2 * (1.0 / 40320.0 + r * (1.0 / 362880.0))
    high = (1.0 / 3628800.0 + r * (1.0 / 39916800.0)) + r2 * (1.0 / 479001600.0 + r * (1.0 / 6227020800.0))
    bits = np.float64(shifted).view(np.int64) - _ROUND_BITS
    half = bits >> 1
    first = np.int64((half + _EXPONENT_BIAS) << 52).view(np.float64)
    second = np.int64((bits - half + _EXPONENT_BIAS) << 52).view(np.float64)
    return r + r2 * (low + r4 * (middle + r4 * high)), first, second


@device
def exp(x):
    """Exponential; the argument is held within [-708, 709]."""
    less_one, first, second = _reduced_exponential(min(max(x, -708.0), 709.0))
    return (1.0 + less_one) * first * second


@device
def expm1(x):
    """``exp(x) - 1``, right near zero too; the argument is held within [-708, 708]."""
    less_one, first, second = _reduced_exponential(min(max(x, -708.0), 708.0))
    power = first * second
    return power * less_one + (power - 1.0)


@device
def sinh(x):
    """Hyperbolic sine, right near zero too; the argument is held within [-708, 708]."""
    t = expm1(abs(x))
    half = 0.5 * (t + t / (1.0 + t))
    return select(x < 0.0, -half, half)


@device
def log(x):
    """Natural logarithm of a positive normal number.

    x = 2^k m with m in [sqrt(1/2), sqrt(2)); log m = 2 artanh(f), f = (m - 1)/(m + 1), by the
    series in f^2 to f^21 (remainder 4e-18), the leading term kept exact as m - 1.
    """
    bits = np.float64(x).view(np.int64)
    k = (bits - _SQRT_HALF_BITS) >> 52
    m = np.int64(bits - (k << 52)).view(np.float64)
    # whole number to double through the mantissa: no conversion instruction needed
    count = np.int64(k + _ROUND_BITS).view(np.float64) - _ROUND
    d = m - 1.0
    f = d / (m + 1.0)
    s = f * f
    s2 = s * s
    s4 = s2 * s2
    low = (1.0 / 3.0 + s * (1.0 / 5.0)) + s2 * (1.0 / 7.0 + s * (1.0 / 9.0))
    high = (1.0 / 11.0 + s * (1.0 / 13.0)) + s2 * (1.0 / 15.0 + s * (1.0 / 17.0))
    series = low + s4 * (high + s4 * (1.0 / 19.0 + s * (1.0 / 21.0)))
    # log(1 + d) = d - d^2/2 + f (d^2/2 + 2 s series)
    h = 0.5 * d * d
    return count * _LN2_HIGH + (d - (h - (f * (h + 2.0 * s * series) + count * _LN2_LOW)))


@device
def inverse_cube_root(x):
    """``x^(-1/3)`` of a positive normal number.

    The exponent and the first digits, read as one number, are near to the logarithm: divided by -3 they give a first
    guess that is right to 4 %. Two steps of the series of ``(1 - e)^(-1/3)``, ``e = 1 - x y^3``, do the rest.
    """
    top = np.int64((np.float64(x).view(np.int64) >> 32) + _ROUND_BITS).view(np.float64) - _ROUND
    shifted = (_CUBE_ROOT_START - top * (1.0 / 3.0)) + _ROUND
    y = np.int64((np.float64(shifted).view(np.int64) - _ROUND_BITS) << 32).view(np.float64)
    e = 1.0 - x * (y * y * y)
    y = y + y * (e * ((1.0 / 3.0 + e * (2.0 / 9.0)) + e * e * (14.0 / 81.0 + e * (35.0 / 243.0))))
    e = 1.0 - x * (y * y * y)
    return y + y * (e * (1.0 / 3.0 + e * (2.0 / 9.0)))


@device
def angle(sine, cosine):
    """Angle in [0, pi/2] with this sine and cosine, neither negative, of a point on the unit circle.

    Halved three times by ``tan(a/2) = tan a / (1 + sqrt(1 + tan^2 a))``; then arctan by its series to x^21 at
    x <= tan(pi/16) (remainder 2e-17 of the result).
    """
    x = sine / (1.0 + cosine)
    x = x / (1.0 + math.sqrt(1.0 + x * x))
    x = x / (1.0 + math.sqrt(1.0 + x * x))
    s = x * x
    series = -1.0 / 19.0 + s * (1.0 / 21.0)
    series = 1.0 / 17.0 + s * series
    series = -1.0 / 15.0 + s * series
    series = 1.0 / 13.0 + s * series
    series = -1.0 / 11.0 + s * series
    series = 1.0 / 9.0 + s * series
    series = -1.0 / 7.0 + s * series
    series = 1.0 / 5.0 + s * series
    series = -1.0 / 3.0 + s * series
    return 8.0 * (x + x * s * series)


@device
def log1p(x):
    """``log(1 + x)`` for x > -1: the logarithm of the rounded sum, and what the rounding lost."""
    u = 1.0 + x
    return log(u) + (x - (u - 1.0)) / u
