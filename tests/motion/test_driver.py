"""The driver is one motion: smooth, without overshoot, and consistent with its own derivatives."""

import numpy as np
import pytest

from replay.errors import InputError
from replay.files import read_json
from replay.motion import Impact, Kinematics, build_driver
from replay.motion.driver import axis_points
from replay.play import Window

TIME = np.arange(-100, 101) / 1000.0


@pytest.fixture(scope="module")
def driver():
    return build_driver(Impact().at(TIME), 0.0, Window())


def test_driver_follows_a_known_motion(driver):
    truth = Impact().at(driver.motion.time_s + driver.start_s)
    assert np.linalg.norm(driver.motion.position_m - truth.position_m, axis=1).max() < 0.05e-3
    assert np.degrees((driver.motion.rotation * truth.rotation.inv()).magnitude()).max() < 0.05
    assert driver.motion.alpha_resultant.max() == pytest.approx(truth.alpha_resultant.max(), rel=0.02)


def test_driver_does_not_overshoot_its_samples(driver):
    assert driver.quality.overshoot_acceleration_percent < 1.0
    assert driver.quality.overshoot_omega_percent < 1.0
    spiky = Impact(peak_acceleration_m_per_s2=2000.0, acceleration_duration_s=0.004, alpha_duration_s=0.005)
    quality = build_driver(spiky.at(np.arange(-30, 31) / 240.0), 0.0, Window()).quality
    assert quality.overshoot_acceleration_percent < 1.0
    assert quality.overshoot_omega_percent < 1.0


def test_pose_velocity_and_acceleration_are_one_motion(driver):
    k, h = driver.motion, driver.quality.step_s
    assert k.time_s == pytest.approx(h * np.arange(601), abs=1e-15)
    # cubic pieces: these differences are exact up to the samples' own kinks
    assert (
        np.abs(np.diff(k.position_m, axis=0) / h - 0.5 * (k.velocity_m_per_s[1:] + k.velocity_m_per_s[:-1])).max()
        < 1e-4
    )
    spin = (k.rotation[1:] * k.rotation[:-1].inv()).as_rotvec() / h
    assert np.abs(spin - 0.5 * (k.omega_rad_per_s[1:] + k.omega_rad_per_s[:-1])).max() < 2e-3
    assert driver.quality.consistency_position_mm < 1e-6
    assert driver.quality.consistency_rotation_deg < 1e-4
    assert driver.quality.closure_position_mm < 0.05


@pytest.mark.parametrize("window", [Window(before_t0_s=0.2), Window(duration_s=0.2)])
def test_a_window_beyond_the_data_is_refused(window):
    with pytest.raises(InputError, match="runs past the data") as caught:
        build_driver(Impact().at(TIME), 0.0, window)
    assert "shorten window" in str(caught.value)


def test_axis_of_rotation_is_computed_from_omega():
    omega, at = np.array([3.0, -4.0, 12.0]), np.array([1.0, 2.0, 3.0])
    axis = axis_points(at, omega)
    assert axis["spin_rad_per_s"] == pytest.approx(13.0)
    assert (np.asarray(axis["Q_m"]) - axis["P_m"]) * axis["spin_rad_per_s"] == pytest.approx(omega)
    assert np.linalg.norm(np.asarray(axis_points(at, np.zeros(3))["Q_m"]) - at) == 1.0


def test_files_of_the_driver_are_read_back(driver, tmp_path):
    driver.write(tmp_path)
    again = Kinematics.read(tmp_path / "driver_6dof.csv")
    assert np.array_equal(again.position_m, driver.motion.position_m)
    assert np.array_equal(again.alpha_rad_per_s2, driver.motion.alpha_rad_per_s2)
    start = read_json(tmp_path / "initial_velocity.json")
    assert start["velocity_m_per_s"] == pytest.approx(driver.motion.velocity_m_per_s[0])
    assert start["omega_rad_per_s"] == pytest.approx(driver.motion.omega_rad_per_s[0])
    first = (tmp_path / "driver_6dof.csv").read_bytes()
    driver.write(tmp_path)
    assert (tmp_path / "driver_6dof.csv").read_bytes() == first
