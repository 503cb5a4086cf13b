"""Protocol section 1 on a foreign helmet: what it is made of, what it weighs, and whether its interfaces are there."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.models import census
from replay.models.mass import MassProperties, mass_properties
from replay.models.quality import aspect_ratios, hex_volumes, scaled_jacobians
from replay.models.surrogate import Surrogate
from replay.models.surrogate_settings import HelmetSettings

_COINCIDENT = 1e-3
_MOST_IDS = 200
PADS = ("comfort_pad", "energy_pad")


def surrogate_inspection(
    helmet: Surrogate, settings: HelmetSettings, *, removed: np.ndarray | None = None
) -> dict[str, Any]:
    """Everything that the protocol asks of a helmet before it is coupled.

    Parameters
    ----------
    helmet
        The helmet.
    settings
        Datum, physical helmet, padding, strap.
    removed
        Numbers of solids that were taken out before, for the gate; none where the deck is as it came.
    """
    kinds = census.element_kinds(helmet.solids)
    hexes = census.as_hexes(helmet.solids, kinds)
    volumes = hex_volumes(helmet.nodes, hexes)
    whole = kinds == 0
    quality = scaled_jacobians(helmet.nodes, hexes[whole])
    with np.errstate(divide="ignore", invalid="ignore"):  # two nodes at one place: the ratio is infinite
        aspect = aspect_ratios(helmet.nodes, hexes[whole])
    skin, folded = census.skin_edges(hexes) if len(hexes) else (0, 0)
    tolerance = _COINCIDENT * census.shortest_edge(helmet.nodes, hexes)
    double = census.duplicate_nodes(helmet.nodes, tolerance) if tolerance > 0 else np.zeros((0, 2), dtype=int)
    lonely = census.unreferenced(len(helmet.nodes), helmet.solids, helmet.shells)
    properties = helmet_mass(helmet, hexes, volumes)
    interfaces = interface_inventory(helmet)
    used = np.unique(np.concatenate([hexes.ravel(), helmet.shells[helmet.shells >= 0].ravel()]))
    extent = helmet.nodes[used].max(axis=0) - helmet.nodes[used].min(axis=0) if len(used) else np.zeros(3)
    return {
        "census": {
            "solids": len(hexes),
            "shells": len(helmet.shells),
            "nodes": len(helmet.nodes),
            "kinds": {name: int((kinds == k).sum()) for k, name in enumerate(census.KINDS)},
            "ids": {
                name: _some(helmet.solid_ids[kinds == k])
                for k, name in enumerate(census.KINDS)
                if k and (kinds == k).any()
            },
            "hex_share": float(whole.mean()) if len(hexes) else 0.0,
        },
        "quality": {
            "min_scaled_jacobian": float(quality.min()) if len(quality) else None,
            "mean_scaled_jacobian": float(quality.mean()) if len(quality) else None,
            "max_aspect_ratio": float(aspect.max()) if len(aspect) else None,
            "not_positive_volumes": _some(helmet.solid_ids[volumes <= 0]),
            "min_volume_m3": float(volumes.min()) if len(volumes) else None,
        },
        "topology": {
            "skin_faces": skin,
            "folded_skin_edges": folded,
            "free_shell_edges": census.free_shell_edges(helmet.shells) if len(helmet.shells) else 0,
            "duplicate_nodes": [[int(helmet.node_ids[a]), int(helmet.node_ids[b])] for a, b in double[:_MOST_IDS]],
            "duplicate_node_pairs": len(double),
            "unreferenced_nodes": _some(helmet.node_ids[lonely]),
        },
        "parts": part_rows(helmet, hexes, volumes),
        "mass": _mass_report(properties, helmet),
        "dimensions_m": dict(zip(("length", "width", "height"), extent.tolist())),
        "padding": {
            "set": settings.padding.set or "not recorded",
            "size": settings.padding.size or "not recorded",
            "set1_parts": list(helmet.pad_sets[0]),
            "set2_parts": list(helmet.pad_sets[1]),
        },
        "chinstrap": {
            "routing": settings.chinstrap.routing or "not recorded",
            "anchors": {name: helmet.node_ids[rows].tolist() for name, rows in helmet.anchors.items()},
            "simulated": False,
        },
        "interfaces": interfaces,
        "gate": _gate_facts(helmet, settings, kinds, volumes, quality, properties, extent, interfaces, removed),
    }


def helmet_mass(helmet: Surrogate, hexes: np.ndarray, volumes: np.ndarray) -> MassProperties | None:
    """Mass properties of solids with a density and of shells; None where nothing has mass."""
    density = np.array([part.density_kg_per_m3 for part in helmet.parts])
    each = density[helmet.solid_part] if len(helmet.parts) else np.zeros(0)
    good = np.isfinite(each) & (volumes > 0)
    pieces = [mass_properties(helmet.nodes, hexes[good], each[good])] if good.any() else []
    if len(helmet.shells):
        area, centre = _shell_areas(helmet)
        mass = area * helmet.shell_thickness_m * density[helmet.shell_part]
        for m, x in zip(mass.tolist(), centre):
            if np.isfinite(m) and m > 0:
                pieces.append(MassProperties(m, x, np.zeros((3, 3))))
    return _together(pieces) if pieces else None


def part_rows(helmet: Surrogate, hexes: np.ndarray, volumes: np.ndarray) -> list[dict[str, Any]]:
    """The table of parts, one row each."""
    area = _shell_areas(helmet)[0] * helmet.shell_thickness_m if len(helmet.shells) else np.zeros(0)
    rows = []
    for k, part in enumerate(helmet.parts):
        solids, shells = helmet.solid_part == k, helmet.shell_part == k
        volume = float(volumes[solids].sum() + area[shells].sum())
        rows.append(
            {
                "pid": part.pid,
                "name": part.name,
                "role": part.role,
                "law": part.law or "none",
                "solids": int(solids.sum()),
                "shells": int(shells.sum()),
                "volume_m3": volume,
                "density_kg_per_m3": part.density_kg_per_m3,
                "mass_kg": volume * part.density_kg_per_m3,
                "problem": part.problem,
            }
        )
    return rows


def interface_inventory(helmet: Surrogate) -> list[dict[str, str]]:
    """Each interface of the protocol's step 1.5.2: ``correct``, ``present`` (with what is wrong), or ``missing``."""
    role = {part.pid: part.role for part in helmet.parts}
    nodes_of = {part.pid: np.unique(helmet.solids[helmet.solid_part == k]) for k, part in enumerate(helmet.parts)}
    pads = [pid for pid, r in role.items() if r in PADS]
    found = []
    for number, (members, kind) in enumerate(zip(helmet.pad_sets, PADS), 1):
        strange = [pid for pid in members if role.get(pid) not in PADS]
        why = f"parts {strange} are no pads" if strange else ""
        found.append(_status(f"pad set {number} ({kind.replace('_', ' ')}s)", bool(members), why))
    loose = [pid for pid in pads if not _joined(pid, set(pads) - {pid}, nodes_of, helmet)]
    why = f"pads {loose} share no node and no contact with another pad" if loose else ""
    found.append(_status("pad-pad", len(pads) > 1, why))
    carriers = {pid for pid, r in role.items() if r in ("shell", "facemask")}
    found.append(_node_interface("facemask mounts", helmet.mounts, carriers, nodes_of))
    carriers |= {pid for pid, r in role.items() if r in ("chin_cup", "strap")}
    found.append(_node_interface("strap anchors", helmet.anchors, carriers, nodes_of))
    return found


