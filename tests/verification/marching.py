"""A bare step loop over the solver's integrator, with a probe at every step."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numba
import numpy as np

from replay.solver import Controls, Material, Problem, SolverPart
from replay.solver.integrator import Integrator

FREE = 1e12


def one_part(nodes: np.ndarray, hexes: np.ndarray, material: Material, controls: Controls, **fields: Any) -> Problem:
    """Problem of a single part."""
    return Problem(nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "part", material),), controls, **fields)


def elastic(modulus: float, poisson: float, density: float) -> Material:
    """Elastic material."""
    return Material("elastic", "elastic", density, {"youngs_modulus_pa": modulus, "poisson_ratio": poisson})


def controls(end: float, **changes: Any) -> Controls:
    """Controls without mass scaling."""
    return Controls(end, **{"mass_scaling_time_step_s": 0.0, **changes})


class March:
    """A run step by step.

    Positions and velocities are seen in the user's order; `v` is at the half step before `t`.
    """

    def __init__(self, problem: Problem) -> None:
        numba.set_num_threads(1)  # these meshes are too small to share
        self.run = Integrator(problem, FREE)
        self.problem = problem

    @property
    def t(self) -> float:
        return self.run.time_s

    @property
    def u(self) -> np.ndarray:
        return self.run.user_order(self.run.nodal[:, :3]) - self.problem.nodes

    @property
    def v(self) -> np.ndarray:
        return self.run.user_order(self.run.nodal[:, 4:7])

    @property
    def stress(self) -> np.ndarray:
        return self.run.element_values("stress", 6)

    def until(self, end: float, probe: Callable[[March], None] | None = None, every: int = 1) -> March:
        """Step to `end`, meeting it exactly; call `probe` before every so many steps."""
        factor = self.problem.controls.time_step_factor
        while self.run.time_s < end * (1 - 1e-12):
            dt = factor * self.run.forces().step_s
            left = end - self.run.time_s
            dt = left / max(np.ceil(left / dt * (1 - 1e-12)), 1)
            self.run.kick(dt, drift=False)
            if probe is not None and self.run.step % every == 0:
                probe(self)
            self.run.drift(dt, self.run.time_s + dt)
        self.run.forces()
        return self

    def record(self, end: float, value: Callable[[March], float], every: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Step to `end`; times and values at every so many steps."""
        rows: list[tuple[float, float]] = []
        self.until(end, lambda m: rows.append((m.t, float(value(m)))), every)
        return np.array(rows)[:, 0], np.array(rows)[:, 1]


def rate(errors: list[float], ratio: float = 2.0) -> list[float]:
    """Orders of convergence between neighbouring refinements."""
    return [float(np.log(a / b) / np.log(ratio)) for a, b in pairwise(errors)]


def crossing_period(times: np.ndarray, signal: np.ndarray) -> float:
    """Mean period of an oscillation about zero, from its interpolated zero crossings."""
    k = np.flatnonzero(np.sign(signal[1:]) != np.sign(signal[:-1]))
    zero = times[k] - signal[k] * (times[k + 1] - times[k]) / (signal[k + 1] - signal[k])
    return float(2 * (zero[-1] - zero[0]) / (len(zero) - 1))
