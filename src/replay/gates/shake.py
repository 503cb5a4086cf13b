"""Helmet shake: does the helmet fly undisturbed for a millisecond? (article, protocol 1.6, 1.7)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge
from replay.gates.numerics import momentum_drift

NO_CONTACT = "no contact in this model"

CHECKS = (
    "ran_to_end",
    "negative_volumes",
    "min_time_step_s",
    "edge_stretch_max",
    "edge_stretch_min",
    "part_velocity_deviation",
    "stress_over_impact_stress",
    "stress_growth",
    "energy_ratio",
    "momentum_drift",
)


def ledger_values(energy: Mapping[str, ArrayLike], time_step_s: ArrayLike) -> dict[str, Any]:
    """Take ``energy_ratio``, ``momentum_drift`` and ``min_time_step_s`` from the solver's tables.

    Parameters
    ----------
    energy
        Columns of energy.csv.
    time_step_s
        Steps that were taken [s].
    """
    ratio = np.asarray(energy["ratio"], dtype=float)
    worst = float(ratio[np.argmax(np.abs(ratio - 1.0))]) if np.isfinite(ratio).all() else float("nan")
    steps = np.asarray(time_step_s, dtype=float)
    return {
        "energy_ratio": worst,
        "momentum_drift": momentum_drift(energy),
        "min_time_step_s": float(steps[steps > 0].min()) if (steps > 0).any() else "no step was taken",
    }


def contact_blow_up(
    contact_normal_J: ArrayLike, kinetic_J: ArrayLike, told: Mapping[str, float], limits: Limits
) -> bool | None:
    """Whether contact went unstable in the flight: it made energy, or left parts inside each other.

    Parameters
    ----------
    contact_normal_J, kinetic_J
        Columns of energy.csv.
    told
        ``contact`` of run.json; empty for a run without contact, which has no answer.
    limits
        Those of the replay's contact hold: ``numerics.contact_creation_share`` (here of the kinetic energy) and
        ``numerics.penetration_over_edge``.
    """
    if not told:
        return None
    numerics = limits.of("numerics")
    made = -float(np.min(contact_normal_J)) / float(np.max(kinetic_J))
    verdicts = (
        numerics["contact_creation_share"].judge(max(made, 0.0)),
        numerics["penetration_over_edge"].judge(float(told["penetration_over_edge"])),
    )
    return "fail" in verdicts or not np.isfinite(made)


def shake_gate(run: Mapping[str, Any], limits: Limits, *, contact_blow_up: bool | None = None) -> Gate:
    """Judge the free flight of the helmet with the controls of the replay.

    Parameters
    ----------
    run
        One entry per name of `CHECKS`; a text in place of a number is the reason why that
        check has no power (such as a run that stopped before it could be measured),
        ``<name>_detail`` adds a sentence.

        - ``ran_to_end``: whether the solver reached the termination time.
        - ``negative_volumes``: number of elements with J <= 0 at any state.
        - ``min_time_step_s``.
        - ``edge_stretch_max``, ``edge_stretch_min``: of any element edge, present over initial length.
        - ``part_velocity_deviation``: greatest |v_part - v_0| / |v_0|, v_part the
          velocity of a part's centre of gravity.
        - ``stress_over_impact_stress``: peak von Mises over rho c v_0 of the same part.
        - ``stress_growth``: peak von Mises of the last third of the run over that of the
          middle third (or over 1 % of rho c v_0, if that is more).
        - ``energy_ratio``: the value farthest from one.
        - ``momentum_drift``: |p - p_0| / |p_0|, greatest.
    contact_blow_up
        Whether contact went unstable; None for a model without contact.
    """
    judge = Judge("shake", limits)
    judge.check_all(run, CHECKS)
    judge.check("contact_blow_up", NO_CONTACT if contact_blow_up is None else contact_blow_up)
    return judge.gate()
