"""Players in one assembly: numbers of their own, and places of their own.

Player 1 has the article's blocks 10,000,000 (helmet) and 60,000,000 (head and body), player 2 has 20,000,000 and
40,000,000. Names of player 2 end in ``_2``; sets that the article numbers by player take the 2 in place of the 1.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from replay.models.model import Model
from replay.models.numbering import BLOCK_SIZE, PLAYERS

_ALL = "all_parts"


def second_player(model: Model) -> Model:
    """Give a model the numbers and names of player 2.

    Parameters
    ----------
    model
        Of player 1, with or without body.

    Raises
    ------
    ValueError
        When a number lies in no block of player 1.
    """
    joints = tuple(
        replace(
            joint, name=f"{joint.name}_2", first=second_number(joint.first), second=second_number(joint.second)
        )
        for joint in model.joints
    )  # fmt: skip
    return replace(
        model,
        node_ids=_second(model.node_ids),
        element_ids=_second(model.element_ids),
        parts=tuple(
            replace(p, pid=second_number(p.pid), name=f"{p.name}_2", material=f"{p.material}_2") for p in model.parts
        ),
        part_sets={
            second_set_name(name): tuple(second_number(pid) for pid in pids) for name, pids in model.part_sets.items()
        },
        part_set_ids={
            second_set_name(name): number if name == _ALL else second_number(number)
            for name, number in model.part_set_ids.items()
        },
        materials={f"{name}_2": facts for name, facts in model.materials.items()},
        node_sets={f"{name}_2": rows for name, rows in model.node_sets.items()},
        joints=joints,
        rigid_node_sets=tuple(f"{name}_2" for name in model.rigid_node_sets),
        info={**model.info, "player": 2},
    )


def second_number(number: int) -> int:
    """The number of player 2 for one of player 1.

    Raises
    ------
    ValueError
        When it lies in no block of player 1.
    """
    return int(_second(np.array([number]))[0])


def _second(numbers: np.ndarray) -> np.ndarray:
    one, two = PLAYERS[1], PLAYERS[2]
    block = numbers // BLOCK_SIZE * BLOCK_SIZE
    known = np.isin(block, (one.head, one.helmet))
    if not known.all():
        message = f"number {numbers[~known][0]} lies in no block of player 1"
        raise ValueError(message)
    return numbers + np.where(block == one.head, two.head - one.head, two.helmet - one.helmet)


def second_set_name(name: str) -> str:
    """Name of player 2's set: ``H2_pads_set1`` for ``H1_pads_set1``, ``head_2`` for ``head_1``, else ``_2`` behind."""
    if name == _ALL:
        return name
    if name.startswith("H1_"):
        return "H2_" + name[3:]
    return (name[:-2] if name.endswith("_1") else name) + "_2"


def placed(model: Model, position_m: np.ndarray, rotation: Rotation) -> Model:
    """Put a player into space.

    Parameters
    ----------
    model
        In the head frame.
    position_m
        Where the head's centre of gravity goes, (3,) [m].
    rotation
        Head to space.
    """
    position = np.asarray(position_m, float)
    joints = tuple(
        replace(
            joint,
            centre_m=tuple((position + rotation.apply(joint.centre_m)).tolist()),
            axes=tuple(map(tuple, rotation.apply(np.array(joint.axes)).tolist())),
        )
        for joint in model.joints
    )
    return replace(model, nodes=position + rotation.apply(model.nodes), joints=joints)


def together(models: Sequence[Model]) -> Model:
    """Several players as one model.

    Parameters
    ----------
    models
        Placed, with numbers that do not clash.

    Returns
    -------
    Model
        ``info["players"]`` keeps the notes of each; notes in which all agree stand beside it.

    Raises
    ------
    ValueError
        When a number or a name occurs twice, or their regions differ.
    """
    numbers: tuple[tuple[str, list[int] | list[str]], ...] = (
        ("node number", [n for m in models for n in m.node_ids.tolist()]),
        ("element number", [n for m in models for n in m.element_ids.tolist()]),
        ("part number", [p.pid for m in models for p in m.parts]),
        ("part", [p.name for m in models for p in m.parts]),
        ("material", [name for m in models for name in m.materials]),
        ("node set", [name for m in models for name in m.node_sets]),
        ("joint", [j.name for m in models for j in m.joints]),
    )
    for what, found in numbers:
        twice = [value for value, count in Counter(found).items() if count > 1]
        if twice:
            message = f"{what} {twice[0]} occurs twice; give a player the numbers of `second_player`"
            raise ValueError(message)
    if len({m.region_names for m in models}) > 1:
        message = "the players' brains have different regions"
        raise ValueError(message)
    first_node = np.cumsum([0, *(len(m.nodes) for m in models)])
    first_part = np.cumsum([0, *(len(m.parts) for m in models)])
    sets: dict[str, tuple[int, ...]] = {}
    for model in models:
        for name, pids in model.part_sets.items():
            sets[name] = tuple(sorted({*sets.get(name, ()), *pids}))
    shared = {k: v for k, v in models[0].info.items() if all(m.info.get(k) == v for m in models)}
    return Model(
        nodes=np.vstack([m.nodes for m in models]),
        node_ids=np.concatenate([m.node_ids for m in models]),
        hexes=np.vstack([m.hexes + k for m, k in zip(models, first_node)]).astype(np.int32),
        element_ids=np.concatenate([m.element_ids for m in models]),
        element_part=np.concatenate([m.element_part + k for m, k in zip(models, first_part)]).astype(np.int32),
        element_region=np.concatenate([m.element_region for m in models]),
        parts=tuple(p for m in models for p in m.parts),
        region_names=models[0].region_names,
        part_sets=sets,
        part_set_ids={name: number for m in models for name, number in m.part_set_ids.items()},
        materials={name: facts for m in models for name, facts in m.materials.items()},
        info={**shared, "players": [m.info for m in models]},
        node_sets={
            name: (rows + k).astype(np.int32)
            for m, k in zip(models, first_node)
            for name, rows in m.node_sets.items()
        },
        joints=tuple(j for m in models for j in m.joints),
        rigid_node_sets=tuple(name for m in models for name in m.rigid_node_sets),
    )  # fmt: skip
