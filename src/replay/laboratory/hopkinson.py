"""The specimen of a split Hopkinson bar: a cylinder of tissue between two platens, its shape and its diameter.

The bars of the published set-up (E 2391.2 MPa, nu 0.36) are 1e5 times stiffer than tissue, so the platens are rigid and
close at a constant speed. They hold the specimen's ends (``glued``), rub them (``frictional``: rigid plates in contact,
with Coulomb friction) or only press them (``lubricated``). A quarter of the cylinder is computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.solver import (
    ContactControls,
    ContactPair,
    Controls,
    Material,
    PrescribedMotion,
    Problem,
    SolverPart,
    solve,
)
from replay.solver.blocks import structured_block
from replay.solver.view import StateView

ENDS = ("glued", "frictional", "lubricated")
#: Coulomb's coefficient of wet tissue on a polished platen: assumed.
FRICTION = 0.2
#: Strains of the article's Figure 4.
SHAPES = (0.15, 0.29, 0.47)


@dataclass(frozen=True)
class Specimen:
    """A cylinder and its mesh.

    Parameters
    ----------
    radius_m, height_m
        [m].
    divisions
        Elements along the core's edge; the rings have half of it, the height twice.
    """

    radius_m: float = 0.015
    height_m: float = 0.015
    divisions: int = 10

    @property
    def hexes_of_the_whole(self) -> int:
        """Hexahedra of the whole cylinder."""
        n = self.divisions
        return 4 * (n * n + 2 * n * (n // 2)) * 2 * n


@dataclass(frozen=True)
class Squeeze:
    """What the specimen did.

    Parameters
    ----------
    ends
        One of `ENDS`.
    strains : (n,) float64
        Nominal compressive strain.
    diameters : (n,) float64
        Diameter, mean over the height, over its first value.
    shapes
        Strain of `SHAPES` -> height over first height, radius over first radius of the free surface, (k, 2) from the
        lower end up.
    """

    ends: str
    strains: NDArray[np.float64]
    diameters: NDArray[np.float64]
    shapes: dict[float, NDArray[np.float64]]


def quarter_cylinder(specimen: Specimen) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Mesh the quarter x, y >= 0: a square core and rings that turn it into the circle.

    Returns
    -------
    nodes : (n, 3) float64
        [m].
    hexes : (m, 8) int64
    """
    n, rings, layers = specimen.divisions, specimen.divisions // 2, 2 * specimen.divisions
    side = 0.5 * specimen.radius_m
    line = np.linspace(0.0, side, n + 1)
    core = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    index = np.arange(len(core)).reshape(n + 1, n + 1)
    quads = [[index[i, j], index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]] for i in range(n) for j in range(n)]
    rim = np.concatenate([index[-1, :], index[-2::-1, -1]])
    angles = np.linspace(0.0, 0.5 * np.pi, 2 * n + 1)
    circle = specimen.radius_m * np.column_stack([np.cos(angles), np.sin(angles)])
    points, inner = [core], rim
    for ring in range(1, rings + 1):
        share = ring / rings
        points.append((1 - share) * core[rim] + share * circle)
        outer = len(core) + (ring - 1) * (2 * n + 1) + np.arange(2 * n + 1)
        quads += [[inner[k], outer[k], outer[k + 1], inner[k + 1]] for k in range(2 * n)]
        inner = outer
    plane, flat = np.concatenate(points), np.array(quads)
    heights = np.linspace(0.0, specimen.height_m, layers + 1)
    nodes = np.concatenate([np.column_stack([plane, np.full(len(plane), z)]) for z in heights])
    hexes = [np.hstack([flat + k * len(plane), flat + (k + 1) * len(plane)]) for k in range(layers)]
    return nodes, np.concatenate(hexes).astype(np.int64)


