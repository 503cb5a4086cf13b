"""Synthetic plays: the truth agrees with itself, and the shipped plays are what the generator makes."""

from dataclasses import replace

import numpy as np
import pytest

from replay.motion import Impact, reconstruct, synthesise
from replay.motion.kinematics import STANDARD_GRAVITY, Kinematics
from replay.motion.synthetic import (
    PULSES,
    SEEDS,
    TEN,
    Flaws,
    RecordedMotion,
    SyntheticCamera,
    draw_impact,
    film,
)
from replay.motion.synthetic.pulses import pulse
from replay.play import load_play

CLOSE = SyntheticCamera(239.76, -24, 26, (3840, 2160), 3840.0)
RECORD = Impact(family="skewed").at(np.arange(-80, 101) / 1000.0)
MOUTHGUARD = """name: play
source:
  kind: wearable
  kinematics: impact_1.csv
  columns:
    time: {name: time_ms, unit: ms}
    acceleration: {names: [lin_acc_x_g, lin_acc_y_g, lin_acc_z_g], unit: g}
    angular_velocity: {names: [ang_vel_x_rad_s, ang_vel_y_rad_s, ang_vel_z_rad_s], unit: rad/s}
  axes: head
  sensor_to_cg_m: [0, 0, 0]
  filter: {kind: none}
"""


@pytest.mark.parametrize("preset", sorted(SEEDS))
def test_shipped_plays_are_those_of_the_generator(repository, preset):
    for name, text in synthesise(preset).files.items():
        assert (repository / "config" / "plays" / preset / name).read_text() == text, name


@pytest.mark.parametrize("family", PULSES)
def test_pulses_are_one_high_and_their_integrals_are_integrals(family):
    t = np.linspace(-0.01, 0.06, 14001)
    value, first, second = pulse(family, t, 0.0, 0.04, 1.0)
    assert value.max() == pytest.approx(1.0, abs=2e-3)
    assert value.min() == pytest.approx(0.0, abs=1e-10)
    step = t[1] - t[0]
    for f, integral in ((value, first), (first, second)):
        summed = np.concatenate([[0.0], np.cumsum(0.5 * step * (f[1:] + f[:-1]))])
        assert integral == pytest.approx(summed, abs=1e-8)


@pytest.mark.parametrize("motion", [*(Impact(family=f) for f in PULSES), RecordedMotion(RECORD)])
def test_truth_agrees_with_its_own_derivatives(motion):
    t, h = np.linspace(-0.05, 0.0897, 60), 1e-6
    before, at, after = (motion.at(t + d) for d in (-h, 0.0, h))
    assert (after.position_m - before.position_m) / (2 * h) == pytest.approx(at.velocity_m_per_s, abs=1e-5)
    assert (after.velocity_m_per_s - before.velocity_m_per_s) / (2 * h) == pytest.approx(
        at.acceleration_m_per_s2, abs=1e-3
    )
    turn = (after.rotation * before.rotation.inv()).as_rotvec() / (2 * h)
    # a record is integrated in steps that meet to a nanoradian
    assert turn == pytest.approx(at.omega_rad_per_s, abs=1e-5 if isinstance(motion, Impact) else 1e-3)
    assert (after.omega_rad_per_s - before.omega_rad_per_s) / (2 * h) == pytest.approx(at.alpha_rad_per_s2, abs=1e-2)


def test_impact_is_as_severe_as_those_of_the_field():
    k = Impact().at(np.linspace(-0.05, 0.1, 3001))
    assert 30.0 < k.omega_resultant.max() < 45.0
    assert 3000.0 < k.alpha_resultant.max() < 6000.0
    assert 60.0 < k.linear_resultant.max() / STANDARD_GRAVITY < 90.0


def test_another_seed_is_another_clip_of_the_same_motion(tmp_path):
    first, second = synthesise("demo", seed=1), synthesise("demo", seed=2)
    assert first.files["kinovea_clicks.csv"] != second.files["kinovea_clicks.csv"]
    assert first.files["truth.csv"] == second.files["truth.csv"]
    first.write(tmp_path)
    assert Kinematics.read(tmp_path / "truth.csv").omega_resultant.max() == pytest.approx(33.6, abs=0.2)


