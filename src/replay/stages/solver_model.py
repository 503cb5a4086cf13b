"""Models that `replay solve` can open: one reader for each kind of file, all to one class.

A new kind is a function from a path to a `SolverModel` and its suffixes in `READERS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from replay.decks import read_keyword
from replay.errors import InputError
from replay.models import Model, read_model
from replay.models.census import KINDS, element_kinds
from replay.solver import Joint, Material, RigidSet, SolverPart
from replay.stages.foreign_deck import open_deck
from replay.stages.own_deck import model_of_own_deck
from replay.stages.problem import body_links, solver_parts


@dataclass(frozen=True)
class SolverModel:
    """Mesh, parts and sets as the solver reads them.

    Parameters
    ----------
    nodes, node_ids : (n, 3), (n,)
        Coordinates [m] and numbers.
    hexes, element_ids, element_part : (m, 8), (m,), (m,)
        Rows of `nodes`, numbers, indices into `parts`.
    parts
        Parts; one that is in `unknown` stands with a placeholder of its density.
    part_sets, node_sets
        Part numbers, and rows of `nodes`, by name.
    unknown
        Part number to what the file says of a material that no law covers.
    rigid_sets, joints
        Those that the model brings along: a player's.
    """

    nodes: NDArray[np.float64]
    node_ids: NDArray[np.int64]
    hexes: NDArray[np.int64]
    element_ids: NDArray[np.int64]
    element_part: NDArray[np.int64]
    parts: tuple[SolverPart, ...]
    part_sets: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    node_sets: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    unknown: Mapping[int, str] = field(default_factory=dict)
    rigid_sets: tuple[RigidSet, ...] = ()
    joints: tuple[Joint, ...] = ()


def open_model(path: Path) -> SolverModel:
    """Read a model by its suffix.

    Raises
    ------
    InputError
        For a suffix that no reader knows, and for what the reader finds.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            path, f"files ending in {path.suffix or 'nothing'!r} are not read", expected=", ".join(sorted(READERS)),
            mend="`replay model` writes a model.h5",
        )  # fmt: skip
    return reader(path)


def _from_model_file(path: Path) -> SolverModel:
    return _of_model(read_model(path))


def _of_model(model: Model) -> SolverModel:
    rigid_sets, joints = body_links(model)
    return SolverModel(
        nodes=model.nodes,
        node_ids=model.node_ids,
        hexes=model.hexes.astype(np.int64),
        element_ids=model.element_ids,
        element_part=model.element_part.astype(np.int64),
        parts=solver_parts(model),
        part_sets=model.part_sets,
        node_sets={name: np.asarray(rows, np.int64) for name, rows in model.node_sets.items()},
        rigid_sets=rigid_sets,
        joints=joints,
    )


def _from_keyword(path: Path) -> SolverModel:
    """Hexahedra of a keyword deck; SI units unless its numbers fit one other system alone."""
    ours = model_of_own_deck(read_keyword(path))
    if ours is not None:
        return _of_model(ours)
    source = open_deck([path], otherwise="m-kg-s")
    mesh, deck = source.helmet, source.deck
    if not len(mesh.solids):
        raise InputError(path, "holds no *ELEMENT_SOLID", expected="hexahedra")
    kinds = element_kinds(mesh.solids)
    if kinds.any():
        row = int(np.argmax(kinds != 0))
        raise InputError(
            path, f"element {mesh.solid_ids[row]} is a {KINDS[kinds[row]]}; {int((kinds != 0).sum())} are no hexahedra",
            line=int(deck.solids.lines[row]), expected="hexahedra alone",
            mend="mesh that part with hexahedra, or let `replay helmet prepare` take wedges out",
        )  # fmt: skip
    used = np.unique(mesh.solids[:, :8])
    row_of = np.full(len(mesh.nodes), -1)
    row_of[used] = np.arange(len(used))
    kept = [k for k in range(len(mesh.parts)) if (mesh.solid_part == k).any()]
    parts, unknown = [], {}
    for part in (mesh.parts[k] for k in kept):
        mid = deck.of_kind("part")[part.pid].whole("mid") if part.has_material else 0
        mapped = source.materials.get(mid)
        if mapped is None or mapped.refused:
            unknown[part.pid] = mapped.keyword if mapped else "no material"
            density = mapped.density_kg_per_m3 if mapped and mapped.density_kg_per_m3 > 0 else 1.0
            material = Material(f"part {part.pid}", "rigid", density, {})
        else:
            material = Material(f"{mapped.keyword} {mid}", mapped.law, mapped.density_kg_per_m3, mapped.parameters)
        parts.append(SolverPart(part.pid, part.name, material))
    return SolverModel(
        nodes=mesh.nodes[used],
        node_ids=mesh.node_ids[used],
        hexes=row_of[mesh.solids[:, :8]],
        element_ids=mesh.solid_ids,
        element_part=np.searchsorted(kept, mesh.solid_part),
        parts=tuple(parts),
        part_sets={e.title or str(number): e.members() for number, e in deck.of_kind("part_set").items()},
        node_sets={n: row_of[r][row_of[r] >= 0] for n, r in mesh.node_sets.items() if (row_of[r] >= 0).any()},
        unknown=unknown,
    )


READERS: dict[str, Callable[[Path], SolverModel]] = {
    ".h5": _from_model_file,
    ".k": _from_keyword,
    ".key": _from_keyword,
    ".dyn": _from_keyword,
}
