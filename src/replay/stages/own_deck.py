"""Our own model through LS-DYNA keyword and back, to the last bit: cards first, and the facts that no card can say."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from replay.decks import DeckPart, KeywordDeck, NumberedSet
from replay.decks.facts import read_facts, same_card
from replay.decks.keyword.materials import map_material
from replay.decks.keyword.units import SYSTEMS
from replay.models import Model, Part
from replay.models.model import GRID_DECIMALS

_FIRST_NODE_SET = 10_000_201
_FIRST_REGION_SET = 60_000_201
_REGION = "region "


def node_sets(model: Model) -> tuple[NumberedSet, ...]:
    """The model's node sets, numbered."""
    return tuple(NumberedSet(_FIRST_NODE_SET + k, name, rows) for k, (name, rows) in enumerate(model.node_sets.items()))


def region_sets(model: Model) -> tuple[NumberedSet, ...]:
    """The brain's regions as sets of elements."""
    regions = ((k, np.flatnonzero(model.element_region == k)) for k in range(1, len(model.region_names)))
    return tuple(
        NumberedSet(_FIRST_REGION_SET + k, _REGION + model.region_names[k], rows) for k, rows in regions if len(rows)
    )


def model_facts(model: Model, position_m: np.ndarray, rotation: Rotation) -> dict[str, Any]:
    """What of a model no card can say, and the pose in which the deck shows it."""
    return {
        "pose": {"position_m": position_m.tolist(), "quaternion_xyzw": rotation.as_quat().tolist()},
        "parts": [asdict(part) for part in model.parts],
        "region_names": list(model.region_names),
        "materials": model.materials,
        "info": model.info,
    }


def model_of_own_deck(deck: KeywordDeck) -> Model | None:
    """The model that a deck of ours was written from; None for a deck of somebody else, or where its parts changed.

    Mesh, numbers and sets come from the cards. Constants of a law come from the facts while the card is as we wrote it;
    from the card where it was edited.
    """
    facts = read_facts(deck)
    entries, cards = deck.of_kind("part"), deck.of_kind("material")
    if facts is None:
        return None
    parts = tuple(Part(**part) for part in facts["parts"])
    if {part.pid: part.name for part in parts} != {pid: entry.title for pid, entry in entries.items()}:
        return None
    materials = dict(facts["materials"])
    for k, part in enumerate(parts):
        law = materials[part.material]
        card = cards.get(entries[part.pid].whole("mid"))
        if card is None:
            return None
        shape = DeckPart(
            part.pid, part.name, law["law"], law["density_kg_per_m3"], law["parameters"], part.assembly
        )  # fmt: skip
        if not same_card(card, shape):
            mapped = map_material(card, deck, SYSTEMS["m-kg-s"])
            if mapped.refused:
                return None
            name = f"{part.material}_{part.pid}"
            parameters = {n: list(v) if isinstance(v, tuple) else v for n, v in mapped.parameters.items()}
            materials[name] = {
                "law": mapped.law,
                "density_kg_per_m3": mapped.density_kg_per_m3,
                "parameters": parameters,
                "certainty": dict.fromkeys(("density_kg_per_m3", *parameters), "given"),
                "source": f"{mapped.keyword} {mapped.mid} of the deck, edited",
            }
            parts = (*parts[:k], replace(part, material=name), *parts[k + 1 :])
    index = {part.pid: k for k, part in enumerate(parts)}
    order = np.argsort(deck.node_ids, kind="stable")
    pose = facts["pose"]
    nodes = Rotation.from_quat(pose["quaternion_xyzw"]).inv().apply(deck.nodes - np.array(pose["position_m"]))

    def rows(of: np.ndarray, members: Any, sorter: np.ndarray) -> np.ndarray:
        return sorter[np.searchsorted(of, np.asarray(members, dtype=np.int64), sorter=sorter)]

    elements = np.argsort(deck.solids.ids, kind="stable")
    names = tuple(facts["region_names"])
    region = np.zeros(len(deck.solids.ids), dtype=np.int32)
    for entry in deck.of_kind("solid_set").values():
        if entry.title.startswith(_REGION):
            region[rows(deck.solids.ids, entry.members(), elements)] = names.index(entry.title.removeprefix(_REGION))
    sets = deck.of_kind("part_set")
    return Model(
        nodes=np.round(nodes, GRID_DECIMALS) + 0.0,
        node_ids=deck.node_ids,
        hexes=rows(deck.node_ids, deck.solids.nodes[:, :8], order).astype(np.int32),
        element_ids=deck.solids.ids,
        element_part=np.array([index[pid] for pid in deck.solids.parts.tolist()], dtype=np.int32),
        element_region=region,
        parts=parts,
        region_names=names,
        part_sets={entry.title: entry.members() for entry in sets.values()},
        part_set_ids={entry.title: number for number, entry in sets.items()},
        materials={m: materials[m] for m in materials if any(p.material == m for p in parts)},
        info=facts["info"],
        node_sets={
            e.title: rows(deck.node_ids, e.members(), order).astype(np.int32) for e in deck.of_kind("node_set").values()
        },
    )
