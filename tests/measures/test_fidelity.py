"""Driver fidelity: a motion against itself, and against one changed by a known amount."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from replay.errors import InputError
from replay.measures import Motion, compare, fidelity


def turning_motion(n: int = 601, duration_s: float = 0.03) -> Motion:
    """A body that turns about a fixed axis with a half-sine angular acceleration and moves along a curve."""
    t = np.linspace(0, duration_s, n)
    w = 2 * np.pi / duration_s
    axis = np.array([2.0, 3.0, 6.0]) / 7
    angle = 0.4 * (w * t - np.sin(w * t)) / (2 * np.pi)
    rate, acceleration = 0.4 * w * (1 - np.cos(w * t)) / (2 * np.pi), 0.4 * w * w * np.sin(w * t) / (2 * np.pi)
    direction = np.array([0.6, 0.0, 0.8])
    start = Rotation.from_rotvec([0.1, -0.7, 2.9])
    return Motion(
        time_s=t,
        position_m=np.outer(0.02 * (1 - np.cos(w * t)) + 3 * t, direction),
        quaternion=(Rotation.from_rotvec(np.outer(angle, axis)) * start).as_quat(),
        velocity_m_per_s=np.outer(0.02 * w * np.sin(w * t) + 3, direction),
        acceleration_m_per_s2=np.outer(0.02 * w * w * np.cos(w * t), direction),
        angular_velocity_rad_per_s=np.outer(rate, axis),
        angular_acceleration_rad_per_s2=np.outer(acceleration, axis),
    )


def every(motion: Motion, step: int) -> Motion:
    return Motion(**{f.name: getattr(motion, f.name)[::step] for f in dataclasses.fields(Motion)})


def test_motion_followed_exactly_has_no_residual():
    target = turning_motion()
    result = fidelity(target, every(target, 3))
    assert result["position_residual_mm"] < 1e-9
    assert result["rotation_residual_deg"] < 1e-9
    for quantity in ("linear_acceleration", "angular_acceleration", "angular_velocity"):
        assert result[quantity]["rmse"] < 1e-9 * result[quantity]["target_peak"]


def test_motion_sampled_between_the_drivers_times_has_only_interpolation_error():
    """Cubic Hermite at 0.15 ms against the true curve: far below the gate's 0.05 mm and 0.05 degrees."""
    fine = turning_motion(6001)
    result = fidelity(every(fine, 30), every(fine, 7))
    assert result["position_residual_mm"] < 1e-6
    assert result["rotation_residual_deg"] < 1e-6


def test_offset_of_a_tenth_of_a_millimetre_is_seen():
    target = turning_motion()
    moved = target.position_m + 1e-4 * np.outer(target.time_s / target.time_s[-1], [0, 1, 0])
    result = fidelity(target, dataclasses.replace(target, position_m=moved))
    assert result["position_residual_mm"] == pytest.approx(0.1, rel=1e-9)


def test_turn_of_a_tenth_of_a_degree_is_seen_whatever_the_sign_of_the_quaternion():
    target = turning_motion()
    extra = Rotation.from_rotvec(np.outer(target.time_s / target.time_s[-1], np.radians([0.0, 0.1, 0.0])))
    q = (extra * Rotation.from_quat(target.quaternion)).as_quat()
    result = fidelity(target, dataclasses.replace(target, quaternion=-q))
    assert result["rotation_residual_deg"] == pytest.approx(0.1, rel=1e-6)


def test_target_with_flipped_quaternion_signs_is_the_same_target():
    target = turning_motion()
    flipped = target.quaternion * np.where(np.arange(len(target.time_s)) % 2, 1.0, -1.0)[:, None]
    assert fidelity(dataclasses.replace(target, quaternion=flipped), target)["rotation_residual_deg"] < 1e-9


def test_start_pose_does_not_count():
    """The model's skull starts where the model has it; what is compared is the motion from there."""
    target = turning_motion()
    elsewhere = dataclasses.replace(target, position_m=target.position_m - [4.0, 5.0, 6.0])
    assert fidelity(target, elsewhere)["position_residual_mm"] < 1e-9