def platens(specimen: Specimen) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Two plates of one hexahedron, below and above the specimen; the lower one comes first.

    Their corners lie where the specimen does not come.
    """
    width, thickness, start = 2.5 * specimen.radius_m, 0.2 * specimen.radius_m, -0.5 * specimen.radius_m
    sheets = [
        structured_block((1, 1, 1), (width - start, width - start, thickness), (start, start, z))
        for z in (-thickness, specimen.height_m)
    ]
    (low, hexes), (high, more) = sheets
    return np.vstack([low, high]), np.vstack([hexes, more + len(low)])


class _Profile:
    """Records the free surface: mean radius at every height."""

    def __init__(self, reference: NDArray[np.float64], specimen: Specimen) -> None:
        on_surface = np.hypot(reference[:, 0], reference[:, 1]) > specimen.radius_m * (1 - 1e-9)
        levels = np.unique(reference[:, 2])
        self._rows = [np.flatnonzero(on_surface & (reference[:, 2] == z)) for z in levels]
        self.times: list[float] = []
        self.profiles: list[NDArray[np.float64]] = []

    def sample(self, view: StateView) -> None:
        """Take the state at a history time."""
        x = view.coordinates  # the specimen's nodes are the first
        rows = [[x[r, 2].mean(), np.hypot(x[r, 0], x[r, 1]).mean()] for r in self._rows]
        self.times.append(view.time_s)
        self.profiles.append(np.array(rows))

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything gathered so far."""
        return {"times": np.array(self.times), "profiles": np.array(self.profiles).reshape(-1, len(self._rows), 2)}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `state` returned."""
        self.times, self.profiles = list(state["times"]), list(state["profiles"])

    def write(self, folder: Path) -> None:
        """Keep everything in memory."""


def squeeze(
    material: Material, ends: str, folder: Path, *, specimen: Specimen | None = None, rate_per_s: float = 750.0,
    strain: float = 0.48, friction: float = FRICTION, threads: int | None = None,
) -> Squeeze:  # fmt: skip
    """Press the specimen at a constant nominal rate.

    Parameters
    ----------
    material
        Of the specimen.
    ends
        ``glued``: the platens hold the ends; ``frictional``: they rub them; ``lubricated``: the ends slide.
    folder
        Receives the run's own files.
    specimen
        The published one by default.
    rate_per_s, strain
        Nominal strain rate, and where to stop.
    friction
        Coefficient of ``frictional`` ends.
    threads
        Of the solver.
    """
    if ends not in ENDS:
        message = f"no ends {ends!r}; there are {', '.join(ENDS)}"
        raise ValueError(message)
    specimen = specimen or Specimen()
    nodes, hexes = quarter_cylinder(specimen)
    low, high = nodes[:, 2] == 0.0, nodes[:, 2] == nodes[:, 2].max()
    fixed = np.zeros(nodes.shape, bool)
    fixed[:, 0], fixed[:, 1] = nodes[:, 0] < 1e-12, nodes[:, 1] < 1e-12
    if ends != "frictional":
        fixed[:, 2] = low | high
    if ends == "glued":
        fixed[low | high] = True
    # a linear field of velocity, so that no wave is sent in at the start
    velocity = np.zeros(nodes.shape)
    velocity[:, 2] = -rate_per_s * nodes[:, 2]
    if ends != "glued":
        velocity[:, :2] = 0.5 * rate_per_s * nodes[:, :2]
    velocity[fixed & (np.arange(3) < 2)] = 0.0
    end = strain / rate_per_s
    controls = Controls(
        end, mass_scaling_time_step_s=0.0, history_interval_s=end / 96, plot_interval_s=end / 3, time_step_floor_s=1e-9
    )
    problem = Problem(
        nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "specimen", material),), controls,
        initial_velocity=velocity, fixed=fixed,
    )  # fmt: skip
    profile = _Profile(nodes, specimen)
    if ends == "frictional":
        problem = _between_platens(problem, specimen, rate_per_s * specimen.height_m, friction)
    solve(problem, folder, recorders=[profile], threads=threads, progress=None, resume=False)
    strains = rate_per_s * np.array(profile.times)
    first = np.array([specimen.height_m, specimen.radius_m])
    shapes = {at: profile.profiles[int(np.argmin(np.abs(strains - at)))] / first for at in SHAPES if at <= strains[-1]}
    means = [np.trapezoid(p[:, 1], p[:, 0]) / (p[-1, 0] - p[0, 0]) / specimen.radius_m for p in profile.profiles]
    return Squeeze(ends, strains, np.array(means), shapes)


def _between_platens(problem: Problem, specimen: Specimen, closing_m_per_s: float, friction: float) -> Problem:
    """Put rigid plates on both ends, the lower at rest, the upper closing, with contact and friction between."""
    nodes, hexes = platens(specimen)
    count = len(problem.nodes)
    plate = Material("platen", "rigid", 7800.0, {"youngs_modulus_pa": 2391.2e6, "poisson_ratio": 0.36})
    part = np.repeat([1, 2], len(hexes) // 2)
    end = problem.controls.termination_time_s
    motions = []
    for pid, speed in ((2, 0.0), (3, -closing_m_per_s)):
        times = np.array([0.0, 1.01 * end])
        path = np.array([[0.0, 0.0, speed * t] for t in times])
        still, level = np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
        motions.append(PrescribedMotion((pid,), times, path, level, still + np.array([0.0, 0.0, speed]), still))
    return Problem(
        np.vstack([problem.nodes, nodes]),
        np.vstack([problem.hexes, hexes + count]),
        np.concatenate([problem.element_part, part]),
        (*problem.parts, SolverPart(2, "lower platen", plate), SolverPart(3, "upper platen", plate)),
        problem.controls,
        initial_velocity=np.vstack([problem.initial_velocity, np.zeros(nodes.shape)]),
        fixed=np.vstack([problem.fixed, np.zeros(nodes.shape, bool)]),
        prescribed=tuple(motions),
        contact=ContactControls(pairs=(ContactPair((1,), (2, 3), friction, name="specimen-platens"),)),
    )
