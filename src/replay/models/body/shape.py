"""A man's skin and joints by stature, mass and muscle: MakeHuman's morph targets, mixed in NumPy.

The mixing weights are linear in every interval of muscle, weight and height, as MakeHuman mixes them. Weight is not
held to its interval: a light giant and a heavy small man lie outside it, and get their volume by going on in a straight
line as far as `WEIGHT_RANGE`; what is missing then is left to the density. Stature is met by a last change of scale.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from scipy.optimize import brentq

#: Unit of the integers in the derived file.
UNIT_M = 1e-4
MUSCLES, WEIGHTS, HEIGHTS = ("average", "max"), ("min", "average", "max"), ("", "min", "max")
STATURE_RANGE_M, MASS_RANGE_KG, MUSCLE_RANGE = (1.50, 2.10), (45.0, 160.0), (0.5, 1.0)
#: Weight of the morphs: 0 least, 0.5 average, 1 most; beyond, a straight line goes on.
WEIGHT_RANGE = (-0.25, 1.5)
#: Mean density of a man with air in his lungs [kg/m^3]: what volume a mass asks for.
MEAN_DENSITY_KG_PER_M3 = 1010.0


def morph_names() -> tuple[str, ...]:
    """Names of the kept morphs: ``muscle-weight`` or ``muscle-weight-height``."""
    return tuple("-".join(filter(None, (m, w, h))) for m in MUSCLES for w in WEIGHTS for h in HEIGHTS)


@dataclass(frozen=True)
class BodyFile:
    """What the derived file holds, in metres; see `replay.models.body.derive`.

    Parameters
    ----------
    points : (n + j, 3)
        Skin, then joints, of the base man.
    morphs : (k, n + j, 3)
        In the order of `morph_names`.
    triangles : (m, 3)
        Rows of `points`.
    joint_names
        Of the last rows of `points`.
    weights : (n, 17)
        Share of each of `SEGMENTS`, sum 1.
    skull_base_m : (3,)
        Joint of head and neck about the star centre of a head of scale 1.
    """

    points: np.ndarray
    morphs: np.ndarray
    triangles: np.ndarray
    joint_names: tuple[str, ...]
    weights: np.ndarray
    skull_base_m: np.ndarray


@dataclass(frozen=True)
class Shape:
    """A man as MakeHuman stands: arms aside, x anterior, y left, z up, soles at z = 0.

    Parameters
    ----------
    skin : (n, 3)
        [m].
    triangles : (m, 3)
        Rows of `skin`, counter-clockwise from outside.
    weights : (n, 17)
        Share of each of `SEGMENTS` in the motion of each point.
    joints
        Name to place (3,) [m].
    weight, height
        Settings of the morphs that were found.
    volume_m3
        Inside the skin.
    """

    skin: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    joints: dict[str, np.ndarray]
    weight: float
    height: float
    volume_m3: float

    @property
    def stature_m(self) -> float:
        """From sole to crown [m]."""
        return float(np.ptp(self.skin[:, 2]))


@cache
def load_body() -> BodyFile:
    """Read ``models/data/body.npz``."""
    with (resources.files("replay.models") / "data" / "body.npz").open("rb") as stream, np.load(stream) as data:
        weights = data["weights"].astype(float)
        return BodyFile(
            data["points"] * UNIT_M, data["morphs"] * UNIT_M, data["triangles"].astype(np.int64),
            tuple(data["joint_names"].tolist()), weights / weights.sum(axis=1, keepdims=True), data["skull_base_m"],
        )  # fmt: skip


def enclosed_volume(points: np.ndarray, triangles: np.ndarray) -> float:
    """Volume inside a closed skin [m^3]."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def shape_of(stature_m: float, mass_kg: float, muscle: float) -> Shape:
    """Morph a man.

    Parameters
    ----------
    stature_m, mass_kg
        Within `STATURE_RANGE_M` and `MASS_RANGE_KG`.
    muscle
        0.5 average, 1 most.

    Raises
    ------
    ValueError
        Outside these ranges.
    """
    for name, value, (low, high) in (
        ("a stature [m]", stature_m, STATURE_RANGE_M), ("a mass [kg]", mass_kg, MASS_RANGE_KG),
        ("muscle", muscle, MUSCLE_RANGE),
    ):  # fmt: skip
        if not low <= value <= high:
            message = f"{name} of {value:g}; between {low:g} and {high:g} is possible"
            raise ValueError(message)
    file = load_body()

    def man(weight: float) -> tuple[np.ndarray, float]:
        height = _root(lambda h: _stature(_mixed(muscle, weight, h)) - stature_m, (-1.0, 1.0))
        points = _mixed(muscle, weight, height)
        return points * (stature_m / _stature(points)), height

    wanted = mass_kg / MEAN_DENSITY_KG_PER_M3
    weight = _root(lambda w: enclosed_volume(man(w)[0], file.triangles) - wanted, WEIGHT_RANGE)
    points, height = man(weight)
    points = points - [0.0, 0.0, points[: len(file.weights), 2].min()]
    skin = points[: len(file.weights)]
    joints = dict(zip(file.joint_names, points[len(file.weights) :]))
    return Shape(skin, file.triangles, file.weights, joints, weight, height, enclosed_volume(skin, file.triangles))


def _stature(points: np.ndarray) -> float:
    return float(np.ptp(points[: len(load_body().weights), 2]))


def _root(function: Callable[[float], float], interval: tuple[float, float]) -> float:
    """Where an increasing function crosses zero; the nearer end where it does not."""
    low, high = interval
    if function(low) >= 0:
        return low
    return high if function(high) <= 0 else float(brentq(function, low, high, xtol=1e-5))


def _mixed(muscle: float, weight: float, height: float) -> np.ndarray:
    """Points of the man of these settings, (n + j, 3) [m]."""
    file, most = load_body(), 2.0 * muscle - 1.0
    shares = {"average": 1.0 - most, "max": most}
    if weight < 0.5:
        loads = {"min": 1.0 - 2.0 * weight, "average": 2.0 * weight}
    else:
        loads = {"average": 2.0 - 2.0 * weight, "max": 2.0 * weight - 1.0}
    tall = {"max": height} if height > 0 else {"min": -height}
    factor: dict[str, float] = {}
    for m in MUSCLES:
        for w in WEIGHTS:
            base = shares[m] * loads.get(w, 0.0)
            factor |= {"-".join(filter(None, (m, w, h))): base * (tall.get(h, 0.0) if h else 1.0) for h in HEIGHTS}
    mix = np.array([factor[name] for name in morph_names()])
    used = np.flatnonzero(mix)
    return file.points + np.einsum("k,kij->ij", mix[used], file.morphs[used])
