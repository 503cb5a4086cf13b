"""Stage ``assembly``: head and helmet, weighed, inspected, drawn, and judged before anything runs."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from replay import gates, models
from replay.files import write_json
from replay.gates.assembly import CHECKS as ASSEMBLY_CHECKS
from replay.gates.helmet import CHECKS as HELMET_CHECKS
from replay.models import Model
from replay.play import Play
from replay.solver import PENETRATION_TABLE, penetration_table, seat
from replay.stages.frame import Stage, Workspace
from replay.stages.limits import limits_of, told
from replay.stages.problem import controls_of, resting_problem, seated_by_contact, unresolved_pairs
from replay.stages.resolved import read_settings

_MOST_PLACES = 4
_PIECES = ("helmet", "facemask", "pads", "chinstrap")


def run(workspace: Workspace) -> str | None:
    """Build the play's head and helmet, or its two players; the helmet gate comes before the assembly gate."""
    stage = Stage(workspace, "assembly", after=["settings"])
    play = read_settings(stage)
    for file in play.model.files:
        stage.follow("inputs")
        stage.read("inputs", file)
    model, judged = _player(stage, play, "struck")
    if play.collision is not None:
        impactor, also = _striker(stage, play)
        models.write_model(stage.write("impactor.h5", "the striking player, or a laboratory's apparatus"), impactor)
        judged = [_both(gate, also.get(gate.name)) for gate in judged]
    models.write_model(stage.write("model.h5", "nodes, hexes, parts, sets, materials"), model)
    models.write_parts_table(stage.write("parts.csv", "parts with material, volume, mass and quality"), model)
    models.write_preview(stage.write("preview.png", "the model from outside and cut in half"), model)
    write_json(
        stage.write("mass_properties.json", "mass, centre of gravity, inertia (protocol 1.3)"),
        models.mass_report(model),
    )
    judged[0].write(stage.write("gate_helmet.json", "gate: helmet readiness"))
    judged[1].write(stage.write("gate.json", "gate: assembly"))
    return stage.finish(judged, parameters=dict(model.info))


def _striker(stage: Stage, play: Play) -> tuple[Model, dict[str, gates.Gate]]:
    """The impactor's model and the gates on it by name: an apparatus has no helmet to be judged."""
    assert play.collision is not None
    if play.collision.apparatus is None:
        model, judged = _player(stage, play, "impactor")
        return model, {gate.name: gate for gate in judged}
    model = models.build_apparatus(play.collision.apparatus.name, play.model.resolution)
    facts = models.apparatus_inspection(model)
    print(models.summary_text(model))
    write_json(
        stage.write("impactor_inspection.json", "what the assembly gate was told of the apparatus"), {"assembly": facts}
    )
    gate = gates.assembly_gate(told(facts, ASSEMBLY_CHECKS), limits_of(stage))
    return model, {gate.name: gate}


def _player(stage: Stage, play: Play, role: str) -> tuple[Model, list[gates.Gate]]:
    """A player's model under the numbers of that player, and the helmet and assembly gates on it."""
    player = play.collision.player(role) if play.collision is not None else None
    worn = player.wears.model_dump() if player is not None else {}
    helmet_piece, *others = (worn.get(name) or named for name, named in zip(_PIECES, play.model.helmet_pieces))
    changed = any(worn.get(name) for name in _PIECES)
    mass = None if changed else play.helmet.mass_kg
    model = models.build_model(
        play.model.preset,
        play.model.resolution,
        helmet_mass_kg=mass,
        design=models.load_design(str(helmet_piece), *others, folder=play.folder),
        helmet_structure=play.model.helmet_structure,
        brain=play.model.brain_material,
        membranes=play.model.membranes,
        outlet=play.model.outlet,
        seat=play.model.helmet_seat,
    )
    before = "" if role == "struck" else f"{role}_"
    contact = None
    if seated_by_contact(model):
        model, contact = seat_helmet(stage, play, model, before)
    helmet = models.helmet_inspection(model)
    if player is not None and player.body is not None:
        model = models.with_body(model, models.BodyPlan(**player.body.model_dump()))
    assembly = models.assembly_inspection(model, helmet_mass_kg=mass)
    print(models.summary_text(model))
    write_json(
        stage.write(f"{before}inspection.json", "what the helmet and assembly gates were told"),
        {"helmet": helmet, "assembly": assembly},
    )
    limits = limits_of(stage)
    judged = [
        gates.helmet_gate(told(helmet, HELMET_CHECKS), limits),
        gates.assembly_gate(told(assembly, ASSEMBLY_CHECKS), limits, contact=contact),
    ]
    return (model if role == "struck" else models.second_player(model)), judged


def _both(struck: gates.Gate, impactor: gates.Gate | None) -> gates.Gate:
    """One gate of both players' checks."""
    if impactor is None:
        return struck
    also = (dataclasses.replace(check, name=f"{check.name}: impactor") for check in impactor.checks)
    return dataclasses.replace(struck, checks=(*struck.checks, *also))


def seat_helmet(stage: Stage, play: Play, model: Model, before: str) -> tuple[Model, dict[str, Any]]:
    """Put the helmet where the play has it, and take out what then lies inside the head (protocol 3.1).

    `before` stands before the name of the table of penetrations.

    Returns
    -------
    tuple of Model and dict
        The model with its moved nodes, and what the assembly gate asks of contact.
    """
    nodes = model.nodes.copy()
    nodes[np.unique(model.hexes[model.elements_of(assembly="helmet")])] += np.array(play.helmet.offset_m)
    model = dataclasses.replace(model, nodes=nodes)
    problem = resting_problem(model, controls_of(play, 1.0, checkpoint_every_s=0.0), play.solver.contact)
    found = seat(problem)
    PENETRATION_TABLE.write(
        stage.write(f"{before}penetrations.csv", "initial penetrations: nodes inside, and nodes moved (protocol 3.1)"),
        penetration_table(found, problem),
    )
    places = found.places([part.name for part in model.parts], nodes)
    before = f"{1e3 * found.deepest_before_m:.3g} mm before; {len(found.rows)} nodes in penetrations.csv"
    unresolved = unresolved_pairs(model, play.solver.contact)
    return dataclasses.replace(model, nodes=found.nodes), {
        "initial_penetration_m": found.deepest_m,
        "initial_penetration_m_detail": "; ".join([before, *places[:_MOST_PLACES]]) if places else "",
        "projection_over_edge": found.share_moved,
        "projection_over_edge_detail": "; ".join(places[:_MOST_PLACES]),
        "projection_jacobian_ratio": found.volume_ratio,
        "unresolved_friction_pairs": len(unresolved),
        "unresolved_friction_pairs_detail": ", ".join(unresolved),
    }
