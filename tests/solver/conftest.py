"""Small problems and a bare step loop for the solver's tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from replay.solver import Controls, Material, Problem, SolverPart
from replay.solver.blocks import structured_block

STEEL = Material("steel", "elastic", 7800.0, {"youngs_modulus_pa": 210e9, "poisson_ratio": 0.3})
RUBBER = Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3})
TISSUE = Material(
    "tissue", "viscohyperelastic", 1040.0,
    {"bulk_modulus_pa": 2.0e6, "shear_modulus_pa": 5e3, "prony_ratios": [0.4, 0.3], "prony_times_s": [1e-3, 1e-2]},
)  # fmt: skip
WATER = Material("water", "fluid", 1000.0, {"bulk_modulus_pa": 2.0e6, "shear_modulus_pa": 1e3})
FOAM = Material(
    "foam", "crushable_foam", 100.0,
    {"youngs_modulus_pa": 1e6, "plateau_stress_pa": 5e4, "densification_strain": 0.6, "rate_coefficient": 0.1},
)  # fmt: skip
PUTTY = Material(
    "putty", "elastic_plastic", 1000.0,
    {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3, "yield_stress_pa": 1e3, "hardening_modulus_pa": 1e4},
)  # fmt: skip
BONE = Material("bone", "rigid", 2000.0, {})


@pytest.fixture
def layered() -> Callable[..., Problem]:
    """Return a builder of a column of all laws: rigid, fluid, tissue, foam, rubber, putty, rigid."""

    def build(end: float = 5e-3, counts: tuple[int, int, int] = (12, 4, 4), **changes: Any) -> Problem:
        nodes, hexes = structured_block(counts, (0.012, 0.004, 0.004))
        # crooked, so that hourglass modes are at work
        inner = np.sin(nodes @ np.array([900.0, 700.0, 500.0]))
        nodes = nodes + 5e-5 * inner[:, None] * np.array([1.0, -0.7, 0.4])
        centre = nodes[hexes].mean(axis=1)[:, 0]
        element_part = np.minimum((centre / 0.002).astype(int), 5)
        element_part[(centre > 0.009) & (centre < 0.010)] = 6
        materials = (BONE, WATER, TISSUE, FOAM, RUBBER, BONE, PUTTY)
        parts = tuple(SolverPart(10 * (k + 1), f"{m.name}-{k}", m) for k, m in enumerate(materials))
        omega = np.array([20.0, -30.0, 40.0])
        fields: dict[str, Any] = {
            "initial_velocity": np.cross(omega, nodes) + np.array([1.0, 0.5, 0.0]),
            "controls": Controls(
                end, history_interval_s=end / 10, plot_interval_s=end / 5, speed_limit_m_per_s=100.0,
                mass_scaling_time_step_s=0.0,
            ),
        }  # fmt: skip
        fields |= changes
        return Problem(nodes, hexes, element_part, parts, **fields)

    return build
