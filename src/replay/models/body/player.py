"""The door to a whole player: a head with its helmet gets a body, posed, weighed and joined at the skull's base.

Everything stays in the head frame (origin at the head's centre of gravity): a player stands where a head alone would
stand, and the body hangs from it. `replay.models.players` numbers and places two of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from replay.models.body.mesh import STEP_RANGE_M, STEPS_M, BodyMesh, HeadRoom, body_mesh
from replay.models.body.posture import BodyJoint, PosedBody, Posture, body_joints, named_posture, pose
from replay.models.body.segments import HEAD, MESHED, de_leva_masses_kg, target_masses_kg
from replay.models.body.shape import load_body, shape_of
from replay.models.head_shape import head_preset, load_data
from replay.models.mass import mass_properties
from replay.models.model import GRID_DECIMALS, Model, ModelJoint, Part
from replay.models.ogrid import RESOLUTIONS
from replay.models.quality import hex_volumes, scaled_jacobians

BONE_PIDS, FLESH_PIDS = 60_000_100, 60_000_200
_FIRST_NUMBER = 65_000_000
SKULL_SET = "skull_base"
TISSUES = ("rigid", "deformable")
NOTES = {
    "rigid": "the body's segments are rigid and held by joints alone; decks do not carry the joints",
    "deformable": "the body is flesh about thin rigid bones, held by joints; decks do not carry the joints",
}


@dataclass(frozen=True)
class BodyPlan:
    """What body a player has.

    Parameters
    ----------
    stature_m, mass_kg
        Without helmet; the head's preset is part of the mass.
    muscle
        0.5 average, 1 most.
    posture
        Name of one of ``data/body.yaml``, or joint angles.
    tissue
        ``rigid``: each segment is one rigid body and joints hold them; ``deformable``: flesh about thin bones.
    step_m
        Edge of a voxel [m]; that of the head's resolution where None.
    """

    stature_m: float = 1.85
    mass_kg: float = 110.0
    muscle: float = 0.9
    posture: str | Posture = "standing"
    tissue: str = "rigid"
    step_m: float | None = None


def with_body(model: Model, plan: BodyPlan = BodyPlan()) -> Model:
    """Give a head its body.

    Parameters
    ----------
    model
        A head, with or without helmet, of `replay.models.build_model`.
    plan
        The body.

    Returns
    -------
    Model
        In the same frame, the head and helmet unchanged in it: parts ``bone_<segment>`` of the assembly ``body`` and
        `joints`; if deformable ``flesh_<segment>`` too, and the node set ``skull_base`` of the neck's end, which moves
        with the skull. ``info["body"]`` has the plan, the table of segments and the axes of every segment.

    Raises
    ------
    ValueError
        For a stature, mass, muscle, joint angle or tissue that is not possible, or a model that has a body.
    """
    if plan.tissue not in TISSUES:
        message = f"no tissue {plan.tissue!r}; there are {', '.join(TISSUES)}"
        raise ValueError(message)
    if model.elements_of(assembly="body").any():
        message = "the model has a body already"
        raise ValueError(message)
    posture = named_posture(plan.posture) if isinstance(plan.posture, str) else plan.posture
    shape = shape_of(plan.stature_m, plan.mass_kg, plan.muscle)
    posed = pose(shape, posture)
    step = STEPS_M[model.info["resolution"]] if plan.step_m is None else plan.step_m
    if not STEP_RANGE_M[0] <= step <= STEP_RANGE_M[1]:
        message = f"voxels of {step:g} m; between {STEP_RANGE_M[0]:g} and {STEP_RANGE_M[1]:g} m is possible"
        raise ValueError(message)
    seat = _Seat.of(model, posed)
    mesh = body_mesh(shape, posed, step, seat.room(model), plan.tissue)
    missing = [name for k, name in enumerate(MESHED) if not mesh.bone[mesh.segment == k].any()]
    if missing:
        message = f"at {step:g} m a voxel there is no bone in {', '.join(missing)}; take smaller voxels"
        raise ValueError(message)
    mesh = replace(mesh, nodes=np.round(seat.to_head(mesh.nodes), GRID_DECIMALS) + 0.0)
    head_kg = mass_properties(*_part_of(model, "head")).mass_kg
    volume = np.bincount(mesh.segment, hex_volumes(mesh.nodes, mesh.hexes), len(MESHED))
    targets = target_masses_kg(plan.mass_kg, head_kg, dict(zip(MESHED, volume.tolist())))
    density = {name: targets[name] / volume[k] for k, name in enumerate(MESHED)}
    skull = next(part for part in model.parts if part.role == "skull")
    joints = tuple(_joint(joint, posed, seat, skull.pid) for joint in body_joints())
    condyles = np.array(model.info["tragion_m"]) + load_data("body.yaml")["condyles_from_tragion_m"]
    joints = tuple(replace(j, centre_m=tuple(condyles.tolist())) if j.name == "skull_base" else j for j in joints)
    body = {
        "stature_m": plan.stature_m,
        "mass_kg": plan.mass_kg,
        "muscle": plan.muscle,
        "posture": posture.name,
        "angles_deg": {name: dict(angles) for name, angles in posture.angles_deg.items()},
        "tissue": plan.tissue,
        "step_m": step,
        "morph_weight": shape.weight,
        "morph_height": shape.height,
        "skin_volume_m3": shape.volume_m3,
        "min_scaled_jacobian": float(scaled_jacobians(mesh.nodes, mesh.hexes).min()),
        "segments": _segment_table(mesh, plan.mass_kg, head_kg, targets, density),
        "axes": {name: (axes @ seat.axes.T).tolist() for name, axes in posed.axes.items()},
    }
    return _merged(model, mesh, density, joints, skull.pid, body)


@dataclass(frozen=True)
class _Seat:
    """Where the head frame is in the body's axes: the rig's joint of head and neck on that of the head."""

    axes: np.ndarray
    star_centre: np.ndarray
    star_centre_in_head: np.ndarray

    @classmethod
    def of(cls, model: Model, posed: PosedBody) -> _Seat:
        scale = load_data("heads.yaml")["presets"][model.info["preset"]]["scalp_scale"]
        axes = posed.axes[HEAD]
        centre = posed.places["skull_base"] - (load_body().skull_base_m * scale) @ axes
        return cls(axes, centre, np.array(model.info["star_centre_m"]))

    def to_head(self, points: np.ndarray) -> np.ndarray:
        return (points - self.star_centre) @ self.axes.T + self.star_centre_in_head

    def room(self, model: Model) -> HeadRoom:
        rows = np.unique(model.hexes[model.elements_of(assembly="helmet")])
        helmet = (model.nodes[rows] - self.star_centre_in_head) @ self.axes + self.star_centre
        surfaces = head_preset(model.info["preset"], RESOLUTIONS[model.info["resolution"]].divisions).surfaces
        return HeadRoom(self.star_centre, self.axes, surfaces.scalp, helmet)


def _joint(joint: BodyJoint, posed: PosedBody, seat: _Seat, skull_pid: int) -> ModelJoint:
    data = load_data("body.yaml")
    neck = joint.name in ("neck", "skull_base")
    factor = data["neck_stiffness_factor"] if neck else 1.0
    pid = {name: BONE_PIDS + k + 1 for k, name in enumerate(MESHED)} | {HEAD: skull_pid}
    return ModelJoint(
        name=joint.name,
        first=pid[joint.parent],
        second=pid[joint.child],
        centre_m=tuple(np.round(seat.to_head(posed.places[joint.name]), GRID_DECIMALS).tolist()),
        axes=tuple(map(tuple, (posed.axes[joint.parent] @ seat.axes.T).tolist())),
        stiffness_n_m_per_rad=tuple(map(tuple, (joint.stiffness * factor).tolist())),
        damping_ratio=data["neck_damping_ratio" if neck else "damping_ratio"],
        centre_stiffness_n_per_m=data["centre_stiffness_n_per_m"],
        centre_damping_ratio=data["centre_damping_ratio"],
    )


def _part_of(model: Model, assembly: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    own = model.elements_of(assembly=assembly)
    return model.nodes, model.hexes[own], model.element_densities()[own]


def _segment_table(
    mesh: BodyMesh, mass_kg: float, head_kg: float, targets: dict[str, float], density: dict[str, float]
) -> dict[str, dict[str, Any]]:
    """Of every segment: hexes, volume, density, mass on the mesh, de Leva's, centre of gravity in the head frame."""
    wanted = de_leva_masses_kg(mass_kg)
    table: dict[str, dict[str, Any]] = {}
    for k, name in enumerate(MESHED):
        own = mesh.segment == k
        found = mass_properties(mesh.nodes, mesh.hexes[own], np.full(int(own.sum()), density[name]))
        table[name] = {
            "hexes": int(own.sum()),
            "bone_hexes": int(mesh.bone[own].sum()),
            "volume_m3": targets[name] / density[name],
            "density_kg_per_m3": density[name],
            "mass_kg": found.mass_kg,
            "de_leva_kg": wanted["head_neck"] - head_kg if name == "neck" else wanted[name],
            "cg_m": found.cg_m.tolist(),
        }
    return table


