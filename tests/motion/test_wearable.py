"""The wearable path: a known truth, measured impacts of the field, and tables that must be refused."""

import shutil

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from replay.errors import InputError, InputErrors
from replay.motion import Impact, Kinematics, build_driver, check_tracks, reconstruct
from replay.motion.kinematics import STANDARD_GRAVITY
from replay.motion.synthetic.headform import headform_record
from replay.play import Window, load_play


@pytest.fixture
def wearable(tmp_path, repository):
    """A copy of the wearable play that a test may spoil."""
    return shutil.copytree(repository / "config" / "plays" / "wearable", tmp_path / "wearable")


def message(folder):
    with pytest.raises((InputError, InputErrors)) as caught:
        check_tracks(load_play(folder))
    assert caught.value.exit_code == 2
    return str(caught.value)


def test_synthetic_mouthguard_gives_the_known_motion_of_the_cg(repository):
    folder = repository / "config" / "plays" / "wearable"
    result = reconstruct(load_play(folder))
    truth, k = Kinematics.read(folder / "truth.csv"), result.kinematics
    rows = np.searchsorted(k.time_s, truth.time_s - 1e-9)
    assert result.t0_s == pytest.approx(0.080, abs=1.5e-3)
    assert k.linear_resultant.max() == pytest.approx(truth.linear_resultant.max(), rel=0.02)
    assert k.alpha_resultant.max() == pytest.approx(truth.alpha_resultant.max(), rel=0.04)
    assert k.omega_resultant.max() == pytest.approx(truth.omega_resultant.max(), rel=0.01)
    assert np.abs(k.omega_rad_per_s[rows] - truth.omega_rad_per_s).max() < 0.3
    assert np.degrees((k.rotation[rows] * truth.rotation.inv()).magnitude()).max() < 0.5
    assert np.abs(k.velocity_m_per_s[rows] - truth.velocity_m_per_s).max() < 0.2


def test_files_and_driver_of_a_wearable_are_those_of_any_play(repository, tmp_path):
    result = reconstruct(load_play(repository / "config" / "plays" / "wearable"))
    names = {path.name for path in result.write(tmp_path)}
    assert names == {"kinematics.csv", "initial_conditions_t0.csv", "qc_summary.txt"}
    again = Kinematics.read(tmp_path / "kinematics.csv")
    assert np.array_equal(again.acceleration_m_per_s2, result.kinematics.acceleration_m_per_s2)
    driver = build_driver(again, result.t0_s, result.play.window)
    assert driver.quality.closure_position_mm < 0.01
    assert driver.quality.closure_rotation_deg < 0.05


def test_a_headform_at_its_cg_in_j211_axes_gives_the_motion_it_had(tmp_path):
    truth = Impact().at(np.arange(-400, 601) / 10000.0)
    # x forward, y right, z down; a headform measures at its CG, here with its own angular acceleration and a class
    sae = np.array([1.0, -1.0, -1.0])
    vectors = (truth.acceleration_m_per_s2 / STANDARD_GRAVITY, truth.omega_rad_per_s, truth.alpha_rad_per_s2)
    table = np.hstack([truth.time_s[:, None] + 0.04, *(truth.in_head_axes(v) * sae for v in vectors)])
    names = ["Time (s)", *(f"{what} {axis}" for what in ("Acc (g)", "Rate (rad/s)", "AngAcc") for axis in "XYZ")]
    rows = [",".join(f"{value:.9g}" for value in row) for row in table]
    folder = tmp_path / "headform"
    folder.mkdir()
    (folder / "wearable.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    (folder / "play.yaml").write_text(HEADFORM)
    k = reconstruct(load_play(folder)).kinematics
    for name in ("acceleration_m_per_s2", "omega_rad_per_s", "alpha_rad_per_s2"):
        own, true = (motion.in_head_axes(getattr(motion, name)) for motion in (k, truth))
        assert np.abs(own - true).max() < 0.02 * np.abs(true).max()


HEADFORM = """name: headform
source:
  kind: wearable
  columns:
    time: {name: Time (s), unit: s}
    acceleration: {names: [Acc (g) X, Acc (g) Y, Acc (g) Z], unit: g}
    angular_velocity: {names: [Rate (rad/s) X, Rate (rad/s) Y, Rate (rad/s) Z], unit: rad/s}
    angular_acceleration: {names: [AngAcc X, AngAcc Y, AngAcc Z], unit: rad/s^2}
  axes: sae_j211
  sensor_to_cg_m: [0, 0, 0]
  filter: {kind: cfc, channel_class: 1000}
"""


def test_gravity_is_taken_out_where_the_play_says_it_is_in(wearable):
    at_rest = ["time_ms,ax_g,ay_g,az_g,wx_deg_per_s,wy_deg_per_s,wz_deg_per_s"]
    at_rest += [f"{i},0,0,-1,0,0,0" for i in range(60)]  # SAE: z points down, a head at rest reads 1 g upward
    (wearable / "wearable.csv").write_text("\n".join(at_rest) + "\n")
    path = wearable / "play.yaml"
    path.write_text(
        path.read_text()
        .replace("gravity: removed", "gravity: included")
        .replace("[0.074773, -0.001055, -0.853344, 0.515957]", "[0, 0, 0, 1]")
    )
    k = reconstruct(load_play(wearable)).kinematics
    assert np.abs(k.acceleration_m_per_s2).max() < 1e-9


def test_clipping_and_the_range_that_was_used_are_reported(wearable):
    path = wearable / "wearable.csv"
    values = reconstruct(load_play(wearable)).quality.gate_values()
    assert values["saturated_samples"] == 0
    assert 0.1 < values["range_used"] < 0.95
    table = pd.read_csv(path)
    table["ay_g"] = table["ay_g"].clip(-30.0, 30.0)
    table.to_csv(path, index=False)
    assert reconstruct(load_play(wearable)).quality.gate_values()["saturated_samples"] >= 3


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("time_ms,ax_g", "time_ms,bx_g", ["wearable.csv:1", "column ax_g is missing"]),
        ("\n5,", "\n5.5,", ["wearable.csv:7: time_ms", "uneven"]),
        ("\n5,", "\n4,", ["wearable.csv:7: time_ms", "stands still or runs back"]),
        ("\n5,", "\n5,x", ["wearable.csv:7: ax_g", "is not a number"]),
        ("\n0,-0.5048", "\n0,-1e308", ["wearable.csv:2: ax_g", "reaches inf m/s^2, which no head survives"]),
    ],
)
def test_bad_tables_are_named_by_line(wearable, old, new, expected):
    path = wearable / "wearable.csv"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    text = message(wearable)
    for part in expected:
        assert part in text


