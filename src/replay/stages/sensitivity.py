"""Stage ``sensitivity``: the same replay at half the hourglass coefficient, and what it changes."""

from __future__ import annotations

import math

import pandas as pd

from replay.files import write_json
from replay.gates import hourglass_sensitivity_gate
from replay.measures import regional_summary
from replay.stages.frame import Stage, Workspace
from replay.stages.impact import BEFORE_A_RUN, UNFINISHED, run_play
from replay.stages.limits import limits_of

_FACTOR = 0.5


def run(workspace: Workspace, *, threads: int | None = None, checkpoint_every_s: float = 10.0) -> str | None:
    """Run again with half the coefficient and compare every region of the brain.

    The energy ledger cannot see a soft tissue that hourglass control holds; this run can.
    """
    stage = Stage(workspace, "sensitivity", after=[*BEFORE_A_RUN, "replay"], keep=UNFINISHED)
    if stage.stopped_by:
        return stage.skip()
    refusal = run_play(stage, threads=threads, checkpoint_every_s=checkpoint_every_s, hourglass_factor=_FACTOR)
    if refusal:
        return refusal
    whole = regional_summary(pd.read_csv(stage.read("replay", "brain_histories.csv")))
    half = regional_summary(pd.read_csv(stage.folder / "brain_histories.csv"))
    regions = {
        name: {
            "mps": values["mps_green_lagrange_p95"],
            "mps_half": half[name]["mps_green_lagrange_p95"],
            "pressure_Pa": values["tensile_pressure_p95_Pa"],
            "pressure_half_Pa": half[name]["tensile_pressure_p95_Pa"],
        }
        for name, values in whole.items()
    }
    write_json(
        stage.write("sensitivity.json", "regional results at the whole and at half the hourglass coefficient"),
        {
            "hourglass_factor": _FACTOR,
            "regions": regions,
            "d_mps_per_ln_coefficient": {
                name: (v["mps"] - v["mps_half"]) / math.log(1.0 / _FACTOR) for name, v in regions.items()
            },
        },
    )
    gate = hourglass_sensitivity_gate(regions, limits_of(stage))
    gate.write(stage.write("gate.json", "gate: hourglass sensitivity"))
    return stage.finish([gate])
