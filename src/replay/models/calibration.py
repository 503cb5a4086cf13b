"""Densities that give a model its masses, and the head its centre of gravity as near as densities should bring it.

Parts whose mass a source states are scaled to it; brain and fluid keep the density of their material. Skull, scalp and
face share the rest of the head: their densities minimise

    sum_i ((f_i - 1) / spread)^2 + sum_axis ((cg - target) / 1 mm)^2        so that the head has its mass,

f_i the factor on the nominal density. With the mass fixed the centre of gravity is linear in f: a small linear system.
The helmet's parts take one common factor, which leaves its centre of gravity where the nominal densities put it and
stands for the hardware, straps and paint that are not meshed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from replay.models.head_shape import HeadPreset
from replay.models.mass import mass_properties
from replay.models.model import Part
from replay.models.quality import hex_volumes

BALANCED_ROLES = ("skull", "scalp", "face")
_CG_TOLERANCE_M = 1e-3


@dataclass(frozen=True)
class Calibration:
    """Materials of a model with their final densities, and the state before and after.

    Parameters
    ----------
    materials
        By name; ``density_kg_per_m3`` is final, ``density_nominal_kg_per_m3`` what the library says.
    table
        By part: volume [m^3], mass before [kg], factor, mass after [kg].
    """

    materials: dict[str, dict[str, Any]]
    table: dict[str, dict[str, float]]


def calibrate_densities(
    nodes: np.ndarray,
    hexes: np.ndarray,
    element_part: np.ndarray,
    parts: tuple[Part, ...],
    head: HeadPreset,
    helmet_mass_kg: float,
    library: dict[str, dict[str, Any]],
) -> Calibration:
    """Find the density of every material.

    Parameters
    ----------
    nodes, hexes, element_part
        The mesh about the star centre: (n, 3) [m], (m, 8), (m,) rows of `parts`.
    parts
        Parts.
    head
        Masses and targets.
    helmet_mass_kg
        Of all helmet parts together.
    library
        Materials by name, `load_materials` and those of the helmet's design.
    """
    volume = np.bincount(element_part, weights=hex_volumes(nodes, hexes), minlength=len(parts))
    nominal = np.array([library[p.material]["density_kg_per_m3"] for p in parts])
    before = volume * nominal
    of_helmet = np.array([p.assembly == "helmet" for p in parts])
    factor: dict[str, float] = {}
    if of_helmet.any():
        share = helmet_mass_kg / before[of_helmet].sum()
        factor |= {p.material: share for p in parts if p.assembly == "helmet"}
    for role, mass in head.part_mass_kg.items():
        rows = [k for k, p in enumerate(parts) if p.role == role]
        factor |= {parts[k].material: mass / before[rows].sum() for k in rows}
    rest = tuple(role for role in BALANCED_ROLES if role not in head.part_mass_kg)
    present = nominal * [factor.get(p.material, 1.0) for p in parts]
    factor |= _balanced(nodes, hexes, element_part, parts, head, rest, present)
    materials: dict[str, dict[str, Any]] = {}
    for part in parts:
        material = dict(library[part.material])
        density = material["density_kg_per_m3"]
        material["density_nominal_kg_per_m3"] = float(density)
        material["density_kg_per_m3"] = float(density * factor.get(part.material, 1.0))
        if part.material in factor:
            material["certainty"] = {**material["certainty"], "density_kg_per_m3": "calibrated"}
        materials[part.material] = material
    table = {
        part.name: {
            "volume_m3": float(volume[k]),
            "mass_before_kg": float(before[k]),
            "density_factor": float(factor.get(part.material, 1.0)),
            "mass_after_kg": float(before[k] * factor.get(part.material, 1.0)),
        }
        for k, part in enumerate(parts)
    }
    return Calibration(materials, table)


def _balanced(
    nodes: np.ndarray,
    hexes: np.ndarray,
    element_part: np.ndarray,
    parts: tuple[Part, ...],
    head: HeadPreset,
    roles: tuple[str, ...],
    density_kg_per_m3: np.ndarray,
) -> dict[str, float]:
    """Factors of the materials of `roles` that give the head its mass, its centre of gravity near the target."""
    target = np.array(head.surfaces.tragion_m) + np.array(head.cg_from_tragion_m)
    fixed_mass, fixed_moment = 0.0, np.zeros(2)
    free: dict[str, np.ndarray] = {}
    for k, part in enumerate(parts):
        here = element_part == k
        if part.assembly != "head" or not here.any():
            continue
        body = mass_properties(nodes, hexes[here], np.full(int(here.sum()), density_kg_per_m3[k]))
        moment = body.mass_kg * (body.cg_m - target)[[0, 2]]
        if part.role in roles:
            free.setdefault(part.material, np.zeros(3))
            free[part.material] += np.array([body.mass_kg, *moment])
        else:
            fixed_mass += body.mass_kg
            fixed_moment += moment
    names = list(free)
    weight = np.array([free[name][0] for name in names])
    pull = np.array([free[name][1:] for name in names]).T / (head.head_mass_kg * _CG_TOLERANCE_M)
    offset = fixed_moment / (head.head_mass_kg * _CG_TOLERANCE_M)
    spread = head.density_spread**-2
    # minimise |pull f + offset|^2 + spread |f - 1|^2 with weight f = mass left: one system with the multiplier
    n = len(names)
    system = np.zeros((n + 1, n + 1))
    system[:n, :n] = pull.T @ pull + spread * np.eye(n)
    system[:n, n] = system[n, :n] = weight
    right = np.append(spread - pull.T @ offset, head.head_mass_kg - fixed_mass)
    return dict(zip(names, np.linalg.solve(system, right)[:n].tolist()))
