"""Stage ``placement``: two players in one scene, the impactor moved along the closing velocity to first contact."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from replay.errors import InputError
from replay.files import read_json, write_json
from replay.gates import placement_gate
from replay.models import Model, assembly_mass, placed, read_model, together, write_model, write_preview
from replay.models.first_contact import FirstContact, first_contact, skin_of
from replay.models.inspection import parts_outside_block
from replay.models.model import GRID_DECIMALS
from replay.play import Collision
from replay.solver import PENETRATION_TABLE, penetration_table, seat
from replay.stages.collision import scene_at_rest
from replay.stages.contact import pairs_without_a_side
from replay.stages.frame import Stage, Workspace
from replay.stages.limits import limits_of
from replay.stages.players import ROLES, PlayerStart, aim_of
from replay.stages.problem import controls_of
from replay.stages.replayed import SCENE
from replay.stages.resolved import read_settings

MODELS = {"struck": "model.h5", "impactor": "impactor.h5"}
"""Files of the assembly stage."""
_PLAY = "play.yaml"
_LEAST_CLOSING_M_PER_S = 1e-3


def run(workspace: Workspace) -> str | None:
    """Place both players, leave the asked gap between them, and judge the scene."""
    stage = Stage(workspace, "placement", after=["settings", "assembly", "driver"])
    if stage.stopped_by:
        return stage.skip()
    play = read_settings(stage)
    if play.collision is None:
        raise InputError(_PLAY, "one driven head needs no placement", expected="a block `collision`")
    models = {role: read_model(stage.read("assembly", file)) for role, file in MODELS.items()}
    told = read_json(stage.read("driver", "starts.json"))
    starts = {role: PlayerStart.from_json(told[role]) for role in ROLES}
    scene, found, places = place(models, starts, play.collision)
    problem = scene_at_rest(scene, controls_of(play, 1.0, checkpoint_every_s=0.0), play)
    inside = seat(problem)
    PENETRATION_TABLE.write(
        stage.write("penetrations.csv", "nodes of one player inside the other; none is moved"),
        penetration_table(inside, problem),
    )
    write_model(stage.write(SCENE, "both players at first contact: nodes, hexes, parts, sets, materials"), scene)
    write_preview(stage.write("preview.png", "both players at first contact"), scene)
    report = _report(scene, found, places, starts, play.collision)
    write_json(stage.write("placement.json", "where the players stand, how fast they close, where they touch"), report)
    print(
        f"placement: {1e3 * found.gap_m:.3f} mm between {report['first_contact']['struck_part']} and "
        f"{report['first_contact']['impactor_part']}, closing at {report['closing_speed_m_per_s']:.3f} m/s"
    )
    wrong = pairs_without_a_side(scene, play.collision.pairs)
    outside = parts_outside_block(scene)
    numbers = [scene.node_ids, scene.element_ids, np.array([part.pid for part in scene.parts])]
    gate = placement_gate(
        {
            "gap_error_m": abs(found.gap_m - play.collision.gap_m),
            "initial_penetration_m": inside.deepest_before_m,
            "colliding_ids": sum(len(rows) - len(np.unique(rows)) for rows in numbers),
            "parts_outside_block": len(outside),
            "parts_outside_block_detail": ", ".join(outside),
            "unresolved_friction_pairs": len(wrong),
            "unresolved_friction_pairs_detail": ", ".join(wrong),
        },
        limits_of(stage),
    )
    gate.write(stage.write("gate.json", "gate: placement"))
    return stage.finish([gate])


def place(
    models: dict[str, Model], starts: dict[str, PlayerStart], collision: Collision
) -> tuple[Model, FirstContact, dict[str, np.ndarray]]:
    """Stand the struck player's head CG at the origin and bring the impactor to first contact.

    Returns
    -------
    tuple of Model, FirstContact, dict
        The scene in global axes, what the search found, and the place of each head CG [m].
    """
    closing = starts["impactor"].head_velocity() - starts["struck"].head_velocity()
    speed = float(np.sqrt(closing @ closing))
    if speed < _LEAST_CLOSING_M_PER_S:
        raise InputError(
            _PLAY, "the players do not close", column="collision",
            expected="an impactor that moves towards the struck player", mend="give the impactor its velocity",
        )  # fmt: skip
    direction = closing / speed
    struck = _stand(models["struck"], np.zeros(3), starts["struck"])
    aim = starts["struck"].rotation.apply(aim_of(collision))
    turned = _stand(models["impactor"], aim, starts["impactor"])
    back = _reach(struck.nodes, -direction) - _reach(turned.nodes, -direction)
    back = max(0.0, back + _reach(turned.nodes, direction) + _reach(turned.nodes, -direction)) + collision.gap_m
    begin = skin_of(turned.nodes - back * direction, turned.hexes)
    found = first_contact(skin_of(struck.nodes, struck.hexes), begin, direction, collision.gap_m)
    centre = aim + (found.travel_m - back) * direction
    impactor = _stand(models["impactor"], centre, starts["impactor"])
    scene = together([struck, impactor])
    info = {name: fact for name, fact in struck.info.items() if name != "player"}
    scene = dataclasses.replace(scene, info={**info, **scene.info})
    return scene, found, {"struck": np.zeros(3), "impactor": centre}


def _name(collision: Collision, role: str) -> str:
    if role == "impactor" and collision.apparatus is not None:
        return collision.apparatus.name
    player = collision.player(role)
    assert player is not None
    return player.name


def _stand(model: Model, centre: np.ndarray, start: PlayerStart) -> Model:
    """The player with the head CG at a place, turned as it starts, on the grid of a nanometre."""
    stood = placed(model, centre, start.rotation)
    return dataclasses.replace(stood, nodes=np.round(stood.nodes, GRID_DECIMALS) + 0.0)


def _reach(nodes: np.ndarray, direction: np.ndarray) -> float:
    """How far a mesh reaches along a direction [m]."""
    return float(np.einsum("nk,k->n", nodes, direction).max())


def _report(
    scene: Model,
    found: FirstContact,
    places: dict[str, np.ndarray],
    starts: dict[str, PlayerStart],
    collision: Collision,
) -> dict[str, Any]:
    closing = starts["impactor"].head_velocity() - starts["struck"].head_velocity()
    touching = {
        role: scene.parts[scene.element_part[scene.elements_of(player=number)][row]].name
        for (role, number), row in zip(ROLES.items(), found.elements)
    }
    return {
        "closing_velocity_m_per_s": closing.tolist(),
        "closing_speed_m_per_s": float(np.sqrt(closing @ closing)),
        "gap_m": found.gap_m,
        "first_contact": {
            "point_m": found.point_m.tolist(),
            "struck_part": touching["struck"],
            "impactor_part": touching["impactor"],
        },
        "players": {
            role: {
                "name": _name(collision, role),
                "head_cg_m": places[role].tolist(),
                **starts[role].to_json(),
                "P_global_m": (places[role] + starts[role].rotation.apply(starts[role].p_m)).tolist(),
                "Q_global_m": (places[role] + starts[role].rotation.apply(starts[role].q_m)).tolist(),
                "mass_kg": assembly_mass(scene, player=number).mass_kg,
            }
            for role, number in ROLES.items()
        },
    }
