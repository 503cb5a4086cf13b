"""The model from a preset and a resolution: mesh, parts, sets, densities, regions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.models.anatomy.labels import Tissue
from replay.models.anatomy.surfaces import face_weight, load_anatomy
from replay.models.calibration import calibrate_densities
from replay.models.cubed_sphere import cube_lattice
from replay.models.facemask import facemask_mesh
from replay.models.guard import relocate_worst_nodes
from replay.models.head_shape import HeadPreset, head_preset, load_data
from replay.models.helmet import helmet_mesh
from replay.models.helmet_design import HelmetDesign, load_design
from replay.models.helmet_layout import direction_at, helmet_layout
from replay.models.mass import mass_properties
from replay.models.materials import load_materials
from replay.models.model import GRID_DECIMALS, Model
from replay.models.numbering import PLAYERS, element_numbers, node_numbers, part_sets, part_table
from replay.models.ogrid import RESOLUTIONS, TISSUES, HeadMesh, head_mesh
from replay.models.quality import shape_functions
from replay.models.regions import REGION_NAMES, label_regions

NOTES = (
    "facemask bars share nodes at crossings, their mounts with the edge of the shell; one hex across a bar",
    "brain and scalp are an average of many people's anatomy; the skull between them is a rule, not a measured bone",
    "sulci and ventricles are meshed as grey matter: the fluid of the article is stiffer in shear than brain",
)
OUTLET_NOTES = {
    "closed": "the skull is closed below the brainstem",
    "open": "fluid fills the foramen magnum; below it is the flesh of the neck, no spinal canal",
}
MEMBRANE_NOTES = {
    "none": "falx and tentorium are left out",
    "cables": "falx and tentorium are nets of cables in the replay; decks do not hold them",
}
SEAT_NOTES = {
    "shared_nodes": (
        "contact is not modelled: pads share nodes with scalp, with each other and with the shell; chin cup with scalp",
        "straps are not modelled; their anchors are node sets",
    ),
    "contact": (
        "pads and chin cup touch the scalp by contact; pads share nodes with each other and with the shell",
        "straps are straight cables from chin cup to shell that touch nothing; the cup's outer face is its hard shell",
    ),
}
STRUCTURE_ROLES = ("shell", "facemask")
STRUCTURE_NOTES = {
    "rigid": (
        "shell and facemask are one rigid body: one hex across a wall or a bar bends by hourglass modes alone, which "
        "are no mechanics; with `helmet_structure: deformable` they are elastic, and the hourglass gate judges it"
    ),
    "deformable": "shell and facemask are elastic, one hex across: their bending is carried by hourglass stiffness",
}
_QUALITY_TARGET = 0.30
#: Shape functions at 4 x 4 x 4 places of a hex, where the labels are asked.
_SAMPLES = np.stack(
    [shape_functions(np.array([u, v, w]) * 0.5 - 0.75) for u in range(4) for v in range(4) for w in range(4)]
)


def build_model(
    preset: str = "nfl",
    resolution: str = "coarse",
    helmet_mass_kg: float | None = None,
    *,
    helmet: bool = True,
    design: HelmetDesign | None = None,
    helmet_structure: str = "rigid",
    brain: str = "brain_isv",
    membranes: str = "none",
    outlet: str = "closed",
    seat: str = "shared_nodes",
) -> Model:
    """Build head and helmet.

    Parameters
    ----------
    preset
        ``anat``, ``nfl`` or ``article``.
    resolution
        ``tiny``, ``coarse``, ``medium`` or ``fine``.
    helmet_mass_kg
        Mass of the physical helmet as worn [kg]; the design's, in the preset's size, where None.
    helmet
        False for a bare head.
    design
        The helmet of `load_design`; the classic one where None.
    helmet_structure
        ``rigid``: shell and facemask move as one body; ``deformable``: both are elastic.
    brain
        Law of the brain: ``brain_isv`` or ``viscohyperelastic``.
    membranes
        Falx and tentorium: ``none``, or ``cables`` (see `replay.models.membranes`).
    outlet
        Skull below the brainstem: ``closed``, or ``open`` with fluid in the foramen magnum.
    seat
        ``shared_nodes``: pads and chin cup share the scalp's nodes; ``contact``: they touch it, held by chin straps.

    Returns
    -------
    Model
        In the head frame, origin at the head's centre of gravity.

    Raises
    ------
    ValueError
        For an unknown preset, resolution, structure, membranes, outlet or seat, or a mass that is not positive.
    """
    if helmet_structure not in STRUCTURE_NOTES:
        message = f"no helmet structure {helmet_structure!r}; there are {', '.join(STRUCTURE_NOTES)}"
        raise ValueError(message)
    if membranes not in MEMBRANE_NOTES:
        message = f"no membranes {membranes!r}; there are {', '.join(MEMBRANE_NOTES)}"
        raise ValueError(message)
    if outlet not in OUTLET_NOTES:
        message = f"no outlet {outlet!r}; there are {', '.join(OUTLET_NOTES)}"
        raise ValueError(message)
    if seat not in SEAT_NOTES:
        message = f"no helmet seat {seat!r}; there are {', '.join(SEAT_NOTES)}"
        raise ValueError(message)
    if resolution not in RESOLUTIONS:
        message = f"no resolution {resolution!r}; there are {', '.join(RESOLUTIONS)}"
        raise ValueError(message)
    worn = (design or load_design()) if helmet else None
    head, blocks = head_preset(preset, RESOLUTIONS[resolution].divisions), PLAYERS[1]
    target = worn.mass_kg * head.helmet_size if worn and helmet_mass_kg is None else helmet_mass_kg
    if target is not None and not target > 0:
        message = f"a helmet of {target} kg"
        raise ValueError(message)
    mesh = _mesh(head, resolution, worn, seat, open_outlet=outlet == "open")
    nodes, moved = relocate_worst_nodes(mesh.nodes, mesh.hexes, target=_QUALITY_TARGET)
    nodes, names = np.round(nodes, GRID_DECIMALS), mesh.part
    parts = tuple(part for part in part_table(blocks, worn) if part.name in set(names.tolist()))
    index = {part.name: k for k, part in enumerate(parts)}
    element_part = np.array([index[name] for name in names.tolist()], dtype=np.int32)
    order = np.argsort(element_part, kind="stable")
    hexes, element_part = mesh.hexes[order], element_part[order]
    regions = np.zeros(len(hexes), dtype=np.int32)
    in_brain = np.array([part.role == "brain" for part in parts])[element_part]
    regions[in_brain] = label_regions(head.surfaces.to_atlas(nodes[hexes[in_brain]].mean(axis=1)))
    library = load_materials(brain) | (worn.materials if worn else {})
    calibration = calibrate_densities(nodes, hexes, element_part, parts, head, target or 0.0, library)
    materials = calibration.materials
    if helmet_structure == "rigid":
        for part in parts:
            if part.role in STRUCTURE_ROLES:
                materials[part.material]["law"] = "rigid"
    density = np.array([materials[part.material]["density_kg_per_m3"] for part in parts])[element_part]
    in_head = np.array([part.assembly == "head" for part in parts])[element_part]
    cg = mass_properties(nodes, hexes[in_head], density[in_head]).cg_m
    cg = np.round(cg, GRID_DECIMALS)
    cg[1] = 0.0  # the head is symmetric; the sum of its elements only nearly so
    sets, set_ids = part_sets(blocks, parts)
    return Model(
        nodes=np.round(nodes - cg, GRID_DECIMALS) + 0.0,  # no negative zeros
        node_ids=node_numbers(blocks, hexes, in_head, len(nodes)),
        hexes=hexes.astype(np.int32),
        element_ids=element_numbers(blocks, in_head),
        element_part=element_part,
        element_region=regions,
        parts=parts,
        region_names=REGION_NAMES,
        part_sets=sets,
        part_set_ids=set_ids,
        materials=materials,
        node_sets=_node_sets(nodes, mesh, worn, seat) if worn else {},
        info={
            "preset": preset,
            "preset_title": head.title,
            "resolution": resolution,
            "player": 1,
            "star_centre_m": [float(v) for v in -cg],
            "tragion_m": [float(v) for v in np.array(head.surfaces.tragion_m) - cg],
            "atlas_centre_mm": list(head.surfaces.atlas_centre_mm),
            "atlas_mm_per_m": head.surfaces.atlas_mm_per_m,
            "atlas_pitch_rad": head.surfaces.atlas_pitch_rad,
            "helmet_mass_target_kg": target if worn else None,
            "calibration": calibration.table,
            "guard_moved_nodes": int(moved),
            "empty_regions": [n for k, n in enumerate(REGION_NAMES) if k and not (regions == k).any()],
            "helmet_structure": helmet_structure if helmet else None,
            "helmet_seat": seat if helmet else None,
            "membranes": membranes,
            "outlet": outlet,
            "notes": [
                *(SEAT_NOTES[seat] if worn else ()),
                *NOTES,
                MEMBRANE_NOTES[membranes],
                OUTLET_NOTES[outlet],
                *((STRUCTURE_NOTES[helmet_structure],) if worn else ()),
            ],
            **_record(worn, seat),
        },
    )


@dataclass(frozen=True)
class _Mesh:
    """Nodes about the star centre, hexes, the part of each; mounts, outer nodes of the cup, of the shell's edge."""

    nodes: np.ndarray
    hexes: np.ndarray
    part: np.ndarray
    mounts: dict[str, np.ndarray]
    cup: np.ndarray
    edge: np.ndarray


