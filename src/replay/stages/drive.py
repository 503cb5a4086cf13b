"""Stage ``driver``: the window around t0, resampled for the solver."""

from __future__ import annotations

from replay.files import read_json, write_json
from replay.motion import Kinematics, build_driver
from replay.stages.frame import Stage, Workspace
from replay.stages.players import ROLES, start_of
from replay.stages.settings import read_settings


def run(workspace: Workspace) -> str | None:
    """Resample pose, velocity and acceleration so that they agree with one another, and state the axis P-Q."""
    stage = Stage(workspace, "driver", after=["settings", "reconstruction"])
    if stage.stopped_by:
        return stage.skip()
    play = read_settings(stage)
    source = "kinematics.csv" if play.reconstruction.mode == "protocol" else "posterior_motion.csv"
    kinematics = Kinematics.read(stage.read("reconstruction", source))
    t0 = read_json(stage.read("reconstruction", "quality.json"))["driving_t0_s"]
    driver = build_driver(kinematics, t0, play.window)
    driver.write(
        stage.write_all(
            {
                "driver_6dof.csv": "motion of the skull's centre of gravity, global axes: what a driven head is told",
                "initial_velocity.json": "velocities, pose and axis P-Q at the start; overshoot and closure",
            }
        )
    )
    if play.collision is not None:
        starts = {role: start_of(play.collision, role, kinematics, driver.start_s).to_json() for role in ROLES}
        write_json(stage.write("starts.json", "posture and velocities of both players at first contact"), starts)
    quality = driver.quality
    print(
        f"driver: {play.window.duration_s * 1e3:g} ms from {driver.start_s:.4f} s; overshoot of acceleration "
        f"{quality.overshoot_acceleration_percent:.3g} %, of omega {quality.overshoot_omega_percent:.3g} %"
    )
    return stage.finish()
