"""The laboratory's apparatus in the striking player's place: a round stack of bonded layers, such as ram or anvil.

Its axis is x, its tip the origin; layers lie behind it. Every layer is a disc of hexes: a square core, inflated towards
the circle, and rings around it.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from replay.documents import Number, Setting, load_yaml, refuse
from replay.errors import InputError
from replay.models.helmet_design import Described, Pair, PartNumber
from replay.models.mass import mass_properties
from replay.models.model import GRID_DECIMALS, Model, Part
from replay.models.numbering import APPARATUS
from replay.models.regions import REGION_NAMES
from replay.play import Positive, Vector3

Name = Annotated[str, Field(pattern="^[a-z][a-z0-9_]*$")]
DIVISIONS = {"tiny": 6, "coarse": 8, "medium": 12, "fine": 16}
"""Cells along an edge of a layer's core, by resolution."""
_WHERE = "play.yaml"
_CORE = 0.62  # half the core's diagonal over the radius
_ROUND = 0.5
_LEAST_LAYERS = 3  # of what deforms: fewer are carried by hourglass stiffness
_NOTE = "the layers of the apparatus are bonded to one another and share nodes"


class Matter(Setting):
    """A material of an apparatus, with the parameters that its law takes."""

    law: Literal["elastic", "viscohyperelastic", "crushable_foam", "rigid"]
    density_kg_per_m3: Positive
    parameters: dict[str, Number | list[Number]]
    certainty: dict[str, Literal["measured", "calibrated", "assumed", "article"]]
    source: str = Field(min_length=1)


class Layer(Setting):
    """A layer of the stack."""

    material: str = Field(description="One of `materials`.")
    thickness_m: Positive = Field(description="Thickness; of a domed layer that of its rim [m].")
    pid: PartNumber


class Place(Setting):
    """Where the helmet is met."""

    from_deg: Pair = Field(description="Azimuth and elevation from which the apparatus comes [degrees].")
    aim_m: Vector3 = Field(default=(0.0, 0.0, 0.0), description="Point of its axis, from the head CG, head axes [m].")

    @property
    def rotation(self) -> Rotation:
        """Apparatus to head axes: x is the way in which the apparatus goes, seen from the head."""
        azimuth, elevation = self.from_deg
        return Rotation.from_euler("ZY", [azimuth + 180.0, elevation], degrees=True)


class Apparatus(Described):
    """A round apparatus, free or held."""

    held: Literal["free", "fixed"] = Field(description="`free`: it moves and is moved; `fixed`: the head falls on it.")
    mass_kg: Positive | None = Field(default=None, description="Of all together; the last layer makes up for it [kg].")
    radius_m: Positive = Field(description="Of every layer [m].")
    face_radius_m: Positive | None = Field(default=None, description="Of the spherical face; flat without [m].")
    layers: dict[Name, Layer] = Field(description="From the face that strikes backwards.", min_length=1)
    materials: dict[Name, Matter] = Field(description="By name.")
    places: dict[Name, Place] = Field(description="By name.", min_length=1)

    @model_validator(mode="after")
    def _goes_together(self) -> Apparatus:
        for name, layer in self.layers.items():
            if layer.material not in self.materials:
                refuse(f"layer {name} is of {layer.material!r}", ", ".join(self.materials), "describe the material")
        if len({layer.pid for layer in self.layers.values()}) < len(self.layers):
            refuse("a part number is given twice", "a number a layer", "number the layers apart")
        if self.face_radius_m is not None and self.face_radius_m < self.radius_m:
            refuse("the face is rounder than a hemisphere", f"at least {self.radius_m} m", "enlarge `face_radius_m`")
        if self.held == "fixed" and not _rigid(self, list(self.layers.values())[-1]):
            refuse("nothing rigid holds it", "a rigid last layer", "make the last layer's material rigid")
        return self

    def place(self, name: str) -> Place:
        """A place by name; `InputError` for one that there is not."""
        if name not in self.places:
            raise InputError(
                _WHERE, f"{self.title} has no place {name!r}", column="collision.apparatus.place",
                expected=", ".join(self.places),
            )  # fmt: skip
        return self.places[name]


def apparatus_names() -> tuple[str, ...]:
    """Names of the apparatus that ships."""
    folder = resources.files("replay.models") / "data" / "apparatus"
    return tuple(sorted(Path(entry.name).stem for entry in folder.iterdir() if entry.name.endswith(".yaml")))


@cache
def load_apparatus(name: str) -> Apparatus:
    """Read the description of an apparatus that ships.

    Raises
    ------
    InputError
        For an unknown name.
    """
    if name not in apparatus_names():
        raise InputError(name, "no apparatus of this name", expected=", ".join(apparatus_names()))
    return load_yaml(Path(str(resources.files("replay.models") / "data" / "apparatus" / f"{name}.yaml")), Apparatus)


