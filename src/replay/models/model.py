"""The model of head and helmet: nodes, hexes, parts, sets and materials, and its file ``model.h5``.

Arrays lie in HDF5 datasets under the names a mesh tool would look for; everything that is not an array
(parts, part sets, materials, notes) is one JSON text, so that the file has one order and the same bytes
whenever the same model is written.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from replay.errors import InputError
from replay.files import atomic_path

SCHEMA = "replay-model"
SCHEMA_VERSION = 1

GRID_DECIMALS = 9
"""Coordinates lie on a grid of a nanometre: any deck's columns hold them, and a rotation there and back finds them."""

ROLES = (
    "brain",
    "csf",
    "skull",
    "scalp",
    "face",
    "comfort_pad",
    "energy_pad",
    "shell",
    "facemask",
    "chin_cup",
    "strap",
    "bone",
    "flesh",
    "cap",
    "cushion",
    "mount",
    "other",
)

_DATASETS = {
    "nodes/coordinates_m": ("nodes", "f8", 3),
    "nodes/ids": ("node_ids", "i8", 0),
    "elements/connectivity": ("hexes", "i4", 8),
    "elements/ids": ("element_ids", "i8", 0),
    "elements/part": ("element_part", "i4", 0),
    "elements/region": ("element_region", "i4", 0),
}
_DOCUMENT_KEYS = ("parts", "region_names", "part_sets", "part_set_ids", "materials", "info")


@dataclass(frozen=True)
class Part:
    """One part.

    Parameters
    ----------
    pid
        Part number, unique, in its assembly's block.
    name
        Name for people: ``brain``, ``energy_pad_front``.
    role
        One of `ROLES`.
    assembly
        ``head``, ``helmet`` or ``body``; ``apparatus`` of a laboratory.
    material
        Key of the model's `materials`.
    """

    pid: int
    name: str
    role: str
    assembly: str
    material: str

    @property
    def player(self) -> int:
        """1, or 2 for a part whose number lies in a block of the second player or of what strikes in his place."""
        return 2 if self.pid // 10_000_000 in (2, 3, 4) else 1


@dataclass(frozen=True)
class ModelJoint:
    """A joint between two rigid parts, as `replay.solver.Joint` takes it.

    Parameters
    ----------
    name
        Unique.
    first, second
        Part numbers.
    centre_m
        (3,) in the model's axes [m].
    axes
        x, y and z of the joint in rows, (3, 3).
    stiffness_n_m_per_rad
        About each axis for positive and negative angles, (3, 2).
    damping_ratio, centre_stiffness_n_per_m, centre_damping_ratio
        As the solver has them.
    """

    name: str
    first: int
    second: int
    centre_m: tuple[float, ...]
    axes: tuple[tuple[float, ...], ...]
    stiffness_n_m_per_rad: tuple[tuple[float, ...], ...]
    damping_ratio: float
    centre_stiffness_n_per_m: float
    centre_damping_ratio: float


