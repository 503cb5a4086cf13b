"""Peaks behind the channel filters: what SAE J211 lets through, what it takes, and when it has no say."""

from __future__ import annotations

import numpy as np
import pytest

from replay.measures import Motion
from replay.motion.filters import channel_frequency_class_cutoff
from replay.stages.channels import NAMES, peaks_behind_filters


def shaken(frequency_hz: float, step_s: float = 1e-4) -> Motion:
    """A head whose acceleration is a sine of 1000 m/s^2 along x, and its angular acceleration one of 5000 rad/s^2."""
    time = np.arange(0.0, 0.1, step_s)
    still, wave = np.zeros((len(time), 3)), np.zeros((len(time), 3))
    wave[:, 0] = np.sin(2 * np.pi * frequency_hz * time)
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    return Motion(time, still, turn, still, 1000.0 * wave, still, 5000.0 * wave)


def test_slow_motion_passes_and_the_corner_is_at_minus_three_decibels() -> None:
    slow = {row["name"]: row["value"] for row in peaks_behind_filters(shaken(20.0))}
    assert tuple(slow) == NAMES
    assert slow["peak_linear_acceleration_cfc180"] == pytest.approx(1000.0, rel=2e-3)
    assert slow["peak_angular_acceleration_cfc1000"] == pytest.approx(5000.0, rel=2e-3)
    corner = channel_frequency_class_cutoff(180)
    at_corner = {row["name"]: row["value"] for row in peaks_behind_filters(shaken(corner))}
    assert at_corner["peak_linear_acceleration_cfc180"] == pytest.approx(1000.0 * 0.5**0.5, rel=0.05)
    assert at_corner["peak_linear_acceleration_cfc1000"] == pytest.approx(1000.0, rel=0.02)


def test_a_class_that_the_sampling_does_not_carry_is_left_out() -> None:
    names = [row["name"] for row in peaks_behind_filters(shaken(20.0, step_s=5e-4))]
    assert names == ["peak_linear_acceleration_cfc180", "peak_angular_acceleration_cfc180"]
    assert peaks_behind_filters(shaken(20.0, step_s=1e-3)) == []


def test_a_record_that_ends_in_a_swing_has_no_peak_of_its_end() -> None:
    motion = shaken(20.0)
    motion.acceleration_m_per_s2[-1, 0] = 9000.0
    found = {row["name"]: row["value"] for row in peaks_behind_filters(motion)}
    assert found["peak_linear_acceleration_cfc180"] == pytest.approx(1000.0, rel=2e-3)
