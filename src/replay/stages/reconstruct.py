"""Stage ``reconstruction``: tracks or wearable to the motion of the skull, and what it is worth."""

from __future__ import annotations

from dataclasses import asdict

from replay.files import write_json
from replay.gates import video_reconstruction_gate, wearable_reconstruction_gate
from replay.motion import reconstruct
from replay.stages.frame import Stage, Workspace
from replay.stages.limits import limits_of
from replay.stages.resolved import read_settings

_MEANINGS = {
    "kinematics.csv": "motion of the skull's centre of gravity; from clicks, both modes with bands",
    "posterior_motion.csv": "posterior mode's central motion, between the frames",
    "peaks.csv": "peaks of both modes, with bands",
    "click_weights.csv": "weight and residual of every click in the batch estimate",
    "initial_conditions_t0.csv": "pose, velocities and axis P-Q at t0 and at the window's start",
    "poses_per_frame.csv": "pose and focal length of every frame",
    "qc_per_frame.csv": "residuals and drifts of every frame",
    "qc_summary.txt": "the quality on one page",
}

_ENSEMBLE = "a driver drawn from the posterior"


def run(workspace: Workspace) -> str | None:
    """Reconstruct the play, from clicks in both modes, and judge the reconstruction."""
    stage = Stage(workspace, "reconstruction", after=["settings", "inputs"])
    play = read_settings(stage)
    for name in play.source.files:
        stage.read("inputs", name)
    result = reconstruct(play)
    folder = stage.write_all({name: _MEANINGS.get(name, _ENSEMBLE) for name in result.files})
    result.write(folder)
    write_json(
        stage.write("quality.json", "numbers for the gate, peaks, and the peaks that noise alone shows"),
        {
            "t0_s": result.t0_s,
            "t0_angular_s": result.t0_angular_s,
            "t0_linear_s": result.t0_linear_s,
            "driving_t0_s": result.driving[1],
            **asdict(result.quality),
            "posterior": result.posterior_quality.document() if result.posterior_quality else None,
        },
    )
    judge = video_reconstruction_gate if result.quality.kind == "clicks" else wearable_reconstruction_gate
    gate = judge(result.quality.gate_values(), limits_of(stage))
    gate.write(stage.write("gate.json", "gate: reconstruction quality"))
    for warning in result.quality.warnings:
        print(f"warning: {warning}")
    return stage.finish([gate])
