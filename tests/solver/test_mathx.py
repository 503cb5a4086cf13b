"""The kernels' exponential, logarithm and angle against 50 digits."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from replay.solver.kernels import mathx


def ulps(result: float, exact: mpmath.mpf) -> float:
    spacing = np.spacing(abs(float(exact))) or np.finfo(float).tiny
    return abs(float((mpmath.mpf(result) - exact) / mpmath.mpf(float(spacing))))


@pytest.mark.parametrize(("low", "high"), [(-1e-8, 1e-8), (-0.4, 0.4), (-20.0, 20.0), (-700.0, 700.0)])
def test_exponential_is_right_to_two_ulps(low: float, high: float) -> None:
    mpmath.mp.dps = 50
    values = np.concatenate([np.linspace(low, high, 400), [0.0]])
    assert max(ulps(mathx.exp(x), mpmath.exp(mpmath.mpf(float(x)))) for x in values) < 2.0


@pytest.mark.parametrize(("low", "high"), [(-300.0, 300.0), (-0.3, 0.3), (-1e-4, 1e-4)])
def test_logarithm_is_right_to_two_ulps(low: float, high: float) -> None:
    mpmath.mp.dps = 50
    values = 10.0 ** np.linspace(low, high, 801)
    assert max(ulps(mathx.log(x), mpmath.log(mpmath.mpf(float(x)))) for x in values if x != 1.0) < 2.0
    assert mathx.log(1.0) == 0.0


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 0.7, 10.0, 600.0])
def test_functions_that_vanish_at_zero_keep_their_digits(scale: float) -> None:
    mpmath.mp.dps = 50
    values = scale * np.concatenate([np.linspace(-1, -1e-3, 150), np.linspace(1e-3, 1, 150)])
    assert max(ulps(mathx.expm1(x), mpmath.expm1(mpmath.mpf(float(x)))) for x in values) < 3.0
    assert max(ulps(mathx.sinh(x), mpmath.sinh(mpmath.mpf(float(x)))) for x in values) < 3.0
    assert max(ulps(mathx.log1p(x), mpmath.log1p(mpmath.mpf(float(x)))) for x in values if x > -1) < 3.0
    assert mathx.expm1(0.0) == mathx.sinh(0.0) == mathx.log1p(0.0) == 0.0


@pytest.mark.parametrize(("low", "high"), [(-300.0, 300.0), (-0.3, 0.3), (-1e-4, 1e-4)])
def test_inverse_cube_root_is_right_to_two_ulps(low: float, high: float) -> None:
    mpmath.mp.dps = 50
    values = 10.0 ** np.linspace(low, high, 801)
    assert max(ulps(mathx.inverse_cube_root(x), 1 / mpmath.cbrt(mpmath.mpf(float(x)))) for x in values) < 2.0
    assert mathx.inverse_cube_root(1.0) == 1.0


def test_exponential_stays_finite_beyond_its_range() -> None:
    assert mathx.exp(1e6) == pytest.approx(math.exp(709.0), rel=1e-12)
    assert 0.0 < mathx.exp(-1e6) < 1e-300
    assert mathx.exp(0.0) == 1.0


@pytest.mark.parametrize("low", [1e-12, 1e-3, 0.5])
def test_angle_is_right_to_five_ulps_over_a_quarter_turn(low: float) -> None:
    mpmath.mp.dps = 50
    for a in np.linspace(low, np.pi / 2, 200):
        x, y = mpmath.cos(mpmath.mpf(float(a))), mpmath.sin(mpmath.mpf(float(a)))
        sine, cosine = float(y), max(float(x), 0.0)
        exact = mpmath.atan2(mpmath.mpf(sine), mpmath.mpf(cosine))
        assert ulps(mathx.angle(sine, cosine), exact) < 5.0
    assert mathx.angle(0.0, 1.0) == 0.0
