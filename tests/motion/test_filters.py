"""Filters against their closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.motion.filters import (
    achieved_cutoff,
    butterworth,
    channel_frequency_class,
    channel_frequency_class_cutoff,
    moving_average,
    moving_average_gain,
    moving_average_length,
    smooth_rotations,
)


@pytest.mark.parametrize(
    ("cutoff", "rate", "length"), [(40.0, 59.94, 1), (15.0, 59.94, 3), (5.0, 59.94, 5), (5.0, 239.76, 21)]
)
def test_articles_cutoffs_give_these_lengths(cutoff, rate, length):
    assert moving_average_length(cutoff, rate) == length


@pytest.mark.parametrize("length", [3, 5, 21])
def test_moving_average_leaves_half_the_power_at_the_achieved_cutoff(length):
    rate = 240.0
    f = achieved_cutoff(length, rate)
    assert moving_average_gain(length, f, rate) == pytest.approx(np.sqrt(0.5), abs=1e-12)
    t = np.arange(4000) / rate
    sine = np.sin(2 * np.pi * f * t)
    ratio = moving_average(sine, length)[100:-100] @ sine[100:-100] / (sine[100:-100] @ sine[100:-100])
    assert ratio == pytest.approx(np.sqrt(0.5), abs=1e-3)


def test_length_one_is_no_filter_and_says_so():
    values = np.random.default_rng(0).normal(size=(9, 3))
    assert np.array_equal(moving_average(values, 1), values)
    assert achieved_cutoff(1, 60.0) == np.inf


def test_moving_average_has_no_phase_and_keeps_lines_to_the_ends():
    line = np.linspace(1.0, 4.0, 30)
    assert moving_average(line, 7) == pytest.approx(line, abs=1e-14)
    spike = np.zeros(31)
    spike[15] = 1.0
    out = moving_average(spike, 5)
    assert out == pytest.approx(out[::-1], abs=0.0)


def test_smoothing_leaves_a_constant_spin_alone_and_halves_noise():
    spin = Rotation.from_rotvec(np.arange(20)[:, None] * np.array([0.05, -0.02, 0.1]))
    assert np.max((smooth_rotations(spin, 5) * spin.inv()).magnitude()) < 1e-12
    noise = Rotation.from_rotvec(np.random.default_rng(1).normal(0, 0.01, (2000, 3)))
    ratio = np.std(smooth_rotations(noise, 5).as_rotvec()) / np.std(noise.as_rotvec())
    assert ratio == pytest.approx(1 / np.sqrt(5), rel=0.05)


@pytest.mark.parametrize("cutoff", [50.0, 120.0])
def test_butterworth_has_minus_3_db_at_the_cutoff_of_both_passes(cutoff):
    t = np.arange(8000) / 2000.0
    sine = np.sin(2 * np.pi * cutoff * t)
    out = butterworth(sine, cutoff, 2000.0)[2000:-2000]
    # the bilinear transform is prewarped at the design frequency, not here: a few parts in a hundred
    assert np.max(np.abs(out)) == pytest.approx(np.sqrt(0.5), rel=0.02)


def test_channel_frequency_class_180_has_minus_3_db_at_300_hz():
    assert channel_frequency_class_cutoff(180.0) == pytest.approx(300.0, rel=2e-3)
    t = np.arange(40000) / 20000.0
    out = channel_frequency_class(np.sin(2 * np.pi * 300.0 * t), 180.0, 20000.0)[5000:-5000]
    assert np.max(np.abs(out)) == pytest.approx(np.sqrt(0.5), rel=5e-3)


def test_a_clip_shorter_than_the_filter_is_our_own_mistake():
    with pytest.raises(ValueError, match="fewer than the filter"):
        moving_average(np.zeros(3), 9)
    with pytest.raises(ValueError, match="fewer than the filter"):
        smooth_rotations(Rotation.identity(3), 9)
