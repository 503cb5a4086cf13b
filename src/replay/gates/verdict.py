"""The verdict on a play: all its gates together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from replay.gates.limits import Limits
from replay.gates.model import Check, Gate

_WORST_FIRST = ("fail", "warn", "vacuous", "pass")
Status = Literal["accepted", "accepted with warnings", "rejected"]


@dataclass(frozen=True)
class PlayVerdict:
    """What the gates say of a play.

    Parameters
    ----------
    play
        Name of the play.
    status
        ``accepted``, ``accepted with warnings`` or ``rejected``.
    gates
        The gates that were evaluated, in the order of the protocol.
    stopped_by
        Name of the gate that ended the play, or "".
    not_evaluated
        Gates that were not reached after a stop, or that are missing without a reason.
    causes
        ``(gate, check)`` pairs that gave the verdict, worst first.
    loosened
        Checks judged by a limit that the play loosened.
    """

    play: str
    status: Status
    gates: tuple[Gate, ...]
    stopped_by: str
    not_evaluated: tuple[str, ...]
    causes: tuple[tuple[Gate, Check], ...]
    loosened: tuple[tuple[Gate, Check], ...]

    def line(self) -> str:
        """Return the verdict in one line, with causes and loosened limits."""
        words = [f"{self.play}: {self.status}"]
        if self.stopped_by:
            words.append(f"stopped by the gate {self.stopped_by}")
        elif self.status == "rejected" and self.not_evaluated:
            words.append(f"not evaluated: {', '.join(self.not_evaluated)}")
        worst = "fail" if self.status == "rejected" else None
        shown = [f"{gate.name}.{check.sentence()}" for gate, check in self.causes if worst in (None, check.verdict)]
        words += shown[:3]
        if len(shown) > 3:
            words.append(f"and {len(shown) - 3} more")
        words += [f"LOOSENED {g.name}.{c.name}: {c.limit} instead of {c.loosened_from}" for g, c in self.loosened]
        return "; ".join(words)

    def to_json(self) -> dict[str, Any]:
        """Return the content of verdict.json."""
        return {
            "play": self.play,
            "status": self.status,
            "line": self.line(),
            "gates": {gate.name: gate.verdict for gate in self.gates},
            "stopped_by": self.stopped_by,
            "not_evaluated": list(self.not_evaluated),
            "causes": [
                {"gate": gate.name, "check": check.name, "verdict": check.verdict, "sentence": check.sentence()}
                for gate, check in self.causes
            ],
            "loosened": [
                {"gate": gate.name, "check": check.name, "limit": check.limit, "instead_of": check.loosened_from}
                for gate, check in self.loosened
            ],
        }


def play_verdict(
    play: str, gates: Sequence[Gate] | Mapping[str, Gate], limits: Limits, *, awaited: Sequence[str] = ("package",)
) -> PlayVerdict:
    """Combine the gates of a play.

    Parameters
    ----------
    play
        Name of the play.
    gates
        The gates that were evaluated.
    limits
        The limits in force; they name all gates and which of them stop a run.
    awaited
        Gates that are evaluated later than this verdict (the package is sealed after the
        report) and are not missed. A gate that is missing for no such reason rejects the play: what was not looked at
        is not accepted.
    """
    given = {gate.name: gate for gate in (gates.values() if isinstance(gates, Mapping) else gates)}
    ordered = tuple(given[name] for name in limits.protocol if name in given)
    stopped_by = next((gate.name for gate in ordered if gate.stops), "")
    missing = tuple(name for name in limits.protocol if name not in given and name not in awaited)
    worst = {gate.verdict for gate in ordered}
    causes = [(gate, check) for gate in ordered for check in gate.causes()]
    causes.sort(key=lambda cause: _WORST_FIRST.index(cause[1].verdict))
    status: Status = "accepted"
    if "fail" in worst or missing:
        status = "rejected"
    elif "warn" in worst:
        status = "accepted with warnings"
    loosened = tuple((gate, check) for gate in ordered for check in gate.checks if check.loosened_from)
    return PlayVerdict(play, status, ordered, stopped_by, missing, tuple(causes), loosened)
