"""Masses of a model beside the article's Table 1 and an average man's head, as a text for the terminal."""

from __future__ import annotations

import numpy as np

from replay.models.head_shape import load_data
from replay.models.inspection import assembly_mass
from replay.models.model import Model
from replay.models.quality import hex_volumes


def comparison_text(model: Model) -> str:
    """Table of the roles that the article weighs, and of mass, moments and centre of gravity of head and helmet."""
    data = load_data("references.yaml")
    volume = hex_volumes(model.nodes, model.hexes)
    mass = volume * model.element_densities()
    lines = [f"{'against the article, Table 1':32} {'volume mL':>10} {'article':>9} {'mass kg':>9} {'article':>9}"]
    for roles, article in data["article"].items():
        own = np.any([model.elements_of(role=role) for role in roles.split(", ")], axis=0)
        if own.any():
            lines.append(
                f"  {roles.replace('_', ' '):30} {volume[own].sum() * 1e6:>10.1f} {article['volume_m3'] * 1e6:>9.1f} "
                f"{mass[own].sum():>9.3f} {article['mass_kg']:>9.2f}"
            )
    man, head = data["average_male"], assembly_mass(model, "head")
    ahead, _, above = -np.array(model.info["tragion_m"]) * 1e3
    lines.append(f"{'head against an average man':32} {'model':>10} {'man':>9} {'differs':>9}")
    rows = [("mass kg", head.mass_kg, man["mass_kg"], True)]
    rows += [
        (f"I{axis}{axis} 1e-3 kg m2", head.inertia_kg_m2[k, k] * 1e3, man["inertia_kg_m2"][k] * 1e3, True)
        for k, axis in enumerate("xyz")
    ]
    rows += [
        (f"CG {way} tragion mm", here, there * 1e3, False)
        for way, here, there in zip(("ahead of", "above"), (ahead, above), man["cg_from_tragion_m"])
    ]
    for name, here, there, relative in rows:
        away = f"{100 * (here / there - 1):+.0f} %" if relative else f"{here - there:+.1f} mm"
        lines.append(f"  {name:30} {here:>10.2f} {there:>9.2f} {away:>9}")
    if model.elements_of(assembly="helmet").any():
        worn, chosen = assembly_mass(model, "helmet"), model.info["helmet"]["chosen"]
        at = ", ".join(f"{value * 1e3:.1f}" for value in worn.cg_m + 0.0)
        lines.append("helmet: " + ", ".join(f"{piece} {name}" for piece, name in chosen.items()))
        lines.append(f"  {'mass kg':30} {worn.mass_kg:>10.2f} {data['helmet']['mass_kg']:>9.2f} {'protocol':>9}")
        lines.append(f"  CG from the head's, mm: {at}")
    return "\n".join(lines)
