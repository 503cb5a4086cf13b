"""Reproducibility package: is everything there that another laboratory needs? (article, discussion)."""

from __future__ import annotations

from collections.abc import Mapping

from replay.gates.limits import Limits
from replay.gates.model import Gate, Judge

_SHARED_ITEMS = (
    "resolved configuration",
    "kinematics.csv",
    "applied driver",
    "run-deck entry point",
    "solver version",
    "source code",
    "gate results",
)
VIDEO_PACKAGE = (
    "kinovea_clicks.csv",
    "helmet_landmarks.csv",
    "Config.json",
    "poses_per_frame.csv",
    "initial_conditions_t0.csv",
    "qc_summary.txt",
    "qc_per_frame.csv",
    *_SHARED_ITEMS,
)
UNRECORDED_PACKAGE = tuple(item for item in _SHARED_ITEMS if item not in ("kinematics.csv", "applied driver"))
WEARABLE_PACKAGE = ("wearable kinematics", "initial_conditions_t0.csv", "qc_summary.txt", *_SHARED_ITEMS)


def package_gate(
    items: Mapping[str, tuple[bool, bool]], limits: Limits, *, required: tuple[str, ...] = VIDEO_PACKAGE
) -> Gate:
    """Judge whether the minimum package is whole.

    Parameters
    ----------
    items
        By item: is it present, and is its hash recorded. A required item that is not
        named counts as absent.
    limits
        The limits in force.
    required
        `VIDEO_PACKAGE`, `WEARABLE_PACKAGE` or `UNRECORDED_PACKAGE`.
    """
    judge = Judge("package", limits)
    for item in required:
        present, hashed = items.get(item, (False, False))
        judge.check("present", bool(present), of=item)
        if present:
            judge.check("hashed", bool(hashed), of=item)
    return judge.gate()
