"""Stage ``driver``: the window around t0, resampled for the solver."""

from __future__ import annotations

from dataclasses import replace

from replay.files import read_json, write_json
from replay.motion import Kinematics, build_driver
from replay.play import Play
from replay.stages.frame import Stage, Workspace
from replay.stages.players import ROLES, start_of
from replay.stages.resolved import read_settings


def run(workspace: Workspace) -> str | None:
    """Resample pose, velocity and acceleration so that they agree with one another, and state the axis P-Q."""
    stage = Stage(workspace, "driver", after=["settings", "reconstruction"])
    if stage.stopped_by:
        return stage.skip()
    play = read_settings(stage)
    if not play.recorded:
        _write_starts(stage, play, None, 0.0)
        print("driver: nothing was recorded; both starts are given")
        return stage.finish()
    chosen = play.reconstruction
    source = "kinematics.csv" if chosen.mode == "protocol" else "posterior_motion.csv"
    motion = Kinematics.read(stage.read("reconstruction", source))
    t0 = read_json(stage.read("reconstruction", "quality.json"))["driving_t0_s"]
    if chosen.draw:
        # a drawn driver is sampled already, on a clock that begins with the window
        drawn = Kinematics.read(stage.read("reconstruction", f"drivers/driver_{chosen.draw:03d}.csv"))
        driver = build_driver(drawn, play.window.before_t0_s, play.window)
        driver = replace(driver, start_s=t0 - play.window.before_t0_s)
    else:
        driver = build_driver(motion, t0, play.window)
    driver.write(
        stage.write_all(
            {
                "driver_6dof.csv": "motion of the skull's centre of gravity, global axes: what a driven head is told",
                "initial_velocity.json": "velocities, pose and axis P-Q at the start; overshoot and closure",
            }
        )
    )
    _write_starts(stage, play, motion, driver.start_s)
    quality = driver.quality
    print(
        f"driver: {play.window.duration_s * 1e3:g} ms from {driver.start_s:.4f} s; overshoot of acceleration "
        f"{quality.overshoot_acceleration_percent:.3g} %, of omega {quality.overshoot_omega_percent:.3g} %"
    )
    return stage.finish()


def _write_starts(stage: Stage, play: Play, motion: Kinematics | None, start_s: float) -> None:
    if play.collision is not None:
        starts = {role: start_of(play.collision, role, motion, start_s).to_json() for role in ROLES}
        write_json(stage.write("starts.json", "posture and velocities of both players at first contact"), starts)
