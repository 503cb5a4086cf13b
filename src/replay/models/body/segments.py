"""The segments of a body, how they hang together, and what each should weigh.

Masses are de Leva's (1996, adjusted Zatsiorsky-Seluyanov, men) as shares of the whole. The head's mass is its preset's:
what is left of de Leva's head and neck is the neck's, and where that would be no neck's density (a light man under a
heavy head) the neck keeps the nearest density allowed and the other segments share the difference.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from replay.models.head_shape import load_data

HEAD = "head"
#: Parent of each segment; the lower trunk carries all.
PARENT: dict[str, str | None] = {
    "lower_trunk": None,
    "mid_trunk": "lower_trunk",
    "upper_trunk": "mid_trunk",
    "neck": "upper_trunk",
    HEAD: "neck",
    **{f"upper_arm_{side}": "upper_trunk" for side in ("left", "right")},
    **{f"forearm_{side}": f"upper_arm_{side}" for side in ("left", "right")},
    **{f"hand_{side}": f"forearm_{side}" for side in ("left", "right")},
    **{f"thigh_{side}": "lower_trunk" for side in ("left", "right")},
    **{f"shank_{side}": f"thigh_{side}" for side in ("left", "right")},
    **{f"foot_{side}": f"shank_{side}" for side in ("left", "right")},
}
SEGMENTS = tuple(PARENT)
#: Segments that are meshed here: all but the head.
MESHED = tuple(name for name in SEGMENTS if name != HEAD)


def kind_of(segment: str) -> str:
    """The segment without its side: ``thigh`` of ``thigh_left``."""
    return segment.removesuffix("_left").removesuffix("_right")


def de_leva_masses_kg(mass_kg: float) -> dict[str, float]:
    """Mass of every segment [kg], ``head_neck`` in one, by de Leva's shares of the whole mass."""
    share = load_data("body.yaml")["segment_mass_percent"]
    names = ["head_neck", *(name for name in MESHED if name != "neck")]
    return {name: mass_kg * share["values"][kind_of(name)] / 100.0 for name in names}


def target_masses_kg(mass_kg: float, head_kg: float, volumes_m3: Mapping[str, float]) -> dict[str, float]:
    """Mass that each meshed segment gets [kg].

    Parameters
    ----------
    mass_kg
        Of the whole player without helmet.
    head_kg
        Of the head's mesh.
    volumes_m3
        Volume of each segment's mesh [m^3].
    """
    masses = de_leva_masses_kg(mass_kg)
    low, high = load_data("body.yaml")["neck_density_kg_per_m3"]["range"]
    neck = float(np.clip(masses.pop("head_neck") - head_kg, low * volumes_m3["neck"], high * volumes_m3["neck"]))
    rest = (mass_kg - head_kg - neck) / sum(masses.values())
    return {"neck": neck, **{name: value * rest for name, value in masses.items()}}