def test_a_recorded_motion_keeps_the_records_own_components_and_goes_on_evenly_outside_it():
    replayed = RecordedMotion(RECORD, position_m=(0.0, 45.0, 0.0), heading_deg=-80.0)
    peak = RECORD.time_s[np.argmax(RECORD.alpha_resultant)]
    at = replayed.at(RECORD.time_s - peak)
    local = RECORD.in_head_axes
    assert at.in_head_axes(at.omega_rad_per_s) == pytest.approx(local(RECORD.omega_rad_per_s), abs=1e-9)
    assert at.in_head_axes(at.acceleration_m_per_s2) == pytest.approx(local(RECORD.acceleration_m_per_s2), abs=1e-6)
    zero = replayed.at(np.zeros(1))
    assert zero.position_m[0] == pytest.approx([0.0, 45.0, 0.0], abs=1e-12)
    assert zero.velocity_m_per_s[0] == pytest.approx(0.0, abs=1e-12)
    late = replayed.at(np.array([0.2, 0.3, 0.4]))
    assert late.acceleration_m_per_s2 == pytest.approx(0.0)
    assert np.diff(late.position_m, n=2, axis=0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.shared
def test_a_measured_impact_can_be_filmed(shared, tmp_path):
    folder = tmp_path / "play"
    folder.mkdir()
    (folder / "impact_1.csv").write_text((shared / "real" / "mouthguard" / "impact_1.csv").read_text())
    (folder / "play.yaml").write_text(MOUTHGUARD)
    record = reconstruct(load_play(folder)).kinematics
    record.write(folder / "kinematics.csv")
    motion = RecordedMotion.read(folder / "kinematics.csv", position_m=(0.0, 1.6, 0.0))
    fine = motion.at(np.arange(-800, 801) / 10000.0)
    assert fine.omega_resultant.max() == pytest.approx(record.omega_resultant.max(), rel=0.03)
    assert np.isfinite(film(motion, CLOSE, seed=1).tracks.pixels).all()


def test_clicks_scatter_as_the_flaws_say():
    flaws = Flaws(click_sigma_px=2.0, outlier_share=0.1, outlier_px=50.0, occluded_share=0.2)
    footage = film(Impact(), replace(CLOSE, landmarks=TEN), seed=3, flaws=flaws)
    error = footage.tracks.pixels - footage.exact_px
    good = ~footage.hidden & ~footage.wild
    assert error[good].std() == pytest.approx(2.0, rel=0.08)
    assert error[footage.wild].std() == pytest.approx(50.0, rel=0.2)
    assert footage.wild.mean() == pytest.approx(0.1 * (1 - footage.hidden.mean()), rel=0.4)
    assert footage.hidden.mean() == pytest.approx(0.18, abs=0.05)
    assert (footage.tracks.seen == ~footage.hidden).all()


def test_blur_makes_clicks_of_fast_landmarks_noisier():
    blurred = [film(Impact(), CLOSE, seed=s, flaws=Flaws(blur_share=0.5)) for s in range(20)]
    error = np.array([np.linalg.norm(f.tracks.pixels - f.exact_px, axis=2) for f in blurred])
    speed = np.linalg.norm(np.gradient(blurred[0].exact_px, axis=0), axis=2)
    fast, slow = speed > np.quantile(speed, 0.9), speed < np.quantile(speed, 0.1)
    assert error[:, fast].std() > 2.0 * error[:, slow].std()
    sharp = film(Impact(), CLOSE, seed=0)
    assert np.std(sharp.tracks.pixels - sharp.exact_px) == pytest.approx(1.0, rel=0.1)


def test_a_turned_head_hides_the_landmarks_of_its_far_side():
    footage = film(Impact(), replace(CLOSE, landmarks=TEN), seed=0, flaws=Flaws(hide_the_far_side=True))
    hidden = dict(zip(TEN, footage.hidden.mean(axis=0)))
    assert hidden["LM8"] + hidden["LM9"] == pytest.approx(1.0)
    assert hidden["LM1"] == 0.0


def test_a_panning_camera_moves_what_stands_still_and_a_zooming_one_enlarges_it():
    points = {"S1": (1.0, 20.0, 0.5), "S2": (-2.0, 25.0, -1.0)}
    still = replace(CLOSE, static_points_m=points)
    t = still.times
    assert np.ptp(still.see_static(t), axis=0) == pytest.approx(0.0, abs=1e-9)
    panned = replace(still, pan_rad_per_s=0.1).see_static(t)
    # turning to the right moves the picture to the left by f tan(angle), and more off the axis
    assert panned[-1, :, 0] - panned[0, :, 0] == pytest.approx(-3840.0 * 0.1 * (t[-1] - t[0]), rel=0.02)
    raised = replace(still, tilt_rad_per_s=0.1).see_static(t)
    assert (raised[-1, :, 1] > raised[0, :, 1]).all()
    zoomed = np.linalg.norm(replace(still, zoom_per_s=1.0).see_static(t) - np.array([1920.0, 1080.0]), axis=2)
    assert np.log(zoomed[-1] / zoomed[0]) == pytest.approx(t[-1] - t[0])


def test_drawn_impacts_differ_and_are_those_of_their_seed():
    first, again = (draw_impact(np.random.default_rng(5), "double", (0.0, 45.0, 0.0)) for _ in range(2))
    assert first == again
    assert first.position_m == (0.0, 45.0, 0.0)
    rng = np.random.default_rng(6)
    t = np.linspace(-0.05, 0.05, 2001)
    peaks = [draw_impact(rng, family).at(t).omega_resultant.max() for family in PULSES for _ in range(20)]
    assert 8.0 < min(peaks) < 15.0
    assert 38.0 < max(peaks) < 50.0


def test_the_pages_example_of_footage_runs(repository):
    page = (repository / "docs" / "reconstruction.md").read_text()
    code = page.split("<!-- example of footage: begin -->")[1].split("```python\n")[1].split("```")[0]
    names: dict = {}
    exec(compile(code, "docs/reconstruction.md", "exec"), names)
    assert names["error"] < 2.5
