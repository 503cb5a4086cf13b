"""Limits in force for a play, and what its gates are told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from replay.gates import Limits
from replay.stages.frame import Finished
from replay.stages.resolved import read_settings


def limits_of(stage: Finished) -> Limits:
    """Limits in force for the play: the shipped ones, with the play's own where it sets some.

    The tolerances of the physical helmet are settings of the play of their own (``helmet.mass_tolerance_kg``).
    """
    play = read_settings(stage)
    tolerances = {
        "assembly.helmet_mass_difference_kg": play.helmet.mass_tolerance_kg,
        "assembly.helmet_cg_difference_m": play.helmet.cg_tolerance_m,
        "helmet.cg_offset_m": play.helmet.cg_tolerance_m,
    }
    return Limits.load({**tolerances, **play.gates}, mode=play.mode, recorded=play.recorded)


def told(facts: Mapping[str, Any], checks: tuple[str, ...]) -> dict[str, Any]:
    """Entries that a gate's checks name, with their details; a detail that says nothing is left out."""
    named = {name: facts[name] for name in checks}
    return named | {f"{name}_detail": facts[f"{name}_detail"] for name in checks if facts.get(f"{name}_detail")}