def _mesh(head: HeadPreset, resolution: str, design: HelmetDesign | None, seat: str, *, open_outlet: bool) -> _Mesh:
    setting = RESOLUTIONS[resolution]
    lattice = cube_lattice(setting.divisions)
    layout = helmet_layout(lattice, design or load_design())  # a bare head is that of the classic helmet
    inner = head_mesh(lattice, head.surfaces, setting, layout.directions, head.least_thickness_m)
    names, none = head_part_names(inner, head), np.zeros(0, dtype=int)
    if open_outlet:
        names[(names == "skull") & _in_foramen(inner, head)] = "csf"
    if design is None:
        return _Mesh(inner.nodes, inner.hexes, names, {}, none, none)
    outer = helmet_mesh(lattice, layout, inner, head.surfaces.scalp, setting, design, seat)
    names, hexes = np.concatenate([names, outer.part]), np.vstack([inner.hexes, outer.hexes])
    foam = outer.hexes[outer.part == "chin_cup"]
    cup, edge = np.setdiff1d(foam[:, 4:], foam[:, :4]), np.unique(outer.edge_quads[:, 2:])
    if design.facemask is None:
        return _Mesh(outer.nodes, hexes, names, {}, cup, edge)
    mask = facemask_mesh(
        outer.nodes, outer.edge_quads, head.surfaces.scalp, design.shell, design.facemask, setting.facemask_step_m
    )
    names = np.concatenate([names, np.full(len(mask.hexes), "facemask")])
    return _Mesh(mask.nodes, np.vstack([hexes, mask.hexes]), names, mask.mounts, cup, edge)


