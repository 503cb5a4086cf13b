"""The table of parts, ``parts.csv``: what each part is, weighs, and how good its mesh is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from replay.models.materials import wave_speed_m_per_s
from replay.models.model import Model
from replay.models.quality import (
    aspect_ratios,
    characteristic_lengths,
    edge_lengths,
    hex_volumes,
    scaled_jacobians,
)
from replay.tables import Column, TableFormat

PARTS = TableFormat(
    "table of parts",
    (
        Column("pid", "part number", "int"),
        Column("name", "name of the part", "text"),
        Column("role", "what it is: brain, csf, skull, ..., shell, facemask, chin_cup, bone, flesh, cap", "text"),
        Column("assembly", "head, helmet or body; apparatus of a laboratory", "text"),
        Column("material", "name of the material", "text"),
        Column("law", "material law", "text"),
        Column("elements", "hexahedra", "int"),
        Column("nodes", "nodes that the part uses, shared ones included", "int"),
        Column("volume_m3", "exact volume of the trilinear hexes"),
        Column("density_kg_per_m3", "density after calibration"),
        Column("mass_kg", "volume times density"),
        Column("min_scaled_jacobian", "least scaled Jacobian"),
        Column("mean_scaled_jacobian", "mean scaled Jacobian"),
        Column("max_aspect_ratio", "longest over shortest edge, worst element"),
        Column("min_edge_m", "shortest edge"),
        Column("min_length_m", "least characteristic length (volume over largest face)"),
        Column("wave_speed_m_per_s", "pressure wave speed at small strain"),
        Column(
            "stable_time_step_s", "least length over wave speed, before any factor; empty for a rigid part",
            may_be_empty=True,
        ),
    ),
)  # fmt: skip


def parts_table(model: Model) -> dict[str, list[Any]]:
    """Columns of `PARTS` for a model, one row a part."""
    volume, quality = hex_volumes(model.nodes, model.hexes), scaled_jacobians(model.nodes, model.hexes)
    aspect, edges = aspect_ratios(model.nodes, model.hexes), edge_lengths(model.nodes, model.hexes).min(axis=1)
    length = characteristic_lengths(model.nodes, model.hexes)
    table: dict[str, list[Any]] = {name: [] for name in PARTS.names}
    for k, part in enumerate(model.parts):
        own = model.element_part == k
        material = model.materials[part.material]
        density, speed = float(material["density_kg_per_m3"]), wave_speed_m_per_s(material)
        row = {
            "pid": part.pid,
            "name": part.name,
            "role": part.role,
            "assembly": part.assembly,
            "material": part.material,
            "law": material["law"],
            "elements": int(own.sum()),
            "nodes": len(np.unique(model.hexes[own])),
            "volume_m3": float(volume[own].sum()),
            "density_kg_per_m3": density,
            "mass_kg": float(volume[own].sum()) * density,
            "min_scaled_jacobian": float(quality[own].min()),
            "mean_scaled_jacobian": float(quality[own].mean()),
            "max_aspect_ratio": float(aspect[own].max()),
            "min_edge_m": float(edges[own].min()),
            "min_length_m": float(length[own].min()),
            "wave_speed_m_per_s": speed,
            "stable_time_step_s": float("nan") if material["law"] == "rigid" else float(length[own].min()) / speed,
        }
        for name, value in row.items():
            table[name].append(value)
    return table


def write_parts_table(path: str | Path, model: Model) -> None:
    """Write ``parts.csv``."""
    PARTS.write(path, parts_table(model))


def summary_text(model: Model) -> str:
    """Quality and mass of a model as a table for the terminal."""
    table = parts_table(model)
    quality = scaled_jacobians(model.nodes, model.hexes)
    heading = (
        f"{model.info['preset']} {model.info['resolution']}: {len(model.nodes)} nodes, {len(model.hexes)} hexes, "
        f"SJ {quality.min():.3f} least, {np.percentile(quality, 1):.3f} 1 %, {quality.mean():.3f} mean"
    )
    lines = [
        heading,
        f"{'pid':>9} {'part':24} {'law':17} {'hexes':>6} {'volume mL':>10} {'mass kg':>8} {'min SJ':>7} {'dt us':>7}",
    ]
    for k in range(len(model.parts)):
        step = table["stable_time_step_s"][k]
        lines.append(
            f"{table['pid'][k]:>9} {table['name'][k]:24} {table['law'][k]:17} {table['elements'][k]:>6} "
            f"{table['volume_m3'][k] * 1e6:>10.2f} {table['mass_kg'][k]:>8.4f} "
            f"{table['min_scaled_jacobian'][k]:>7.3f} {'rigid' if np.isnan(step) else f'{step * 1e6:.3f}':>7}"
        )
    for assembly in ("head", "helmet", "body", "apparatus"):
        total = sum(m for m, a in zip(table["mass_kg"], table["assembly"]) if a == assembly)
        if assembly in table["assembly"]:
            lines.append(f"{'':>9} {assembly:24} {'':17} {'':>6} {'':>10} {total:>8.4f}")
    return "\n".join(lines)


def segments_text(model: Model) -> str:
    """Segments of the body as a table for the terminal: what each weighs and what de Leva says."""
    body, head = model.info["body"], float(_mass_of(model, "head"))
    title = (
        f"body {body['stature_m']:g} m, {body['mass_kg']:g} kg, {body['posture']}, {body['tissue']} segments, "
        f"voxels of {1e3 * body['step_m']:g} mm, SJ {body['min_scaled_jacobian']:.3f} least"
    )
    lines = [
        title,
        f"{'segment':18} {'hexes':>6} {'bone':>6} {'volume L':>9} {'kg/m3':>7} {'mass kg':>8} {'de Leva':>8} {'%':>7}",
    ]
    for name, facts in body["segments"].items():
        own, wanted = facts["mass_kg"], facts["de_leva_kg"]
        if name == "neck":  # de Leva has head and neck in one
            name, own, wanted = "neck and head", own + head, wanted + head
        lines.append(
            f"{name:18} {facts['hexes']:>6} {facts['bone_hexes']:>6} {1e3 * facts['volume_m3']:>9.2f} "
            f"{facts['density_kg_per_m3']:>7.0f} {own:>8.3f} {wanted:>8.3f} {100 * (own / wanted - 1):>+7.2f}"
        )
    lines.append(f"{'whole':18} {'':>6} {'':>6} {'':>9} {'':>7} {head + _mass_of(model, 'body'):>8.3f}")
    return "\n".join(lines)


def _mass_of(model: Model, assembly: str) -> float:
    own = model.elements_of(assembly=assembly)
    return float((hex_volumes(model.nodes, model.hexes[own]) * model.element_densities()[own]).sum())