def build_apparatus(name: str, resolution: str) -> Model:
    """Mesh and weigh an apparatus.

    Parameters
    ----------
    name
        Of `load_apparatus`.
    resolution
        ``tiny``, ``coarse``, ``medium`` or ``fine``.

    Returns
    -------
    Model
        Tip at the origin, layers along -x, numbered in the block of the apparatus.
    """
    design, divisions = load_apparatus(name), DIVISIONS[resolution]
    nodes, hexes, layer_of = _stack(design, divisions)
    nodes = np.round(nodes, GRID_DECIMALS) + 0.0
    parts = tuple(
        Part(APPARATUS + layer.pid, name, _role(design, name), "apparatus", layer.material)
        for name, layer in design.layers.items()
    )
    materials = {part.material: design.materials[part.material].model_dump() for part in parts}
    ballast = parts[-1].material
    if design.mass_kg is not None:
        density = np.array([materials[p.material]["density_kg_per_m3"] for p in parts])[layer_of]
        heavy = np.array([p.material == ballast for p in parts])[layer_of]
        own, rest = (mass_properties(nodes, hexes[k], density[k]).mass_kg if k.any() else 0.0 for k in (heavy, ~heavy))
        materials[ballast]["density_kg_per_m3"] *= (design.mass_kg - rest) / own
    pids = tuple(part.pid for part in parts)
    return Model(
        nodes=nodes,
        node_ids=APPARATUS + 1 + np.arange(len(nodes), dtype=np.int64),
        hexes=hexes.astype(np.int32),
        element_ids=APPARATUS + 1 + np.arange(len(hexes), dtype=np.int64),
        element_part=layer_of.astype(np.int32),
        element_region=np.zeros(len(hexes), np.int32),
        parts=parts,
        region_names=REGION_NAMES,
        part_sets={"apparatus": pids, "all_parts": pids},
        part_set_ids={"apparatus": APPARATUS + 98, "all_parts": 99},
        materials=materials,
        info={
            "preset": name,
            "resolution": resolution,
            "player": 2,
            "apparatus": design.model_dump(mode="json"),
            "notes": [_NOTE],
        },
    )


def _stack(design: Apparatus, divisions: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, hexes and the layer of each hex; hexes of a layer follow one another."""
    disc, quads = _disc(divisions)
    flat = disc * design.radius_m
    edge = 2 * _CORE / np.sqrt(2.0) * design.radius_m / divisions
    front = np.zeros(len(disc))
    if design.face_radius_m is not None:
        front = np.sqrt(design.face_radius_m**2 - np.einsum("ij,ij->i", flat, flat)) - design.face_radius_m
    planes, layer_of, behind = [front], [], float(front.min())
    for k, layer in enumerate(design.layers.values()):
        behind -= layer.thickness_m
        thick = (float(planes[-1].mean()) - behind) / edge
        # hexes twice as thick as wide: a foam that bottoms out snaps sideways at its free edge where they are flat
        count = max(1 if _rigid(design, layer) else _LEAST_LAYERS, round(thick / 2))
        share = np.arange(1, count + 1)[:, None] / count
        planes += list((1 - share) * planes[-1] + share * behind)
        layer_of += [k] * count
    nodes = np.concatenate([np.column_stack([x, flat]) for x in planes])
    hexes = np.concatenate(
        [np.hstack([quads + (k + 1) * len(disc), quads + k * len(disc)]) for k in range(len(layer_of))]
    )
    return nodes, hexes, np.repeat(layer_of, len(quads))


def _role(design: Apparatus, name: str) -> str:
    """The last layer holds the others; of these a foam is crushed, and anything else is there to be struck."""
    if name == list(design.layers)[-1]:
        return "mount"
    law = design.materials[design.layers[name].material].law
    return "cushion" if law == "crushable_foam" else "cap"


def _rigid(design: Apparatus, layer: Layer) -> bool:
    return design.materials[layer.material].law == "rigid"


def _disc(divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit disc: points (p, 2), and quads (q, 4) counter-clockwise."""
    n, rings = divisions, divisions // 2
    line = np.linspace(-1.0, 1.0, n + 1)
    square = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    core = _inflated(square) * _CORE
    index = np.arange(len(core)).reshape(n + 1, n + 1)
    around = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    rim = _directions(square[around])
    loops, points = [around], [core]
    for ring in range(1, rings + 1):
        share = ring / rings
        points.append((1 - share) * core[around] + share * rim)
        loops.append(len(core) + (ring - 1) * len(around) + np.arange(len(around)))
    quads = [np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)]
    quads += [
        np.stack([inner, outer, np.roll(outer, -1), np.roll(inner, -1)], axis=-1) for inner, outer in pairwise(loops)
    ]
    return np.concatenate(points), np.concatenate(quads)


def _directions(square: np.ndarray) -> np.ndarray:
    """Unit vectors of points on a square's edge, spaced evenly in angle."""
    tangents = np.tan(np.pi / 4 * square)
    return tangents / np.sqrt(np.einsum("ij,ij->i", tangents, tangents))[:, None]


def _inflated(square: np.ndarray) -> np.ndarray:
    """Points of the square [-1, 1]^2 between it and the unit disc, as the core of a head is."""
    reach = np.abs(square).max(axis=1)
    disc = np.zeros_like(square)
    off = reach > 0
    disc[off] = _directions(square[off] / reach[off, None]) * reach[off, None]
    weight = (_ROUND * reach)[:, None]
    return (1 - weight) * square / np.sqrt(2.0) + weight * disc
