"""Stage ``fidelity``: whether the skull of the model made the motion it was told to."""

from __future__ import annotations

import pandas as pd

from replay.files import read_json, write_json
from replay.gates import fidelity_gate
from replay.measures import Motion, fidelity
from replay.motion import DRIVER
from replay.stages.frame import Stage, Workspace
from replay.stages.limits import limits_of
from replay.stages.players import ROLES
from replay.stages.replayed import replayed_model
from replay.stages.resolved import read_settings


def run(workspace: Workspace) -> str | None:
    """Compare target and applied motion of the skull's centre of gravity, and judge it."""
    stage = Stage(workspace, "fidelity", after=["settings", "assembly", "driver", "placement", "replay"])
    if stage.stopped_by:
        return stage.skip()
    play = read_settings(stage)
    tracked = 1 if play.collision is None else ROLES[play.collision.tracked]
    target = DRIVER.read(stage.read("driver", "driver_6dof.csv"))
    result = fidelity(Motion.from_columns({n: target[n] for n in target}), skull_motion(stage, tracked))
    write_json(stage.write("fidelity.json", "target against applied motion, article Table 4"), result)
    gate = fidelity_gate(
        {**result, **{name: _judged(result[name]) for name in _QUANTITIES}},
        limits_of(stage),
        prescribed=play.collision is None,
    )
    gate.write(stage.write("gate.json", "gate: driver fidelity"))
    return stage.finish([gate])


_QUANTITIES = ("linear_acceleration", "angular_acceleration", "angular_velocity")


def skull_motion(stage: Stage, player: int = 1) -> Motion:
    """Motion of a player's skull at the head's centre of gravity, from the solver's histories.

    A driven skull is told of that point; a free one is told of its own centre of gravity.
    """
    parts = replayed_model(stage).parts
    skull = next(part.pid for part in parts if part.role == "skull" and part.player == player)
    motion = Motion.from_history(pd.read_csv(stage.read("replay", "histories.csv")), skull)
    if not stage.made("placement", "placement.json"):
        return motion
    players = read_json(stage.read("placement", "placement.json"))["players"]
    role = next(name for name, number in ROLES.items() if number == player)
    return motion.of_point(players[role]["head_cg_m"])


def _judged(entry: dict[str, object]) -> dict[str, object]:
    """What the gate judges of one quantity; a peak of zero has no percentage, and the check says so."""
    names = ("rmse_percent_of_peak", "delta_peak_percent", "delta_time_to_peak_ms")
    return {name: "the target's peak is zero" if entry[name] is None else entry[name] for name in names}
