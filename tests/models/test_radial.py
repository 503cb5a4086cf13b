"""Radial surfaces: exact ellipsoids, limited slopes, true thickness along the normal."""

from __future__ import annotations

import numpy as np
import pytest

from replay.models.radial import Ellipsoid, SlopeLimited, Smoothed, ray_stretch, sample_directions
from replay.models.radial import steepest_slope as slope


def test_an_off_centre_ellipsoid_is_met_exactly() -> None:
    body = Ellipsoid((0.08, 0.06, 0.05), (0.02, -0.01, 0.015))
    d = sample_directions()
    point = (d * body(d)[:, None] - body.centre_m) / body.half_axes_m
    np.testing.assert_allclose(np.linalg.norm(point, axis=1), 1.0, rtol=1e-12)


def test_a_star_centre_outside_is_refused() -> None:
    with pytest.raises(ValueError, match="star centre lies outside"):
        Ellipsoid((0.1, 0.1, 0.1), (0.2, 0.0, 0.0))


def spiked(directions: np.ndarray) -> np.ndarray:
    """A sphere with a spike at the pole."""
    return 0.1 + 0.08 * np.exp(-40.0 * (1.0 - directions[:, 2]))


@pytest.mark.parametrize("limit", [0.5, 1.0])
def test_slopes_are_limited_from_outside_and_gentle_ones_untouched(limit: float) -> None:
    d = sample_directions()
    assert slope(spiked) > 1.5
    limited = SlopeLimited(spiked, limit)
    assert slope(limited) <= limit * 1.001
    assert (limited(d) >= spiked(d) * (1 - 1e-12)).all()
    gentle = Ellipsoid((0.1, 0.09, 0.095))
    np.testing.assert_allclose(SlopeLimited(gentle, limit)(d), gentle(d), rtol=1e-12)


def test_smoothing_keeps_a_sphere_and_flattens_a_ripple() -> None:
    d = sample_directions()
    np.testing.assert_allclose(Smoothed(Ellipsoid((0.1, 0.1, 0.1)), 8.0)(d), 0.1, rtol=1e-12)

    def ripple(directions: np.ndarray) -> np.ndarray:
        return 0.1 + 0.005 * np.cos(12 * np.arctan2(directions[:, 1], directions[:, 0]))

    equator = d[np.abs(d[:, 2]) < 0.2]
    assert np.ptp(Smoothed(ripple, 10.0)(equator)) < 0.25 * np.ptp(ripple(equator))


def test_thickness_along_a_ray_grows_with_the_inverse_cosine_to_the_normal() -> None:
    body, d = Ellipsoid((0.10, 0.08, 0.06)), sample_directions()
    point = d * body(d)[:, None]
    normal = point / np.array(body.half_axes_m) ** 2
    cosine = np.sum(d * normal, axis=1) / np.linalg.norm(normal, axis=1)
    np.testing.assert_allclose(ray_stretch(body, d), 1 / cosine, rtol=1e-5)
