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


def load_materials() -> dict[str, dict[str, Any]]:
    """Read the materials: name to law, density, parameters, certainty of each number, source."""
    return load_data("materials.yaml")


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
