"""The shipped bands cover on motions that had no part in making them, and would not if they were a quarter as wide."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.motion.bands import CONSTANTS_FILE, QUANTITIES, Spread, band, constants
from replay.motion.readout import ANGULAR, read_out
from replay.motion.synthetic.families import BUILDING, TESTING, draw

CLIPS = 30
SIGMA_RAD = np.array([0.011, 0.025, 0.026])
"""What six landmarks tell of an orientation at 300 px/m and 1 px, by axis."""


@pytest.fixture(scope="module")
def told():
    """Band of the peak angular velocity and the truth, of orientations observed at 59.94 fps."""
    out = []
    for seed in range(CLIPS):
        rng = np.random.default_rng([23, seed])
        time = (np.arange(-12, 13) + rng.random()) / 59.94
        truth = draw(TESTING[seed % 2], rng, (time[0], time[-1]), np.zeros(3))
        rotation = truth.at(time).rotation
        turns = (rotation[:-1].inv() * rotation[1:]).as_rotvec()
        axes = Rotation.random(random_state=seed).as_matrix()
        level = np.concatenate([np.zeros((1, 3)), np.cumsum(turns, axis=0)])
        level += (SIGMA_RAD * rng.standard_normal((len(time), 3))) @ axes.T
        information = np.tile(axes @ np.diag(SIGMA_RAD**-2) @ axes.T, (len(time), 1, 1))
        drawn = read_out(time - time[0], level, information, ANGULAR, np.random.default_rng(seed), draws=200)
        steps = (len(drawn.time_s) - 1) // (len(time) - 1)
        peaks = np.linalg.norm(drawn.rate, axis=2)[:, steps:-steps].max(axis=1)
        fine = truth.at(np.linspace(time[1], time[-2], 1000))
        out.append((band("omega_rad_per_s", peaks, 59.94), float(fine.omega_resultant.max())))
    return out


def covered(told, share):
    inside = 0
    for found, truth in told:
        low, high = (found.value * (end / found.value) ** share for end in (found.low, found.high))
        inside += low <= truth <= high
    return inside / len(told)


def test_bands_cover_on_other_families(told):
    assert covered(told, 1.0) >= 0.85


def test_bands_of_a_quarter_of_the_width_would_not(told):
    assert covered(told, 0.25) < 0.85


def test_the_peak_is_read_as_well_as_the_table_says(told):
    error = [abs(found.value / truth - 1.0) for found, truth in told]
    assert np.median(error) < 0.12


def test_families_that_build_do_not_test():
    assert not set(BUILDING) & set(TESTING)
    assert f"families: [{', '.join(BUILDING)}]" in CONSTANTS_FILE.read_text()


def test_every_quantity_has_constants():
    known = constants()
    assert {*known.peaks, "t0_s"} == set(QUANTITIES)
    assert list(known.rates) == sorted(known.rates)
    assert 0.0 < known.instant < 1.0
    for calibration in known.peaks.values():
        assert sorted(calibration.widths) == list(calibration.widths)
        assert min(*calibration.below, *calibration.above, *calibration.factor) > 0.0
        assert len(calibration.factor) == len(known.rates)


def test_no_posterior_counts_as_surer_than_the_sharpest_of_the_calibration():
    known = constants()
    sharpest = known.peaks["omega_rad_per_s"].widths[0]
    sharp, sharper, vague = (
        known.apply("omega_rad_per_s", Spread(3.0, share * sharpest), 59.94).ends for share in (1.0, 0.1, 2.0)
    )
    assert sharp == sharper
    assert vague[1] / vague[0] > 1.1 * sharp[1] / sharp[0]


def test_constants_between_two_rates_lie_between_theirs():
    known = constants()
    at = [known.at_rate(known.curves["omega"], fps) for fps in (30.0, 59.94, 84.8, 119.88)]
    assert at[0] == at[1] == known.curves["omega"][0]
    assert at[2] == pytest.approx(0.5 * (at[1] + at[3]), rel=1e-3)


def test_lobes_of_like_height_compete_and_a_single_one_does_not():
    time = np.arange(0.0, 0.2, 0.001)

    def lobe(at):
        return np.exp(-0.5 * ((time - at) / 0.004) ** 2)

    two = constants().instants(time, lobe(0.080) + 0.95 * lobe(0.120))
    first, second = (part.chance for part in two.parts)
    assert 0.5 < first < 0.7
    assert first + second == pytest.approx(1.0)
    assert two.value == pytest.approx(0.080)
    assert two.resolved
    assert two.covers(0.080)
    assert two.covers(0.120)
    assert not two.covers(0.100)
    assert " or " in two.text(1e-3)
    one = constants().instants(time, lobe(0.080))
    assert not one.parts
    assert one.low < 0.080 < one.high
    flat = constants().instants(time, np.ones(len(time)))
    assert not flat.resolved
