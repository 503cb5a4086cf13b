"""One play many times: the members of an ensemble, and which of their stages they share.

An ensemble is described beside its play, in ``config/plays/<play>/<name>.ensemble.yaml``:

    title: Friction of the pads, and sixteen drivers that the footage allows
    combine: grid                       # grid: every combination; rows: the first of each, the second of each ...
    vary:
      solver.contact.friction: [0.1, 0.3]
      reconstruction.draw: {from: 1, to: 16}
    set:
      reconstruction.ensemble: 16       # the same for every member

A stage is run once for every distinct choice of the settings it stands on; where that is the play's own, the play's
own run of the stage serves.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import Field, field_validator, model_validator

from replay.documents import Setting, load_yaml, refuse
from replay.play.overrides import unknown_setting

ENDING = ".ensemble.yaml"
MOST_MEMBERS = 1000
ADDRESS = re.compile(r"(?P<play>[a-z0-9_-]+)\.(?P<ensemble>[a-z0-9_-]+)(?:/(?P<member>[0-9]+))?")
"""``demo.friction`` is an ensemble, ``demo.friction/003`` one of its members."""

# Settings that each stage reads, by the beginning of their path, and the stages whose files it reads.
_OF_CONTACT = tuple(f"solver.contact.{name}" for name in ("scheme", "points", "pairs", "self_contact"))
_STANDS_ON: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "inputs": ((), ()),
    "reconstruction": (("t0", "window", "reconstruction.mode", "reconstruction.ensemble", "gates"), ()),
    "assembly": (("helmet", "model", "collision", "gates", *_OF_CONTACT), ()),
    "driver": (("window", "reconstruction", "collision"), ("reconstruction",)),
    "placement": (("collision", "solver.contact", "gates"), ("assembly", "driver")),
    "shake": (("solver", "shake", "gates"), ("assembly",)),
}
# A sensitivity run costs what the replay costs: the play's own speaks for its members.
_THE_PLAYS_OWN = ("inputs", "sensitivity")


class Span(Setting):
    """Whole numbers from the first to the last."""

    first: int = Field(alias="from", description="First.")
    last: int = Field(alias="to", description="Last, included.")


class EnsembleSettings(Setting):
    """What varies between the members of an ensemble."""

    title: str = Field(default="", description="One sentence on the ensemble.")
    combine: Literal["grid", "rows"] = Field(
        default="grid",
        description="`grid`: every combination of the values; `rows`: the first of each, the second of each ...",
    )
    vary: dict[str, list[Any] | Span] = Field(
        description="Dotted path of a setting to its values, or to whole numbers {from: 1, to: 16}.", min_length=1
    )
    set: dict[str, Any] = Field(default_factory=dict, description="Settings that are the same for every member.")

    @field_validator("vary", "set")
    @classmethod
    def _are_settings(cls, value: dict[str, Any]) -> dict[str, Any]:
        for path, values in value.items():
            reason = unknown_setting(path)
            if path.partition(".")[0] in ("name", "source", "withhold"):
                reason = f"{path} belongs to the play itself"
            if reason:
                refuse(reason, "the dotted path of a setting of play.yaml", "correct the path")
            if isinstance(values, list) and not values:
                refuse(f"{path} has no values", "a list of values", "write at least one")
        return value

    @model_validator(mode="after")
    def _combine(self) -> EnsembleSettings:
        lengths = {path: len(values) for path, values in self.values.items()}
        if both := sorted(set(self.vary) & set(self.set)):
            refuse(f"{both[0]} stands in `vary` and in `set`", "one of the two", "remove one")
        if self.combine == "rows" and len(set(lengths.values())) > 1:
            found = ", ".join(f"{path} {count}" for path, count in lengths.items())
            refuse(f"the rows have different numbers of values: {found}", "as many of each", "complete the shorter")
        if len(self.rows) > MOST_MEMBERS:
            refuse(f"{len(self.rows)} members", f"at most {MOST_MEMBERS}", "vary less at a time")
        return self

    @property
    def values(self) -> dict[str, list[Any]]:
        """Path to its values, spans written out."""
        return {
            path: list(range(given.first, given.last + 1)) if isinstance(given, Span) else given
            for path, given in self.vary.items()
        }

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Path to value of each member, without what all have in common."""
        columns = self.values
        combined = itertools.product(*columns.values()) if self.combine == "grid" else zip(*columns.values())
        return [dict(zip(columns, row)) for row in combined]


@dataclass(frozen=True)
class Member:
    """One member of an ensemble.

    Parameters
    ----------
    address
        ``demo.friction/003``.
    varied
        Dotted path to the value that tells it from the others.
    overrides
        These and what all members have in common.
    owners
        Stage to the address whose run of it serves, for the stages that are not its own.
    """

    address: str
    varied: Mapping[str, Any]
    overrides: Mapping[str, Any]
    owners: Mapping[str, str]


def read_ensemble(path: Path) -> EnsembleSettings:
    """Read an ensemble's description; as `replay.documents.load_yaml`."""
    return load_yaml(path, EnsembleSettings)


def members_of(play: str, name: str, settings: EnsembleSettings) -> dict[str, Member]:
    """Members of an ensemble by their number, ``001`` and on."""
    everyone = settings.rows
    width = max(3, len(str(len(everyone))))
    found: dict[str, Member] = {}
    first: dict[tuple[str, str], str] = {}
    for k, varied in enumerate(everyone, start=1):
        address = f"{play}.{name}/{k:0{width}d}"
        overrides = {**settings.set, **varied}
        owners = {}
        for stage in _STANDS_ON:
            own = {path: value for path, value in overrides.items() if _reads(stage, path)}
            if not own:
                owners[stage] = play
                continue
            choice = yaml.safe_dump(own)
            owner = first.setdefault((stage, choice), address)
            if owner != address:
                owners[stage] = owner
        owners |= dict.fromkeys(_THE_PLAYS_OWN, play)
        found[address.rpartition("/")[2]] = Member(address, varied, overrides, owners)
    return found


def _reads(stage: str, path: str) -> bool:
    beginnings, before = _STANDS_ON[stage]
    return any(path == b or path.startswith(f"{b}.") or b.startswith(f"{path}.") for b in beginnings) or any(
        _reads(earlier, path) for earlier in before
    )
