"""The suite behind the second table of docs/accuracy.md: one clip through it, and a row from it."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def suite(repository):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(repository / "benchmarks"))
        yield __import__("accuracy_suite")


@pytest.fixture(scope="module")
def row(suite):
    clip = suite.film(suite.CELLS["base"].footage, "half_sine", 1)
    again = suite.film(suite.CELLS["base"].footage, "half_sine", 1)
    assert np.array_equal(clip.tracks.pixels, again.tracks.pixels)
    return {"family": "half_sine", "seed": 1, **suite.measure(clip, *suite.both_modes(clip))}


def test_both_modes_are_measured_against_the_truth(row):
    assert row["rmse"] < row["protocol_rmse"]
    assert abs(np.exp(row["spread"]["omega_rad_per_s"][0]) / row["truth"]["omega_rad_per_s"] - 1.0) < 0.3
    assert abs(row["spread"]["t0_s"][0] - row["truth"]["t0_s"]) < 0.008
    assert not row["flipped"]


def test_a_row_of_the_table_has_as_many_cells_as_its_heading(suite, row):
    cells = suite.line(suite.CELLS["base"], [row] * 5).count("|")
    assert cells == suite.HEADER.splitlines()[0].count("|") == suite.HEADER.splitlines()[1].count("|")
    assert suite.line(suite.CELLS["null"], [row] * 5).count("|") == cells


def test_hidden_landmarks_leave_three_in_every_frame(suite):
    clip = suite.film(suite.CELLS["occluded"].footage, "half_sine", 2)
    seen = clip.tracks.seen
    assert 0.10 < 1.0 - seen.mean() < 0.25
    assert seen.sum(axis=1).min() >= 3


def test_cells_differ_and_change_one_thing_at_a_time(suite):
    footages = [(cell.footage, cell.quiet) for cell in suite.CELLS.values()]
    assert len(set(footages)) == len(footages)
