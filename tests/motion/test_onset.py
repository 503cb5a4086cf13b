"""Just before the impact: the onset, and velocities that no later frame has a say in."""

from dataclasses import replace

import numpy as np
import pytest

from replay.motion.onset import contact_index, onset_index
from replay.motion.posterior import reconstruct_posterior
from replay.motion.protocol import reconstruct_clicks
from replay.motion.readout import ANGULAR, LINEAR, read_quiet
from replay.motion.side_by_side import posterior_quality
from replay.motion.synthetic import Flaws, Impact, SyntheticCamera, film
from replay.motion.told import Told

SIX = ("LM1", "LM2", "LM3", "LM4", "LM5", "LM8")
IMPACT = Impact(position_m=(0.0, 20.0, 0.0))


@pytest.fixture(scope="module")
def filmed():
    camera = SyntheticCamera(119.88, -18, 18, (1920, 1080), 8000.0, landmarks=SIX)
    return film(IMPACT, camera, seed=3, flaws=Flaws(click_sigma_px=1.0))


def reconstructed(footage):
    settings = footage.settings()
    protocol = reconstruct_clicks(footage.tracks, footage.template, settings)
    return settings, reconstruct_posterior(footage.tracks, footage.template, settings, protocol)


@pytest.fixture(scope="module")
def found(filmed):
    return reconstructed(filmed)


def true_onset():
    """Of the closed form: the linear pulse leads."""
    time = np.arange(-0.05, 0.05, 1e-5)
    motion = IMPACT.at(time)
    return time[contact_index(motion.alpha_resultant, motion.linear_resultant)]


def test_the_onset_is_where_the_first_acceleration_reaches_a_tenth():
    # sin^2 reaches a tenth after asin(sqrt(0.1)) / pi of its length
    lead = IMPACT.acceleration_lead_s + IMPACT.acceleration_duration_s * (0.5 - np.arcsin(np.sqrt(0.1)) / np.pi)
    turn = IMPACT.alpha_duration_s * (0.5 - np.arcsin(np.sqrt(0.1)) / np.pi)
    assert true_onset() == pytest.approx(-max(lead, turn), abs=1e-4)


def test_a_forerunner_is_no_onset():
    time = np.arange(0.0, 0.2, 1e-3)

    def lobe(at, height):
        return height * np.exp(-0.5 * ((time - at) / 0.004) ** 2)

    curve = lobe(0.050, 0.3) + lobe(0.100, 0.8) + lobe(0.130, 1.0)
    # a Gaussian of 0.8 falls to 0.1 at sqrt(2 ln 8) widths
    assert time[onset_index(curve)] == pytest.approx(0.100 - 0.004 * np.sqrt(2 * np.log(8)), abs=1e-3)
    assert onset_index(np.ones(5)) == 0
    assert list(onset_index(np.stack([curve, curve[::-1]]))) == [onset_index(curve), onset_index(curve[::-1])]


def test_the_onset_lies_in_its_band(filmed, found):
    settings, posterior = found
    onset = posterior_quality(posterior, filmed.tracks, settings).bands["onset_s"]
    assert onset.covers(true_onset() - filmed.camera.times[0])
    assert onset.high < posterior_quality(posterior, filmed.tracks, settings).bands["t0_s"].high


def test_velocities_before_the_impact_are_those_of_the_head_before_it(found):
    before = found[1].before
    truth = IMPACT.at(np.array([true_onset()]))
    away = before.motion.velocity_m_per_s - truth.velocity_m_per_s
    assert np.all(np.abs(away[0]) < 4.0 * before.sigma_velocity_m_per_s)
    assert np.all(np.abs(before.motion.omega_rad_per_s - truth.omega_rad_per_s)[0] < 4.0 * before.sigma_omega_rad_per_s)
    # across the line of sight a broadcast tells the speed, along it hardly
    assert before.sigma_velocity_m_per_s[0] < 0.3 < before.sigma_velocity_m_per_s[1]
    assert before.motion.omega_resultant[0] < 0.1 * IMPACT.at(np.array([0.008])).omega_resultant[0]


def test_a_zooming_lens_is_not_taken_for_a_head_that_comes_closer(found):
    camera = SyntheticCamera(119.88, -18, 18, (1920, 1080), 8000.0, landmarks=SIX, zoom_per_s=0.4)
    _, posterior = reconstructed(film(IMPACT, camera, seed=3, flaws=Flaws(click_sigma_px=1.0)))
    before, truth = posterior.before, IMPACT.at(np.array([true_onset()]))
    away = (before.motion.velocity_m_per_s - truth.velocity_m_per_s)[0]
    assert np.all(np.abs(away) < 3.0 * before.sigma_velocity_m_per_s)
    # clicks from 20 m tell nothing of the lens: 0.3 per second of it are 6 m/s along the line of sight, none across
    assert before.sigma_velocity_m_per_s[1] == pytest.approx(6.0, rel=0.1)
    assert before.sigma_velocity_m_per_s[0] < 0.5
    assert found[1].before.sigma_velocity_m_per_s[1] < 3.0


@pytest.mark.parametrize("scales", [ANGULAR, LINEAR], ids=["angular", "linear"])
def test_frames_after_the_onset_have_no_say(scales):
    time = np.arange(20) / 60.0
    values = 0.5 * time[:, None] * np.array([1.0, -2.0, 0.5])
    information = np.tile(np.eye(3) / 1e-3**2, (20, 1, 1))
    quiet = read_quiet(Told(time, values, information), scales, 0.2, 0.2)
    struck = values + np.where(time >= 0.2, 3.0, 0.0)[:, None]
    same = read_quiet(Told(time, struck, information), scales, 0.2, 0.2)
    assert same.rate == pytest.approx(quiet.rate, abs=1e-6)
    assert quiet.rate == pytest.approx(0.5 * np.array([1.0, -2.0, 0.5]), abs=0.03)
    fewer = read_quiet(Told(time, values, information), scales, 0.1, 0.2)
    assert np.trace(fewer.covariance) > np.trace(quiet.covariance)


def test_a_frame_of_two_landmarks_is_passed_over(filmed):
    pixels = filmed.tracks.pixels.copy()
    pixels[9, 2:] = np.nan
    _, posterior = reconstructed(replace(filmed, tracks=replace(filmed.tracks, pixels=pixels)))
    truth = IMPACT.at(np.linspace(-0.1, 0.1, 2001)).omega_resultant.max()
    assert np.median(posterior.peaks["omega_rad_per_s"]) == pytest.approx(truth, rel=0.2)
