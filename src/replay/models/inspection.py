"""What a technician would look up in the model before trusting it: the numbers of the helmet and assembly gates."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.models.mass import Datum, MassProperties, mass_properties, three_point_datum
from replay.models.model import Model
from replay.models.numbering import PLAYERS, Blocks
from replay.models.quality import hex_volumes, scaled_jacobians

SKIN = 9020
"""Part number of the skin within a head's block."""
_MOUNTS = ("brow", "side_high", "side_low")
_STRAPS = ("front", "rear")


def blocks_of(model: Model) -> Blocks:
    """Blocks of numbers of the player whose head and helmet a model is."""
    return PLAYERS[model.info.get("player", 1)]


def friction_pairs(model: Model) -> tuple[tuple[int, str, int], ...]:
    """Head-side part, helmet-side set or part, friction type: the article's step 3.2."""
    blocks = blocks_of(model)
    skin, (comfort, energy) = blocks.head + SKIN, blocks.pad_sets
    return (skin, comfort, 1), (skin, energy, 1), (skin, "chin_cup", 2)


def assembly_mass(
    model: Model, assembly: str | None = None, *, name: str | None = None, player: int | None = None
) -> MassProperties:
    """Mass properties of an assembly, of one part by name, or of everything.

    Parameters
    ----------
    model
        The model.
    assembly
        ``head`` or ``helmet``.
    name
        Name of one part.
    player
        1, the struck one, or 2.
    """
    chosen = model.elements_of(assembly=assembly, player=player)
    if name is not None:
        chosen &= model.element_part == model.part_index(name)
    return mass_properties(model.nodes, model.hexes[chosen], model.element_densities()[chosen])


def helmet_datum(model: Model) -> Datum:
    """Three-point datum: the middle of the shell's front edge, and its outermost points left and right.

    A helmet maker finds the same points on the real shell: centre of the brow edge, and the widest point of each
    side at the height of the brow edge.
    """
    shell = model.nodes[np.unique(model.hexes[model.elements_of(role="shell")])]
    middle = shell[np.abs(shell[:, 1]) < 1e-9]
    front = middle[middle[:, 0] > 0]
    brow = front[np.argmin(np.round(front[:, 2], 9))]
    near = shell[np.abs(shell[:, 2] - brow[2]) < 0.02]
    left, right = near[np.argmax(np.round(near[:, 1], 9))], near[np.argmin(np.round(near[:, 1], 9))]
    return three_point_datum(brow, left, right)


def mass_report(model: Model) -> dict[str, Any]:
    """Mass, centre of gravity and inertia of head, helmet, body and parts; the helmet's CG in its datum (step 1.3)."""
    report: dict[str, Any] = {"units": "kg, m, kg m^2; head frame", "assemblies": {}, "parts": {}}
    for assembly in ("head", "helmet", "body"):
        if model.elements_of(assembly=assembly).any():
            report["assemblies"][assembly] = _as_dict(assembly_mass(model, assembly))
    for part in model.parts:
        report["parts"][part.name] = {"pid": part.pid, **_as_dict(assembly_mass(model, name=part.name))}
    if model.elements_of(role="shell").any():
        datum = helmet_datum(model)
        cg = assembly_mass(model, "helmet").cg_m
        report["datum"] = {
            "what": "centre of the circle through brow centre and the shell's sides at its height",
            "origin_m": datum.origin_m.tolist(),
            "axes": datum.axes.tolist(),
            "radius_m": datum.radius_m,
            "helmet_cg_m": datum.relative(cg).tolist(),
        }
    report["calibration"] = model.info.get("calibration", {})
    return report


