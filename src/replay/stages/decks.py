"""Stage ``decks``: the same replay for other solvers, as the article's card and as LS-DYNA keyword."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from replay import decks
from replay.files import read_json
from replay.models import Model, read_model
from replay.motion import Kinematics
from replay.play import Play, estimate
from replay.stages.frame import Stage, Workspace
from replay.stages.own_deck import model_facts, node_sets, region_sets
from replay.stages.players import PLAYER_SETS, held_part
from replay.stages.problem import chin_straps, seated_by_contact
from replay.stages.replayed import replayed_model
from replay.stages.resolved import read_settings

# Numbers of the two stabilisations in the article's solver; its protocol uses 4.
_HOURGLASS_METHODS = {"stiffness": 4, "selective": 4, "viscous": 1}
_WRITERS = (
    ("velodyne", decks.write_velodyne),
    ("lsdyna", decks.write_lsdyna),
    ("openradioss", decks.write_openradioss),
)
_EVERYTHING = "all_parts"


def run(workspace: Workspace) -> str | None:
    """Write both decks with the model posed at the start of the window."""
    stage = Stage(workspace, "decks", after=["settings", "assembly", "driver", "placement"])
    if stage.stopped_by:
        return stage.skip()
    play = read_settings(stage)
    if play.collision is not None:
        deck = collision_deck(play, replayed_model(stage), read_json(stage.read("placement", "placement.json")))
    else:
        model = read_model(stage.read("assembly", "model.h5"))
        deck = deck_input(play, model, Kinematics.read(stage.read("driver", "driver_6dof.csv")))
    folder = stage.folder_for_many()
    for solver, write in _WRITERS:
        for path in write(folder / solver, deck):
            stage.write(path.relative_to(folder).as_posix(), f"run deck for {solver}")
    asked = estimate(play.model.resolution, play.window.duration_s)
    script = decks.write_own_submit(
        folder / "replay",
        workspace.play,
        threads=asked.threads,
        memory_mb=asked.memory_mb,
        minutes=asked.minutes,
    )
    stage.write(script.relative_to(folder).as_posix(), "batch script for the solver of this program")
    return stage.finish()


def deck_input(play: Play, model: Model, driver: Kinematics) -> decks.DeckInput:
    """What both writers need: the solver's own problem, in their terms."""
    position = driver.position_m[0]
    speed, p, q = decks.axis_through(position, driver.omega_rad_per_s[0])
    return decks.DeckInput(
        **_common(play, model),
        nodes=position + driver.rotation[0].apply(model.nodes),
        initial_velocities=(
            decks.InitialVelocity(model.part_set_ids[_EVERYTHING], _triple(driver.velocity_m_per_s[0]), speed, p, q),
        ),
        driver=decks.Driver(
            pid=next(part.pid for part in model.parts if part.role == "skull"),
            time_s=driver.time_s,
            velocity_m_per_s=driver.velocity_m_per_s,
            omega_rad_per_s=driver.omega_rad_per_s,
        ),
        contact=seated_by_contact(model),
        cables=tuple(
            decks.Cable(strap.name, int(strap.nodes[0]), int(strap.nodes[-1]), strap.stiffness_n_per_m)
            for strap in chin_straps(model)[1]
        ),
        facts=model_facts(model, driver.position_m[0], driver.rotation[0]),
    )


def collision_deck(play: Play, scene: Model, placement: dict[str, Any]) -> decks.DeckInput:
    """Both players with their initial velocities (protocol 3.6), and contact of everything."""
    assert play.collision is not None
    velocities = []
    for role, names in PLAYER_SETS.items():
        start = placement["players"][role]
        p, q = (_triple(np.array(start[key])) for key in ("P_global_m", "Q_global_m"))
        velocity = _triple(np.array(start["velocity_m_per_s"]))
        for name in (name for name in names if name in scene.part_sets):
            number = scene.part_set_ids[name]
            velocities.append(decks.InitialVelocity(number, velocity, start["omega_rad_per_s"], p, q))
    held, still = held_part(scene), np.zeros((2, 3))
    return decks.DeckInput(
        **_common(play, scene),
        nodes=scene.nodes,
        driver=decks.Driver(held.pid, np.array([0.0, play.window.duration_s]), still, still) if held else None,
        initial_velocities=tuple(velocities),
        contact=True,
        facts=model_facts(scene, np.zeros(3), Rotation.identity()),
    )


def _common(play: Play, model: Model) -> dict[str, Any]:
    """What a deck says of its model and controls, driven or colliding."""
    settings = play.solver
    return {
        "title": f"{play.name}: {play.title}" if play.title else play.name,
        "node_ids": model.node_ids,
        "hexes": model.hexes,
        "element_ids": model.element_ids,
        "element_part": model.element_part,
        "parts": decks.deck_parts(model.parts, model.materials),
        "part_sets": tuple(
            decks.PartSet(model.part_set_ids[name], name, pids) for name, pids in model.part_sets.items()
        ),
        "controls": decks.DeckControls(
            termination_time_s=play.window.duration_s,
            time_step_factor=settings.time_step_factor,
            plot_interval_s=settings.plot_interval_s,
            history_interval_s=settings.history_interval_s,
            hourglass_method=_HOURGLASS_METHODS[settings.hourglass.method],
            hourglass_coefficient=settings.hourglass.coefficient,
            bulk_viscosity_quadratic=settings.bulk_viscosity.quadratic,
            bulk_viscosity_linear=settings.bulk_viscosity.linear,
            mass_scaling_time_step_s=settings.mass_scaling_time_step_s,
        ),
        "notes": tuple(model.info["notes"]),
        "node_sets": node_sets(model),
        "element_sets": region_sets(model),
    }


def _triple(vector: np.ndarray) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