def test_a_dropped_sample_is_not_bridged_silently(wearable):
    path = wearable / "wearable.csv"
    rows = path.read_text().split("\n")
    path.write_text("\n".join(rows[:40] + rows[41:]))
    text = message(wearable)
    assert "wearable.csv:41" in text
    assert "uneven" in text


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("unit: deg/s", "unit: rad/s", "check source.columns.angular_velocity.unit (now rad/s)"),
        ("[ax_g, ay_g, az_g]", "[ax_g, ax_g, az_g]", "column 'ax_g' is named twice"),
    ],
)
def test_a_wrong_unit_or_a_column_named_twice_is_told(wearable, old, new, expected):
    path = wearable / "play.yaml"
    path.write_text(path.read_text().replace(old, new, 1))
    assert expected in message(wearable)


PLAY = """name: impact
source:
  kind: wearable
  kinematics: {file}
  columns:
    time: {{name: time_ms, unit: ms}}
    acceleration: {{names: [lin_acc_x_g, lin_acc_y_g, lin_acc_z_g], unit: g}}
    angular_velocity: {{names: [ang_vel_x_rad_s, ang_vel_y_rad_s, ang_vel_z_rad_s], unit: rad/s}}
  axes: head
  sensor_to_cg_m: [0, 0, 0]
  filter: {{kind: none}}
"""


@pytest.mark.shared
@pytest.mark.parametrize("number", [1, 2, 3])
def test_measured_impacts_keep_their_peaks(shared, tmp_path, number):
    source = shared / "real" / "mouthguard" / f"impact_{number}.csv"
    folder = tmp_path / "impact"
    folder.mkdir()
    shutil.copy(source, folder)
    (folder / "play.yaml").write_text(PLAY.format(file=source.name))
    result = reconstruct(load_play(folder))
    table, k = pd.read_csv(source), result.kinematics
    a = np.linalg.norm(table[[f"lin_acc_{c}_g" for c in "xyz"]], axis=1) * STANDARD_GRAVITY
    omega = np.linalg.norm(table[[f"ang_vel_{c}_rad_s" for c in "xyz"]], axis=1)
    assert k.linear_resultant == pytest.approx(a, rel=1e-9)
    assert k.omega_resultant == pytest.approx(omega, rel=1e-9)
    assert 0.080 < result.t0_s < 0.125
    for values in k.columns().values():
        assert np.isfinite(values).all()
    driver = build_driver(k, result.t0_s, Window())
    assert driver.quality.overshoot_acceleration_percent < 1.0
    inside = (k.time_s >= driver.start_s) & (k.time_s <= driver.start_s + 0.030)
    assert driver.motion.linear_resultant.max() == pytest.approx(a[inside].max(), rel=0.02)


def test_a_motion_read_from_its_file_is_worn_by_a_headform_without_loss(tmp_path):
    time = np.arange(301) * 1e-4
    turn = Rotation.from_rotvec(np.outer(20.0 * time, [0.0, 0.0, 1.0]))
    pushed = np.tile([300.0, 0.0, 0.0], (len(time), 1))
    spin = np.tile([0.0, 0.0, 20.0], (len(time), 1))
    still = np.zeros((len(time), 3))
    Kinematics(time, still, turn, still, pushed, spin, still).write(tmp_path / "head_motion.csv")
    text = headform_record(Kinematics.read(tmp_path / "head_motion.csv"), seed=1)
    table = np.array([line.split(",") for line in text.splitlines()[1:]], float)
    assert table[:200, 1:4].std() < 0.5, "the head goes on as it begins before the motion"
    expected = turn.inv().apply(pushed) / 9.80665
    assert np.abs(table[200:, 1:4] - expected).max() < 6 * 0.3
    assert np.abs(table[200:, 6] - np.degrees(20.0)).max() < 6 * 3.0