def helmet_inspection(model: Model, *, helmet_cg_in_datum_m: np.ndarray | None = None) -> dict[str, Any]:
    """Numbers for the helmet gate, by the gate's names, and what stands behind them.

    Parameters
    ----------
    model
        The model.
    helmet_cg_in_datum_m
        Measured centre of gravity of the physical helmet in the three-point datum, (3,) [m]; without one that
        check has no power and says so.
    """
    chosen = model.elements_of(assembly="helmet")
    hexes = model.hexes[chosen]
    points = model.nodes[np.unique(hexes)]
    length, width, height = (float(v) for v in points.max(axis=0) - points.min(axis=0))
    wedges = model.element_ids[chosen][_degenerate(hexes)]
    missing = missing_interfaces(model)
    properties = assembly_mass(model, "helmet")
    return {
        "mass_kg": properties.mass_kg,
        "cg_m": properties.cg_m.tolist(),
        "cg_in_datum_m": helmet_datum(model).relative(properties.cg_m).tolist(),
        "cg_offset_m": _cg_offset(model, helmet_cg_in_datum_m),
        "length_m": length,
        "width_m": width,
        "height_m": height,
        "elements": len(hexes),
        "hex_share": 1.0 - len(wedges) / len(hexes),
        "wedge_share": len(wedges) / len(hexes),
        "wedge_ids": [int(v) for v in wedges],
        "removed_not_wedge": 0,
        "missing_interfaces": len(missing),
        "missing_interfaces_detail": ", ".join(missing),
        "unusable_parts": 0,
        "colliding_ids": len(model.node_ids)
        + len(model.element_ids)
        - len(np.unique(model.node_ids))
        - len(np.unique(model.element_ids)),
        "min_volume_m3": float(hex_volumes(model.nodes, hexes).min()),
        "min_scaled_jacobian": float(scaled_jacobians(model.nodes, hexes).min()),
    }


def missing_interfaces(model: Model) -> list[str]:
    """Name every interface of the article's step 1.5 that the model lacks: pads, pad-pad, mounts, strap anchors."""
    missing = [name for name in blocks_of(model).pad_sets if not model.part_sets.get(name)]
    names = {part.name: k for k, part in enumerate(model.parts)}
    for name, k in names.items():
        if name.startswith("comfort_pad_"):
            partner = names.get(name.replace("comfort", "energy"))
            if partner is None or not len(_shared(model, k, partner)):
                missing.append(f"pad-pad {name}")
        elif name.startswith("energy_pad_") and ("shell" not in names or not len(_shared(model, k, names["shell"]))):
            missing.append(f"pad-shell {name}")
    worn = model.info.get("helmet", {})
    mask, strap = worn.get("facemask", {"mounts": _MOUNTS}), worn.get("chinstrap", {"straps": _STRAPS})
    for place in mask["mounts"] if mask else ():
        missing += [
            f"facemask mount {place} {side}"
            for side in ("left", "right")
            if not len(model.node_sets.get(f"facemask_mount_{place}_{side}", ()))
        ]
    for anchor in (*(f"strap_anchor_{name}" for name in strap["straps"]), "chin_cup_strap"):
        missing += [
            f"{anchor} {side}" for side in ("left", "right") if not len(model.node_sets.get(f"{anchor}_{side}", ()))
        ]
    if "chin_cup" not in names:
        missing.append("chin cup")
    return missing


def assembly_inspection(
    model: Model, *, helmet_mass_kg: float | None = None, helmet_cg_in_datum_m: np.ndarray | None = None
) -> dict[str, Any]:
    """Numbers for the assembly gate, by the gate's names, and what stands behind them.

    Parameters
    ----------
    model
        The model.
    helmet_mass_kg
        Mass of the physical helmet [kg]; without one that check has no power and says so.
    helmet_cg_in_datum_m
        Its measured centre of gravity in the three-point datum, (3,) [m].
    """
    head, helmet = assembly_mass(model, "head"), assembly_mass(model, "helmet")
    pids = [part.pid for part in model.parts]
    outside = parts_outside_block(model)
    loose = unconnected_parts(model)
    unresolved = [
        f"{pid}-{other}"
        for pid, other, _ in friction_pairs(model)
        if pid not in pids or not (model.part_sets.get(other) or other in {part.name for part in model.parts})
    ]
    mass: float | str = "no mass of the physical helmet is given"
    if helmet_mass_kg is not None:
        mass = abs(helmet.mass_kg - helmet_mass_kg)
    return {
        "helmet_mass_kg": helmet.mass_kg,
        "helmet_mass_difference_kg": mass,
        "helmet_cg_difference_m": _cg_offset(model, helmet_cg_in_datum_m),
        "head_mass_kg": head.mass_kg,
        "head_cg_offset_m": float(np.sqrt(np.sum(head.cg_m**2))),
        "duplicate_part_ids": len(pids) - len(set(pids)),
        "parts_outside_block": len(outside),
        "parts_outside_block_detail": ", ".join(outside),
        "unconnected_parts": len(loose),
        "unconnected_parts_detail": ", ".join(loose),
        "unresolved_friction_pairs": len(unresolved),
        "unresolved_friction_pairs_detail": ", ".join(unresolved),
        "min_scaled_jacobian": float(scaled_jacobians(model.nodes, model.hexes).min()),
    }


