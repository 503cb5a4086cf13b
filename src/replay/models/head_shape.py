"""The head by preset: the derived anatomy with the scales and thicknesses of ``data/heads.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from typing import Any

import yaml

from replay.models.anatomy.surfaces import Offset, OuterSkull, brain_surface, load_anatomy, scalp_surface
from replay.models.radial import RadialSurface, RadialSurfaces, SlopeLimited, steepest_slope


@dataclass(frozen=True)
class HeadPreset:
    """A head by name: surfaces and target masses.

    Parameters
    ----------
    name, title
        ``nfl``, and what it is.
    surfaces
        The four surfaces.
    head_mass_kg
        Mass of the head [kg].
    part_mass_kg
        Masses that a source states for parts, by role [kg]; others follow from density and the head's mass.
    helmet_size
        Mass of a helmet of this head's size over that of the same helmet on the ``nfl`` head.
    least_thickness_m
        Least thickness of ``csf``, ``skull``, ``scalp`` [m].
    cg_from_tragion_m
        Where the centre of gravity should lie from the tragion [m].
    density_spread
        How far densities may leave their nominal values for it (one standard deviation, relative).
    """

    name: str
    title: str
    surfaces: RadialSurfaces
    head_mass_kg: float
    part_mass_kg: dict[str, float]
    helmet_size: float
    least_thickness_m: dict[str, float]
    cg_from_tragion_m: tuple[float, float, float]
    density_spread: float


def load_data(name: str) -> dict[str, Any]:
    """Read a YAML file of ``models/data``."""
    text = (resources.files("replay.models") / "data" / name).read_text(encoding="utf-8")
    data = yaml.safe_load(text)
    assert isinstance(data, dict)
    return data


def preset_names() -> tuple[str, ...]:
    """Names of the presets."""
    return tuple(load_data("heads.yaml")["presets"])


def head_preset(name: str, divisions: int) -> HeadPreset:
    """Build a preset for a mesh.

    Parameters
    ----------
    name
        ``anat``, ``nfl`` or ``article``.
    divisions
        Of the cubed sphere: a coarse mesh takes smoother surfaces.

    Raises
    ------
    ValueError
        When there is no such preset.
    """
    data = load_data("heads.yaml")
    if name not in data["presets"]:
        message = f"no head preset {name!r}; there are {', '.join(data['presets'])}"
        raise ValueError(message)
    preset, limits, anatomy = data["presets"][name], data["slope_limit"], load_anatomy()
    least = {key: float(value) for key, value in data["least_thickness_m"].items()}
    blur = data["smoothing_deg"]
    sigma = min(max(blur["per_division"] / divisions, blur["least"]), blur["most"])
    brain = _limited(brain_surface(preset["brain_scale"]).smoothed(sigma), limits["brain"])
    scalp = _limited(scalp_surface(preset["scalp_scale"]).smoothed(sigma), limits["scalp"])
    inner = _limited(Offset(brain, preset["fluid_m"]), limits["inner_skull"])
    bone = OuterSkull(inner, scalp, preset["calvaria_m"], preset["face_share"], least["scalp"])
    return HeadPreset(
        name=name,
        title=preset["title"],
        surfaces=RadialSurfaces(
            brain=brain,
            inner_skull=inner,
            outer_skull=_limited(bone, limits["outer_skull"]),
            scalp=scalp,
            tragion_m=_triple(preset["scalp_scale"] * value for value in data["tragion_m"]),
            atlas_centre_mm=_triple(anatomy.star_centre_mni_mm),
            atlas_mm_per_m=1000.0 / (anatomy.brain_scale * preset["brain_scale"]),
            atlas_pitch_rad=anatomy.pitch_rad,
        ),
        head_mass_kg=float(preset["head_mass_kg"]),
        part_mass_kg={key: float(value) for key, value in preset.get("part_mass_kg", {}).items()},
        helmet_size=float(preset["helmet_mass_kg"]) / float(data["presets"]["nfl"]["helmet_mass_kg"]),
        least_thickness_m=least,
        cg_from_tragion_m=_triple(data["cg_from_tragion_m"]),
        density_spread=float(data["density_spread"]),
    )


def _limited(surface: RadialSurface, limit: float) -> RadialSurface:
    return SlopeLimited(surface, limit) if steepest_slope(surface) > limit else surface


def _triple(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z
