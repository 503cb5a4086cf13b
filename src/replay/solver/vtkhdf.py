"""The states of a run over time: a temporal VTKHDF unstructured grid, and its XDMF twin.

While the solver runs, states are appended to a plain side file (``states.partial``) of
fixed-size records, each with its checksum. A killed run leaves at worst one unfinished
record at its end, and a resumed run cuts the file back to the state its checkpoint names.
Only at the end are the records laid out as HDF5, in one pass and in one order: the bytes of
``states.vtkhdf`` depend on the states alone, never on how often the run was interrupted.

ParaView (5.12 and later) and VTK read the file directly; VisIt reads the ``.xdmf`` beside
it, which refers to the same datasets.
"""

from __future__ import annotations

import contextlib
import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO
from xml.sax.saxutils import quoteattr

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.errors import InputError, ReplayError, ResumeError
from replay.files import atomic_path, write_text

_MAGIC = b"replay states 1\n"
_VTK_HEXAHEDRON = 12
#: Room for headers and indices, beyond the arrays themselves.
_MARGIN = 1 << 19
_STATIC_POINT = ("node_ids",)
_STATIC_CELL = ("element_ids", "element_pid")
_XDMF_SHAPE = {1: "Scalar", 3: "Vector", 6: "Tensor6", 9: "Tensor"}


