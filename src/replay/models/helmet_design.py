"""The description of a helmet: shell, pads, facemask and chin strap, each a YAML file that ships or is a play's own.

Angles are about the star centre [degrees]: elevation above the horizontal plane, azimuth from anterior (0) over the
side (90) to posterior (180), both sides alike. Lattice coordinates run from -1 to 1 over the 90 degrees of a face of
the cubed sphere: x ahead, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Field, ValidationInfo, field_validator, model_validator

from replay.documents import Number, Setting, load_yaml, refuse
from replay.errors import InputError
from replay.models.facemask_design import Facemask
from replay.models.materials import CERTAINTIES, load_materials
from replay.play import Positive

SettingT = TypeVar("SettingT", bound=Setting)
Pair = tuple[Number, Number]
PartNumber = Annotated[int, Field(gt=0, lt=10_000_000, description="Part number within the helmet's block.")]

NO_FACEMASK = "none"
_FOLDERS = {"helmet": "helmets", "pads": "pads", "facemask": "facemasks", "chinstrap": "chinstraps"}
_STRUCTURE_MATERIALS = ("polycarbonate", "titanium", "steel")


def _known_material(name: str, info: ValidationInfo) -> str:
    known = (info.context or {}).get("materials", ())
    if known and name not in known:
        refuse("is no material", ", ".join(known), "correct the name, or describe the material under `materials:`")
    return name


class Described(Setting):
    """What every file of a helmet says of itself."""

    title: str = Field(description="What it is.", min_length=1)
    source: str = Field(description="Where its numbers come from.", min_length=1)
    certainty: dict[str, Literal["measured", "calibrated", "assumed", "article"]] = Field(
        description=f"How sure its numbers are: {', '.join(CERTAINTIES)}."
    )


class Standoff(Setting):
    """Distance from the smoothed scalp to the shell along the normal, by direction."""

    front: Positive = Field(description="Ahead [m].")
    side: Positive = Field(description="At the sides [m].")
    back: Positive = Field(description="Behind [m].")
    crown: Positive = Field(description="Above; and below, where there is a shell [m].")

    @property
    def least_m(self) -> float:
        """The smallest of the four [m]."""
        return min(self.front, self.side, self.back, self.crown)


class Coverage(Setting):
    """Cells of the lattice that the shell covers."""

    brow: Annotated[Number, Field(ge=-1, le=1)] = Field(description="In front: cells above this lattice line.")
    bottom: Annotated[Number, Field(ge=-1, le=1)] = Field(description="Elsewhere: cells above this lattice line.")
    flap_front: Annotated[Number, Field(ge=-1, le=1)] = Field(
        description="At the sides, `brow` holds before this line."
    )


class Outline(Setting):
    """Where the edge of the shell runs: [azimuth, elevation] points, straight between them."""

    brow: tuple[Pair, ...] = Field(description="From the middle of the brow sidewards [degrees].", min_length=2)
    flap: tuple[Pair, ...] = Field(description="From there down the front of the flap [degrees].", min_length=2)
    bottom: tuple[Pair, ...] = Field(description="From there under the ear to the nape [degrees].", min_length=2)

    @model_validator(mode="after")
    def _is_one_line(self) -> Outline:
        for name, points, axis, sign in (
            ("brow", self.brow, 0, 1), ("flap", self.flap, 1, -1), ("bottom", self.bottom, 0, 1)
        ):  # fmt: skip
            if any(sign * (b[axis] - a[axis]) <= 0 for a, b in pairwise(points)):
                word = ("azimuth must rise", "elevation must fall")[axis]
                refuse(f"{name} turns back", f"{word} from point to point", "put the points in order")
        if self.brow[-1] != self.flap[0] or self.flap[-1] != self.bottom[0]:
            refuse("the edge has a gap", "brow, flap and bottom that end where the next begins", "repeat the point")
        if self.brow[0][0] != 0 or self.bottom[-1][0] != 180:
            refuse("the edge is open", "brow from azimuth 0, bottom to azimuth 180", "add the point")
        return self


class Opening(Setting):
    """Cells of the side faces that the shell leaves open, their corners rounded."""

    x: Pair = Field(description="Lattice coordinates ahead.")
    z: Pair = Field(description="Lattice coordinates up.")


class HelmetShell(Described):
    """The shell, how far it stands off the head, and what is worn with it unless a play says otherwise."""

    facemask: str = Field(description="Facemask by name or file.")
    pads: str = Field(description="Pads by name or file.")
    chinstrap: str = Field(description="Chin strap by name or file.")
    mass_kg: Positive = Field(description="Mass of shell, pads and chin strap on the `nfl` head [kg].")
    shell_m: Positive = Field(description="Thickness of the shell [m].")
    shell_material: Annotated[str, Field(description="Material of the shell.")]
    shell_pid: PartNumber = 1
    standoff_m: Standoff = Field(description="Smoothed scalp to shell [m].")
    liner_smoothing_deg: Positive = Field(description="Smoothing of the scalp from which layers are offset [degrees].")
    coverage: Coverage = Field(description="Cells that the shell covers.")
    edge_deg: Outline = Field(description="Its edge [degrees].")
    edge_decay_deg: Positive = Field(
        default=13.5, description="Angle over which the grid forgets the edge; one and a half cells at least [degrees]."
    )
    ear: Opening | None = Field(default=None, description="Opening over the ear.")

    _material = field_validator("shell_material")(_known_material)


class FoamParameters(Setting):
    """Parameters of a crushable foam."""

    youngs_modulus_pa: Positive
    plateau_stress_pa: Positive
    densification_strain: Annotated[Number, Field(gt=0, lt=1)]
    unloading_factor: Annotated[Number, Field(gt=0, le=1)]


class Foam(Setting):
    """A foam of one's own."""

    law: Literal["crushable_foam"] = "crushable_foam"
    density_kg_per_m3: Positive
    parameters: FoamParameters
    certainty: dict[str, Literal["measured", "calibrated", "assumed", "article"]]
    source: str = Field(min_length=1)


