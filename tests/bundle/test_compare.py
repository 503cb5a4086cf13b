"""Comparing: exact to the byte, tolerance by the number, volatile not at all."""

from __future__ import annotations

import io
import json
import math
import shutil
import zipfile

import h5py
import numpy as np
import pytest

from replay.bundle import compare, seal
from replay.bundle.numbers import worst
from replay.bundle.units import unit_of
from replay.errors import BundleError, InputError
from replay.manifest import Artifact, write_manifest

from .conftest import fabricate, fabricate_source


def by_path(comparison) -> dict:
    return {d.path: d for d in comparison.differences}


def test_two_equal_runs_are_identical_whatever_their_logs(tmp_path, sealed):
    result = compare(sealed(), sealed(log=b"took half an hour\n"))
    assert result.agree
    assert result.identical
    assert by_path(result)["results/replay/run.log"].outcome == "not compared"
    assert by_path(result)["results/driver/driver_6dof.csv"].outcome == "same"
    assert "README.md" in by_path(result)
    assert result.text() == "the runs agree: exact 33 same; tolerance 1 same; volatile 2 not compared"


def test_a_difference_within_tolerance_agrees_but_is_not_identical(sealed):
    result = compare(sealed(), sealed(shift=1e-10))
    assert result.agree
    assert not result.identical
    histories = by_path(result)["results/replay/histories.csv"]
    assert histories.outcome == "within"
    assert histories.worst.where == "line 5, x_m"
    assert by_path(result)["results/replay/manifest.json"].outcome == "within"


def test_a_difference_beyond_tolerance_is_named_with_its_unit(sealed):
    result = compare(sealed(), sealed(shift=1e-3))
    assert not result.agree
    worst_one = result.differences[0]
    assert (worst_one.path, worst_one.outcome) == ("results/replay/histories.csv", "differs")
    assert worst_one.worst.absolute == pytest.approx(1e-3)
    assert "worst at line 5, x_m: " in result.text()
    assert "(by 0.001 m, relative" in result.text()


def test_an_exact_artifact_may_not_differ_in_one_byte(tmp_path, sealed, source_root):
    results = fabricate(tmp_path)
    (results / "driver/driver_6dof.csv").write_text("time_s,x_m\n0.0,1.00\n")
    write_manifest(
        results / "driver", stage="driver", play="demo", artifacts=[Artifact.exact("driver_6dof.csv", "driver")]
    )
    seal(results, tmp_path / "demo.zip", source_root=source_root)
    result = compare(sealed(), tmp_path / "demo.zip")
    assert by_path(result)["results/driver/driver_6dof.csv"].outcome == "differs"
    assert not result.agree


def test_the_first_artifact_to_differ_is_the_one_where_the_runs_parted(tmp_path, sealed, source_root):
    """Not the first by name (a deck) nor the one that is farthest off (a history), but the earliest in the workflow."""
    results = fabricate(tmp_path, shift=1e3)
    for stage, name, reads in (
        ("driver", "driver_6dof.csv", "reconstruction/kinematics.csv"),
        ("decks", "a.csv", "driver/driver_6dof.csv"),
    ):
        (results / stage / name).write_text("time_s,ax_m_per_s2\n0.0,1.25\n")
        inputs = {reads: results / reads}
        write_manifest(results / stage, stage=stage, play="demo", artifacts=[Artifact.exact(name, "x")], inputs=inputs)
    seal(results, tmp_path / "demo.zip", source_root=source_root)
    result = compare(sealed(), tmp_path / "demo.zip")
    assert result.first.path == "results/driver/driver_6dof.csv"
    assert (
        "first to differ, in the order of the workflow:\n  results/driver/driver_6dof.csv (exact): differs"
        in result.text()
    )
    assert by_path(result)["results/replay/histories.csv"].worst.absolute == pytest.approx(1e3)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("line 5, alpha_x_rad_per_s2", "rad/s^2"),
        ("line 5, x_m", "m"),
        ("line 5, time_s", "s"),
        ("solver.plot_interval_s", "s"),
        ("nodes/coordinates_m[3, 1]", "m"),
        ("momentum_x_N_s", "N s"),
        ("inertia_kg_m2", "kg m^2"),
        ("checks[3].rmse_percent_of_peak", ""),
        ("delta_peak_percent", "%"),
        ("rate_hz", "Hz"),
        ("solver.time_step_factor", ""),
        ("m", ""),
        ("frames_per_s", ""),
    ],
)
def test_a_difference_carries_the_unit_of_its_name(name, unit):
    assert unit_of(name) == unit


def test_another_source_is_told_but_what_it_made_is_compared(tmp_path, sealed):
    source = fabricate_source(tmp_path / "source")
    (source / "src/replay/__init__.py").write_text('__version__ = "0.1.1"\n')
    seal(fabricate(tmp_path), tmp_path / "demo.zip", source_root=source)
    result = compare(sealed(), tmp_path / "demo.zip")
    assert result.identical
    assert "made with different source" in result.text()
    assert "different source" not in compare(sealed(), sealed()).text()


def test_folders_unpacked_bundles_and_archives_compare_with_one_another(tmp_path, sealed):
    results = fabricate(tmp_path)
    with zipfile.ZipFile(sealed()) as archive:
        archive.extractall(tmp_path)
    for other in (sealed(), tmp_path / "demo"):
        for pair in ((results, other), (other, results)):
            result = compare(*pair)
            assert result.identical
            assert all(d.path.startswith("results/") for d in result.differences)
    assert compare(sealed(), tmp_path / "demo").identical


