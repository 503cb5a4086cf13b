"""Consistent unit systems of keyword files, by name, and what the numbers of a deck say about its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from replay.decks.keyword.transform import Transform


@dataclass(frozen=True)
class Units:
    """A consistent system: what one unit of mass, length and time is in SI."""

    name: str
    mass_kg: float
    length_m: float
    time_s: float

    def to_si(self) -> Transform:
        """Conversion of a deck's numbers to m, kg, s."""
        return Transform(mass=self.mass_kg, length=self.length_m, time=self.time_s)

    def factor(self, dimension: str) -> float:
        """What one unit of a dimension (``pressure``, ``density``...) is in SI."""
        return self.to_si().factor(dimension)


SYSTEMS = {
    u.name: u
    for u in (
        Units("m-kg-s", 1.0, 1.0, 1.0),
        Units("mm-tonne-s", 1e3, 1e-3, 1.0),
        Units("mm-kg-ms", 1.0, 1e-3, 1e-3),
        Units("mm-g-ms", 1e-3, 1e-3, 1e-3),
        Units("cm-g-us", 1e-3, 1e-2, 1e-6),
        Units("cm-g-s", 1e-3, 1e-2, 1.0),
        Units("in-lbf-s", 175.12683524647636, 0.0254, 1.0),
    )
}
"""The systems in use; ``in-lbf-s`` has lbf s^2/in for its mass. Their names are those of length, mass and time."""

_SOLID_DENSITIES = (5.0, 25_000.0)
_EXTENTS_M = (0.05, 1.0)


def plausible_units(densities: Sequence[float], extent: float) -> list[Units]:
    """Systems in which the densities are those of solids and foams and the model is as large as a helmet or a head.

    Parameters
    ----------
    densities
        Of the deck's materials, in its own unit.
    extent
        Largest dimension of the mesh, in its own unit.

    Returns
    -------
    list of Units
        None: no system fits. Several: the numbers do not decide (time cannot be seen in them at all where a deck has
        no stiffness).
    """
    return [
        u for u in SYSTEMS.values()
        if _EXTENTS_M[0] <= extent * u.length_m <= _EXTENTS_M[1]
        and all(_SOLID_DENSITIES[0] <= d * u.factor("density") <= _SOLID_DENSITIES[1] for d in densities if d > 0)
    ]  # fmt: skip