def _in_foramen(mesh: HeadMesh, head: HeadPreset) -> np.ndarray:
    """Mask (m,) of the hexes of a head whose centre lies in the direction of the foramen magnum."""
    facts = load_data("heads.yaml")["foramen_magnum"]
    away = head.surfaces.to_atlas(mesh.nodes[mesh.hexes].mean(axis=1)) - np.array(head.surfaces.atlas_centre_mm)
    axis = np.array(facts["towards_mni_mm"]) - np.array(head.surfaces.atlas_centre_mm)
    along = np.einsum("ij,j->i", away, axis) / np.sqrt(axis @ axis)
    across = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - along**2, 0.0))
    return (along > 0) & (across < along * np.tan(np.radians(facts["half_angle_deg"])))


def head_part_names(mesh: HeadMesh, head: HeadPreset) -> np.ndarray:
    """Part of every hex of a head, (m,): tissues by layer, brain by the label volume, scalp by direction."""
    names = np.array(TISSUES)[mesh.tissue].astype("U32")
    corners = mesh.nodes[mesh.hexes]
    soft = names == "scalp"
    centre = corners[soft].mean(axis=1)
    centre /= np.sqrt(np.einsum("ij,ij->i", centre, centre))[:, None]
    names[soft] = np.where(face_weight(centre) > 0.5, "face", "scalp")
    brain = names == "brain"
    sampled = np.einsum("pn,enk->epk", _SAMPLES, corners[brain])
    label = load_anatomy().labels.at(head.surfaces.to_atlas(sampled.reshape(-1, 3))).reshape(sampled.shape[:2])
    white, grey = (label == Tissue.WHITE).sum(axis=1), (label == Tissue.GREY).sum(axis=1)
    names[brain] = np.where(white > grey, "white_matter", "grey_matter")
    return names


def _record(design: HelmetDesign | None, seat: str) -> dict[str, object]:
    """What a model says of its helmet."""
    if design is None:
        return {}
    strap = {
        "stiffness_n_per_m": design.chinstrap.stiffness_n_per_m,
        "damping_n_s_per_m": design.chinstrap.damping_n_s_per_m,
    }
    return {"helmet": design.document(), **({"strap": strap} if seat == "contact" else {})}


def _node_sets(nodes: np.ndarray, mesh: _Mesh, design: HelmetDesign, seat: str) -> dict[str, np.ndarray]:
    """Mounts of the facemask, and where the chin strap goes: outer corners of the cup, edge of the shell."""
    sets = {f"facemask_mount_{name}": rows for name, rows in mesh.mounts.items()}
    if seat == "contact":
        sets["chin_cup_shell"] = mesh.cup
    away = nodes[mesh.edge] / np.sqrt(np.einsum("ij,ij->i", nodes[mesh.edge], nodes[mesh.edge]))[:, None]
    for side, sign in (("left", 1), ("right", -1)):
        sets[f"chin_cup_strap_{side}"] = mesh.cup[[_furthest(nodes[mesh.cup], np.array([0.0, sign, 0.0]))]]
        for name, strap in design.chinstrap.straps.items():
            azimuth, elevation = strap.anchor_deg
            towards = direction_at(np.array(sign * azimuth), np.array(elevation))
            sets[f"strap_anchor_{name}_{side}"] = mesh.edge[[_furthest(away, towards)]]
    return {name: np.sort(rows).astype(np.int32) for name, rows in sets.items()}


def _furthest(points: np.ndarray, direction: np.ndarray) -> int:
    return int(np.argmax(np.round(np.einsum("ij,j->i", points, direction), 9)))
