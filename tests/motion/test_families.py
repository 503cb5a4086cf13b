"""Families of impacts: what makes each of them, and that they agree with themselves."""

import numpy as np
import pytest
from scipy.signal import find_peaks

from replay.motion.synthetic.families import BUILDING, TESTING, draw

SPAN = (-0.2, 0.2)
TIME = np.arange(-0.15, 0.15, 1e-3)


def drawn(family, seed, **options):
    return draw(family, np.random.default_rng(seed), SPAN, np.zeros(3), **options)


@pytest.mark.parametrize("family", [*BUILDING, *TESTING[:2]])
def test_a_motion_is_the_integral_of_its_rates(family):
    k = drawn(family, 1).at(TIME)
    turned = (k.rotation[1:] * k.rotation[:-1].inv()).as_rotvec() / 1e-3
    assert np.abs(turned - 0.5 * (k.omega_rad_per_s[1:] + k.omega_rad_per_s[:-1])).max() < 0.1
    gained = np.diff(k.velocity_m_per_s, axis=0) / 1e-3
    # the grid of half a millisecond steps by its later sample
    assert np.abs(gained - 0.5 * (k.acceleration_m_per_s2[1:] + k.acceleration_m_per_s2[:-1])).max() < 90.0
    assert 10.0 < k.omega_resultant.max() < 70.0


def test_many_lobes_are_of_like_height_where_one_pulse_has_one():
    def lobes(family):
        counts = []
        for seed in range(20):
            alpha = drawn(family, seed).at(TIME).alpha_resultant
            counts.append(len(find_peaks(alpha, height=0.4 * alpha.max(), prominence=0.1 * alpha.max())[0]))
        return np.mean(counts)

    assert lobes("many_lobes") > 1.5 * lobes("sine_squared")


def test_a_quiet_motion_has_no_impact():
    k = drawn("skewed", 3, quiet=True).at(TIME)
    assert k.omega_resultant.max() < 15.0
    assert k.alpha_resultant.max() < 200.0


def test_measured_records_are_turned_and_scaled(shared):
    records = shared / "real" / "mouthguard"
    peaks = {round(drawn("mouthguard", seed, records=records).at(TIME).omega_resultant.max(), 3) for seed in range(6)}
    assert len(peaks) == 6
    with pytest.raises(ValueError, match="folder of its records"):
        drawn("mouthguard", 0)