def apparatus_inspection(model: Model) -> dict[str, Any]:
    """Numbers for the assembly gate of a laboratory's apparatus; what is asked of heads has no power and says so."""
    outside, loose = parts_outside_block(model), unconnected_parts(model)
    headless = ("helmet_mass_difference_kg", "helmet_cg_difference_m", "head_mass_kg", "head_cg_offset_m")
    return {
        **dict.fromkeys(headless, "an apparatus has neither head nor helmet"),
        "mass_kg": assembly_mass(model).mass_kg,
        "duplicate_part_ids": len(model.parts) - len({part.pid for part in model.parts}),
        "parts_outside_block": len(outside),
        "parts_outside_block_detail": ", ".join(outside),
        "unconnected_parts": len(loose),
        "unconnected_parts_detail": ", ".join(loose),
        "min_scaled_jacobian": float(scaled_jacobians(model.nodes, model.hexes).min()),
    }


def parts_outside_block(model: Model) -> list[str]:
    """Names of the parts whose number lies outside the block of their player's assembly (protocol 1.6)."""
    block = [PLAYERS[model.info.get("player", part.player)].of(part.assembly) for part in model.parts]
    return [part.name for part, (low, high) in zip(model.parts, block) if not low < part.pid <= high]


def unconnected_parts(model: Model) -> list[str]:
    """Names of the parts that share no node with another part, and that no strap and no joint holds."""
    pairs = np.unique(np.stack([np.repeat(model.element_part, 8), model.hexes.ravel()], axis=1), axis=0)
    users = np.bincount(pairs[:, 1], minlength=len(model.nodes))
    tied = np.unique(pairs[users[pairs[:, 1]] > 1, 0])
    ends = [np.empty(0, int)]
    if model.info.get("helmet_seat") == "contact":
        ends += [rows for name, rows in model.node_sets.items() if name.startswith("chin_cup_strap")]
    held = pairs[np.isin(pairs[:, 1], np.concatenate(ends)), 0]
    jointed = {pid for joint in model.joints for pid in (joint.first, joint.second)}
    return [p.name for k, p in enumerate(model.parts) if k not in tied and k not in held and p.pid not in jointed]


def _cg_offset(model: Model, measured_in_datum_m: np.ndarray | None) -> float | str:
    if measured_in_datum_m is None:
        return "no centre of gravity of the physical helmet is given"
    away = helmet_datum(model).relative(assembly_mass(model, "helmet").cg_m) - np.asarray(measured_in_datum_m)
    return float(np.sqrt(np.sum(away**2)))


def _shared(model: Model, first: int, second: int) -> np.ndarray:
    return np.intersect1d(model.hexes[model.element_part == first], model.hexes[model.element_part == second])


def _degenerate(hexes: np.ndarray) -> np.ndarray:
    ordered = np.sort(hexes, axis=1)
    return (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)


def _as_dict(properties: MassProperties) -> dict[str, Any]:
    return {
        "mass_kg": properties.mass_kg,
        "cg_m": properties.cg_m.tolist(),
        "inertia_kg_m2": properties.inertia_kg_m2.tolist(),
        "principal_kg_m2": properties.principal_kg_m2.tolist(),
    }