@dataclass(frozen=True)
class Model:
    """Head, helmet and body as hexahedra, in the head frame (x anterior, y left, z superior, origin at the head's CG).

    Parameters
    ----------
    nodes
        Coordinates, (n, 3) float64 [m].
    node_ids
        Numbers of the nodes in decks, (n,) int64.
    hexes
        Rows of `nodes`, (m, 8) int32, in the order (-,-,-) (+,-,-) (+,+,-) (-,+,-) (-,-,+) (+,-,+) (+,+,+) (-,+,+).
    element_ids
        Numbers of the elements in decks, (m,) int64.
    element_part
        Index into `parts`, (m,) int32.
    element_region
        Index into `region_names`, (m,) int32; 0 is ``none``.
    parts
        The parts.
    region_names
        Names of the brain's regions; the first is ``none``.
    part_sets
        Name of a set to the part numbers in it.
    part_set_ids
        Name of a set to its number in decks.
    node_sets
        Name of a set to rows of `nodes`.
    materials
        Name to ``{law, density_kg_per_m3, parameters, certainty, source}``.
    info
        Preset, resolution, calibration and notes.
    joints
        Joints between rigid parts.
    rigid_node_sets
        Names of the node sets that move as one body; one that shares a node with a rigid part moves with it.
    """

    nodes: np.ndarray
    node_ids: np.ndarray
    hexes: np.ndarray
    element_ids: np.ndarray
    element_part: np.ndarray
    element_region: np.ndarray
    parts: tuple[Part, ...]
    region_names: tuple[str, ...]
    part_sets: dict[str, tuple[int, ...]]
    part_set_ids: dict[str, int]
    materials: dict[str, dict[str, Any]]
    info: dict[str, Any]
    node_sets: dict[str, np.ndarray] = field(default_factory=dict)
    joints: tuple[ModelJoint, ...] = ()
    rigid_node_sets: tuple[str, ...] = ()

    @property
    def has_damage(self) -> bool:
        """Whether the brain's law keeps the damage variable."""
        return bool(self.materials["brain"]["law"] == "brain_isv")

    def part_index(self, name: str) -> int:
        """Index of the part of this name.

        Raises
        ------
        KeyError
            When no part has this name.
        """
        for index, part in enumerate(self.parts):
            if part.name == name:
                return index
        raise KeyError(name)

    def elements_of(
        self, *, role: str | None = None, assembly: str | None = None, player: int | None = None
    ) -> np.ndarray:
        """Mask (m,) bool of the elements whose part has this role and belongs to this assembly and player."""
        chosen = [
            role in (None, p.role) and assembly in (None, p.assembly) and player in (None, p.player) for p in self.parts
        ]
        return np.array(chosen, dtype=bool)[self.element_part]

    def element_densities(self) -> np.ndarray:
        """Density of each element, (m,) float64 [kg/m^3]."""
        densities = np.array([self.materials[p.material]["density_kg_per_m3"] for p in self.parts], dtype=float)
        return densities[self.element_part]


def write_model(path: str | Path, model: Model) -> None:
    """Write a model to HDF5, atomically; the same model always gives the same bytes.

    Parameters
    ----------
    path
        File to write.
    model
        The model.
    """
    document = {
        "parts": [asdict(part) for part in model.parts],
        "region_names": list(model.region_names),
        "part_sets": {name: [int(pid) for pid in pids] for name, pids in model.part_sets.items()},
        "part_set_ids": {name: int(number) for name, number in model.part_set_ids.items()},
        "materials": model.materials,
        "info": model.info,
    }
    if model.joints or model.rigid_node_sets:
        document |= {"joints": [asdict(j) for j in model.joints], "rigid_node_sets": list(model.rigid_node_sets)}
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["schema"] = SCHEMA
        file.attrs["schema_version"] = SCHEMA_VERSION
        file.attrs["units"] = "SI: m, kg, s"
        file.attrs["frame"] = "x anterior, y left, z superior, origin at the CG of the head"
        for name, (attribute, kind, _) in _DATASETS.items():
            _put(file, name, np.ascontiguousarray(getattr(model, attribute), dtype=kind))
        for name in sorted(model.node_sets):
            _put(file, f"node_sets/{name}", np.ascontiguousarray(model.node_sets[name], dtype="i4"))
        text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False).encode("utf-8")
        _put(file, "document_json", np.frombuffer(text, dtype="u1"))


def _put(file: h5py.File, name: str, values: np.ndarray) -> None:
    file.create_dataset(name, data=values, track_times=False)


