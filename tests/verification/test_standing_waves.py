"""A dynamic solution known at every point and time: pressure and shear waves that stand in a cube.

The cube slides along its walls (no normal displacement, no shear stress). ``u_p = grad(cos pi x cos pi y cos pi z)``
and ``u_s = (sin pi x cos pi y, -cos pi x sin pi y, 0)`` satisfy both, and swing with ``sqrt(3) pi c_p`` and
``sqrt(2) pi c_s``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from marching import March, controls, elastic, one_part, rate

from replay.solver.blocks import structured_block

MODULUS, POISSON, DENSITY, SPEED = 1e6, 0.3, 1000.0, 1e-6


def crooked_cube(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit cube whose inner nodes are moved by a smooth field, the same for every mesh; walls stay plane."""
    nodes, hexes = structured_block((count, count, count), (1.0, 1.0, 1.0))
    x, y, z = np.pi * nodes.T
    bump = 0.04 * np.sin(x) * np.sin(y) * np.sin(z)
    return nodes + bump[:, None] * np.array([1.0, -1.5, 0.8]), hexes


def error(count: int) -> float:
    """Root mean square error of the displacements over their amplitude, after most of a swing."""
    nodes, hexes = crooked_cube(count)
    x, y, z = np.pi * nodes.T
    pressure = np.stack([np.sin(x) * np.cos(y) * np.cos(z), np.cos(x) * np.sin(y) * np.cos(z),
                         np.cos(x) * np.cos(y) * np.sin(z)], axis=1)  # fmt: skip
    shear = np.stack([np.sin(x) * np.cos(y), -np.cos(x) * np.sin(y), 0 * z], axis=1)
    held = (nodes < 1e-9) | (nodes > 1 - 1e-9)
    velocity = SPEED * (pressure + shear)
    velocity[held] = 0.0
    settings = controls(1.0, bulk_viscosity_linear=0.0, bulk_viscosity_quadratic=0.0)
    march = March(
        one_part(nodes, hexes, elastic(MODULUS, POISSON, DENSITY), settings, initial_velocity=velocity, fixed=held)
    )
    stiff = MODULUS / ((1 + POISSON) * (1 - 2 * POISSON))
    omega_p = np.sqrt(3.0) * np.pi * np.sqrt(stiff * (1 - POISSON) / DENSITY)
    omega_s = np.sqrt(2.0) * np.pi * np.sqrt(MODULUS / (2 * (1 + POISSON)) / DENSITY)
    march.until(0.8 * 2 * np.pi / omega_s)
    t = march.t
    exact = SPEED * (pressure * np.sin(omega_p * t) / omega_p + shear * np.sin(omega_s * t) / omega_s)
    scale = SPEED * np.sqrt(((pressure / omega_p) ** 2 + (shear / omega_s) ** 2).sum(axis=1).mean())
    return float(np.sqrt(((march.u - exact) ** 2).sum(axis=1).mean()) / scale)


def test_standing_waves_converge_with_the_second_order(report: Callable[..., None]) -> None:
    errors = [error(count) for count in (6, 12, 24)]
    name = "standing pressure and shear waves, crooked cube of 24^3"
    report(name, "rms error of displacement over amplitude", 0.0, errors[-1], 0.02)
    report(name, "order of convergence", 2.0, rate(errors)[-1], 0.15)