def test_what_one_run_lacks_is_named(tmp_path, sealed):
    results = fabricate(tmp_path)
    shutil.rmtree(results / "decks")
    assert {d.path for d in compare(sealed(), results).differences if d.outcome == "missing"} == {
        "results/decks/manifest.json",
        "results/decks/velodyne/velodyne.card",
    }
    assert compare(results, sealed()).count("extra") == 2


def test_what_is_no_run_is_refused(tmp_path, sealed):
    with pytest.raises(BundleError, match="does not exist"):
        compare(sealed(), tmp_path / "none.zip")
    (tmp_path / "demo").mkdir()
    with pytest.raises(InputError, match="no stage has finished"):
        compare(tmp_path / "demo", sealed())


def apart(path: str, old: bytes, new: bytes, rtol: float = 0.0, atol: float = 0.0):
    return worst(path, io.BytesIO(old), io.BytesIO(new), rtol, atol)


def hdf(**datasets: np.ndarray) -> bytes:
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        for name, values in datasets.items():
            file[f"group/{name}"] = values
    return stream.getvalue()


def test_the_worst_entry_is_the_one_farthest_beyond_its_tolerance():
    found = apart("a.csv", b"t,x\n0,100\n1,1\n", b"t,x\n0,101\n1,1.5\n", rtol=0.1)
    assert (found.where, found.old, found.new, found.within) == ("line 3, x", "1.0", "1.5", False)
    assert (found.absolute, found.relative) == (0.5, 0.5)
    assert apart("a.csv", b"t,x\n0,100\n", b"t,x\n0,101\n", rtol=0.1).within
    assert not apart("a.csv", b"t,x\n0,100\n", b"t,x\n0,101\n", atol=0.99).within


@pytest.mark.parametrize(
    ("path", "old", "new", "where"),
    [
        ("a.csv", b"t,x\n0,1\n", b"t,x\n0,1\n1,2\n", "line 3, t"),
        ("a.csv", b"t,x\n0,a\n", b"t,x\n0,b\n", "line 2, x"),
        ("a.csv", b"t,x\n0,nan\n", b"t,x\n0,1\n", "line 2, x"),
        ("a.csv", b"t,x\n0,1\n", b"t,y\n0,1\n", "line 2, x"),
        ("a.json", b'{"a": {"b": [1, 2]}}', b'{"a": {"b": [1, 3]}}', "a.b[1]"),
        ("a.json", b'{"a": 1}', b'{"a": null}', "a"),
        ("a.json", b"{}", b"hello", "the file"),
    ],
)
def test_what_is_no_number_or_not_on_both_sides_is_never_within(path, old, new, where):
    found = apart(path, old, new, rtol=1e-3, atol=1e-3)
    assert found.where == where
    assert not found.within


def test_arrays_are_compared_entry_by_entry():
    values = np.arange(12.0).reshape(4, 3)
    other = values.copy()
    other[2, 1] += 0.25
    found = apart("a.h5", hdf(x=values), hdf(x=other), atol=0.3)
    assert (found.where, found.absolute, found.within) == ("group/x[2, 1]", 0.25, True)
    assert apart("a.h5", hdf(x=values), hdf(x=values)) is None
    shape = apart("a.vtkhdf", hdf(x=values), hdf(x=values[:2]), atol=9.0)
    assert not shape.within
    assert math.isnan(shape.absolute)
    missing = apart("a.h5", hdf(x=values), hdf(y=values))
    assert (missing.where, missing.old, missing.new) == ("group/x", "there", "missing")


def test_large_datasets_are_compared_block_by_block_and_the_index_is_that_of_the_whole(monkeypatch):
    monkeypatch.setattr("replay.bundle.numbers._BLOCK_VALUES", 30)
    values = np.arange(300.0).reshape(100, 3)
    other = values.copy()
    other[77, 2] += 0.5
    other[13, 0] += 0.25
    found = apart("a.h5", hdf(x=values), hdf(x=other))
    assert (found.where, found.absolute) == ("group/x[77, 2]", 0.5)
    assert apart("a.h5", hdf(x=np.empty((0, 3))), hdf(x=np.empty((0, 3)))) is None
    assert apart("a.h5", hdf(x=np.float64(1.0)), hdf(x=np.float64(2.0))).where == "group/x"


def test_of_an_exact_table_the_worst_entry_is_the_one_farthest_off_beside_its_column():
    """Not the first to differ, nor the greatest number: a pressure of 1e5 Pa that moves by 1 has hardly moved."""
    old = b"time_s,p_Pa,x_m\n0,100000,0.001\n1,100000,0.002\n"
    new = b"time_s,p_Pa,x_m\n0,100001,0.001\n1,100000,0.003\n"
    assert apart("a.csv", old, new).where == "line 3, x_m"
    assert apart(
        "a.h5", hdf(p=np.full(3, 1e5), x=np.ones(3)), hdf(p=np.full(3, 1e5) + 1, x=np.ones(3) + 0.1)
    ).where == ("group/x[0]")


def test_texts_beside_numbers_are_compared_too():
    names = np.array([b"brain", b"skull"])
    assert apart("a.h5", hdf(n=names, x=np.ones(2)), hdf(n=names, x=np.ones(2))) is None
    assert apart("a.h5", hdf(n=names), hdf(n=names[::-1])).where == "group/n"
    assert apart("a.csv", b"part,x\nbrain,1\n", b"part,x\nskull,1\n").where == "line 2, part"


def test_the_order_of_keys_is_part_of_a_json_file():
    found = apart("a.json", json.dumps({"a": 1, "b": 2}).encode(), json.dumps({"b": 2, "a": 1}).encode())
    assert found.where == "(keys)"