def test_delta_peak_is_fe_less_target_over_target():
    """The article's third row, 45.01 against 59.95 rad/s at 15.0 and 13.909 ms, by the definition of its first two."""
    t = np.linspace(0, 0.03, 3001)

    def bump(height, at):
        return np.outer(height * np.exp(-(((t - at) / 0.003) ** 2)), [0, 1, 0])

    result = compare(t, bump(45.01, 0.015), t, bump(59.95, 0.01391))
    assert result.delta_peak_percent == pytest.approx(100 * (59.95 - 45.01) / 45.01, rel=1e-6)
    assert result.delta_time_to_peak_ms == pytest.approx(-1.09, abs=1e-6)


def test_rmse_is_of_the_vector_difference():
    t = np.linspace(0, 1, 11)
    target = np.outer(np.ones(11), [10.0, 0, 0])
    result = compare(t, target, t, target + np.array([0, 3.0, 4.0]))
    assert result.rmse == pytest.approx(5.0)
    assert result.rmse_percent_of_peak == pytest.approx(50.0)


def test_target_of_zero_has_no_percentage():
    t = np.linspace(0, 1, 5)
    result = compare(t, np.zeros((5, 3)), t, np.ones((5, 3)))
    assert result.delta_peak_percent is None
    assert result.rmse_percent_of_peak is None


def test_histories_that_do_not_overlap_are_refused():
    with pytest.raises(ValueError, match=r"target spans 0..1 s, applied 2..3 s"):
        compare([0, 1], np.ones((2, 3)), [2, 3], np.ones((2, 3)))


def test_motion_is_read_from_the_drivers_columns():
    motion = turning_motion(5)
    table = {"time_s": motion.time_s}
    for k, axis in enumerate("xyz"):
        table[f"skull_{axis}_m"] = motion.position_m[:, k]
        table[f"skull_v{axis}_m_per_s"] = motion.velocity_m_per_s[:, k]
        table[f"skull_a{axis}_m_per_s2"] = motion.acceleration_m_per_s2[:, k]
        table[f"skull_omega_{axis}_rad_per_s"] = motion.angular_velocity_rad_per_s[:, k]
        table[f"skull_alpha_{axis}_rad_per_s2"] = motion.angular_acceleration_rad_per_s2[:, k]
    for k, axis in enumerate("xyzw"):
        table[f"skull_q{axis}"] = motion.quaternion[:, k]
    read = Motion.from_columns(table, prefix="skull_")
    for field in dataclasses.fields(Motion):
        assert np.array_equal(getattr(read, field.name), getattr(motion, field.name))


def history_of(motion: Motion, pid: int = 7) -> pd.DataFrame:
    """What the solver writes of a rigid part, beside a deformable one."""
    columns = {"time_s": motion.time_s, "pid": pid, "part": "skull"}
    for k, axis in enumerate("xyz"):
        columns[f"{axis}_m"] = motion.position_m[:, k]
        columns[f"v{axis}_m_per_s"] = motion.velocity_m_per_s[:, k]
        columns[f"omega_{axis}_rad_per_s"] = motion.angular_velocity_rad_per_s[:, k]
    for k, axis in enumerate("xyzw"):
        columns[f"q{axis}"] = motion.quaternion[:, k]
    skull = pd.DataFrame(columns)
    soft = skull.assign(pid=8, part="brain", qx=np.nan, qy=np.nan, qz=np.nan, qw=np.nan)
    return pd.concat([skull, soft]).sort_values("time_s", kind="stable", ignore_index=True)


def test_accelerations_are_the_differences_of_the_recorded_velocities():
    """Every 0.1 ms of a 30 ms sine: (w dt)^2 / 6 = 7e-5 of the peak."""
    exact = turning_motion(301)
    read = Motion.from_history(history_of(exact), 7)
    peak = np.abs(exact.acceleration_m_per_s2).max()
    assert np.abs(read.acceleration_m_per_s2 - exact.acceleration_m_per_s2)[1:-1].max() < 1e-4 * peak
    result = fidelity(turning_motion(), read)
    assert abs(result["linear_acceleration"]["delta_peak_percent"]) < 0.05
    assert abs(result["angular_acceleration"]["delta_peak_percent"]) < 0.05
    assert result["position_residual_mm"] < 1e-9


@pytest.mark.parametrize(("pid", "message"), [(8, "301 rows, 0 of them with an orientation"), (9, "part 9 has 0 rows")])
def test_part_that_is_not_rigid_has_no_motion(pid, message):
    with pytest.raises(InputError, match=message):
        Motion.from_history(history_of(turning_motion(301)), pid)
