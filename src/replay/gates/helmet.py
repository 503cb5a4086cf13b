"""Helmet readiness: may this helmet surrogate be coupled at all? (article, protocol 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

CHECKS = (
    "mass_kg",
    "cg_offset_m",
    "length_m",
    "width_m",
    "height_m",
    "wedge_share",
    "removed_not_wedge",
    "missing_interfaces",
    "unusable_parts",
    "colliding_ids",
    "min_volume_m3",
    "min_scaled_jacobian",
)


def helmet_gate(inspection: Mapping[str, Any], limits: Limits) -> Gate:
    """Judge the inspection of a helmet.

    Parameters
    ----------
    inspection
        One entry per name of `CHECKS`; a text in place of a number is the reason why that
        check has no power, ``<name>_detail`` adds a sentence (removed ids, missing sets).

        - ``mass_kg``: mass of the helmet surrogate.
        - ``cg_offset_m``: distance of its centre of gravity from where the physical
          helmet has it, relative to the three-point datum.
        - ``length_m``, ``width_m``, ``height_m``: overall dimensions along x, y, z.
        - ``wedge_share``: wedges (elements with coinciding nodes) left, over all elements.
        - ``removed_not_wedge``: elements removed that were no wedges.
        - ``missing_interfaces``: sets missing among pads, pad-pad, facemask mounts and
          strap anchors.
        - ``unusable_parts``: parts without a definition, a material, or a law of ours.
        - ``colliding_ids``: numbers of nodes, elements, parts and other things given twice.
        - ``min_volume_m3``, ``min_scaled_jacobian``: over all elements.
    """
    judge = Judge("helmet", limits)
    judge.check_all(inspection, CHECKS)
    return judge.gate()
