"""Fitting parameters to tests: weighted least squares within bounds, many starts, and what the data can tell apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from replay.errors import InputError
from replay.laboratory.material_point import Answer, answer
from replay.laboratory.programme import programme
from replay.laboratory.records import STATUSES, Curve
from replay.solver import Material

#: Error of a point as a share of its curve's largest stress, before the status widens it: every curve weighs alike.
RELATIVE_ERROR = 0.08
_STEPS = 120
#: A parameter nearer to a bound than this, in the logarithm of its range, lies on it.
ON_A_BOUND = 1e-3


@dataclass(frozen=True)
class Free:
    """A parameter that is fitted, in its logarithm.

    Parameters
    ----------
    name
        In the law.
    least, most
        Bounds, both positive.
    """

    name: str
    least: float
    most: float


@dataclass(frozen=True)
class Fit:
    """A calibration.

    Parameters
    ----------
    material
        With the fitted parameters.
    free
        What was fitted.
    cost
        Half the sum of squared weighted residuals.
    costs
        Of every start, best first.
    rms_pa
        By curve [Pa], over its points.
    correlation : (k, k) float64
        Of the logarithms of the free parameters, from the Jacobian at the fit.
    spread : (k,) float64
        Standard error of each logarithm at a weighted residual of one; infinite where the data do not see it.
    profile
        By parameter: its values and the least cost at each.
    """

    material: Material
    free: tuple[Free, ...]
    cost: float
    costs: tuple[float, ...]
    rms_pa: dict[str, float]
    correlation: NDArray[np.float64]
    spread: NDArray[np.float64]
    profile: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]

    def value(self, name: str) -> float:
        """Fitted value of a parameter."""
        return float(self.material.parameters[name])  # type: ignore[arg-type]

    def on_a_bound(self) -> list[str]:
        """Parameters that a bound holds."""
        held = []
        for f in self.free:
            at = np.log(self.value(f.name) / f.least) / np.log(f.most / f.least)
            if not ON_A_BOUND < at < 1 - ON_A_BOUND:
                held.append(f.name)
        return held


def curve_answer(material: Material, curve: Curve, steps: int = _STEPS) -> Answer:
    """The material in a curve's test."""
    return answer(material, programme(curve.mode, curve.rate_per_s, float(curve.strains[-1]), steps))


def curve_error(material: Material, curve: Curve) -> NDArray[np.float64]:
    """Model minus measured nominal stress at the curve's points [Pa]."""
    found = curve_answer(material, curve)
    return np.interp(curve.strains, found.programme.strains, found.nominal_pa) - curve.stresses_pa


def rms(material: Material, curves: Sequence[Curve]) -> dict[str, float]:
    """Root mean square error of every curve [Pa]."""
    return {curve.name: float(np.sqrt((curve_error(material, curve) ** 2).mean())) for curve in curves}


def point_errors(curve: Curve) -> NDArray[np.float64]:
    """Error that a fit gives each point [Pa]."""
    widened = np.array([STATUSES[status] for status in curve.statuses])
    return RELATIVE_ERROR * curve.stresses_pa.max() * widened


def calibrate(
    material: Material,
    free: Sequence[Free],
    curves: Sequence[Curve],
    *,
    starts: int = 8,
    seed: int = 1,
    profiles: int = 7,
) -> Fit:
    """Fit parameters to curves.

    Parameters
    ----------
    material
        First guess, and the parameters that stay.
    free
        What is fitted.
    curves
        Tests.
    starts
        How many first guesses: the given one, and random ones within a factor of three of it.
    seed
        Of the random starts.
    profiles
        Points of each parameter's profile; 0 for none.

    Raises
    ------
    InputError
        When a free parameter's value or bounds make no sense.
    """
    low, high = (np.log([getattr(f, name) for f in free]) for name in ("least", "most"))
    first = np.log([float(material.parameters[f.name]) for f in free])  # type: ignore[arg-type]
    for f, value in zip(free, first):
        if not 0 < f.least < f.most or not np.log(f.least) <= value <= np.log(f.most):
            where = f"material {material.name!r}"
            raise InputError(
                where, f"it is {np.exp(value):.6g}", column=f.name,
                expected=f"between its bounds {f.least:g} and {f.most:g}, both positive",
            )  # fmt: skip

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        tried = _with(material, free, x)
        try:
            return np.concatenate([curve_error(tried, curve) / point_errors(curve) for curve in curves])
        except InputError:
            return np.full(sum(len(curve.strains) for curve in curves), 1e3)

    def solve(x: NDArray[np.float64], keep: int | None = None) -> OptimizeResult:
        if keep is None:
            return least_squares(residuals, x, bounds=(low, high), x_scale=0.3, max_nfev=60)
        rest = np.delete(np.arange(len(x)), keep)

        def others(y: NDArray[np.float64]) -> NDArray[np.float64]:
            full = x.copy()
            full[rest] = y
            return residuals(full)

        return least_squares(others, x[rest], bounds=(low[rest], high[rest]), x_scale=0.3, max_nfev=15)

    rng = np.random.default_rng(seed)
    guesses = [first] + [
        np.clip(first + rng.uniform(-np.log(3.0), np.log(3.0), len(first)), low + 1e-6, high - 1e-6)
        for _ in range(starts - 1)
    ]
    found = sorted((solve(guess) for guess in guesses), key=lambda r: r.cost)
    best = found[0]
    fitted = _with(material, free, best.x)
    correlation, spread = _identifiability(best.jac)
    profile = {}
    for k, f in enumerate(free if profiles else ()):
        reach = min(2.0 * spread[k], np.log(4.0))
        values = np.clip(best.x[k] + np.linspace(-reach, reach, profiles), low[k], high[k])
        costs = []
        for value in values:
            x = best.x.copy()
            x[k] = value
            costs.append(float(solve(x, k).cost))
        profile[f.name] = (np.exp(values), np.array(costs))
    return Fit(
        fitted, tuple(free), float(best.cost), tuple(float(r.cost) for r in found), rms(fitted, curves), correlation,
        spread, profile,
    )  # fmt: skip


def left_out(material: Material, free: Sequence[Free], curves: Sequence[Curve]) -> dict[str, float]:
    """Root mean square error of every curve under the fit to all others [Pa]: what a fit foretells.

    Parameters
    ----------
    material
        First guess of each of the fits; that of all curves is a fair one.
    free, curves
        As of `calibrate`. Of one curve nothing can be left out: the result is empty.
    """
    errors: dict[str, float] = {}
    for curve in curves if len(curves) > 1 else ():
        others = [other for other in curves if other is not curve]
        errors |= rms(calibrate(material, free, others, starts=1, profiles=0).material, [curve])
    return errors


def _with(material: Material, free: Sequence[Free], x: NDArray[np.float64]) -> Material:
    values: Mapping[str, Any] = dict(zip((f.name for f in free), np.exp(x).tolist()))
    return replace(material, parameters={**material.parameters, **values})


def _identifiability(jacobian: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Correlation and standard error from the singular values; a direction that no point sees is infinitely wide."""
    _, size, axes = np.linalg.svd(jacobian, full_matrices=True)
    size = np.append(size, np.zeros(jacobian.shape[1] - len(size)))
    seen = size > 1e-6 * size[0]
    variance = np.where(seen, 1.0 / np.where(seen, size, 1.0) ** 2, 1e12)
    covariance = (axes.T * variance) @ axes
    spread = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(spread, spread)
    return correlation, np.where(spread > 1e3, np.inf, spread)
