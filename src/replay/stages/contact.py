"""Contact of a play and of ``replay solve``: names become parts before a run, its sums the gate's numbers after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import pandas as pd

from replay.files import read_json
from replay.gates import Limits
from replay.gates.model import Judge
from replay.gates.numerics import CONTACT_CHECKS
from replay.play import ContactSettings, FrictionPair
from replay.solver import ContactControls, ContactPair

_SIDES = ("first", "second")


class _Named(Protocol):
    @property
    def pid(self) -> int: ...
    @property
    def name(self) -> str: ...


class Parted(Protocol):
    """A model with parts and sets of them."""

    @property
    def parts(self) -> Sequence[_Named]: ...  # noqa: D102
    @property
    def part_sets(self) -> Mapping[str, tuple[int, ...]]: ...  # noqa: D102


def part_numbers(model: Parted, name: str) -> tuple[int, ...]:
    """Numbers of the part, or of those parts of the set that the model has; none if there is neither."""
    if name in model.part_sets:
        present = {part.pid for part in model.parts}
        return tuple(pid for pid in model.part_sets[name] if pid in present)
    return tuple(part.pid for part in model.parts if part.name == name)


def pairs_without_a_side(model: Parted, pairs: Sequence[FrictionPair]) -> list[str]:
    """Pairs of which the model lacks a side, ``first-second``."""
    return [
        f"{pair.first}-{pair.second}"
        for pair in pairs
        if not (part_numbers(model, pair.first) and part_numbers(model, pair.second))
    ]


def unresolved_names(model: Parted, contact: ContactSettings) -> list[tuple[str, str]]:
    """Path within the block, and name, of everything that the model has not."""
    named = [(f"pairs[{k}].{side}", getattr(p, side)) for k, p in enumerate(contact.pairs) for side in _SIDES]
    named += [(f"self_contact[{k}]", name) for k, name in enumerate(contact.self_contact)]
    return [(path, name) for path, name in named if not part_numbers(model, name)]


def contact_controls(model: Parted, contact: ContactSettings, more: tuple[ContactPair, ...] = ()) -> ContactControls:
    """Contact of the parts that a model has, with further pairs; pairs of which it lacks a side are left out."""
    pairs = []
    for pair in contact.pairs:
        first, second = part_numbers(model, pair.first), part_numbers(model, pair.second)
        if first and second:
            pairs.append(ContactPair(first, second, pair.friction, name=f"{pair.first}-{pair.second}"))
    itself = [pid for name in contact.self_contact for pid in part_numbers(model, name)]
    return ContactControls(
        most_iterations=contact.most_iterations,
        tolerance=contact.tolerance,
        points=contact.points,
        friction=contact.friction,
        pairs=(*pairs, *more),
        self_contact=tuple(dict.fromkeys(itself)),
    )


def contact_numbers(summary: dict, energy: pd.DataFrame) -> dict[str, float | str] | None:
    """What the gates ask about contact, from ``run.json`` and ``energy.csv``; None for a run without contact."""
    told = summary["contact"]
    if not told:
        return None
    internal = float(energy["internal_J"].max())
    made = max(0.0, -float(energy["contact_normal_J"].min()))
    # the ledger's friction is a loss; work of 1e-12 of what there is, is rounding
    friction = -float(energy["friction_J"].min())
    return {
        "contact_creation_share": made / internal if internal > 0 else "the run has no internal energy",
        "friction_work_J": friction if friction > 1e-12 * internal else -float(energy["friction_J"].max()),
        "contact_unconverged_share": told["unconverged_share"] if told["steps"] else "nothing touched",
        "contact_unconverged_share_detail": f"{told['mean_iterations']:.1f} iterations a step",
        "penetration_over_edge": told["penetration_over_edge"],
    }


def contact_lines(folder: Path) -> list[str]:
    """What the numerics gate would say, by the shipped limits, of contact in the run of `folder`: a line a check."""
    judge = Judge("numerics", Limits.load())
    numbers = contact_numbers(read_json(folder / "run.json"), pd.read_csv(folder / "energy.csv"))
    judge.check_all(numbers or {}, CONTACT_CHECKS)
    return [f"{check.verdict}: {check.sentence()}" for check in judge.gate().checks]
