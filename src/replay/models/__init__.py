"""Head and helmet: the hexahedral model, its materials, its numbers and its picture."""

from __future__ import annotations

from pathlib import Path

from replay.models.build import build_model
from replay.models.helmet_design import HelmetDesign, load_design
from replay.models.inspection import assembly_inspection, assembly_mass, helmet_inspection, mass_report
from replay.models.materials import brain_material, brain_parameters, brain_sets, load_materials
from replay.models.model import Model, Part, read_model, write_model
from replay.models.parts_table import PARTS, parts_table, summary_text, write_parts_table
from replay.models.submodel import select_assembly


def write_preview(path: str | Path, model: Model) -> None:
    """Draw the model from outside and cut in half, as PNG; see `replay.models.preview`."""
    from replay.models import preview  # matplotlib only when a picture is asked for

    preview.write_preview(path, model)


__all__ = [
    "PARTS",
    "HelmetDesign",
    "Model",
    "Part",
    "assembly_inspection",
    "assembly_mass",
    "brain_material",
    "brain_parameters",
    "brain_sets",
    "build_model",
    "helmet_inspection",
    "load_design",
    "load_materials",
    "mass_report",
    "parts_table",
    "read_model",
    "select_assembly",
    "summary_text",
    "write_model",
    "write_parts_table",
    "write_preview",
]
