"""Head, helmet and body: the hexahedral model, its materials, its numbers and its picture."""

from __future__ import annotations

from pathlib import Path

from replay.models.apparatus import Apparatus, apparatus_names, build_apparatus, load_apparatus
from replay.models.body.player import BodyPlan, with_body
from replay.models.body.posture import Posture, posture_names
from replay.models.build import build_model
from replay.models.comparison import comparison_text
from replay.models.helmet_design import HelmetDesign, load_design
from replay.models.inspection import (
    apparatus_inspection,
    assembly_inspection,
    assembly_mass,
    helmet_inspection,
    mass_report,
)
from replay.models.materials import brain_material, brain_parameters, brain_sets, load_materials
from replay.models.membranes import CableNet, falx, tentorium
from replay.models.model import Model, ModelJoint, Part, read_model, write_model
from replay.models.parts_table import PARTS, parts_table, segments_text, summary_text, write_parts_table
from replay.models.players import placed, second_player, together
from replay.models.submodel import select_assembly


def write_preview(path: str | Path, model: Model) -> None:
    """Draw the model from outside and cut in half, as PNG; see `replay.models.preview`."""
    from replay.models import preview  # matplotlib only when a picture is asked for

    preview.write_preview(path, model)


__all__ = [
    "PARTS",
    "Apparatus",
    "BodyPlan",
    "CableNet",
    "HelmetDesign",
    "Model",
    "ModelJoint",
    "Part",
    "Posture",
    "apparatus_inspection",
    "apparatus_names",
    "assembly_inspection",
    "assembly_mass",
    "brain_material",
    "brain_parameters",
    "brain_sets",
    "build_apparatus",
    "build_model",
    "comparison_text",
    "falx",
    "helmet_inspection",
    "load_apparatus",
    "load_design",
    "load_materials",
    "mass_report",
    "parts_table",
    "placed",
    "posture_names",
    "read_model",
    "second_player",
    "segments_text",
    "select_assembly",
    "summary_text",
    "tentorium",
    "together",
    "with_body",
    "write_model",
    "write_parts_table",
    "write_preview",
]