class StatesWriter:
    """Append states of a hexahedral mesh to a file that survives the death of its writer.

    Parameters
    ----------
    path
        Final name, ``states.vtkhdf``. The growing file is `path` with the suffix
        ``.partial``, the twin `path` with the suffix ``.xdmf``.
    nodes
        ``(n, 3)`` float [m], reference coordinates.
    hexes
        ``(m, 8)`` integer rows into `nodes`, in VTK's hexahedron order.
    node_ids, element_ids, element_pid
        ``(n,)``, ``(m,)``, ``(m,)`` integers, stored once.
    point_fields, cell_fields
        Name (with its unit) to number of components of what each state holds, as float32.
    resume
        Continue the growing file of an earlier run of the same mesh and fields; call
        `rewind` next. Otherwise an earlier growing file is replaced.

    Raises
    ------
    ResumeError
        When `resume` is asked for and the growing file is missing or of another model.
    ValueError
        When the arrays do not fit one another.
    """

    def __init__(
        self,
        path: str | Path,
        nodes: ArrayLike,
        hexes: ArrayLike,
        node_ids: ArrayLike,
        element_ids: ArrayLike,
        element_pid: ArrayLike,
        point_fields: Mapping[str, int],
        cell_fields: Mapping[str, int],
        *,
        resume: bool = False,
    ) -> None:
        self.path = Path(path)
        self.partial_path = self.path.with_suffix(".partial")
        self.xdmf_path = self.path.with_suffix(".xdmf")
        self._mesh = _Mesh(nodes, hexes, node_ids, element_ids, element_pid)
        self._fields = [(name, self._mesh.n_nodes, int(k), "PointData") for name, k in point_fields.items()]
        self._fields += [(name, self._mesh.n_hexes, int(k), "CellData") for name, k in cell_fields.items()]
        names = [field[0] for field in self._fields]
        if len(set(names)) < len(names) or set(names) & {*_STATIC_POINT, *_STATIC_CELL}:
            message = f"the names of the fields {names} are not distinct from one another and from the ids"
            raise ValueError(message)
        self._record_size = 8 + 4 * sum(rows * k for _, rows, k, _ in self._fields) + 4
        header = self._header()
        self._start = len(header)
        self._stream: BinaryIO | None = self._reopen(header) if resume else self._begin(header)
        self.n_states = (self._size() - self._start) // self._record_size

    def _header(self) -> bytes:
        """Begin a growing file: the layout of its records and the mesh they belong to."""
        layout = {"mesh_crc32": self._mesh.checksum(), "fields": self._fields, "record_bytes": self._record_size}
        text = json.dumps(layout, separators=(",", ":")).encode()
        return _MAGIC + struct.pack("<I", len(text)) + text

    def _begin(self, header: bytes) -> BinaryIO:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        stream = self.partial_path.open("wb+")
        stream.write(header)
        stream.flush()
        return stream

    def _reopen(self, header: bytes) -> BinaryIO:
        if not self.partial_path.is_file():
            message = f"{self.partial_path}: the states of the interrupted run are gone\n    mend: start the run anew"
            raise ResumeError(message)
        stream = self.partial_path.open("rb+")
        if stream.read(len(header)) != header:
            stream.close()
            message = (
                f"{self.partial_path}: holds states of another mesh or other fields\n"
                "    mend: start the run anew, or resume with the model it began with"
            )
            raise ResumeError(message)
        return stream

    def _size(self) -> int:
        return os.fstat(self._open().fileno()).st_size

    def _open(self) -> BinaryIO:
        if self._stream is None:
            message = f"{self.path}: states are closed already"
            raise ValueError(message)
        return self._stream

    def append(self, time_s: float, fields: Mapping[str, ArrayLike]) -> None:
        """Add a state; the record is handed to the operating system before the call returns.

        Parameters
        ----------
        time_s
            Time of the state [s], later than that of the state before.
        fields
            One array ``(rows, components)`` (or ``(rows,)`` for one component) per field.

        Raises
        ------
        ValueError
            When fields are missing, unknown or of the wrong size (our own mistake).
        ReplayError
            When the disk is full.
        """
        stream = self._open()
        if set(fields) != {field[0] for field in self._fields}:
            message = f"{self.path}: fields {sorted(fields)} given, {[f[0] for f in self._fields]} declared"
            raise ValueError(message)
        body = [struct.pack("<d", float(time_s))]
        for name, rows, components, _ in self._fields:
            values = np.ascontiguousarray(fields[name], dtype="<f4")
            if values.size != rows * components or len(values) != rows:
                message = f"{self.path}: field {name} has shape {values.shape}, expected ({rows}, {components})"
                raise ValueError(message)
            body.append(values.tobytes())
        record = b"".join(body)
        record += struct.pack("<I", zlib.crc32(record))
        with self._told_when_full():
            stream.seek(self._start + self.n_states * self._record_size)
            stream.write(record)
            stream.flush()
        self.n_states += 1

    def sync(self) -> None:
        """Force the states onto the disk; call before a checkpoint that counts on them is written."""
        with self._told_when_full():
            os.fsync(self._open().fileno())

    @contextlib.contextmanager
    def _told_when_full(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            message = f"{self.partial_path}: cannot be written ({error.strerror})\n    mend: free disk space and resume"
            raise ReplayError(message) from error

    def rewind(self, n_states: int) -> None:
        """Drop every state after the first `n_states`, as if they had never been written.

        Raises
        ------
        ResumeError
            When fewer whole states are there, or one of them is damaged.
        """
        stream = self._open()
        if not 0 <= n_states <= self.n_states:
            message = (
                f"{self.partial_path}: holds {self.n_states} whole states where the checkpoint counts {n_states}\n"
                "    mend: start the run anew"
            )
            raise ResumeError(message)
        for _ in self._records(n_states):
            pass
        stream.truncate(self._start + n_states * self._record_size)
        self.n_states = n_states

    def _records(self, count: int) -> Iterator[bytes]:
        stream = self._open()
        stream.seek(self._start)
        for index in range(count):
            record = stream.read(self._record_size)
            if len(record) < self._record_size or zlib.crc32(record[:-4]) != struct.unpack("<I", record[-4:])[0]:
                message = f"{self.partial_path}: state {index} is damaged\n    mend: start the run anew"
                raise ResumeError(message)
            yield record[:-4]

    def close(self) -> None:
        """Lay the states out as ``.vtkhdf``, write the ``.xdmf`` twin, and remove the growing file."""
        if self._stream is None:
            return
        room = self._size() + 2 * self._mesh.n_bytes + _MARGIN
        with atomic_path(self.path, reserve_bytes=room) as temporary:
            times = self._write_hdf(temporary)
        write_text(self.xdmf_path, _xdmf(self.path.name, self._mesh, self._fields, times))
        self.abandon()
        self.partial_path.unlink()

    def abandon(self) -> None:
        """Let go of the growing file and leave it as it is, for a later run to resume."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def _write_hdf(self, path: Path) -> list[float]:
        count, mesh = self.n_states, self._mesh
        times: list[float] = []
        # The earliest format has no time stamps in its groups; a later default may.
        with h5py.File(path, "w", libver=("earliest", "v110")) as file:
            root = file.create_group("VTKHDF")
            root.attrs["Version"] = np.array([2, 0], np.int64)
            root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", 16))
            _static(root, "NumberOfPoints", np.array([mesh.n_nodes], np.int64))
            _static(root, "NumberOfCells", np.array([mesh.n_hexes], np.int64))
            _static(root, "NumberOfConnectivityIds", np.array([8 * mesh.n_hexes], np.int64))
            _static(root, "Points", mesh.nodes)
            _static(root, "Connectivity", mesh.hexes.ravel())
            _static(root, "Offsets", np.arange(0, 8 * mesh.n_hexes + 1, 8, dtype=np.int64))
            _static(root, "Types", np.full(mesh.n_hexes, _VTK_HEXAHEDRON, np.uint8))
            groups = {name: root.create_group(name) for name in ("PointData", "CellData")}
            for name in _STATIC_POINT:
                _static(groups["PointData"], name, mesh.static[name])
            for name in _STATIC_CELL:
                _static(groups["CellData"], name, mesh.static[name])
            datasets = [
                groups[where].create_dataset(
                    name,
                    shape=(count * rows, k) if k > 1 else (count * rows,),
                    maxshape=(None, k) if k > 1 else (None,),
                    chunks=(rows, k) if k > 1 else (rows,),
                    dtype="<f4",
                    shuffle=True,
                    compression="gzip",
                    compression_opts=1,
                    track_times=False,
                )
                for name, rows, k, where in self._fields
            ]
            for index, record in enumerate(self._records(count)):
                times.append(struct.unpack_from("<d", record)[0])
                at = 8
                for dataset, (_, rows, k, _) in zip(datasets, self._fields):
                    values = np.frombuffer(record, "<f4", rows * k, at)
                    dataset[index * rows : (index + 1) * rows] = values.reshape(rows, k) if k > 1 else values
                    at += values.nbytes
            self._write_steps(root, times)
        return times

    def _write_steps(self, root: h5py.Group, times: list[float]) -> None:
        """Say, for each step, where its rows begin; static datasets begin at row 0 in every step."""
        count = len(times)
        zeros = np.zeros(count, np.int64)
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(count)
        _static(steps, "Values", np.array(times, np.float64))
        _static(steps, "NumberOfParts", np.ones(count, np.int64))
        _static(steps, "PartOffsets", zeros)
        _static(steps, "PointOffsets", zeros)
        _static(steps, "CellOffsets", zeros.reshape(count, 1))
        _static(steps, "ConnectivityIdOffsets", zeros.reshape(count, 1))
        offsets = {name: steps.create_group(f"{name}Offsets") for name in ("PointData", "CellData")}
        for name in _STATIC_POINT:
            _static(offsets["PointData"], name, zeros)
        for name in _STATIC_CELL:
            _static(offsets["CellData"], name, zeros)
        for name, rows, _, where in self._fields:
            _static(offsets[where], name, np.arange(count, dtype=np.int64) * rows)

    def __enter__(self) -> StatesWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()


class _Mesh:
    """The static part, checked once and in the dtypes that are stored."""

    def __init__(self, nodes: Any, hexes: Any, node_ids: Any, element_ids: Any, element_pid: Any) -> None:
        self.nodes = np.ascontiguousarray(nodes, "<f8")
        self.hexes = np.ascontiguousarray(hexes, "<i8")
        self.n_nodes, self.n_hexes = len(self.nodes), len(self.hexes)
        self.static: dict[str, NDArray[Any]] = {
            "node_ids": np.ascontiguousarray(node_ids, "<i8"),
            "element_ids": np.ascontiguousarray(element_ids, "<i8"),
            "element_pid": np.ascontiguousarray(element_pid, "<i4"),
        }
        expected = {"node_ids": self.n_nodes, "element_ids": self.n_hexes, "element_pid": self.n_hexes}
        wrong = [name for name, rows in expected.items() if self.static[name].shape != (rows,)]
        if self.nodes.shape != (self.n_nodes, 3) or self.hexes.shape != (self.n_hexes, 8) or wrong:
            message = f"nodes {self.nodes.shape}, hexes {self.hexes.shape}, {wrong or 'ids'}: shapes do not fit"
            raise ValueError(message)
        if not self.n_nodes or not self.n_hexes or self.hexes.min() < 0 or self.hexes.max() >= self.n_nodes:
            message = f"{self.n_hexes} elements name rows outside the {self.n_nodes} nodes"
            raise ValueError(message)

    @property
    def n_bytes(self) -> int:
        return self.nodes.nbytes + self.hexes.nbytes + sum(array.nbytes for array in self.static.values())

    def checksum(self) -> int:
        value = 0
        for array in (self.nodes, self.hexes, *self.static.values()):
            value = zlib.crc32(array.tobytes(), value)
        return value


def _static(group: h5py.Group, name: str, values: NDArray[Any]) -> None:
    group.create_dataset(name, data=values, track_times=False)


def _xdmf(name: str, mesh: _Mesh, fields: list[tuple[str, int, int, str]], times: list[float]) -> str:
    """Text of the twin: one grid per state, each a hyperslab of the datasets in `name`."""

    def item(path: str, shape: str, number: str, precision: int) -> str:
        return (
            f'<DataItem Format="HDF" NumberType="{number}" Precision="{precision}" Dimensions="{shape}">'
            f"{name}:/VTKHDF/{path}</DataItem>"
        )

    lines = ['<?xml version="1.0" ?>', '<Xdmf Version="3.0"><Domain>']
    lines.append('<Grid Name="states" GridType="Collection" CollectionType="Temporal">')
    for index, time_s in enumerate(times):
        lines += [
            f'<Grid Name="state {index}" GridType="Uniform"><Time Value="{time_s!r}"/>',
            f'<Topology TopologyType="Hexahedron" NumberOfElements="{mesh.n_hexes}">',
            item("Connectivity", f"{mesh.n_hexes} 8", "Int", 8),
            '</Topology><Geometry GeometryType="XYZ">',
            item("Points", f"{mesh.n_nodes} 3", "Float", 8),
            "</Geometry>",
        ]
        for static, values in mesh.static.items():
            where = "PointData" if static in _STATIC_POINT else "CellData"
            lines += [
                f'<Attribute Name="{static}" AttributeType="Scalar" Center="{_center(where)}">',
                item(f"{where}/{static}", str(len(values)), "Int", values.itemsize),
                "</Attribute>",
            ]
        for field, rows, k, where in fields:
            shape, whole = (f"{rows} {k}", f"{len(times) * rows} {k}") if k > 1 else (str(rows), str(len(times) * rows))
            slab = f"{index * rows} 0 1 1 {rows} {k}" if k > 1 else f"{index * rows} 1 {rows}"
            kind = _XDMF_SHAPE.get(k, "Matrix")
            lines += [
                f'<Attribute Name={quoteattr(field)} AttributeType="{kind}" Center="{_center(where)}">',
                f'<DataItem ItemType="HyperSlab" Dimensions="{shape}">',
                f'<DataItem Format="XML" NumberType="Int" Dimensions="3 {2 if k > 1 else 1}">{slab}</DataItem>',
                item(f"{where}/{field}", whole, "Float", 4),
                "</DataItem></Attribute>",
            ]
        lines.append("</Grid>")
    lines += ["</Grid>", "</Domain></Xdmf>", ""]
    return "\n".join(lines)


def _center(where: str) -> str:
    return "Node" if where == "PointData" else "Cell"


class States:
    """A finished states file, open for reading; fields come from the disk when asked for.

    Attributes
    ----------
    times_s
        ``(T,)`` float64 [s].
    nodes, hexes, node_ids, element_ids, element_pid
        As given to the writer.
    point_fields, cell_fields
        Name to number of components.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if not self.path.is_file():
            raise InputError(path, "the file does not exist", mend="run the stage that writes the states")
        try:
            self._file = h5py.File(self.path, "r")
        except OSError:
            raise InputError(
                path, "is not an HDF5 file", expected="a VTKHDF states file", mend="run the stage again"
            ) from None
        try:
            self._read_frame()
        except KeyError as error:
            self._file.close()
            raise InputError(
                path, f"has no {error}", expected="a VTKHDF states file of this project", mend="run the stage again"
            ) from None

    def _read_frame(self) -> None:
        root = self._file["VTKHDF"]
        self.times_s: NDArray[np.float64] = root["Steps/Values"][:]
        self.nodes: NDArray[np.float64] = root["Points"][:]
        self.hexes: NDArray[np.int64] = root["Connectivity"][:].reshape(-1, 8)
        self.node_ids: NDArray[np.int64] = root["PointData/node_ids"][:]
        self.element_ids: NDArray[np.int64] = root["CellData/element_ids"][:]
        self.element_pid: NDArray[np.int32] = root["CellData/element_pid"][:]
        self.point_fields = _components(root["PointData"], _STATIC_POINT)
        self.cell_fields = _components(root["CellData"], _STATIC_CELL)

    def __len__(self) -> int:
        return len(self.times_s)

    def field(self, name: str, index: int) -> NDArray[np.float32]:
        """Read one field of one state.

        Parameters
        ----------
        name
            Field, as declared to the writer.
        index
            State, from 0; negative counts from the end.

        Returns
        -------
        numpy.ndarray
            ``(rows, components)`` float32, or ``(rows,)`` for one component.

        Raises
        ------
        InputError
            When the file has no such field.
        IndexError
            When there is no such state.
        """
        where, rows = ("PointData", len(self.nodes)) if name in self.point_fields else ("CellData", len(self.hexes))
        if name not in self.point_fields and name not in self.cell_fields:
            known = ", ".join([*self.point_fields, *self.cell_fields])
            raise InputError(self.path, f"has no field {name!r}", expected=known, mend="ask for one of these")
        index = range(len(self))[index]
        return self._file[f"VTKHDF/{where}/{name}"][index * rows : (index + 1) * rows]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> States:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _components(group: h5py.Group, static: tuple[str, ...]) -> dict[str, int]:
    return {n: (d.shape[1] if d.ndim > 1 else 1) for n, d in group.items() if n not in static}


def read_states(path: str | Path) -> States:
    """Open a finished states file for reading; use as a context manager.

    Raises
    ------
    InputError
        When the file is missing or not a states file.
    """
    return States(path)
