"""The analytic head: the surfaces of ``data/heads.yaml`` behind the door of `replay.models.radial`."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
import yaml

from replay.models.radial import Ellipsoid, RadialSurface, RadialSurfaces, SlopeLimited, SmoothUnion, steepest_slope


@dataclass(frozen=True)
class HeadPreset:
    """A head by name: surfaces and target masses.

    Parameters
    ----------
    name, title
        ``nfl``, and what it is.
    surfaces
        The four surfaces.
    part_mass_kg
        Target mass of ``brain``, ``csf``, ``skull``, ``scalp`` [kg].
    helmet_mass_kg
        Mass of the helmet that goes with it, unless a play says otherwise [kg].
    least_thickness_m
        Least thickness of ``csf``, ``skull``, ``scalp`` [m].
    """

    name: str
    title: str
    surfaces: RadialSurfaces
    part_mass_kg: dict[str, float]
    helmet_mass_kg: float
    least_thickness_m: dict[str, float]


def load_data(name: str) -> dict[str, Any]:
    """Read a YAML file of ``models/data``."""
    text = (resources.files("replay.models") / "data" / name).read_text(encoding="utf-8")
    data = yaml.safe_load(text)
    assert isinstance(data, dict)
    return data


def preset_names() -> tuple[str, ...]:
    """Names of the presets."""
    return tuple(load_data("heads.yaml")["presets"])


def head_preset(name: str) -> HeadPreset:
    """Build a preset.

    Parameters
    ----------
    name
        ``anat``, ``nfl`` or ``article``.

    Raises
    ------
    ValueError
        When there is no such preset.
    """
    data = load_data("heads.yaml")
    if name not in data["presets"]:
        message = f"no head preset {name!r}; there are {', '.join(data['presets'])}"
        raise ValueError(message)
    preset = data["presets"][name]
    limits = data["slope_limit"]
    shapes = {
        "brain": data["brain"],
        "inner_skull": data["inner_skull"],
        "outer_skull": preset["outer_skull"],
        "scalp": preset["scalp"],
    }
    surfaces = {key: _limited(_surface(shape), float(limits[key])) for key, shape in shapes.items()}
    brain = np.array(data["brain"][0]["half_axes_m"])
    masses = {key: float(value) for key, value in data["part_mass_kg"].items()}
    masses["scalp"] = round(float(preset["head_mass_kg"]) - sum(masses.values()), 9)
    return HeadPreset(
        name=name,
        title=preset["title"],
        surfaces=RadialSurfaces(
            **surfaces,
            tragion_m=_triple(data["tragion_m"]),
            atlas_centre_mm=_triple(data["star_centre_mni_mm"]),
            atlas_mm_per_m=_triple(np.array(data["atlas_half_extents_mm"]) / brain),
        ),
        part_mass_kg=masses,
        helmet_mass_kg=float(preset["helmet_mass_kg"]),
        least_thickness_m={key: float(value) for key, value in data["least_thickness_m"].items()},
    )


def _surface(shape: list[dict[str, Any]]) -> RadialSurface:
    bodies = tuple(Ellipsoid(_triple(b["half_axes_m"]), _triple(b.get("centre_m", (0.0, 0.0, 0.0)))) for b in shape)
    return bodies[0] if len(bodies) == 1 else SmoothUnion(bodies)


def _limited(surface: RadialSurface, limit: float) -> RadialSurface:
    return SlopeLimited(surface, limit) if steepest_slope(surface) > limit else surface


def _triple(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z
