"""A check, a gate, and how their verdicts combine and are written.

A check compares one value with one limit. Its verdict is ``pass``, ``warn``, ``fail``, or
``vacuous`` when it has no power (a residual with no degrees of freedom, a contact check of
a model without contact). A gate's verdict is the worst of its checks; a vacuous check
counts as a warning: it has proved nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.errors import InputError
from replay.files import read_json, write_json
from replay.gates.limits import Limits, Verdict

Value = float | int | bool | None
_RANK = {"pass": 0, "vacuous": 1, "warn": 1, "fail": 2}
_GATE_VERDICT = ("pass", "warn", "fail")


@dataclass(frozen=True)
class Check:
    """One comparison of a value with a limit.

    Parameters
    ----------
    name
        What is checked, without the gate's name; a check made per part or region adds it
        after a colon (``hourglass_share: helmet_shell``).
    value
        The value, None where it could not be had.
    unit
        Its unit ("1" for a ratio, "" for yes or no).
    limit
        The limit as text.
    verdict
        ``pass``, ``warn``, ``fail`` or ``vacuous``.
    source
        Who set the limit.
    detail
        One sentence that a reader needs, such as why the check is vacuous or which part is worst.
    loosened_from
        The shipped limit as text, where the play made it looser.
    """

    name: str
    value: Value
    unit: str
    limit: str
    verdict: Verdict
    source: str
    detail: str = ""
    loosened_from: str = ""

    def sentence(self) -> str:
        """Return the check as one clause for a person."""
        shown = "no value" if self.value is None else _shown(self.value)
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        clause = f"{self.name} {shown}{unit if self.value is not None else ''} (limit {self.limit}{unit})"
        return clause + (f": {self.detail}" if self.detail else "")


@dataclass(frozen=True)
class Gate:
    """A gate of the protocol with its checks.

    Parameters
    ----------
    name
        As in ``limits.yaml``.
    title
        For a person.
    stops_run
        Whether a failure ends the play here.
    checks
        In the order in which they are shown.
    """

    name: str
    title: str
    stops_run: bool
    checks: tuple[Check, ...]

    def __post_init__(self) -> None:
        if not self.checks:
            message = f"gate {self.name} has no check: a gate that cannot fail is none"
            raise ValueError(message)

    @property
    def verdict(self) -> Verdict:
        """The worst of the checks, a vacuous one counting as a warning."""
        return _GATE_VERDICT[max(_RANK[check.verdict] for check in self.checks)]  # type: ignore[return-value]

    @property
    def stops(self) -> bool:
        """Whether this gate, with this verdict, ends the play."""
        return self.stops_run and self.verdict == "fail"

    def causes(self) -> tuple[Check, ...]:
        """Return the checks that gave the verdict, worst first; none for a pass."""
        bad = [check for check in self.checks if check.verdict != "pass"]
        return tuple(sorted(bad, key=lambda check: (-_RANK[check.verdict], check.verdict == "vacuous")))

    def cause_lines(self) -> list[str]:
        """Return the causes for a terminal: one line a check, and one line a reason for those without power."""
        lines = [f"{check.verdict}: {check.sentence()}" for check in self.causes() if check.verdict != "vacuous"]
        powerless: dict[str, list[str]] = {}
        for check in self.causes():
            if check.verdict == "vacuous":
                powerless.setdefault(check.detail or "no reason given", []).append(check.name)
        return lines + [f"not checked ({why}): {', '.join(names)}" for why, names in powerless.items()]

    def to_json(self) -> dict[str, Any]:
        """Return the content of gate.json."""
        return {"gate": self.name, "verdict": self.verdict, "checks": [_check_to_json(c) for c in self.checks]}

    def write(self, path: str | Path) -> None:
        """Write gate.json."""
        write_json(path, self.to_json())


def read_gate(path: str | Path, limits: Limits | None = None) -> Gate:
    """Read a gate.json back.

    Raises
    ------
    InputError
        When the file is not a gate, or its verdict is not that of its checks.
    """
    limits = limits or Limits.load()
    raw = read_json(path)
    try:
        facts = limits.gates[raw["gate"]]
        checks = tuple(Check(**check) for check in raw["checks"])
        unknown = {c.verdict for c in checks} - set(_RANK)
        if unknown:
            raise KeyError(unknown.pop())
        gate = Gate(facts.name, facts.title, facts.stops_run, checks)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            path,
            f"is not a gate file ({error})",
            expected='{"gate", "verdict", "checks": [{"name", "value", "unit", "limit", "verdict", "source"}]}',
            mend="run the stage again that writes it",
        ) from None
    if raw.get("verdict") != gate.verdict:
        raise InputError(
            path,
            f"says {raw.get('verdict')!r}, but its checks say {gate.verdict!r}",
            mend="the file was edited; run the stage again that writes it",
        )
    return gate


class Judge:
    """Builds the checks of one gate from values and the limits.

    Parameters
    ----------
    gate
        Name of the gate.
    limits
        The limits in force for this play.
    """

    def __init__(self, gate: str, limits: Limits) -> None:
        self._facts = limits.gates[gate]
        self._limits = limits.of(gate)
        self._checks: list[Check] = []

    def parameter(self, name: str) -> float:
        """Return a setting of the gate that is not a bound."""
        value = self._limits[name].parameter
        assert value is not None
        return value

    def check(self, name: str, value: Value | str, detail: str = "", *, of: str = "") -> Check:
        """Judge one value and keep the check.

        Parameters
        ----------
        name
            Name of the limit within the gate.
        value
            A number or a bool; None when it could not be had; a *text* is the reason why
            the check has no power. The last two are vacuous.
        detail
            One sentence for the reader.
        of
            The part or region the check is made for.
        """
        limit = self._limits[name]
        label = f"{name}: {of}" if of else name
        loosened = limit.text({**limit.bounds, **limit.loosened_from}) if limit.loosened_from else ""
        if value is None or isinstance(value, str):
            reason = value or "no value was given"
            check = Check(label, None, limit.unit, limit.text(), "vacuous", limit.source, reason, loosened)
        else:
            plain = value if isinstance(value, bool) else _plain_number(value)
            check = Check(label, plain, limit.unit, limit.text(), limit.judge(plain), limit.source, detail, loosened)
        self._checks.append(check)
        return check

    def check_all(self, values: Mapping[str, Any], names: Iterable[str]) -> None:
        """Judge the values of `names` in that order; ``<name>_detail`` in `values` is the detail.

        Raises
        ------
        ValueError
            When a value is missing or unknown (a mistake of ours, not of a user).
        """
        names = list(names)
        known = {*names, *(f"{name}_detail" for name in names)}
        wrong = sorted((set(names) - set(values)) | (set(values) - known))
        if wrong:
            message = f"gate {self._facts.name}: {', '.join(wrong)} missing or unknown"
            raise ValueError(message)
        for name in names:
            self.check(name, values[name], values.get(f"{name}_detail", ""))

    def gate(self) -> Gate:
        """Return the gate with the checks made so far."""
        facts = self._facts
        return Gate(facts.name, facts.title, facts.stops_run, tuple(self._checks))


def _check_to_json(check: Check) -> dict[str, Any]:
    out: dict[str, Any] = {
        "name": check.name,
        "value": check.value,
        "unit": check.unit,
        "limit": check.limit,
        "verdict": check.verdict,
        "source": check.source,
    }
    if check.detail:
        out["detail"] = check.detail
    if check.loosened_from:
        out["loosened_from"] = check.loosened_from
    return out


def _plain_number(value: Any) -> float | int | bool:
    """Turn a numpy scalar into a Python number; a bool of numpy stays a bool."""
    return value.item() if hasattr(value, "item") else value


def _shown(value: Value) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
