"""Two players in one model: the impactor's numbers and names, its place, and both together.

The struck player keeps the numbers of a single player: helmet 1 from 10,000,000, body 1 from 60,000,000. The
impactor gets those of the article's second one: helmet 2 from 20,000,000, body 2 from 40,000,000.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from replay.models.model import GRID_DECIMALS, Model

PREFIX = "impactor_"
"""Before every name of the impactor's that is not an article's own."""
EVERYTHING = "all_parts"
PLAYER_SETS = {"struck": ("head_1", "helmet_1"), "impactor": ("head_2", "helmet_2")}
"""Sets that hold all parts of each player; a deck's set is a range of numbers, and no one range holds a player."""
#: First number of each block of player 1, and what brings it to that of player 2.
_SHIFTS = ((10_000_000, 20_000_000, 10_000_000), (60_000_000, 70_000_000, -20_000_000))


def as_impactor(model: Model) -> Model:
    """Give a player the numbers and names of the second one.

    Parts, node sets and sets of parts are called as before with `PREFIX`, or by the article's number two: the set
    ``H1_pads_set1`` becomes ``H2_pads_set1``, ``helmet_1`` becomes ``helmet_2``.
    """
    parts = tuple(
        replace(part, pid=int(_second(np.array([part.pid]))[0]), name=PREFIX + part.name, player="impactor")
        for part in model.parts
    )
    number = {old.pid: new.pid for old, new in zip(model.parts, parts)}
    sets = {_named(name): tuple(number[pid] for pid in pids) for name, pids in model.part_sets.items()}
    return replace(
        model,
        node_ids=_second(model.node_ids),
        element_ids=_second(model.element_ids),
        parts=parts,
        part_sets=sets,
        part_set_ids={
            _named(name): int(_second(np.array([n]))[0]) if n > 99 else n for name, n in model.part_set_ids.items()
        },
        node_sets={PREFIX + name: rows for name, rows in model.node_sets.items()},
    )


def _second(numbers: np.ndarray) -> np.ndarray:
    """Numbers of player 2 for those of player 1."""
    out = numbers.copy()
    for low, high, shift in _SHIFTS:
        out[(numbers >= low) & (numbers < high)] += shift
    return out


def _named(name: str) -> str:
    """Name of a set of parts of player 2."""
    if name == EVERYTHING:
        return name
    renamed = re.sub(r"^H1_", "H2_", re.sub(r"_1$", "_2", name))
    return renamed if renamed != name else PREFIX + name


def placed(model: Model, rotation: Rotation, position_m: np.ndarray) -> Model:
    """Turn a model about its origin, the head's centre of gravity, and move that to a place."""
    return replace(model, nodes=np.round(rotation.apply(model.nodes) + position_m, GRID_DECIMALS) + 0.0)


def joined(struck: Model, impactor: Model) -> Model:
    """Both players in one model; the impactor must have come through `as_impactor`.

    Materials of one name and one content are one; where the impactor's differ they get the prefix. ``info`` is the
    struck player's, with the impactor's under ``impactor``.
    """
    materials, name_of = _materials(struck.materials, impactor.materials)
    parts = struck.parts + tuple(replace(part, material=name_of[part.material]) for part in impactor.parts)
    n = len(struck.nodes)
    everything = tuple(sorted(part.pid for part in parts))
    return replace(
        struck,
        nodes=np.vstack([struck.nodes, impactor.nodes]),
        node_ids=np.concatenate([struck.node_ids, impactor.node_ids]),
        hexes=np.vstack([struck.hexes, impactor.hexes + n]).astype(np.int32),
        element_ids=np.concatenate([struck.element_ids, impactor.element_ids]),
        element_part=np.concatenate([struck.element_part, impactor.element_part + len(struck.parts)]).astype(np.int32),
        element_region=np.concatenate([struck.element_region, impactor.element_region]),
        parts=parts,
        part_sets=struck.part_sets | impactor.part_sets | {EVERYTHING: everything},
        part_set_ids=struck.part_set_ids | impactor.part_set_ids,
        materials=materials,
        node_sets=struck.node_sets | {name: (rows + n).astype(np.int32) for name, rows in impactor.node_sets.items()},
        info={**struck.info, "impactor": impactor.info},
    )


def _materials(
    struck: Mapping[str, dict[str, Any]], impactor: Mapping[str, dict[str, Any]]
) -> tuple[dict[str, dict[str, Any]], dict[str, str]]:
    """Materials of both, and the name of each of the impactor's among them."""
    name_of = {name: name if struck.get(name, facts) == facts else PREFIX + name for name, facts in impactor.items()}
    return {**struck, **{name_of[name]: facts for name, facts in impactor.items()}}, name_of
