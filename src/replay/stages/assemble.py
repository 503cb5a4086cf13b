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
from replay.stages.problem import controls_of, resting_problem, seated_by_contact, unresolved_pairs
from replay.stages.settings import read_settings
from replay.stages.verdict import limits_of, told

_MOST_PLACES = 4


def run(workspace: Workspace) -> str | None:
    """Build the model of the play's settings; the helmet gate comes before the assembly gate."""
    stage = Stage(workspace, "assembly", after=["settings"])
    play = read_settings(stage)
    limits = limits_of(stage)
    for file in play.model.files:
        stage.follow("inputs")
        stage.read("inputs", file)
    model = models.build_model(
        play.model.preset,
        play.model.resolution,
        helmet_mass_kg=play.helmet.mass_kg,
        design=models.load_design(*play.model.helmet_pieces, folder=play.folder),
        helmet_structure=play.model.helmet_structure,
        brain=play.model.brain_material,
        seat=play.model.helmet_seat,
    )
    contact = None
    if seated_by_contact(model):
        model, contact = seat_helmet(stage, play, model)
    print(models.summary_text(model))
    models.write_model(stage.write("model.h5", "nodes, hexes, parts, sets, materials"), model)
    models.write_parts_table(stage.write("parts.csv", "parts with material, volume, mass and quality"), model)
    models.write_preview(stage.write("preview.png", "the model from outside and cut in half"), model)
    write_json(
        stage.write("mass_properties.json", "mass, centre of gravity, inertia (protocol 1.3)"),
        models.mass_report(model),
    )
    helmet = models.helmet_inspection(model)
    assembly = models.assembly_inspection(model, helmet_mass_kg=play.helmet.mass_kg)
    write_json(
        stage.write("inspection.json", "what the helmet and assembly gates were told"),
        {"helmet": helmet, "assembly": assembly},
    )
    judged = [
        gates.helmet_gate(told(helmet, HELMET_CHECKS), limits),
        gates.assembly_gate(told(assembly, ASSEMBLY_CHECKS), limits, contact=contact),
    ]
    judged[0].write(stage.write("gate_helmet.json", "gate: helmet readiness"))
    judged[1].write(stage.write("gate.json", "gate: assembly"))
    return stage.finish(judged, parameters=dict(model.info))


def seat_helmet(stage: Stage, play: Play, model: Model) -> tuple[Model, dict[str, Any]]:
    """Put the helmet where the play has it, and take out what then lies inside the head (protocol 3.1).

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
        stage.write("penetrations.csv", "initial penetrations: nodes inside, and nodes moved (protocol 3.1)"),
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
