"""Synthetic plays: the truth agrees with itself, and the shipped plays are what the generator makes."""

import numpy as np
import pytest

from replay.motion import Impact, synthesise
from replay.motion.kinematics import STANDARD_GRAVITY, Kinematics
from replay.motion.synthetic import SEEDS


@pytest.mark.parametrize("preset", sorted(SEEDS))
def test_shipped_plays_are_those_of_the_generator(repository, preset):
    for name, text in synthesise(preset).files.items():
        assert (repository / "config" / "plays" / preset / name).read_text() == text, name


def test_truth_agrees_with_its_own_derivatives():
    t, h = np.linspace(-0.05, 0.1, 60), 1e-6
    before, at, after = (Impact().at(t + d) for d in (-h, 0.0, h))
    assert (after.position_m - before.position_m) / (2 * h) == pytest.approx(at.velocity_m_per_s, abs=1e-5)
    assert (after.velocity_m_per_s - before.velocity_m_per_s) / (2 * h) == pytest.approx(
        at.acceleration_m_per_s2, abs=1e-3
    )
    turn = (after.rotation * before.rotation.inv()).as_rotvec() / (2 * h)
    assert turn == pytest.approx(at.omega_rad_per_s, abs=1e-5)
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
