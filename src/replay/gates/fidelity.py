"""Driver fidelity: did the model's skull make the motion it was told to? (article, protocol 3.8, Table 4)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

QUANTITIES = ("linear_acceleration", "angular_acceleration", "angular_velocity")
DIFFERENCES = ("rmse_percent_of_peak", "delta_peak_percent", "delta_time_to_peak_ms")
RESIDUALS = ("position_residual_mm", "rotation_residual_deg")


def fidelity_gate(fidelity: Mapping[str, Any], limits: Limits, *, prescribed: bool = True) -> Gate:
    """Judge applied against target motion at the skull's centre of gravity.

    Parameters
    ----------
    fidelity
        By each name of `QUANTITIES` a mapping with the names of `DIFFERENCES`, and, for a
        prescribed driver, the names of `RESIDUALS`. None or a text in place of a number
        (a peak of zero has no percentage) is vacuous.
    limits
        The limits in force.
    prescribed
        Whether the skull is driven: then what is left between target and applied position
        is numerical only, and is judged.
    """
    judge = Judge("fidelity", limits)
    for quantity in QUANTITIES:
        for name in DIFFERENCES:
            judge.check(name, fidelity[quantity][name], of=quantity)
    if prescribed:
        for name in RESIDUALS:
            judge.check(name, fidelity[name])
    return judge.gate()