def read_model(path: str | Path) -> Model:
    """Read a model.

    Parameters
    ----------
    path
        A file of `write_model`.

    Raises
    ------
    InputError
        When the file is missing, is not HDF5, is of another kind or version, lacks something, or its
        indices point outside.
    """
    path = Path(path)
    mend = "run the assembly stage again"
    if not path.is_file():
        raise InputError(path, "the file does not exist", mend=mend)
    try:
        with h5py.File(path, "r") as file:
            _check_schema(path, file)
            arrays = {
                attribute: _array(path, file, name, kind, width) for name, (attribute, kind, width) in _DATASETS.items()
            }
            node_sets = {}
            if "node_sets" in file:
                node_sets = {str(name): np.asarray(file["node_sets"][name], dtype="i4") for name in file["node_sets"]}
            document = _document(path, file)
    except OSError as error:
        raise InputError(path, f"is not a whole HDF5 file ({error})", expected="a model.h5", mend=mend) from None
    parts = tuple(Part(**part) for part in document["parts"])
    _check_indices(path, arrays, len(parts), len(document["region_names"]))
    return Model(
        **arrays,
        parts=parts,
        region_names=tuple(document["region_names"]),
        part_sets={name: tuple(pids) for name, pids in document["part_sets"].items()},
        part_set_ids=dict(document["part_set_ids"]),
        materials=document["materials"],
        info=document["info"],
        node_sets=node_sets,
        joints=tuple(_joint(joint) for joint in document.get("joints", [])),
        rigid_node_sets=tuple(document.get("rigid_node_sets", [])),
    )


def _joint(facts: dict[str, Any]) -> ModelJoint:
    rows = {name: tuple(map(tuple, facts[name])) for name in ("axes", "stiffness_n_m_per_rad")}
    return ModelJoint(**{**facts, **rows, "centre_m": tuple(facts["centre_m"])})


def _check_schema(path: Path, file: h5py.File) -> None:
    schema, version = file.attrs.get("schema"), file.attrs.get("schema_version")
    if schema != SCHEMA or version != SCHEMA_VERSION:
        raise InputError(
            path,
            f"has schema {schema!r}, version {version}",
            expected=f"schema {SCHEMA!r}, version {SCHEMA_VERSION}",
            mend="build the model again with this version",
        )


def _array(path: Path, file: h5py.File, name: str, kind: str, width: int) -> np.ndarray:
    if name not in file:
        raise InputError(path, f"dataset {name} is missing", mend="build the model again")
    values = np.asarray(file[name], dtype=kind)
    shape = f"(n, {width})" if width else "(n,)"
    if values.ndim != (2 if width else 1) or (width and values.shape[1] != width) or not len(values):
        raise InputError(path, f"dataset {name} has shape {values.shape}", expected=shape, mend="build the model again")
    if not np.all(np.isfinite(values)):
        raise InputError(path, f"dataset {name} holds values that are not finite", mend="build the model again")
    return values


def _document(path: Path, file: h5py.File) -> Mapping[str, Any]:
    if "document_json" not in file:
        raise InputError(path, "dataset document_json is missing", mend="build the model again")
    try:
        document = json.loads(bytes(np.asarray(file["document_json"], dtype="u1")).decode("utf-8"))
        missing = [key for key in _DOCUMENT_KEYS if key not in document]
    except (UnicodeDecodeError, json.JSONDecodeError, TypeError) as error:
        raise InputError(path, f"document_json is damaged ({error})", mend="build the model again") from None
    if missing:
        raise InputError(path, f"document_json lacks {', '.join(missing)}", mend="build the model again")
    return document


def _check_indices(path: Path, arrays: Mapping[str, np.ndarray], parts: int, regions: int) -> None:
    n, m = len(arrays["nodes"]), len(arrays["hexes"])
    for name, length in (("node_ids", n), ("element_ids", m), ("element_part", m), ("element_region", m)):
        if len(arrays[name]) != length:
            raise InputError(path, f"{name} has {len(arrays[name])} entries", expected=f"{length}", mend="build again")
    for name, limit in (("hexes", n), ("element_part", parts), ("element_region", regions)):
        low, high = int(arrays[name].min()), int(arrays[name].max())
        if low < 0 or high >= limit:
            raise InputError(
                path,
                f"{name} points to {low if low < 0 else high}",
                expected=f"0 to {limit - 1}",
                mend="build the model again",
            )