def _node_interface(
    name: str, sets: dict[str, np.ndarray] | Any, carriers: set[int], nodes_of: dict[int, np.ndarray]
) -> dict[str, str]:
    carrying = np.concatenate([nodes_of[pid] for pid in carriers]) if carriers else np.zeros(0, dtype=int)
    off = [place for place, rows in sets.items() if not len(rows) or not np.isin(rows, carrying).all()]
    sides = {side for side in ("left", "right") if any(place.endswith(side) for place in sets)}
    why = f"{', '.join(off)}: empty, or not on shell, facemask, cup or strap" if off else ""
    if not why and len(sides) < 2:
        why = "not on both sides (names end in left and right)"
    return _status(name, bool(sets), why)


def _status(name: str, there: bool, why: str) -> dict[str, str]:
    status = "missing" if not there else "present" if why else "correct"
    return {"interface": name, "status": status, "why": why if there else ""}


def _joined(pid: int, others: set[int], nodes_of: dict[int, np.ndarray], helmet: Surrogate) -> bool:
    return any(len(np.intersect1d(nodes_of[pid], nodes_of[other])) for other in others) or any(
        pid in group and group & others for group in helmet.tied
    )


def _gate_facts(
    helmet: Surrogate,
    settings: HelmetSettings,
    kinds: np.ndarray,
    volumes: np.ndarray,
    quality: np.ndarray,
    properties: MassProperties | None,
    extent: np.ndarray,
    interfaces: list[dict[str, str]],
    removed: np.ndarray | None,
) -> dict[str, Any]:
    """Numbers for the helmet gate, by its names."""
    bad = [part for part in helmet.parts if part.problem]
    wrong = [f"{entry['interface']} {entry['status']}" for entry in interfaces if entry["status"] != "correct"]
    degenerate = kinds != 0
    facts: dict[str, Any] = {
        "mass_kg": properties.mass_kg if properties else "no part has both solids and a density",
        "cg_offset_m": _cg_offset(helmet, settings, properties),
        "length_m": float(extent[0]),
        "width_m": float(extent[1]),
        "height_m": float(extent[2]),
        "wedge_share": float(degenerate.mean()) if len(kinds) else "the deck has no solid",
        "removed_not_wedge": 0 if removed is None else int((removed != 1).sum()),
        "missing_interfaces": len(wrong),
        "missing_interfaces_detail": ", ".join(wrong),
        "min_volume_m3": float(volumes.min()) if len(volumes) else "the deck has no solid",
        "min_scaled_jacobian": float(quality.min()) if len(quality) else "the deck has no hexahedron",
        "unusable_parts": len(bad),
        "unusable_parts_detail": "; ".join(f"part {part.pid} {part.name}: {part.problem}" for part in bad[:8]),
    }
    if degenerate.any():
        counts = [f"{int((kinds == k).sum())} {census.KINDS[k]}" for k in range(1, 5) if (kinds == k).any()]
        facts["wedge_share_detail"] = ", ".join(counts)
    if len(volumes) and volumes.min() <= 0:
        facts["min_volume_m3_detail"] = f"{int((volumes <= 0).sum())} elements: mirrored, or their nodes out of order"
    return facts


