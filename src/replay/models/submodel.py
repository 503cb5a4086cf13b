"""One assembly out of a model: the helmet alone for the shake, the head alone for a bare-head run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from replay.models.model import Model


def select_assembly(model: Model, assembly: str) -> Model:
    """Keep the elements of one assembly and the nodes they use; numbers stay as they are.

    Parameters
    ----------
    model
        The model.
    assembly
        ``head``, ``helmet`` or ``body``.

    Raises
    ------
    ValueError
        When the model has no element of it.
    """
    keep = model.elements_of(assembly=assembly)
    if not keep.any():
        message = f"the model has no element of the assembly {assembly!r}"
        raise ValueError(message)
    used = np.zeros(len(model.nodes), dtype=bool)
    used[model.hexes[keep]] = True
    row = np.where(used, np.cumsum(used) - 1, -1)
    old = [k for k, part in enumerate(model.parts) if part.assembly == assembly]
    index = np.full(len(model.parts), -1)
    index[old] = np.arange(len(old))
    pids = {model.parts[k].pid for k in old}
    sets = {name: tuple(p for p in members if p in pids) for name, members in model.part_sets.items()}
    sets = {name: members for name, members in sets.items() if members}
    node_sets = {name: row[rows][row[rows] >= 0].astype(np.int32) for name, rows in model.node_sets.items()}
    node_sets = {name: rows for name, rows in node_sets.items() if len(rows)}
    return replace(
        model,
        nodes=model.nodes[used],
        node_ids=model.node_ids[used],
        hexes=row[model.hexes[keep]].astype(np.int32),
        element_ids=model.element_ids[keep],
        element_part=index[model.element_part[keep]].astype(np.int32),
        element_region=model.element_region[keep],
        parts=tuple(model.parts[k] for k in old),
        part_sets=sets,
        part_set_ids={name: model.part_set_ids[name] for name in sets},
        node_sets=node_sets,
        joints=tuple(joint for joint in model.joints if {joint.first, joint.second} <= pids),
        rigid_node_sets=tuple(name for name in model.rigid_node_sets if name in node_sets),
        materials={model.parts[k].material: model.materials[model.parts[k].material] for k in old},
    )
