"""Numbers of parts, sets, nodes and elements: a block for each player's head and helmet, as the article has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.models.helmet_design import HelmetDesign
from replay.models.materials import MATERIAL_OF_ROLE
from replay.models.model import Part

BLOCK_SIZE = 10_000_000
APPARATUS = 30_000_000
"""Block of a laboratory's apparatus, which takes the second player's place."""
_HEAD_PARTS = {"grey_matter": 1, "csf": 2, "skull": 3, "white_matter": 4, "scalp": 9020, "face": 9021}
_HEAD_ROLES = {"grey_matter": "brain", "white_matter": "brain"}


@dataclass(frozen=True)
class Blocks:
    """Where a player's numbers begin; a body counts on in the block of its head.

    Parameters
    ----------
    player
        1 or 2.
    head, helmet
        First number of each block; parts, nodes and elements count from the next.
    """

    player: int
    head: int
    helmet: int

    def of(self, assembly: str) -> tuple[int, int]:
        """First and last number of the block of ``head``, ``body``, ``helmet`` or ``apparatus``."""
        first = {"helmet": self.helmet, "apparatus": APPARATUS}.get(assembly, self.head)
        return first, first + BLOCK_SIZE - 1

    @property
    def pad_sets(self) -> tuple[str, str]:
        """Names of the sets of comfort pads and of energy pads."""
        return f"H{self.player}_pads_set1", f"H{self.player}_pads_set2"

    @property
    def set_ids(self) -> dict[str, int]:
        """Set numbers by name."""
        comfort, energy = self.pad_sets
        return {
            comfort: self.helmet + 99,
            energy: self.helmet + 100,
            "all_parts": 99,
            f"helmet_{self.player}": self.helmet + 98,
            f"head_{self.player}": self.head + 98,
            "skull": self.head + 99,
        }


PLAYERS = {1: Blocks(1, 60_000_000, 10_000_000), 2: Blocks(2, 40_000_000, 20_000_000)}
"""The struck player and the other; the article's blocks."""


def part_table(blocks: Blocks, design: HelmetDesign | None) -> tuple[Part, ...]:
    """Parts of head and helmet with their numbers, in the order of a model's elements."""
    parts = []
    for name, number in _HEAD_PARTS.items():
        role = _HEAD_ROLES.get(name, name)
        parts.append(Part(blocks.head + number, name, role, "head", MATERIAL_OF_ROLE[role]))
    if design is None:
        return tuple(parts)
    shell, cup, pads = design.shell, design.chinstrap.cup, design.pads.pads
    worn = [(shell.shell_pid, "shell", "shell", shell.shell_material)]
    if design.facemask is not None:
        worn.append((design.facemask.pid, "facemask", "facemask", design.facemask.material))
    comfort = [(p.comfort_pid, f"comfort_pad_{name}", "comfort_pad", p.comfort_material) for name, p in pads.items()]
    energy = [(p.energy_pid, f"energy_pad_{name}", "energy_pad", p.energy_material) for name, p in pads.items()]
    worn += [*sorted(comfort), *sorted(energy), (cup.pid, "chin_cup", "chin_cup", cup.material)]
    parts += [Part(blocks.helmet + pid, name, role, "helmet", material) for pid, name, role, material in worn]
    return tuple(parts)


def part_sets(blocks: Blocks, parts: Sequence[Part]) -> tuple[dict[str, tuple[int, ...]], dict[str, int]]:
    """Part numbers of every set that has any, and the sets' numbers."""
    comfort, energy = blocks.pad_sets
    chosen = {
        comfort: [p.pid for p in parts if p.role == "comfort_pad"],
        energy: [p.pid for p in parts if p.role == "energy_pad"],
        "all_parts": [p.pid for p in parts],
        f"helmet_{blocks.player}": [p.pid for p in parts if p.assembly == "helmet"],
        f"head_{blocks.player}": [p.pid for p in parts if p.assembly == "head"],
        "skull": [p.pid for p in parts if p.role == "skull"],
    }
    sets = {name: tuple(sorted(pids)) for name, pids in chosen.items() if pids}
    return sets, {name: blocks.set_ids[name] for name in sets}


def node_numbers(blocks: Blocks, hexes: np.ndarray, in_head: np.ndarray, count: int) -> np.ndarray:
    """Node numbers, (count,): nodes that head and helmet share count with the head."""
    of_head = np.zeros(count, dtype=bool)
    of_head[hexes[in_head]] = True
    return element_numbers(blocks, of_head)


def element_numbers(blocks: Blocks, in_head: np.ndarray) -> np.ndarray:
    """Numbers counted from the head's block where `in_head`, from the helmet's elsewhere, (n,)."""
    return np.where(in_head, blocks.head + np.cumsum(in_head), blocks.helmet + np.cumsum(~in_head)).astype(np.int64)
