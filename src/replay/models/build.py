"""The model from a preset and a resolution: mesh, parts, sets, densities, regions."""

from __future__ import annotations

import numpy as np

from replay.models.anatomy.labels import Tissue
from replay.models.anatomy.surfaces import face_weight, load_anatomy
from replay.models.calibration import calibrate_densities
from replay.models.cubed_sphere import cube_lattice
from replay.models.facemask import facemask_mesh
from replay.models.guard import relocate_worst_nodes
from replay.models.head_shape import HeadPreset, head_preset, load_data
from replay.models.helmet import helmet_mesh
from replay.models.helmet_layout import PADS, helmet_layout
from replay.models.mass import mass_properties
from replay.models.materials import MATERIAL_OF_ROLE
from replay.models.model import GRID_DECIMALS, Model, Part
from replay.models.ogrid import RESOLUTIONS, TISSUES, HeadMesh, head_mesh
from replay.models.quality import shape_functions
from replay.models.regions import REGION_NAMES, label_regions

HEAD_PART_IDS = {
    "grey_matter": 60000001, "csf": 60000002, "skull": 60000003, "white_matter": 60000004, "scalp": 60009020,
    "face": 60009021,
}  # fmt: skip
HEAD_ROLES = {"grey_matter": "brain", "white_matter": "brain"}
PID_BLOCKS = {
    "head": (60_000_000, 69_999_999),
    "helmet": (10_000_000, 19_999_999),
    "impactor_head": (40_000_000, 49_999_999),
    "impactor_helmet": (20_000_000, 29_999_999),
}
SET_IDS = {
    "H1_pads_set1": 10000099,
    "H1_pads_set2": 10000100,
    "all_parts": 99,
    "helmet_1": 10000098,
    "head_1": 60000098,
    "skull": 60000099,
}
NOTES = (
    "facemask bars share nodes at crossings, their mounts with the edge of the shell; one hex across a bar",
    "brain and scalp are an average of many people's anatomy; the skull between them is a rule, not a measured bone",
    "sulci and ventricles are meshed as grey matter: the fluid of the article is stiffer in shear than brain",
    "falx and tentorium are left out",
)
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
    helmet_structure: str = "rigid",
    brain: str = "brain_isv",
    seat: str = "shared_nodes",
) -> Model:
    """Build head and helmet.

    Parameters
    ----------
    preset
        ``anat``, ``nfl`` or ``article``.
    resolution
        ``tiny`` or ``coarse``.
    helmet_mass_kg
        Mass of the physical helmet [kg]; the preset's where None.
    helmet
        False for a bare head.
    helmet_structure
        ``rigid``: shell and facemask move as one body; ``deformable``: both are elastic.
    brain
        Law of the brain: ``brain_isv`` or ``viscohyperelastic``.
    seat
        ``shared_nodes``: pads and chin cup share the scalp's nodes; ``contact``: they touch it, held by chin straps.

    Returns
    -------
    Model
        In the head frame, origin at the head's centre of gravity.

    Raises
    ------
    ValueError
        For an unknown preset, resolution, structure or seat, or a mass that is not positive.
    """
    if helmet_structure not in STRUCTURE_NOTES:
        message = f"no helmet structure {helmet_structure!r}; there are {', '.join(STRUCTURE_NOTES)}"
        raise ValueError(message)
    if seat not in SEAT_NOTES:
        message = f"no helmet seat {seat!r}; there are {', '.join(SEAT_NOTES)}"
        raise ValueError(message)
    if resolution not in RESOLUTIONS:
        message = f"no resolution {resolution!r}; there are {', '.join(RESOLUTIONS)}"
        raise ValueError(message)
    head = head_preset(preset, RESOLUTIONS[resolution].divisions)
    target = head.helmet_mass_kg if helmet_mass_kg is None else float(helmet_mass_kg)
    if not target > 0:
        message = f"a helmet of {target} kg"
        raise ValueError(message)
    nodes, hexes, names, mounts, cup = _mesh(head, resolution, seat if helmet else None)
    nodes, moved = relocate_worst_nodes(nodes, hexes, target=_QUALITY_TARGET)
    nodes = np.round(nodes, GRID_DECIMALS)
    parts = tuple(part for part in part_table() if part.name in set(names.tolist()))
    index = {part.name: k for k, part in enumerate(parts)}
    element_part = np.array([index[name] for name in names.tolist()], dtype=np.int32)
    order = np.argsort(element_part, kind="stable")
    hexes, element_part = hexes[order], element_part[order]
    regions = np.zeros(len(hexes), dtype=np.int32)
    in_brain = np.array([part.role == "brain" for part in parts])[element_part]
    regions[in_brain] = label_regions(head.surfaces.to_atlas(nodes[hexes[in_brain]].mean(axis=1)))
    calibration = calibrate_densities(nodes, hexes, element_part, parts, head, target, brain)
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
    sets, set_ids = _part_sets(parts)
    return Model(
        nodes=np.round(nodes - cg, GRID_DECIMALS) + 0.0,  # no negative zeros
        node_ids=_numbers(hexes, in_head, len(nodes)),
        hexes=hexes.astype(np.int32),
        element_ids=_element_ids(in_head),
        element_part=element_part,
        element_region=regions,
        parts=parts,
        region_names=REGION_NAMES,
        part_sets=sets,
        part_set_ids=set_ids,
        materials=materials,
        node_sets=_node_sets(nodes, mounts, cup, hexes, element_part, index, seat),
        info={
            "preset": preset,
            "preset_title": head.title,
            "resolution": resolution,
            "star_centre_m": [float(v) for v in -cg],
            "tragion_m": [float(v) for v in np.array(head.surfaces.tragion_m) - cg],
            "atlas_centre_mm": list(head.surfaces.atlas_centre_mm),
            "atlas_mm_per_m": head.surfaces.atlas_mm_per_m,
            "atlas_pitch_rad": head.surfaces.atlas_pitch_rad,
            "helmet_mass_target_kg": target if helmet else None,
            "calibration": calibration.table,
            "guard_moved_nodes": int(moved),
            "empty_regions": [n for k, n in enumerate(REGION_NAMES) if k and not (regions == k).any()],
            "helmet_structure": helmet_structure if helmet else None,
            "helmet_seat": seat if helmet else None,
            "notes": [*SEAT_NOTES[seat], *NOTES, STRUCTURE_NOTES[helmet_structure]] if helmet else list(NOTES),
            **({"strap": load_data("helmet.yaml")["strap"]} if helmet and seat == "contact" else {}),
        },
    )


