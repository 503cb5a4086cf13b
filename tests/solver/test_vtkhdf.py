"""States over time: any interruption leaves the same bytes, and other programs read them."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import h5py
import numpy as np
import pytest

from replay.errors import InputError, ReplayError, ResumeError
from replay.solver.vtkhdf import StatesWriter, read_states

NODES = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1, 2)], float) * 0.01
HEXES = np.array([[0, 1, 4, 3, 6, 7, 10, 9], [1, 2, 5, 4, 7, 8, 11, 10]])
POINT, CELL = {"displacement_m": 3}, {"von_mises_Pa": 1, "stress_Pa": 6}


def writer(folder: Path, *, resume: bool = False, nodes: np.ndarray = NODES) -> StatesWriter:
    ids = np.arange(12) + 101
    return StatesWriter(folder / "states.vtkhdf", nodes, HEXES, ids, [7, 9], [1, 4], POINT, CELL, resume=resume)


def state(index: int) -> tuple[float, dict[str, np.ndarray]]:
    values = np.random.default_rng(index)
    return index * 1e-3, {
        "displacement_m": values.normal(size=(12, 3)),
        "von_mises_Pa": values.normal(size=2) * 1e5,
        "stress_Pa": values.normal(size=(2, 6)),
    }


def complete(folder: Path, count: int = 5) -> Path:
    with writer(folder) as states:
        for index in range(count):
            states.append(*state(index))
    return folder / "states.vtkhdf"


def test_states_come_back_as_written(tmp_path):
    complete(tmp_path)
    with read_states(tmp_path / "states.vtkhdf") as states:
        assert len(states) == 5
        np.testing.assert_array_equal(states.times_s, np.arange(5) * 1e-3)
        np.testing.assert_array_equal(states.nodes, NODES)
        np.testing.assert_array_equal(states.hexes, HEXES)
        np.testing.assert_array_equal(states.node_ids, np.arange(12) + 101)
        np.testing.assert_array_equal(states.element_ids, [7, 9])
        np.testing.assert_array_equal(states.element_pid, [1, 4])
        assert states.point_fields == POINT
        assert states.cell_fields == CELL
        for index in range(5):
            for name, values in state(index)[1].items():
                np.testing.assert_array_equal(states.field(name, index), values.astype("f4"))
        np.testing.assert_array_equal(states.field("von_mises_Pa", -1), states.field("von_mises_Pa", 4))
        with pytest.raises(InputError, match=r"no field 'damage'[\s\S]*displacement_m"):
            states.field("damage", 0)
        with pytest.raises(IndexError):
            states.field("von_mises_Pa", 5)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["states.vtkhdf", "states.xdmf"]


def test_bytes_do_not_depend_on_the_clock(tmp_path):
    first = complete(tmp_path / "a")
    time.sleep(1.1)  # HDF5 time stamps, were there any, count whole seconds
    second = complete(tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()
    assert first.with_suffix(".xdmf").read_bytes() == second.with_suffix(".xdmf").read_bytes()


def test_killed_and_resumed_run_leaves_the_same_bytes(tmp_path):
    straight = complete(tmp_path / "straight").read_bytes()
    folder = tmp_path / "killed"
    program = (
        "import os, sys, time; from pathlib import Path; sys.path.insert(0, sys.argv[1])\n"
        "from test_vtkhdf import writer, state\n"
        "w = writer(Path(sys.argv[2]))\n"
        "for k in range(4): w.append(*state(k))\n"
        "print('ready', flush=True); time.sleep(60)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program, str(Path(__file__).parent), str(folder)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    with (folder / "states.partial").open("ab") as stream:
        stream.write(b"half a record")
    with writer(folder, resume=True) as states:
        assert states.n_states == 4
        states.rewind(2)
        for index in range(2, 5):
            states.append(*state(index))
    assert (folder / "states.vtkhdf").read_bytes() == straight
    assert not (folder / "states.partial").exists()


def test_rewinding_in_place_forgets_the_later_states(tmp_path):
    straight = complete(tmp_path / "straight").read_bytes()
    with writer(tmp_path / "again") as states:
        for index in (0, 1, 8, 9):
            states.append(*state(index))
        states.sync()
        states.rewind(2)
        for index in range(2, 5):
            states.append(*state(index))
    assert (tmp_path / "again/states.vtkhdf").read_bytes() == straight


def test_an_error_while_writing_keeps_the_growing_file_for_resuming(tmp_path):
    def interrupted() -> None:
        with writer(tmp_path) as states:
            states.append(*state(0))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [p.name for p in tmp_path.iterdir()] == ["states.partial"]


def test_resuming_refuses_what_it_cannot_continue(tmp_path):
    with pytest.raises(ResumeError, match=r"are gone[\s\S]*mend"):
        writer(tmp_path, resume=True)
    states = writer(tmp_path)
    for index in range(3):
        states.append(*state(index))
    states.abandon()
    with pytest.raises(ResumeError, match="another mesh"):
        writer(tmp_path, resume=True, nodes=NODES * 2)
    states = writer(tmp_path, resume=True)
    with pytest.raises(ResumeError, match="holds 3 whole states where the checkpoint counts 4"):
        states.rewind(4)
    states.abandon()
    data = bytearray((tmp_path / "states.partial").read_bytes())
    data[-20] ^= 1
    (tmp_path / "states.partial").write_bytes(data)
    states = writer(tmp_path, resume=True)
    with pytest.raises(ResumeError, match="state 2 is damaged"):
        states.rewind(3)
    states.rewind(2)
    states.abandon()


def test_a_run_without_states_still_closes(tmp_path):
    with read_states(complete(tmp_path, count=0)) as states:
        assert len(states) == 0


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("von_mises_Pa", np.zeros(3), r"von_mises_Pa has shape \(3,\)"),
        ("displacement_m", np.zeros((3, 12)), r"displacement_m has shape \(3, 12\)"),
        ("unknown", np.zeros(2), "declared"),
    ],
)
def test_fields_of_the_wrong_shape_are_refused(tmp_path, name, value, complaint):
    states = writer(tmp_path)
    with pytest.raises(ValueError, match=complaint):
        states.append(0.0, {**state(0)[1], name: value})
    states.abandon()


def test_a_foreign_file_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_states(tmp_path / "none.vtkhdf")
    (tmp_path / "text.vtkhdf").write_text("hello")
    with pytest.raises(InputError, match="not an HDF5 file"):
        read_states(tmp_path / "text.vtkhdf")
    with h5py.File(tmp_path / "other.vtkhdf", "w") as file:
        file.create_group("VTKHDF")
    with pytest.raises(InputError, match="expected: a VTKHDF states file"):
        read_states(tmp_path / "other.vtkhdf")


def test_xdmf_twin_refers_to_the_same_numbers(tmp_path):
    path = complete(tmp_path)
    grids = ET.parse(path.with_suffix(".xdmf")).getroot().findall("Domain/Grid/Grid")
    assert [float(grid.find("Time").get("Value")) for grid in grids] == [k * 1e-3 for k in range(5)]
    with h5py.File(path) as file, read_states(path) as states:

        def resolve(item: ET.Element) -> np.ndarray:
            name, dataset = item.text.split(":")
            assert name == path.name
            values = file[dataset][...]
            shape = [int(n) for n in item.get("Dimensions").split()]
            assert values.size == np.prod(shape)
            assert values.dtype.itemsize == int(item.get("Precision"))
            return values.reshape(shape)

        for index, grid in enumerate(grids):
            np.testing.assert_array_equal(resolve(grid.find("Geometry/DataItem")), NODES)
            np.testing.assert_array_equal(resolve(grid.find("Topology/DataItem")), HEXES)
            for attribute in grid.findall("Attribute"):
                name = attribute.get("Name")
                slab = attribute.find("DataItem")
                if slab.get("ItemType") != "HyperSlab":
                    np.testing.assert_array_equal(resolve(slab), getattr(states, name))
                    continue
                selection, source = slab.findall("DataItem")
                start, stride, count = np.array(selection.text.split(), int).reshape(3, -1)
                assert (stride == 1).all()
                window = tuple(slice(a, a + c) for a, c in zip(start, count))
                np.testing.assert_array_equal(resolve(source)[window], states.field(name, index))


def test_a_disk_too_full_for_the_file_is_told_before_hdf5_meets_it(tmp_path, monkeypatch):
    # HDF5 crashes the process on a full disk
    def full(handle: int, start: int, size: int) -> None:
        assert size > states.partial_path.stat().st_size
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    states = writer(tmp_path)
    states.append(*state(0))
    with monkeypatch.context() as patch:
        patch.setattr(os, "posix_fallocate", full)
        with pytest.raises(ReplayError, match=r"states.vtkhdf: cannot be written \(No space left on device\)"):
            states.close()
    assert [p.name for p in tmp_path.iterdir()] == ["states.partial"]
    states.close()
    assert complete(tmp_path / "whole", 1).read_bytes() == (tmp_path / "states.vtkhdf").read_bytes()


def test_vtk_opens_the_states_with_times_and_values(tmp_path):
    pytest.importorskip("vtk", reason="VTK is an extra (pip install 'replay-impact[vtk]'): its reader is not here")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(complete(tmp_path)))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 5
    for index in (0, 3, 4):
        reader.SetStep(index)
        reader.Update()
        grid = reader.GetOutputDataObject(0)
        assert grid.GetNumberOfCells() == 2
        assert grid.GetCellType(1) == 12
        expected = state(index)[1]
        for name in CELL:
            np.testing.assert_array_equal(vtk_to_numpy(grid.GetCellData().GetArray(name)), expected[name].astype("f4"))
        displacement = vtk_to_numpy(grid.GetPointData().GetArray("displacement_m"))
        np.testing.assert_array_equal(displacement, expected["displacement_m"].astype("f4"))
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetCellData().GetArray("element_pid")), [1, 4])
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetPointData().GetArray("node_ids")), np.arange(12) + 101)


def test_vtk_opens_the_xdmf_twin_with_the_same_values(tmp_path):
    pytest.importorskip("vtk", reason="VTK is an extra (pip install 'replay-impact[vtk]'): its reader is not here")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

    reader = vtkXdmfReader()
    reader.SetFileName(str(complete(tmp_path).with_suffix(".xdmf")))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(reader.GetExecutive().TIME_STEPS())
    assert np.allclose(times, np.arange(5) * 1e-3)
    for index in (0, 4):
        reader.UpdateTimeStep(times[index])
        grid = reader.GetOutputDataObject(0)
        if grid.IsA("vtkMultiBlockDataSet"):
            grid = grid.GetBlock(0)
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()).astype(float), NODES)
        expected = state(index)[1]
        np.testing.assert_array_equal(
            vtk_to_numpy(grid.GetCellData().GetArray("von_mises_Pa")), expected["von_mises_Pa"].astype("f4")
        )
        np.testing.assert_array_equal(
            vtk_to_numpy(grid.GetPointData().GetArray("displacement_m")), expected["displacement_m"].astype("f4")
        )
