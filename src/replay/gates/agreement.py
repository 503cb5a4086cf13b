"""Agreement of two laboratories on one play: same inputs, same driver, same limits (article, discussion)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

INPUT_CHECKS = (
    "same_video",
    "frame_rate_difference_percent",
    "template_scale_percent",
    "template_residual_mm",
    "helmet_to_com_difference_mm",
    "same_filters",
)
MOTION_CHECKS = (
    "t0_difference_samples",
    "along_ray_over_noise",
    "velocity_difference_m_per_s",
    "spin_difference_rad_per_s",
)
QUANTITY_CHECKS = (
    "rmse_percent_of_peak",
    "delta_peak_percent",
    "time_to_peak_difference_samples",
    "iso_18571_rating",
)


def agreement_gate(
    values: Mapping[str, Any],
    quantities: Mapping[str, Mapping[str, Any]],
    laboratories: Mapping[str, Mapping[str, Any]],
    limits: Limits,
) -> Gate:
    """Judge whether two digitisations of one play give one driver.

    Parameters
    ----------
    values
        The names of `INPUT_CHECKS` and `MOTION_CHECKS`, a text where a check has no power; ``<name>_detail``
        says more of one.
    quantities
        Quantity to the names of `QUANTITY_CHECKS`.
    laboratories
        Laboratory to ``own_gates_passed`` (or why that is not known), ``own_gates_passed_detail`` and
        ``limits_as_shipped``.
    limits
        As shipped: what two laboratories agree by is not set by one of them.
    """
    judge = Judge("agreement", limits)
    for name, laboratory in laboratories.items():
        detail = laboratory.get("own_gates_passed_detail", "")
        judge.check("own_gates_passed", laboratory["own_gates_passed"], detail, of=name)
        judge.check("limits_as_shipped", laboratory["limits_as_shipped"], of=name)
    for name in (*INPUT_CHECKS, *MOTION_CHECKS):
        judge.check(name, values[name], values.get(f"{name}_detail", ""))
    for quantity, found in quantities.items():
        for name in QUANTITY_CHECKS:
            judge.check(name, found[name], of=quantity)
    return judge.gate()
