"""The hourglass sensitivity gate: the answer at half the hourglass coefficient must be the same.

The energy ledger cannot see a soft tissue that the hourglass stiffness holds: with a
stiffness scaled by the bulk modulus a brain stays nearly unstrained, and its ledger looks
healthy. So the run is made again at half the coefficient and regional results compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

ConvergenceClass = Literal["A", "B", "C", "unknown"]
NOT_RUN = "no run at half the hourglass coefficient exists for this model and resolution"


def hourglass_sensitivity_gate(regions: Mapping[str, Mapping[str, float]] | None, limits: Limits) -> Gate:
    """Compare regional results of a run with those at half its hourglass coefficient.

    Parameters
    ----------
    regions
        By region: ``mps``, ``mps_half``, ``pressure_Pa``, ``pressure_half_Pa``, the peaks
        over time of the 95th percentile of strain and of the tensile pressure. None when the
        second run was not made: the checks are vacuous.
    limits
        The limits in force.
    """
    judge = Judge("hourglass_sensitivity", limits)
    if not regions:
        judge.check("strain_difference", NOT_RUN)
        judge.check("pressure_difference", NOT_RUN)
        return judge.gate()
    for region, values in regions.items():
        for name, key in (("strain_difference", "mps{}"), ("pressure_difference", "pressure{}_Pa")):
            full, half = values[key.format("")], values[key.format("_half")]
            reason = f"{region} shows none of it in the run"
            judge.check(name, abs(half - full) / abs(full) if full != 0 else reason, of=region)
    return judge.gate()


def convergence_class(gate: Gate) -> ConvergenceClass:
    """Return the class shown beside every strain: A (passes), B (warns), C (fails), or unknown (never run)."""
    verdicts = {check.verdict for check in gate.checks}
    if verdicts == {"vacuous"}:
        return "unknown"
    return "C" if "fail" in verdicts else "B" if "warn" in verdicts else "A"
