"""Materials of the model: reading ``data/materials.yaml``, and the speed of a pressure wave in each law."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from replay.models.head_shape import load_data

CERTAINTIES = ("measured", "calibrated", "assumed", "article")

MATERIAL_OF_ROLE = {
    "brain": "brain",
    "csf": "csf",
    "skull": "skull",
    "scalp": "scalp",
    "face": "face",
    "comfort_pad": "comfort_foam",
    "energy_pad": "energy_foam",
    "shell": "polycarbonate",
    "facemask": "titanium",
    "chin_cup": "chin_cup_foam",
}


#: Laws of the brain: how its material is found.
BRAIN_LAWS = ("brain_isv", "viscohyperelastic")


def load_materials(brain: str = "brain_isv") -> dict[str, dict[str, Any]]:
    """Read the materials: name to law, density, parameters, certainty of each number, source.

    Parameters
    ----------
    brain
        Law of the brain, one of `BRAIN_LAWS`.

    Raises
    ------
    ValueError
        For another law.
    """
    if brain not in BRAIN_LAWS:
        message = f"no brain of the law {brain!r}; there are {', '.join(BRAIN_LAWS)}"
        raise ValueError(message)
    materials = load_data("materials.yaml")
    return materials | {"brain": brain_material()} if brain == "brain_isv" else materials


def brain_parameters() -> dict[str, dict[str, Any]]:
    """Parameters of the brain's law: name to symbol, unit, bounds of a fit, certainty and meaning."""
    return load_data("brain.yaml")["parameters"]


def brain_sets() -> tuple[str, ...]:
    """Names of the parameter sets of the brain's law."""
    return tuple(load_data("brain.yaml")["sets"])


def brain_material(name: str = "compression") -> dict[str, Any]:
    """One of the parameter sets of the brain's law ``brain_isv``, in the form of `load_materials`.

    Parameters
    ----------
    name
        Name of the set in ``data/brain.yaml``; the default is argued for in docs/physics.md.
    """
    data = load_data("brain.yaml")
    chosen, density = data["sets"][name], data["density_kg_per_m3"]
    certainty = {key: facts["certainty"] for key, facts in data["parameters"].items()}
    return {
        "law": "brain_isv",
        "density_kg_per_m3": density["value"],
        "parameters": dict(chosen["values"]),
        "certainty": {"density_kg_per_m3": density["certainty"], **certainty},
        "source": chosen["source"],
    }


def wave_speed_m_per_s(material: Mapping[str, Any]) -> float:
    """Speed of a plane pressure wave at small strain [m/s].

    ``sqrt((K + 4/3 G) / rho)`` with the law's initial moduli; a foam crushes sideways without Poisson effect and has
    ``sqrt(E / rho)``.

    Parameters
    ----------
    material
        ``law``, ``density_kg_per_m3`` and ``parameters``.
    """
    p, density = material["parameters"], float(material["density_kg_per_m3"])
    if "bulk_modulus_pa" in p:
        stiffness = p["bulk_modulus_pa"] + 4 / 3 * p["shear_modulus_pa"]
    else:
        nu = p.get("poisson_ratio", 0.0)
        stiffness = p["youngs_modulus_pa"] * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    return math.sqrt(stiffness / density)
