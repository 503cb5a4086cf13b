"""Star-shaped surfaces: the radius in each direction from one centre.

This is the door through which anatomy enters: whatever gives a radius for a direction can be a brain, a skull or
a scalp (`anatomy.surfaces`; an ellipsoid where a test wants a closed form). What is between the door and the mesh
is here too: the limit on the slope, without which hexes of a radial grid invert, and the smoothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from replay.models.cubed_sphere import cube_lattice

RadialSurface = Callable[[np.ndarray], np.ndarray]
"""Unit directions (n, 3) to radii (n,) [m]."""

_SAMPLE_DIVISIONS = 24


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid whose axes lie along the frame's; the star centre (the origin) must be inside.

    Parameters
    ----------
    half_axes_m
        Along x, y, z [m].
    centre_m
        Its centre [m].
    """

    half_axes_m: tuple[float, float, float]
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        scaled = np.array(self.centre_m) / np.array(self.half_axes_m)
        if scaled @ scaled >= 1.0:
            message = f"the star centre lies outside the ellipsoid {self}"
            raise ValueError(message)

    def __call__(self, directions: np.ndarray) -> np.ndarray:
        """Radius [m]: the positive root of ``|A (r d - c)| = 1``."""
        axes = np.array(self.half_axes_m)
        d, c = directions / axes, np.array(self.centre_m) / axes
        dd, dc = np.einsum("ij,ij->i", d, d), np.einsum("ij,j->i", d, c)
        return (dc + np.sqrt(dc**2 + dd * (1.0 - c @ c))) / dd

    @property
    def volume_m3(self) -> float:
        """Volume [m^3]."""
        a, b, c = self.half_axes_m
        return 4 / 3 * np.pi * a * b * c


@dataclass(frozen=True)
class SlopeLimited:
    """The smallest surface outside another whose slope ``|d ln r / d theta|`` nowhere exceeds a limit.

    A slope of 1 is an angle of 45 degrees between ray and normal.

    Parameters
    ----------
    surface
        The surface.
    limit
        Largest slope.
    """

    surface: RadialSurface
    limit: float = 1.0

    def __call__(self, directions: np.ndarray) -> np.ndarray:
        """Radius [m]: the upper envelope ``max_j r_j exp(-limit * angle_j)`` over directions j."""
        own = self.surface(directions)
        samples, log_radii = sample_directions(), self._log_radii
        envelope = np.empty(len(directions))
        for start in range(0, len(directions), 512):
            part = slice(start, start + 512)
            envelope[part] = (log_radii - self.limit * angles(directions[part], samples)).max(axis=1)
        return np.maximum(own, np.exp(envelope))

    @cached_property
    def _log_radii(self) -> np.ndarray:
        return np.log(self.surface(sample_directions()))


@dataclass(frozen=True)
class Smoothed:
    """A surface smoothed by a Gaussian over the sphere.

    Parameters
    ----------
    surface
        The surface.
    sigma_deg
        Standard deviation [degrees].
    """

    surface: RadialSurface
    sigma_deg: float

    def __call__(self, directions: np.ndarray) -> np.ndarray:
        """Radius [m]: the weighted mean over directions."""
        samples, radii = sample_directions(), self._radii
        out = np.empty(len(directions))
        for start in range(0, len(directions), 512):
            part = slice(start, start + 512)
            weight = np.exp(-0.5 * (angles(directions[part], samples) / np.radians(self.sigma_deg)) ** 2)
            out[part] = (weight * radii).sum(axis=1) / weight.sum(axis=1)
        return out

    @cached_property
    def _radii(self) -> np.ndarray:
        return self.surface(sample_directions())


@dataclass(frozen=True)
class RadialSurfaces:
    """The four surfaces of a head about one star centre, and how its coordinates read in an atlas.

    Parameters
    ----------
    brain, inner_skull, outer_skull, scalp
        From inside to outside.
    tragion_m
        Midpoint of the two tragia (ear points), relative to the star centre [m].
    atlas_centre_mm
        Position of the star centre in MNI coordinates (x right, y anterior, z superior) [mm].
    atlas_mm_per_m
        Atlas millimetres per metre of the head.
    atlas_pitch_rad
        Angle by which the head's x axis falls below the atlas's y axis [rad].
    """

    brain: RadialSurface
    inner_skull: RadialSurface
    outer_skull: RadialSurface
    scalp: RadialSurface
    tragion_m: tuple[float, float, float]
    atlas_centre_mm: tuple[float, float, float]
    atlas_mm_per_m: float
    atlas_pitch_rad: float

    def to_atlas(self, points: np.ndarray) -> np.ndarray:
        """MNI coordinates [mm] of points (n, 3) [m] relative to the star centre."""
        return to_atlas(points, self.atlas_centre_mm, self.atlas_mm_per_m, self.atlas_pitch_rad)


def to_atlas(points: np.ndarray, centre_mm: Sequence[float], mm_per_m: float, pitch_rad: float) -> np.ndarray:
    """MNI coordinates [mm] of points (n, 3) [m] relative to the star centre; see `RadialSurfaces`."""
    x, y, z = (points * mm_per_m).T
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    return np.stack([-y, c * x + s * z, c * z - s * x], axis=1) + np.array(centre_mm)


def sample_directions() -> np.ndarray:
    """Directions, evenly spread, on which slopes are limited and means are taken: (3458, 3)."""
    global _samples
    if _samples is None:
        _samples = cube_lattice(_SAMPLE_DIVISIONS).directions
    return _samples


_samples: np.ndarray | None = None


def angles(directions: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Angles between two sets of unit vectors, (n, m) [rad]."""
    return np.arccos(np.clip(np.einsum("ik,jk->ij", directions, others), -1.0, 1.0))


def steepest_slope(surface: RadialSurface) -> float:
    """Largest ``|d ln r / d theta|`` of a surface between neighbours of the sample directions."""
    lattice = cube_lattice(_SAMPLE_DIVISIONS)
    logs = np.log(surface(lattice.directions))
    a, b = lattice.quads, np.roll(lattice.quads, -1, axis=1)
    d = lattice.directions
    angle = np.arccos(np.clip(np.einsum("qik,qik->qi", d[a], d[b]), -1, 1))
    return float(np.max(np.abs(logs[a] - logs[b]) / angle))


def ray_stretch(surface: RadialSurface, directions: np.ndarray) -> np.ndarray:
    """Length along the ray of a unit of thickness along the normal, (n,): ``sqrt(1 + (d ln r / d theta)^2)``."""
    helper = np.where(np.abs(directions[:, 2:]) < 0.7, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(helper, directions)
    first /= np.sqrt(np.einsum("ij,ij->i", first, first))[:, None]
    second = np.cross(directions, first)
    step, squares = 1e-3, np.zeros(len(directions))
    for tangent in (first, second):
        ahead = directions * np.cos(step) + tangent * np.sin(step)
        behind = directions * np.cos(step) - tangent * np.sin(step)
        squares += (np.log(surface(ahead) / surface(behind)) / (2 * step)) ** 2
    return np.sqrt(1 + squares)
