"""Forces of a replay, for stage ``measures``: contact by pair, the facemask's mounts, the straps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from replay.measures import FORCE_TABLE, Motion, contact_summary, force_history, impulse_on, mount_impulse
from replay.models import Model, assembly_mass
from replay.stages.fidelity import skull_motion
from replay.stages.frame import Stage


def forces(stage: Stage, model: Model) -> dict[str, Any]:
    """Summaries for ``measures.json``; the histories go to ``facemask_force.csv`` and ``blow_force.csv``."""
    touched = None
    if stage.made("replay", "contact.csv"):
        touched = pd.read_csv(stage.read("replay", "contact.csv"))
    return {
        "contact": {"pairs": [] if touched is None else contact_summary(touched), "blow": _blow(stage, model, touched)},
        "facemask_mounts": _mounts(stage, model, touched),
        "straps": _straps(stage),
    }


def _blow(stage: Stage, model: Model, touched: pd.DataFrame | None) -> dict[str, Any] | None:
    """What the impactor gave the struck player: resultant over all pairs of parts of the two."""
    struck = {part.pid for part in model.parts if part.player == 1}
    if touched is None or touched.empty or len(struck) == len(model.parts):
        return None
    time, impulse = impulse_on(touched, struck)
    history = force_history(time, impulse)
    FORCE_TABLE.write(stage.write("blow_force.csv", "force of the impactor on the struck player", unit="N"), history)
    return {
        **_peak(history),
        "impulse_N_s": float(np.sqrt((impulse[-1] ** 2).sum())),
        "duration_s": _duration(history),
    }


def _mounts(stage: Stage, model: Model, touched: pd.DataFrame | None) -> dict[str, Any] | str:
    """Resultant through the mounts of the struck player's facemask."""
    mask = next((part for part in model.parts if part.role == "facemask" and part.player == 1), None)
    if mask is None:
        return "the struck player wears no facemask"
    if model.materials[mask.material]["law"] != "rigid":
        return "not computed: the facemask deforms, and its nodes at the mounts are those of the shell"
    own = assembly_mass(model, name=mask.name)
    centre = own.cg_m
    if not stage.made("placement", "placement.json"):
        skull = skull_motion(stage)
        centre = skull.position_m[0] + Rotation.from_quat(skull.quaternion[0]).apply(centre)
    body = Motion.from_history(pd.read_csv(stage.read("replay", "histories.csv")), mask.pid)
    given: np.ndarray | float = 0.0
    if touched is not None and not touched.empty:
        given = impulse_on(touched, {mask.pid})[1]
    history = force_history(body.time_s, mount_impulse(body.of_point(centre), own.mass_kg, given))
    FORCE_TABLE.write(stage.write("facemask_force.csv", "force of the shell on the facemask", unit="N"), history)
    return _peak(history)


def _straps(stage: Stage) -> list[dict[str, Any]] | str:
    if not stage.made("replay", "straps.csv"):
        return "this model has no straps: the helmet shares nodes with the head"
    table = pd.read_csv(stage.read("replay", "straps.csv"))
    return [
        {"strap": str(name), "peak_tension_N": float(rows["tension_N"].max())}
        for name, rows in table.groupby("strap", sort=False)
    ]


def _peak(history: dict[str, np.ndarray]) -> dict[str, float]:
    at = int(np.argmax(history["force_N"]))
    return {"peak_force_N": float(history["force_N"][at]), "peak_time_s": float(history["time_s"][at])}


def _duration(history: dict[str, np.ndarray], share: float = 0.05) -> float:
    """Time from the first to the last interval with more than a share of the greatest force [s]."""
    strong = history["time_s"][history["force_N"] > share * history["force_N"].max()]
    return float(strong[-1] - strong[0]) if len(strong) else 0.0
