"""From a scene of two players to what the solver is asked: free bodies, contact of everything, initial velocities."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.models import Model
from replay.play import Play
from replay.solver import ContactControls, ContactPair, Controls, PrescribedMotion, Problem
from replay.stages.contact import contact_controls, part_numbers
from replay.stages.players import ROLES, PlayerStart, held_part, scene_velocities
from replay.stages.problem import (
    body_links,
    chin_straps,
    seated_by_contact,
    solver_parts,
)


def collision_problem(scene: Model, placement: dict[str, Any], controls: Controls, play: Play) -> Problem:
    """Both players free, each with its initial velocity (protocol 3.5 and 3.6).

    Parameters
    ----------
    scene
        Of stage ``placement``, in global axes.
    placement
        Content of ``placement.json``.
    controls
        Numerical settings.
    play
        Of a collision.
    """
    players = placement["players"]
    starts = {role: PlayerStart.from_json(players[role]) for role in ROLES}
    centres = {role: np.array(players[role]["head_cg_m"]) for role in ROLES}
    return _problem(scene, scene_velocities(scene, starts, centres), controls, play)


def scene_at_rest(scene: Model, controls: Controls, play: Play) -> Problem:
    """The same without velocities: what initial penetration is looked for in."""
    return _problem(scene, np.zeros_like(scene.nodes), controls, play)


def _problem(scene: Model, velocities: np.ndarray, controls: Controls, play: Play) -> Problem:
    bodies, joints = body_links(scene)
    shells, straps = zip(*(chin_straps(scene, number) for number in ROLES.values()))
    return Problem(
        nodes=scene.nodes,
        hexes=scene.hexes,
        element_part=scene.element_part,
        parts=solver_parts(scene),
        controls=controls,
        initial_velocity=velocities,
        prescribed=_held(scene, controls),
        node_ids=scene.node_ids,
        element_ids=scene.element_ids,
        rigid_sets=(*sum(shells, ()), *bodies),
        joints=joints,
        straps=sum(straps, ()),
        contact=contact_of_players(scene, play),
    )


def _held(scene: Model, controls: Controls) -> tuple[PrescribedMotion, ...]:
    """The motion of what is held: none at all."""
    part = held_part(scene)
    if part is None:
        return ()
    still = np.zeros((2, 3))
    times = np.array([0.0, controls.termination_time_s])
    return (PrescribedMotion((part.pid,), times, still, np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)), still, still),)


def contact_of_players(scene: Model, play: Play) -> ContactControls:
    """Contact between the players; within a player only where the helmet is seated by contact.

    Where pads share nodes with scalp and shell, faces that meet in a gap between two pads are no pair of bodies; nor
    are the layers of an apparatus.
    """
    assert play.collision is not None
    apart: list[ContactPair] = []
    for role, number in ROLES.items():
        if not seated_by_contact(scene) or (role == "impactor" and play.collision.apparatus is not None):
            own = tuple(part.pid for part in scene.parts if part.player == number)
            apart.append(ContactPair(own, own, active=False, name=f"within the {role} player"))
    between = [
        ContactPair(
            part_numbers(scene, p.first), part_numbers(scene, p.second), p.friction, name=f"{p.first}-{p.second}"
        )
        for p in play.collision.pairs
    ]
    return contact_controls(scene, play.solver.contact, (*apart, *between))
