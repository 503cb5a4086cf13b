"""Recorders: what they gather is right, resumes bit for bit, and is written the same twice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pytest

from replay.errors import InputError
from replay.measures import BrainRecorder, ShakeRecorder, read_snapshots, regional_summary, shake_measures
from replay.measures.brain import HISTORY_TABLE, PEAK_TABLE
from replay.measures.shake import SHAKE_TABLE


@dataclass
class View:
    """A state as the solver shows it."""

    time_s: float
    stress: np.ndarray
    volumes: np.ndarray
    gradient: np.ndarray | None = None
    coordinates: np.ndarray | None = None
    velocities: np.ndarray | None = None

    def deformation_gradient(self) -> np.ndarray:
        assert self.gradient is not None
        return self.gradient


ELEMENTS = 30
ROWS = np.arange(5, 25)
GROUPS = {"left": np.arange(0, 10), "right": np.arange(10, 20), "nowhere": np.zeros(0, dtype=int)}


def brain_view(k: int) -> View:
    rng = np.random.default_rng(k)
    return View(
        time_s=k * 1e-4,
        stress=rng.normal(0, 1e4, (ELEMENTS, 6)),
        volumes=np.linspace(1e-9, 4e-9, ELEMENTS) * (1 + 1e-3 * k),
        gradient=np.eye(3) + rng.normal(0, 0.05, (ELEMENTS, 3, 3)),
    )


def brain_recorder() -> BrainRecorder:
    return BrainRecorder(ROWS, 1000 + ROWS, GROUPS)


def files(folder) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_resumed_brain_recorder_writes_the_same_bytes(tmp_path):
    straight = brain_recorder()
    for k in range(25):
        straight.sample(brain_view(k))
    straight.write(tmp_path / "straight")

    first = brain_recorder()
    for k in range(12):
        first.sample(brain_view(k))
    stored = {name: array.copy() for name, array in first.state().items()}
    first.sample(brain_view(99))
    second = brain_recorder()
    second.restore(stored)
    for k in range(12, 25):
        second.sample(brain_view(k))
    second.write(tmp_path / "resumed")

    assert files(tmp_path / "resumed") == files(tmp_path / "straight")
    assert set(files(tmp_path / "straight")) == {"brain_histories.csv", "element_peaks.csv", "brain_snapshots.h5"}


def test_recorder_stopped_before_its_first_sample_resumes(tmp_path):
    empty = brain_recorder().state()
    recorder = brain_recorder()
    recorder.restore(empty)
    recorder.sample(brain_view(0))
    recorder.write(tmp_path)
    assert len(HISTORY_TABLE.read(tmp_path / "brain_histories.csv")) == 3


def test_state_of_another_brain_is_refused():
    other = BrainRecorder(np.arange(3), np.arange(3), {})
    with pytest.raises(ValueError, match="the state holds 3 elements, this brain has 20"):
        brain_recorder().restore(other.state())


def test_peaks_are_of_each_element_over_time(tmp_path):
    recorder = brain_recorder()
    strains = []
    for k in range(8):
        view = brain_view(k)
        recorder.sample(view)
        c = np.swapaxes(view.gradient, 1, 2) @ view.gradient
        strains.append(0.5 * (np.linalg.eigvalsh(c)[ROWS, 2] - 1))
    recorder.write(tmp_path)
    table = PEAK_TABLE.read(tmp_path / "element_peaks.csv")
    assert table["element_id"].tolist() == (1000 + ROWS).tolist()
    assert table["mps_green_lagrange"].to_numpy() == pytest.approx(np.max(strains, axis=0), rel=1e-12)
    assert table["mps_green_lagrange_time_s"].to_numpy() == pytest.approx(1e-4 * np.argmax(strains, axis=0))
    assert table["volume_m3"].to_numpy() == pytest.approx(brain_view(0).volumes[ROWS])


def test_regions_are_recorded_apart_and_an_empty_one_is_left_out(tmp_path):
    recorder = brain_recorder()
    view = brain_view(0)
    view.gradient = np.tile(np.eye(3), (ELEMENTS, 1, 1))
    view.gradient[ROWS[10:], 0, 1] = 0.4
    recorder.sample(view)
    recorder.write(tmp_path)
    table = HISTORY_TABLE.read(tmp_path / "brain_histories.csv").set_index("region")
    assert list(table.index) == ["brain", "left", "right"]
    assert table.loc["left", "mps_green_lagrange_max"] == pytest.approx(0.0, abs=1e-12)
    assert table.loc["right", "mps_green_lagrange_p95"] == pytest.approx(0.2439608, abs=5e-8)
    assert table.loc["right", "mps_log_p50"] == pytest.approx(0.1986901, abs=5e-8)
    assert table.loc["right", "csdm15"] == 1.0
    assert table.loc["brain", "csdm15"] == pytest.approx(view.volumes[15:25].sum() / view.volumes[5:25].sum())
    assert table.loc["right", "csdm25"] == 0.0


def test_csdm_keeps_what_has_been_reached(tmp_path):
    recorder = brain_recorder()
    for k, shear in enumerate((0.0, 0.6, 0.0)):
        view = brain_view(0)
        view.time_s = k * 1e-4
        view.gradient = np.tile(np.eye(3), (ELEMENTS, 1, 1))
        view.gradient[:, 0, 1] = shear
        recorder.sample(view)
    recorder.write(tmp_path)
    brain = HISTORY_TABLE.read(tmp_path / "brain_histories.csv").query("region == 'brain'")
    assert brain["csdm25"].tolist() == [0.0, 1.0, 1.0]


def test_snapshots_are_kept_every_interval(tmp_path):
    recorder = brain_recorder()
    for k in range(31):
        recorder.sample(brain_view(k))
    recorder.write(tmp_path)
    times, ids, strain = read_snapshots(tmp_path / "brain_snapshots.h5")
    assert times == pytest.approx([0, 1e-3, 2e-3, 3e-3])
    assert ids.tolist() == (1000 + ROWS).tolist()
    assert strain.shape == (4, 20)


def test_file_that_holds_no_snapshots_is_refused(tmp_path):
    (tmp_path / "x.h5").write_text("not HDF5")
    with pytest.raises(InputError, match="is not a file of brain snapshots"):
        read_snapshots(tmp_path / "x.h5")


def test_summary_is_the_peak_over_time_and_none_where_nothing_is_known():
    rows = {name: [0.0, 0.2, 0.1, np.nan] for name in HISTORY_TABLE.names[3:]}
    table = pd.DataFrame({"time_s": [0, 1, 2, 3], "region": ["a"] * 3 + ["b"], "volume_m3": [1e-6] * 4} | rows)
    summary = regional_summary(table)
    assert summary["a"]["mps_green_lagrange_p95"] == 0.2
    assert summary["a"]["mps_green_lagrange_p95_time_s"] == 1.0
    assert summary["b"]["mps_green_lagrange_p95"] is None


def test_brain_without_elements_is_refused():
    with pytest.raises(ValueError, match="0 rows"):
        BrainRecorder([], [], {})


CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)
TWO_CUBES = np.vstack([CUBE, CUBE + np.array([5.0, 0, 0])]) * 0.01


def shake_recorder() -> ShakeRecorder:
    hexes = np.arange(16).reshape(2, 8)
    return ShakeRecorder(hexes, TWO_CUBES, [0, 1], ["shell", "pad"], [1500.0, 80.0], [1600.0, 350.0], [0.4, 0, 0])


def shake_view(time_s: float = 0.0) -> View:
    return View(
        time_s=time_s,
        stress=np.zeros((2, 6)),
        volumes=np.full(2, 1e-6),
        coordinates=TWO_CUBES + np.array([0.4 * time_s, 0, 0]),
        velocities=np.tile([0.4, 0.0, 0.0], (16, 1)),
    )


def shake_table(views, tmp_path) -> pd.DataFrame:
    recorder = shake_recorder()
    for view in views:
        recorder.sample(view)
    recorder.write(tmp_path)
    return SHAKE_TABLE.read(tmp_path / "shake.csv")


def test_free_flight_shows_nothing(tmp_path):
    found = shake_measures(shake_table([shake_view(k * 1e-4) for k in range(10)], tmp_path))
    assert found["edge_stretch_max"] == pytest.approx(1.0, abs=1e-12)
    assert found["part_velocity_deviation"] == pytest.approx(0.0, abs=1e-12)
    assert found["stress_over_impact_stress"] == found["stress_growth"] == 0.0
    assert found["negative_volumes"] == 0


def test_launched_part_spiking_element_and_negative_volume_are_seen(tmp_path):
    views = [shake_view(k * 1e-4) for k in range(9)]
    views[4].velocities[8:, 1] = 0.1
    views[6].coordinates[3] += [0, 0.006, 0]
    views[7].volumes[1] = -1e-9
    found = shake_measures(shake_table(views, tmp_path))
    assert found["part_velocity_deviation"] == pytest.approx(0.25)
    assert found["part_velocity_deviation_detail"] == "pad at 0.4 ms"
    assert found["edge_stretch_max"] == pytest.approx(1.6)
    assert found["negative_volumes"] == 1


def test_stress_is_measured_by_the_parts_own_impedance_and_its_growth_is_seen(tmp_path):
    views = [shake_view(k * 1e-4) for k in range(9)]
    for k, view in enumerate(views):
        view.stress[1, 0] = 80 * 350 * 0.4 * 0.05 * 2**k / 2**5
    found = shake_measures(shake_table(views, tmp_path))
    assert found["stress_over_impact_stress"] == pytest.approx(0.4)
    assert found["stress_growth"] == pytest.approx(8.0)


def test_rounding_noise_does_not_grow(tmp_path):
    views = [shake_view(k * 1e-4) for k in range(9)]
    for k, view in enumerate(views):
        view.stress[0, 0] = 1e-9 * 10**k
    assert shake_measures(shake_table(views, tmp_path))["stress_growth"] < 1e-3


def test_few_samples_cannot_show_a_growth(tmp_path):
    assert shake_measures(shake_table([shake_view()], tmp_path))["stress_growth"] == "1 samples cannot show a growth"


def test_resumed_shake_recorder_writes_the_same_bytes(tmp_path):
    straight, resumed = shake_recorder(), shake_recorder()
    first = shake_recorder()
    for k in range(6):
        straight.sample(shake_view(k * 1e-4))
        if k < 3:
            first.sample(shake_view(k * 1e-4))
    resumed.restore(first.state())
    for k in range(3, 6):
        resumed.sample(shake_view(k * 1e-4))
    straight.write(tmp_path / "a")
    resumed.write(tmp_path / "b")
    assert files(tmp_path / "a") == files(tmp_path / "b")
