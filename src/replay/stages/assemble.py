"""Stage ``assembly``: head and helmet, weighed, inspected, drawn, and judged before anything runs."""

from __future__ import annotations

from replay import gates, models
from replay.files import write_json
from replay.gates.assembly import CHECKS as ASSEMBLY_CHECKS
from replay.gates.helmet import CHECKS as HELMET_CHECKS
from replay.stages.frame import Stage, Workspace
from replay.stages.settings import read_settings
from replay.stages.verdict import limits_of, told


def run(workspace: Workspace) -> str | None:
    """Build the model of the play's settings; the helmet gate comes before the assembly gate."""
    stage = Stage(workspace, "assembly", after=["settings"])
    play = read_settings(stage)
    limits = limits_of(stage)
    model = models.build_model(
        play.model.preset,
        play.model.resolution,
        helmet_mass_kg=play.helmet.mass_kg,
        helmet_structure=play.model.helmet_structure,
        brain=play.model.brain_material,
    )
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
        gates.assembly_gate(told(assembly, ASSEMBLY_CHECKS), limits),
    ]
    judged[0].write(stage.write("gate_helmet.json", "gate: helmet readiness"))
    judged[1].write(stage.write("gate.json", "gate: assembly"))
    return stage.finish(judged, parameters=dict(model.info))
