"""Assembly: do head and helmet together have the right masses, numbers and seats? (article, protocol 3.1, 3.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

NO_CONTACT = "no contact in this model: pads share nodes with scalp and shell"

CHECKS = (
    "helmet_mass_difference_kg",
    "helmet_cg_difference_m",
    "head_mass_kg",
    "head_cg_offset_m",
    "duplicate_part_ids",
    "parts_outside_block",
    "unconnected_parts",
    "min_scaled_jacobian",
)
CONTACT_CHECKS = (
    "initial_penetration_m",
    "projection_over_edge",
    "projection_jacobian_ratio",
    "unresolved_friction_pairs",
)


def assembly_gate(facts: Mapping[str, Any], limits: Limits, *, contact: Mapping[str, Any] | None = None) -> Gate:
    """Judge the assembled model.

    Parameters
    ----------
    facts
        One entry per name of `CHECKS`; a text in place of a number is the reason why that
        check has no power, ``<name>_detail`` adds a sentence.

        - ``helmet_mass_difference_kg``: |surrogate - physical|.
        - ``helmet_cg_difference_m``: distance of the two centres of gravity.
        - ``head_mass_kg``; ``head_cg_offset_m``: distance of the head's centre of gravity
          from the origin of the head frame.
        - ``duplicate_part_ids``, ``parts_outside_block``: numbers of parts.
        - ``unconnected_parts``: parts that share no node with another part and that no strap holds.
        - ``min_scaled_jacobian``: over all elements.
    contact
        One entry per name of `CONTACT_CHECKS`, or None for a model without contact.
    """
    judge = Judge("assembly", limits)
    judge.check_all(facts, CHECKS)
    judge.check_all(contact if contact is not None else dict.fromkeys(CONTACT_CHECKS, NO_CONTACT), CONTACT_CHECKS)
    return judge.gate()
