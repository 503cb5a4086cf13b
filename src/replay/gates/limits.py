"""The limits of every gate, with their units and sources, and a play's own settings of them.

``limits.yaml`` beside this module is the only place where a limit is written. A play may
set a bound to another number; a looser one is applied, marked and printed.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, cast

import yaml

from replay.errors import InputError, InputErrors

LIMITS_FILE = Path(__file__).with_name("limits.yaml")
Bound = float | bool
Verdict = Literal["pass", "warn", "fail", "vacuous"]

_BEYOND: dict[str, Callable[[float, float], bool]] = {
    "above": lambda value, bound: value > bound,
    "from": lambda value, bound: value >= bound,
    "below": lambda value, bound: value < bound,
    "to": lambda value, bound: value <= bound,
    "unless": lambda value, bound: value != bound,
}
_SIGN = {"above": "<=", "from": "<", "below": ">=", "to": ">", "unless": "is"}
_UPPER, _LOWER = ("above", "from"), ("below", "to")


@dataclass(frozen=True)
class Limit:
    """One limit: its bounds, its unit, and who set it.

    Parameters
    ----------
    name
        ``gate.check``.
    unit
        Unit of the value and of the bounds ("1" for a ratio, "" for yes or no).
    source
        Who set it: the article with its section, or the reason of ours.
    bounds
        ``{"warn_above": 0.05, ...}``; see the head of ``limits.yaml``.
    parameter
        For an entry that is a setting of a gate rather than a bound.
    loosened_from
        Bounds that the play replaced by looser ones, as they stood.
    """

    name: str
    unit: str
    source: str
    bounds: Mapping[str, Bound] = field(default_factory=dict)
    parameter: float | None = None
    loosened_from: Mapping[str, Bound] = field(default_factory=dict)

    def judge(self, value: float | bool) -> Verdict:
        """Return ``fail``, ``warn`` or ``pass`` for a value; a NaN or infinite one fails."""
        if not isinstance(value, bool) and not math.isfinite(value):
            return "fail"
        for verdict in ("fail", "warn"):
            for name, bound in self.bounds.items():
                severity, kind = name.split("_")
                if severity == verdict and _BEYOND[kind](value, bound):
                    return cast(Verdict, verdict)
        return "pass"

    def text(self, bounds: Mapping[str, Bound] | None = None) -> str:
        """Return the limit as a person reads it: what passes, and where a warning turns into a failure."""
        bounds = self.bounds if bounds is None else bounds
        if self.parameter is not None:
            return f"{self.parameter:g}"
        warns = {n.split("_")[1]: b for n, b in bounds.items() if n.startswith("warn")}
        fails = {n.split("_")[1]: b for n, b in bounds.items() if n.startswith("fail")}
        if warns and fails:
            return f"{_range(warns)} (fails unless {_range(fails)})"
        return f"{_range(warns)} (warns)" if warns else _range(fails)


def _range(bounds: Mapping[str, Bound]) -> str:
    if "unless" in bounds:
        return "yes" if bounds["unless"] else "no"
    low = [(k, b) for k, b in bounds.items() if k in _LOWER]
    high = [(k, b) for k, b in bounds.items() if k in _UPPER]
    if low and high and low[0][0] == "below" and high[0][0] == "above":
        return f"{low[0][1]:g} to {high[0][1]:g}"
    return " and ".join(f"{_SIGN[k]} {b:g}" for k, b in low + high)


@dataclass(frozen=True)
class GateFacts:
    """What ``limits.yaml`` says of a gate as a whole."""

    name: str
    title: str
    stops_run: bool
    source: str
    between_plays: bool = False
    mode: str = ""
    of_record: bool = False


class Limits:
    """All limits, with a play's own settings applied.

    Parameters
    ----------
    limits
        By full name ``gate.check``.
    gates
        Facts of each gate, in the order of the protocol.
    mode
        Of the play: a gate that is for another mode is not asked for.
    recorded
        Whether the play has a record of the head's motion; without one no gate on it is asked for.
    """

    def __init__(
        self,
        limits: Mapping[str, Limit],
        gates: Mapping[str, GateFacts],
        mode: str = "driver",
        *,
        recorded: bool = True,
    ) -> None:
        self.mode, self.recorded = mode, recorded
        self._limits = MappingProxyType(dict(limits))
        self.gates = MappingProxyType(dict(gates))

    @property
    def protocol(self) -> dict[str, GateFacts]:
        """The gates that every play of this mode passes, in order; without those that judge plays against others."""
        return {
            name: facts
            for name, facts in self.gates.items()
            if not facts.between_plays and facts.mode in ("", self.mode) and (self.recorded or not facts.of_record)
        }

    @classmethod
    def load(
        cls,
        overrides: Mapping[str, Any] | None = None,
        *,
        file: str | Path = "play.yaml",
        mode: str = "driver",
        recorded: bool = True,
    ) -> Limits:
        """Load the shipped limits and apply a play's settings.

        Parameters
        ----------
        overrides
            ``{"gate.check": number}`` where the limit has one bound, else
            ``{"gate.check": {"fail_above": number, ...}}``.
        file
            Named in errors: where the overrides were written.
        mode
            Of the play, ``driver`` or ``collision``.
        recorded
            Whether the play has a record of the head's motion.

        Raises
        ------
        InputError, InputErrors
            For an unknown limit or bound, or a bound that is not a number.
        """
        limits, gates = _shipped()
        changed, errors = dict(limits), []
        for name, setting in (overrides or {}).items():
            try:
                changed[name] = _override(limits, str(name), setting, file)
            except InputError as error:
                errors.append(error)
        if errors:
            raise errors[0] if len(errors) == 1 else InputErrors(errors)
        return cls(changed, gates, mode, recorded=recorded)

    def __getitem__(self, name: str) -> Limit:
        return self._limits[name]

    def __iter__(self):
        return iter(self._limits)

    def of(self, gate: str) -> dict[str, Limit]:
        """Return the limits of one gate by the name of the check."""
        return {n.split(".", 1)[1]: v for n, v in self._limits.items() if n.startswith(gate + ".")}

    @property
    def loosened(self) -> tuple[Limit, ...]:
        """Limits that the play made looser than the shipped ones."""
        return tuple(limit for limit in self._limits.values() if limit.loosened_from)


@cache
def _shipped() -> tuple[dict[str, Limit], dict[str, GateFacts]]:
    raw = yaml.safe_load(LIMITS_FILE.read_text(encoding="utf-8"))
    gates = {name: GateFacts(name=name, **facts) for name, facts in raw["gates"].items()}
    limits = {}
    for name, entry in raw["limits"].items():
        rest = {k: v for k, v in entry.items() if k not in ("unit", "source", "parameter")}
        limits[name] = Limit(name, entry["unit"], entry["source"], rest, entry.get("parameter"))
    return limits, gates


def _override(limits: Mapping[str, Limit], name: str, setting: Any, file: str | Path) -> Limit:
    where = f"gates.{name}"
    if name not in limits:
        near = difflib.get_close_matches(name, limits, n=1, cutoff=0.5)
        mend = f"did you mean {near[0]}?" if near else "the names are in docs/gates.md"
        raise InputError(file, "there is no such limit", column=where, mend=mend)
    limit = limits[name]
    if limit.parameter is not None:
        return replace(limit, parameter=_number(setting, file, where))
    if not isinstance(setting, Mapping):
        if len(limit.bounds) != 1:
            raise InputError(
                file,
                f"{setting!r} does not say which bound it sets",
                column=where,
                expected=", ".join(limit.bounds),
                mend=f"write {{{next(iter(limit.bounds))}: {setting}}}",
            )
        setting = {next(iter(limit.bounds)): setting}
    bounds, loosened = dict(limit.bounds), {}
    for key, value in setting.items():
        if key not in bounds:
            raise InputError(file, f"{key!r} is not a bound of this limit", column=where, expected=", ".join(bounds))
        if key.endswith("unless"):
            raise InputError(file, "a yes-or-no check cannot be set", column=where, mend="remove the line")
        bounds[key] = _number(value, file, f"{where}.{key}")
        kind = key.split("_")[1]
        shipped = limit.bounds[key]
        if (kind in _UPPER and bounds[key] > shipped) or (kind in _LOWER and bounds[key] < shipped):
            loosened[key] = shipped
    return replace(limit, bounds=bounds, loosened_from=loosened)


def _number(value: Any, file: str | Path, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(file, f"{value!r} is not a number", column=where, expected="a finite number")
    return float(value)