class Pad(Setting):
    """A comfort pad on the skin and an energy pad behind it, in the cells of one face within these ranges."""

    face: Literal["front", "back", "left", "right", "crown"] = Field(description="Face of the lattice.")
    x: Pair = Field(default=(-1.0, 1.0), description="Lattice coordinates ahead.")
    y: Pair = Field(default=(-1.0, 1.0), description="Lattice coordinates to the left.")
    z: Pair = Field(default=(-1.0, 1.0), description="Lattice coordinates up.")
    comfort_m: Positive = Field(description="Thickness of the comfort pad; the energy pad fills up to the shell [m].")
    continues: str | None = Field(
        default=None, description="Name of an earlier pad, as thick, that this one goes on from without a gap."
    )
    comfort_pid: PartNumber
    energy_pid: PartNumber
    comfort_material: str = Field(default="comfort_foam", description="Material of the comfort pad.")
    energy_material: str = Field(default="energy_foam", description="Material of the energy pad.")


class PadSet(Described):
    """The pads of a helmet; where two would touch, the later one gives way by a row of cells, or continues it."""

    materials: dict[str, Foam] = Field(default_factory=dict, description="Foams beside those of the library.")
    pads: dict[Annotated[str, Field(pattern="^[a-z][a-z0-9_]*$")], Pad] = Field(description="By name.", min_length=1)

    @model_validator(mode="after")
    def _materials_are_known(self, info: ValidationInfo) -> PadSet:
        known = [*(info.context or {}).get("materials", ()), *self.materials]
        for name, pad in self.pads.items():
            for material in (pad.comfort_material, pad.energy_material):
                if known and (material not in known or material in _STRUCTURE_MATERIALS):
                    refuse(f"pad {name} is of {material!r}", "a foam", "describe the foam under `materials:`")
        return self

    @model_validator(mode="after")
    def _continued_are_before(self) -> PadSet:
        before: dict[str, float] = {}
        for name, pad in self.pads.items():
            if pad.continues is not None and before.get(pad.continues) != pad.comfort_m:
                refuse(
                    f"pad {name} continues {pad.continues!r}",
                    f"a pad described before it whose comfort pad is {1e3 * pad.comfort_m:.3g} mm thick as well",
                    "correct the name or the thickness, or leave a gap between them",
                )
            before[name] = pad.comfort_m
        return self


class Cup(Setting):
    """The chin cup: cells of the front face below one line, and of the bottom face before another."""

    front_below: Annotated[Number, Field(ge=-1, le=1)]
    bottom_before: Annotated[Number, Field(ge=-1, le=1)]
    half_width: Annotated[Number, Field(gt=0, le=1)]
    thickness_m: Positive
    material: str
    pid: PartNumber = 181

    _material = field_validator("material")(_known_material)


class Strap(Setting):
    """A strap of each side."""

    anchor_deg: Pair = Field(description="Azimuth and elevation of its anchor at the shell's edge [degrees].")


class Chinstrap(Described):
    """Chin cup and straps."""

    cup: Cup = Field(description="The chin cup.")
    straps: dict[Annotated[str, Field(pattern="^[a-z][a-z0-9_]*$")], Strap] = Field(
        description="Straps of the left side by name; the right side is their image.", min_length=1
    )
    stiffness_n_per_m: Positive = Field(description="Stiffness of a strap of its length [N/m].")
    damping_n_s_per_m: Annotated[Number, Field(ge=0)] = Field(description="Damping of a strap [N s/m].")


