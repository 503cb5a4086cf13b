"""ISO/TS 18571: published answers, and what any rating of a curve against itself must do."""

from __future__ import annotations

import numpy as np
import pytest

from replay.measures import iso_18571, rate
from replay.measures.rating import _warp

TIME = np.arange(301) * 1e-4


def pulse(time: np.ndarray) -> np.ndarray:
    return 100 * np.sin(np.pi * np.clip((time - 0.005) / 0.015, 0, 1))


@pytest.mark.parametrize(("factor", "overall"), [(1.0, 1.0), (1.05, 0.990), (1.1, 0.961), (1.2, 0.896), (1.5, 0.734)])
def test_scaled_pulse_is_rated_as_published(factor, overall):
    assert round(iso_18571(pulse(TIME), factor * pulse(TIME)).overall, 3) == overall


@pytest.mark.parametrize(("samples", "overall"), [(3, 0.987), (10, 0.902), (20, 0.801)])
def test_shifted_pulse_is_rated_as_published(samples, overall):
    rating = iso_18571(pulse(TIME), pulse(TIME - samples * 1e-4))
    assert round(rating.overall, 3) == overall
    assert rating.shift == samples
    assert iso_18571(pulse(TIME - samples * 1e-4), pulse(TIME)).shift == -samples


def test_scores_of_a_scaled_pulse_are_those_of_their_definitions():
    """Corridor by hand; slope is (2 - 0.2)/2, since the slopes of both pulses differ by a fifth everywhere."""
    rating = iso_18571(pulse(TIME), 1.2 * pulse(TIME))
    apart = 0.2 * pulse(TIME)
    corridor = np.where(apart <= 5, 1.0, ((50 - apart) / 45) ** 2).mean()
    assert rating.corridor == pytest.approx(corridor, abs=1e-12)
    assert rating.slope == pytest.approx(0.9, abs=1e-12)
    assert rating.phase == 1.0


def test_rating_does_not_know_units_and_never_leaves_0_to_1():
    rng = np.random.default_rng(1)
    for _ in range(20):
        r, v = rng.normal(size=(2, 150)).cumsum(axis=1)
        rating = iso_18571(r, v)
        scaled = iso_18571(1024.0 * r, 1024.0 * v)
        for name in ("corridor", "phase", "magnitude", "slope", "overall"):
            assert 0.0 <= getattr(rating, name) <= 1.0
            assert getattr(scaled, name) == pytest.approx(getattr(rating, name), abs=1e-12)


@pytest.mark.parametrize(("factor", "grade"), [(1.0, "excellent"), (1.2, "good"), (1.5, "fair"), (-1.0, "poor")])
def test_grades_are_those_of_the_standard(factor, grade):
    assert iso_18571(pulse(TIME), factor * pulse(TIME)).grade == grade


def dumb_warp_cost(x: np.ndarray, y: np.ndarray, width: int) -> float:
    n = len(x)
    cost = np.full((n, n), np.inf)
    for i in range(n):
        for j in range(max(0, i - width), min(n, i + width + 1)):
            before = [cost[a, b] for a, b in ((i - 1, j), (i, j - 1), (i - 1, j - 1)) if a >= 0 and b >= 0]
            cost[i, j] = (x[i] - y[j]) ** 2 + (min(before) if before else 0.0)
    return float(cost[-1, -1])


@pytest.mark.parametrize("width", [0, 1, 4, 39])
def test_warping_finds_the_cheapest_path_inside_its_window(width):
    x, y = np.random.default_rng(2).normal(size=(2, 40)).cumsum(axis=1)
    i, j = _warp(x, y, width)
    assert (i[0], j[0], i[-1], j[-1]) == (0, 0, 39, 39)
    assert {(a, b) for a, b in zip(np.diff(i), np.diff(j))} <= {(0, 1), (1, 0), (1, 1)}
    assert np.abs(i - j).max() <= width
    assert ((x[i] - y[j]) ** 2).sum() == pytest.approx(dumb_warp_cost(x, y, width), rel=1e-12)


def test_histories_at_other_rates_are_brought_to_10_khz_over_their_common_span():
    fine, coarse = np.linspace(0, 0.03, 6001), np.linspace(0.002, 0.04, 381)
    rating = rate(fine, pulse(fine), coarse, pulse(coarse))
    assert rating.overall > 0.999


def test_constant_or_short_histories_have_no_rating():
    for r, v in ((np.ones(50), TIME[:50]), (TIME[:50], np.zeros(50)), (TIME[:5], TIME[:5])):
        with pytest.raises(ValueError, match="too short or constant"):
            iso_18571(r, v)
