"""Placement: do two players stand apart, by the asked gap, under numbers of their own? (article, protocol 3.4-3.6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

CHECKS = (
    "gap_error_m",
    "initial_penetration_m",
    "colliding_ids",
    "parts_outside_block",
    "unresolved_friction_pairs",
)


def placement_gate(facts: Mapping[str, Any], limits: Limits) -> Gate:
    """Judge a scene of two players.

    Parameters
    ----------
    facts
        One entry per name of `CHECKS`; ``<name>_detail`` adds a sentence.

        - ``gap_error_m``: |least distance of the two surfaces - the gap asked for|.
        - ``initial_penetration_m``: deepest node of one player inside the other.
        - ``colliding_ids``: numbers of nodes, elements and parts that occur twice.
        - ``parts_outside_block``, ``unresolved_friction_pairs``: how many.
    """
    judge = Judge("placement", limits)
    judge.check_all(facts, CHECKS)
    return judge.gate()
