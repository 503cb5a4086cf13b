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
from replay.models import read_model
from replay.solver import Material, SolverPart
from replay.stages.problem import solver_parts

#: Keyword of a deck's material to a law and the names of its fields after the density.
_KEYWORD_LAWS = {
    "*MAT_ELASTIC": ("elastic", ("youngs_modulus_pa", "poisson_ratio")),
    "*MAT_RIGID": ("rigid", ("youngs_modulus_pa", "poisson_ratio")),
}


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
    model = read_model(path)
    return SolverModel(
        nodes=model.nodes,
        node_ids=model.node_ids,
        hexes=model.hexes.astype(np.int64),
        element_ids=model.element_ids,
        element_part=model.element_part.astype(np.int64),
        parts=solver_parts(model),
        part_sets=model.part_sets,
        node_sets={name: np.asarray(rows, np.int64) for name, rows in model.node_sets.items()},
    )


def _from_keyword(path: Path) -> SolverModel:
    """Solids of a keyword deck in SI units; other elements and materials beyond two are not read."""
    deck = read_keyword(path)
    if not deck.solids:
        raise InputError(path, "holds no *ELEMENT_SOLID", expected="hexahedra")
    ids = np.array(sorted({n for _, corners in deck.solids.values() for n in corners}), np.int64)
    lost = [n for n in ids.tolist() if n not in deck.nodes]
    if lost:
        raise InputError(path, f"node {lost[0]} is in an element and not under *NODE", mend="add the node")
    wrong = [e for e, (_, corners) in deck.solids.items() if len(set(corners)) != 8]
    if wrong:
        raise InputError(
            path, f"element {wrong[0]} has fewer than eight nodes of its own", expected="hexahedra alone",
            mend="mesh that part with hexahedra",
        )  # fmt: skip
    pids = sorted({pid for pid, _ in deck.solids.values()})
    index = {pid: k for k, pid in enumerate(pids)}
    parts, unknown = [], {}
    for pid in pids:
        if pid not in deck.parts:
            raise InputError(path, f"part {pid} has elements and no *PART", mend="add the part")
        name, _, mid = deck.parts[pid]
        keyword, values = deck.materials.get(mid, (f"no *MAT with number {mid}", (1.0,)))
        if keyword in _KEYWORD_LAWS:
            law, names = _KEYWORD_LAWS[keyword]
            material = Material(f"{keyword} {mid}", law, values[0], dict(zip(names, values[1:])))
        else:
            unknown[pid] = keyword
            material = Material(f"{keyword} {mid}", "rigid", values[0], {})
        parts.append(SolverPart(pid, name or f"part {pid}", material))
    return SolverModel(
        nodes=np.array([deck.nodes[n] for n in ids.tolist()]),
        node_ids=ids,
        hexes=np.searchsorted(ids, np.array([corners for _, corners in deck.solids.values()])),
        element_ids=np.array(list(deck.solids), np.int64),
        element_part=np.array([index[pid] for pid, _ in deck.solids.values()], np.int64),
        parts=tuple(parts),
        part_sets=dict(deck.part_sets.values()),
        unknown=unknown,
    )


READERS: dict[str, Callable[[Path], SolverModel]] = {
    ".h5": _from_model_file,
    ".k": _from_keyword,
    ".key": _from_keyword,
    ".dyn": _from_keyword,
}