def _merged(
    model: Model, mesh: BodyMesh, density: dict[str, float], joints: tuple[ModelJoint, ...], skull_pid: int,
    body: dict[str, Any],
) -> Model:  # fmt: skip
    data = load_data("body.yaml")
    parts, materials = list(model.parts), dict(model.materials)
    element_part = np.empty(len(mesh.hexes), np.int32)
    for role, first in (("bone", BONE_PIDS), ("flesh", FLESH_PIDS)):
        for k, segment in enumerate(MESHED):
            own = (mesh.segment == k) & (mesh.bone == (role == "bone"))
            if not own.any():
                continue
            name = f"{role}_{segment}"
            element_part[own] = len(parts)
            parts.append(Part(first + k + 1, name, role, "body", name))
            facts = data[role]
            soft = role == "flesh" and segment == "neck"
            materials[name] = {
                "law": facts["law"],
                "density_kg_per_m3": density[segment],
                "parameters": dict(facts["neck_parameters" if soft else "parameters"]),
                "certainty": dict(facts["certainty"]),
                "source": facts["source"],
            }
    order = np.argsort(element_part, kind="stable")
    skull_nodes = np.unique(model.hexes[model.element_part == [p.pid for p in model.parts].index(skull_pid)])
    lowest = skull_nodes[np.argmin(model.nodes[skull_nodes, 2])]
    neck_end = np.concatenate([[lowest], mesh.skull_nodes + len(model.nodes)]).astype(np.int32)
    carried = {SKULL_SET: neck_end} if len(mesh.skull_nodes) else {}
    pids = tuple(part.pid for part in parts if part.assembly == "body")
    everyone = tuple(sorted({*model.part_sets.get("all_parts", ()), *pids}))
    return replace(
        model,
        nodes=np.vstack([model.nodes, mesh.nodes]),
        node_ids=np.concatenate([model.node_ids, _FIRST_NUMBER + 1 + np.arange(len(mesh.nodes))]),
        hexes=np.vstack([model.hexes, (mesh.hexes[order] + len(model.nodes)).astype(np.int32)]),
        element_ids=np.concatenate([model.element_ids, _FIRST_NUMBER + 1 + np.arange(len(mesh.hexes))]),
        element_part=np.concatenate([model.element_part, element_part[order]]),
        element_region=np.concatenate([model.element_region, np.zeros(len(mesh.hexes), np.int32)]),
        parts=tuple(parts),
        part_sets={**model.part_sets, "all_parts": everyone, "body_1": pids},
        part_set_ids={**model.part_set_ids, "body_1": 60_000_097},
        materials=materials,
        node_sets={**model.node_sets, **carried},
        joints=joints,
        rigid_node_sets=tuple(carried),
        info={**model.info, "body": body, "notes": [*model.info["notes"], NOTES[body["tissue"]]]},
    )