def part_table() -> tuple[Part, ...]:
    """Every part the builder knows, with its number."""
    ids = load_data("helmet.yaml")["part_ids"]
    parts = []
    for name, pid in HEAD_PART_IDS.items():
        role = HEAD_ROLES.get(name, name)
        parts.append(Part(pid, name, role, "head", MATERIAL_OF_ROLE[role]))
    for role in ("shell", "facemask"):
        parts.append(Part(ids[role], role, role, "helmet", MATERIAL_OF_ROLE[role]))
    for role in ("comfort_pad", "energy_pad"):
        parts += [Part(ids[role][pad], f"{role}_{pad}", role, "helmet", MATERIAL_OF_ROLE[role]) for pad in PADS]
    parts.append(Part(ids["chin_cup"], "chin_cup", "chin_cup", "helmet", MATERIAL_OF_ROLE["chin_cup"]))
    return tuple(parts)


def _mesh(
    head: HeadPreset, resolution: str, seat: str | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Nodes, hexes, part name of each hex, mounts, outer nodes of the chin cup; a bare head where there is no seat."""
    setting, helmet = RESOLUTIONS[resolution], load_data("helmet.yaml")
    lattice = cube_lattice(setting.divisions)
    layout = helmet_layout(lattice, helmet)
    inner = head_mesh(lattice, head.surfaces, setting, layout.directions, head.least_thickness_m)
    names = head_part_names(inner, head)
    if seat is None:
        return inner.nodes, inner.hexes, names, {}, np.zeros(0, dtype=int)
    outer = helmet_mesh(lattice, layout, inner, head.surfaces.scalp, setting, helmet, seat)
    mask = facemask_mesh(outer.nodes, outer.edge_quads, head.surfaces.scalp, helmet, setting.facemask_step_m)
    names = np.concatenate([names, outer.part, np.full(len(mask.hexes), "facemask")])
    foam = outer.hexes[outer.part == "chin_cup"]
    cup = np.setdiff1d(foam[:, 4:], foam[:, :4])
    return mask.nodes, np.vstack([inner.hexes, outer.hexes, mask.hexes]), names, mask.mounts, cup


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


def _part_sets(parts: tuple[Part, ...]) -> tuple[dict[str, tuple[int, ...]], dict[str, int]]:
    chosen = {
        "H1_pads_set1": [p.pid for p in parts if p.role == "comfort_pad"],
        "H1_pads_set2": [p.pid for p in parts if p.role == "energy_pad"],
        "all_parts": [p.pid for p in parts],
        "helmet_1": [p.pid for p in parts if p.assembly == "helmet"],
        "head_1": [p.pid for p in parts if p.assembly == "head"],
        "skull": [p.pid for p in parts if p.role == "skull"],
    }
    sets = {name: tuple(sorted(pids)) for name, pids in chosen.items() if pids}
    return sets, {name: SET_IDS[name] for name in sets}


def _numbers(hexes: np.ndarray, in_head: np.ndarray, count: int) -> np.ndarray:
    """Node numbers: the head's from 60,000,001, the helmet's own from 10,000,001."""
    of_head = np.zeros(count, dtype=bool)
    of_head[hexes[in_head]] = True
    return np.where(of_head, 60_000_000 + np.cumsum(of_head), 10_000_000 + np.cumsum(~of_head)).astype(np.int64)


def _element_ids(in_head: np.ndarray) -> np.ndarray:
    return np.where(in_head, 60_000_000 + np.cumsum(in_head), 10_000_000 + np.cumsum(~in_head)).astype(np.int64)


def _node_sets(
    nodes: np.ndarray,
    mounts: dict[str, np.ndarray],
    cup: np.ndarray,
    hexes: np.ndarray,
    element_part: np.ndarray,
    index: dict[str, int],
    seat: str,
) -> dict[str, np.ndarray]:
    """Mounts of the facemask, and where the chin strap goes: outer corners of the cup, lower edge of the shell."""
    if "shell" not in index:
        return {}
    sets = {f"facemask_mount_{name}": rows for name, rows in mounts.items()}
    if seat == "contact":
        sets["chin_cup_shell"] = cup
    shell = np.unique(hexes[element_part == index["shell"]])
    for side, sign in (("left", 1), ("right", -1)):
        sets[f"chin_cup_strap_{side}"] = cup[[_furthest(nodes[cup], np.array([0.0, sign, 0.0]))]]
        for name, direction in (("front", [1.0, sign, -1.2]), ("rear", [-0.3, sign, -1.2])):
            sets[f"strap_anchor_{name}_{side}"] = shell[[_furthest(nodes[shell], np.array(direction))]]
    return {name: np.sort(rows).astype(np.int32) for name, rows in sets.items()}


def _furthest(points: np.ndarray, direction: np.ndarray) -> int:
    return int(np.argmax(np.round(np.einsum("ij,j->i", points, direction), 9)))
