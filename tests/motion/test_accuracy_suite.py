"""The suite behind the second table of docs/accuracy.md: one clip through it, and a row from it."""

import json
from dataclasses import replace

import numpy as np
import pytest


@pytest.fixture(scope="module")
def suite(repository):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(repository / "benchmarks"))
        yield __import__("accuracy_suite")


@pytest.fixture(scope="module")
def measured(suite):
    return __import__("measured")


@pytest.fixture(scope="module")
def row(suite, measured):
    clip, again = (suite.clip_of(suite.BASE, "half_sine", 2) for _ in range(2))
    assert np.array_equal(clip.footage.tracks.pixels, again.footage.tracks.pixels)
    return {"family": "half_sine", "seed": 2, **measured.measure(clip, *measured.both_modes(clip))}


def test_both_modes_are_measured_against_the_truth(row):
    assert row["rmse"] < row["protocol_rmse"]
    assert row["draws"]["omega_rad_per_s"][3] == pytest.approx(row["truth"]["omega_rad_per_s"], rel=0.3)
    assert abs(row["draws"]["t0_s"][3] - row["truth"]["t0_s"]) < 0.012
    assert row["truth"]["onset_s"] < row["truth"]["t0_s"]
    assert not row["flipped"]


def test_what_is_kept_gives_the_bands_of_the_reconstruction(suite, measured, row):
    clip = suite.clip_of(suite.BASE, "half_sine", 2)
    _, posterior = measured.both_modes(clip)
    from replay.motion.side_by_side import posterior_quality

    bands = posterior_quality(posterior, clip.footage.tracks, clip.settings).bands
    kept = json.loads(json.dumps(row))
    for name, band in bands.items():
        again = measured.kept_band(name, kept)
        assert again.ends == pytest.approx(band.ends, rel=1e-3)
        assert again.resolved == band.resolved


def test_a_row_of_the_table_has_as_many_cells_as_its_heading(suite, row):
    cells = suite.line(suite.CELLS["base"], [row] * 5).count("|")
    assert cells == suite.HEADER.splitlines()[0].count("|") == suite.HEADER.splitlines()[1].count("|")
    assert suite.line(suite.CELLS["null"], [row] * 5).count("|") == cells
    assert {line.count("|") for line in suite.by_family([row, row]).splitlines()} == {8}


def test_rows_of_another_estimator_are_filmed_again(measured, row, tmp_path):
    file = tmp_path / "cell.jsonl"
    kept = [{**row, "estimator": made_by} for made_by in (measured.estimator(), "0" * 12)]
    file.write_text("".join(json.dumps(one) + "\n" for one in kept))
    assert [one["estimator"] for one in measured.rows_of(file)] == [measured.estimator()]


def test_a_mirror_image_that_the_margin_calls_sure_is_counted(suite, row):
    mirrored = {**row, "flipped": True, "flip_margin": suite.DECIDED_FLIP + 1.0}
    told = suite.flips({"three": [row, mirrored], "base": [row] * 3})
    assert "three landmarks, 2 clips: protocol mode holds the mirror image in 0, posterior mode in 1" in told
    assert "above it in 1 of those that are flipped. With four or more, 3 clips" in told


def test_cells_differ_and_change_one_thing_at_a_time(suite):
    views = [(cell.view, cell.quiet) for cell in suite.CELLS.values()]
    assert len(set(views)) == len(views)
    assert suite.CELLS["noisy"].view == replace(suite.BASE, sigma_px=2.7)


def test_calibration_and_test_share_neither_family_nor_seed(suite):
    calibration = __import__("calibrate_bands")
    assert {calibration.filmed(seed)[0] for seed in range(4)} == set(calibration.BUILDING)
    assert not {suite.CELLS["base"].filmed(seed)[0] for seed in range(3)} & set(calibration.BUILDING)