@dataclass(frozen=True)
class HelmetDesign:
    """A helmet as it is worn.

    Parameters
    ----------
    shell, pads, facemask, chinstrap
        Its four descriptions; no facemask where it is None.
    chosen
        ``helmet``, ``facemask``, ``pads``, ``chinstrap`` to the name or file of each.
    """

    shell: HelmetShell
    pads: PadSet
    facemask: Facemask | None
    chinstrap: Chinstrap
    chosen: dict[str, str]

    @property
    def mass_kg(self) -> float:
        """Mass with facemask on the ``nfl`` head [kg]."""
        return self.shell.mass_kg + (self.facemask.mass_kg if self.facemask else 0.0)

    @property
    def materials(self) -> dict[str, dict[str, Any]]:
        """Materials that the design brings along, in the form of `load_materials`."""
        return {name: foam.model_dump() for name, foam in self.pads.materials.items()}

    def document(self) -> dict[str, Any]:
        """Everything that describes the helmet, for the model's record."""
        parts = {"helmet": self.shell, "pads": self.pads, "facemask": self.facemask, "chinstrap": self.chinstrap}
        return {"chosen": self.chosen} | {k: v.model_dump(mode="json") if v else None for k, v in parts.items()}


def shipped(kind: str) -> tuple[str, ...]:
    """Names of the descriptions of a kind (``helmet``, ``pads``, ``facemask``, ``chinstrap``) that ship."""
    folder = resources.files("replay.models") / "data" / _FOLDERS[kind]
    return tuple(sorted(Path(entry.name).stem for entry in folder.iterdir() if entry.name.endswith(".yaml")))


def load_design(
    helmet: str = "classic",
    facemask: str | None = None,
    pads: str | None = None,
    chinstrap: str | None = None,
    *,
    folder: Path = Path(),
) -> HelmetDesign:
    """Read a helmet.

    Parameters
    ----------
    helmet
        Name of a helmet that ships, or a file ending in ``.yaml``.
    facemask, pads, chinstrap
        Likewise; those of the helmet where None. ``none`` leaves the facemask off.
    folder
        Where files lie.

    Raises
    ------
    InputError, InputErrors
        For an unknown name, a file that cannot be used, and pieces that do not go together.
    """
    shell, _ = _load("helmet", helmet, HelmetShell, folder)
    chosen = {
        "helmet": helmet,
        "facemask": facemask or shell.facemask,
        "pads": pads or shell.pads,
        "chinstrap": chinstrap or shell.chinstrap,
    }
    pad_set, pads_file = _load("pads", chosen["pads"], PadSet, folder)
    strap, _ = _load("chinstrap", chosen["chinstrap"], Chinstrap, folder)
    mask = None if chosen["facemask"] == NO_FACEMASK else _load("facemask", chosen["facemask"], Facemask, folder)[0]
    for name, pad in pad_set.pads.items():
        if pad.comfort_m >= shell.standoff_m.least_m - 0.005:
            raise InputError(
                pads_file, f"comfort pad {name} is {pad.comfort_m * 1e3:.3g} mm thick", column=f"pads.{name}.comfort_m",
                expected=f"5 mm less than the helmet's stand-off of {shell.standoff_m.least_m * 1e3:.3g} mm",
                mend="make it thinner, or choose a helmet that stands off further",
            )  # fmt: skip
    numbers = [shell.shell_pid, strap.cup.pid, *([mask.pid] if mask else [])]
    numbers += [pid for pad in pad_set.pads.values() for pid in (pad.comfort_pid, pad.energy_pid)]
    twice = sorted({pid for pid in numbers if numbers.count(pid) > 1})
    if twice:
        raise InputError(
            pads_file, f"part number {twice[0]} is given twice", mend="number pads, shell, facemask and cup apart"
        )
    return HelmetDesign(shell, pad_set, mask, strap, chosen)


def _load(kind: str, name: str, model: type[SettingT], folder: Path) -> tuple[SettingT, Path]:
    if name.endswith((".yaml", ".yml")):
        path = folder / name
    elif name in shipped(kind):
        path = Path(str(resources.files("replay.models") / "data" / _FOLDERS[kind] / f"{name}.yaml"))
    else:
        names = ", ".join([*shipped(kind), *([NO_FACEMASK] if kind == "facemask" else [])])
        raise InputError(name, f"no {kind} of this name", expected=f"{names}, or a file ending in .yaml")
    return load_yaml(path, model, context={"materials": tuple(load_materials())}), path