def _cg_offset(helmet: Surrogate, settings: HelmetSettings, properties: MassProperties | None) -> float | str:
    if settings.physical.cg_in_datum_m is None:
        return "no centre of gravity of the physical helmet is given"
    if helmet.datum is None or properties is None:
        return "the helmet has no datum or no mass"
    away = helmet.datum.relative(properties.cg_m) - np.array(settings.physical.cg_in_datum_m)
    return float(np.sqrt(np.sum(away**2)))


def _mass_report(properties: MassProperties | None, helmet: Surrogate) -> dict[str, Any]:
    if properties is None:
        return {"mass_kg": None}
    report: dict[str, Any] = {
        "mass_kg": properties.mass_kg,
        "cg_m": properties.cg_m.tolist(),
        "inertia_kg_m2": properties.inertia_kg_m2.tolist(),
    }
    if helmet.datum is not None:
        axes = helmet.datum.axes
        report["datum"] = {
            "origin_m": helmet.datum.origin_m.tolist(),
            "axes": axes.tolist(),
            "radius_m": helmet.datum.radius_m,
            "cg_m": helmet.datum.relative(properties.cg_m).tolist(),
            "inertia_kg_m2": np.einsum("ij,jk,lk->il", axes, properties.inertia_kg_m2, axes).tolist(),
        }
    return report


def _shell_areas(helmet: Surrogate) -> tuple[np.ndarray, np.ndarray]:
    """Area [m^2] and centroid of each shell as two triangles, (k,), (k, 3)."""
    quad = helmet.nodes[helmet.shells]
    first = 0.5 * np.linalg.norm(np.cross(quad[:, 1] - quad[:, 0], quad[:, 2] - quad[:, 0]), axis=1)
    second = 0.5 * np.linalg.norm(np.cross(quad[:, 2] - quad[:, 0], quad[:, 3] - quad[:, 0]), axis=1)
    area = first + second
    weighed = first[:, None] * quad[:, [0, 1, 2]].mean(axis=1) + second[:, None] * quad[:, [0, 2, 3]].mean(axis=1)
    return area, weighed / np.maximum(area, np.finfo(float).tiny)[:, None]


def _together(pieces: list[MassProperties]) -> MassProperties:
    mass = sum(piece.mass_kg for piece in pieces)
    cg = np.sum([piece.mass_kg * piece.cg_m for piece in pieces], axis=0) / mass
    inertia = np.zeros((3, 3))
    for piece in pieces:
        arm = piece.cg_m - cg
        inertia += piece.inertia_kg_m2 + piece.mass_kg * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return MassProperties(mass, cg, inertia)


def _some(ids: np.ndarray) -> list[int]:
    return [int(v) for v in ids]
