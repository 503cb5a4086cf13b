"""The read-out between frames: its own pulses come back, a quiet head stays quiet, and its bands cover."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.motion.bands import RATIOS, Calibration, band, constants, spread
from replay.motion.events import event_aligned, pulse
from replay.motion.readout import ANGULAR, fine_grid, read_out

TIME = np.arange(31) / 59.94
AXIS = np.array([0.6, 0.0, 0.8])


def observed(shape, instant, size, sigma, seed):
    """Orientation of a struck head at the frames, and its information."""
    level = shape.at(TIME - instant)[0]
    values = size * (level - level[0])[:, :1] * AXIS + np.random.default_rng(seed).normal(0, sigma, (len(TIME), 3))
    return values, np.tile(np.eye(3) / sigma**2, (len(TIME), 1, 1))


@pytest.mark.parametrize("shape", [pulse(0.012, 0.07), event_aligned(0.016)], ids=lambda s: s.name)
def test_shapes_integrate_their_own_rates(shape):
    t = np.linspace(-0.05, 0.5, 5501)
    level, rate, slope = shape.at(t)
    assert np.abs(np.gradient(level, t, axis=0) - rate)[50:-50].max() < 0.06
    assert np.abs(np.cumsum(slope, axis=0) * (t[1] - t[0]) - (rate - rate[0])).max() < 0.02
    assert np.sqrt((rate**2).sum(axis=1)).max() == pytest.approx(1.0, abs=0.15)


def test_the_fine_grid_passes_through_every_frame():
    grid = fine_grid(TIME)
    steps = (len(grid) - 1) // (len(TIME) - 1)
    assert grid[::steps] == pytest.approx(TIME)
    assert np.diff(grid).max() < 1.0e-3


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.7])
def test_a_pulse_between_frames_comes_back(phase):
    instant = TIME[14] + phase / 59.94
    shape = pulse(0.013, 0.060)
    values, information = observed(shape, instant, 30.0, 0.004, 1)
    drawn = read_out(TIME, values, information, ANGULAR, np.random.default_rng(0), draws=200)
    peak = np.linalg.norm(drawn.rate, axis=2).max(axis=1)
    top = 30.0 * np.abs(shape.rate[:, 0]).max()
    assert np.median(peak) == pytest.approx(top, rel=0.06)
    assert abs(np.median(drawn.event_s) - instant) < 2e-3
    assert drawn.event_probability > 0.999


def test_a_quiet_head_has_no_event():
    peaks = []
    for seed in range(3):
        values, information = observed(pulse(0.012, 0.07), 0.2, 0.0, 0.05, seed)
        drawn = read_out(TIME, values, information, ANGULAR, np.random.default_rng(seed), draws=100)
        assert drawn.event_probability < 0.6
        peaks.append(np.median(np.linalg.norm(drawn.rate, axis=2).max(axis=1)))
    assert np.median(peaks) < 5.0


def test_a_frame_that_tells_nothing_is_passed_over():
    shape, instant = pulse(0.015, 0.07), 0.24
    values, information = observed(shape, instant, 30.0, 0.01, 3)
    values[10] = 50.0
    information[10] = 0.0
    drawn = read_out(TIME, values, information, ANGULAR, np.random.default_rng(0), draws=100)
    assert np.median(np.linalg.norm(drawn.rate, axis=2).max(axis=1)) == pytest.approx(
        30.0 * np.abs(shape.rate[:, 0]).max(), rel=0.15
    )


def test_the_read_out_does_not_care_for_the_axes():
    turn = Rotation.from_euler("xyz", [40, 70, -20], degrees=True)
    values, information = observed(pulse(0.012, 0.07), 0.24, 25.0, 0.02, 2)
    one = read_out(TIME, values, information, ANGULAR, np.random.default_rng(0), draws=400)
    other = read_out(TIME, turn.apply(values), information, ANGULAR, np.random.default_rng(0), draws=400)
    a, b = (np.linalg.norm(d.rate, axis=2).max(axis=1) for d in (one, other))
    assert np.median(a) == pytest.approx(np.median(b), rel=0.03)
    assert one.event_probability == pytest.approx(other.event_probability, abs=1e-6)


def test_a_band_is_the_centre_shifted_and_widened():
    found = spread("omega_rad_per_s", np.exp(np.random.default_rng(0).normal(np.log(30.0), 0.1, 4000)))
    assert found.width == pytest.approx(0.1, rel=0.05)
    made = Calibration((0.05, 0.2), (0.0, 1.0), (2.0, 4.0), (3.0, 6.0), factor=(1.0, 2.0))
    known = replace(constants(), rates=(60.0, 240.0), peaks={"omega_rad_per_s": made})
    told = known.apply("omega_rad_per_s", found, 120.0)
    assert np.log(told.value / 30.0) == pytest.approx(0.05, abs=0.01)
    # the middle of the knots, in the logarithm of the width; the middle of the rates, in theirs
    assert np.log(told.value / told.low) == pytest.approx(1.5 * 0.3, rel=0.06)
    assert np.log(told.high / told.value) == pytest.approx(1.5 * 0.45, rel=0.06)


def test_a_band_that_spans_too_much_is_said_in_words():
    wide = band("a_along_m_per_s2", np.exp(np.random.default_rng(0).normal(5.0, 1.5, 500)), 59.94)
    assert not wide.resolved
    assert wide.text() == "not resolvable from this footage"
    assert set(RATIOS) >= {"omega_rad_per_s", "alpha_rad_per_s2"}
