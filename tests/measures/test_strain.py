"""Strain and stress measures against closed forms, and their statistics against the definition."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.measures import (
    green_lagrange,
    logarithmic,
    maximum_shear_strain,
    principal_stretches,
    tensile_pressure,
    volume_fraction_at_least,
    von_mises,
    weighted_percentile,
)


def simple_shear(gamma: float) -> np.ndarray:
    return np.array([[[1.0, gamma, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]])


def test_simple_shear_of_0_4():
    stretches = principal_stretches(simple_shear(0.4))
    assert logarithmic(stretches)[0, 0] == pytest.approx(0.1986901, abs=5e-8)
    assert green_lagrange(stretches)[0, 0] == pytest.approx(0.2439608, abs=5e-8)


@pytest.mark.parametrize("stretch", [0.3, 0.9, 1.0, 1.5, 3.0])
def test_uniaxial_stretch_is_read_back(stretch):
    gradient = np.diag([1 / np.sqrt(stretch), stretch, 1 / np.sqrt(stretch)])[None]
    found = np.sort(principal_stretches(gradient)[0])
    assert found == pytest.approx(np.sort([stretch, stretch**-0.5, stretch**-0.5]), rel=1e-12)


def test_strain_does_not_see_a_rotation():
    rng = np.random.default_rng(3)
    gradient = np.eye(3) + rng.normal(0, 0.1, (50, 3, 3))
    turned = Rotation.random(50, rng=rng).as_matrix() @ gradient
    assert principal_stretches(turned) == pytest.approx(principal_stretches(gradient), rel=1e-12)


def test_small_strains_agree_and_shear_is_half_the_angle():
    stretches = principal_stretches(simple_shear(1e-6))
    assert green_lagrange(stretches)[0, 0] == pytest.approx(logarithmic(stretches)[0, 0], rel=1e-5)
    assert maximum_shear_strain(stretches)[0] == pytest.approx(0.5e-6, rel=1e-6)


def test_pressure_is_tensile_only_and_von_mises_sees_no_pressure():
    stress = np.array([[-3.0, -3, -3, 0, 0, 0], [6.0, 0, 0, 0, 0, 0], [0, 0, 0, 2.0, 0, 0]])
    assert tensile_pressure(stress) == pytest.approx([0.0, 2.0, 0.0])
    assert von_mises(stress) == pytest.approx([0.0, 6.0, 2.0 * np.sqrt(3)])


def test_stress_as_six_components_or_as_matrix_is_the_same():
    rng = np.random.default_rng(1)
    six = rng.normal(size=(20, 6))
    xx, yy, zz, xy, yz, zx = six.T
    full = np.stack([np.stack(r, axis=-1) for r in ((xx, xy, zx), (xy, yy, yz), (zx, yz, zz))], axis=1)
    assert von_mises(full) == pytest.approx(von_mises(six), rel=1e-14)
    deviator = full - np.trace(full, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    assert von_mises(six) == pytest.approx(np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))), rel=1e-12)


@pytest.mark.parametrize("percent", [5, 50, 95, 100])
def test_weighted_percentile_agrees_with_numpy(percent):
    rng = np.random.default_rng(11)
    values, weights = rng.normal(size=400), rng.uniform(0.1, 5.0, 400)
    expected = np.percentile(values, percent, weights=weights, method="inverted_cdf")
    assert weighted_percentile(values, weights, percent) == expected


def test_percentile_weighs_volume_not_elements():
    values, volumes = [0.1, 0.2, 0.9], [90.0, 6.0, 4.0]
    assert weighted_percentile(values, volumes, 50) == 0.1
    assert weighted_percentile(values, volumes, 95) == 0.2
    assert weighted_percentile(values, volumes, 97) == 0.9


def test_empty_or_unfinished_region_has_no_percentile():
    assert np.isnan(weighted_percentile([], [], 95))
    assert np.isnan(weighted_percentile([0.1, np.nan], [1.0, 1.0], 50))
    assert np.isnan(volume_fraction_at_least([], [], 0.15))


def test_csdm_is_the_share_of_volume_at_or_above_the_threshold():
    assert volume_fraction_at_least([0.1, 0.15, 0.3], [2.0, 1.0, 1.0], 0.15) == 0.5
