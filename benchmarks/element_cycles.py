"""Element cycles per second of each law, beside a plain per-element Numba loop in the same run.

    python benchmarks/element_cycles.py [elements along an edge ...]

A cycle is everything that a step does: element forces, nodal sums, kick, drift, time step, ledger. The
peer is the same elastic element written with small arrays, one element at a time, as most would at first. Ratios are
what to trust; the rates depend on the machine and on who else uses it.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numba
import numpy as np

from replay.solver import Controls, Material, Problem, SolverPart
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator

MATERIALS = {
    "elastic": {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3},
    "viscohyperelastic": {
        "bulk_modulus_pa": 2e6, "shear_modulus_pa": 5e3, "prony_ratios": [0.4, 0.3], "prony_times_s": [1e-3, 1e-2],
    },
    "brain_isv": {
        "shear_modulus_pa": 14e3, "bulk_modulus_pa": 2e6, "reference_rate_per_s": 100.0, "rate_exponent": 1.0,
        "yield_stress_pa": 6.5e3, "pressure_sensitivity": 0.0, "locking_stretch": 2.3, "network_modulus_pa": 470.0,
        "back_stress_modulus_pa": 45.0, "softening_rate": 14.0, "initial_xi1": 0.0, "initial_xi_star": 0.036,
        "xi_star_saturation": 0.006, "xi_star_rate": 7.2, "softening_factor": 0.018, "hardening_rate": 16.0,
        "initial_xi2": 0.0, "xi2_saturation": 2.0, "hardening_factor": 0.16, "pore_growth_exponent": 1.5,
        "pore_shear_sensitivity": 1e-6, "initial_porosity": 1e-6,
    },
    "fluid": {"bulk_modulus_pa": 2e6, "shear_modulus_pa": 1e3},
    "crushable_foam": {"youngs_modulus_pa": 1e6, "plateau_stress_pa": 5e4, "densification_strain": 0.6},
}  # fmt: skip
ROUNDS = 5
GAMMA = np.array(
    [[1, 1, -1, -1, -1, -1, 1, 1], [1, -1, -1, 1, -1, 1, 1, -1], [1, -1, 1, -1, 1, -1, 1, -1],
     [-1, 1, -1, 1, 1, -1, 1, -1]], float,
)  # fmt: skip
#: Numbering of the element seen from each of its nodes: one closed form serves all eight.
TURNS = np.array(
    [[0, 1, 2, 3, 4, 5, 6, 7], [1, 2, 3, 0, 5, 6, 7, 4], [2, 3, 0, 1, 6, 7, 4, 5], [3, 0, 1, 2, 7, 4, 5, 6],
     [4, 7, 6, 5, 0, 3, 2, 1], [5, 4, 7, 6, 1, 0, 3, 2], [6, 5, 4, 7, 2, 1, 0, 3], [7, 6, 5, 4, 3, 2, 1, 0]]
)  # fmt: skip


@numba.njit(error_model="numpy")
def plain_gradient(x: Any, b: Any) -> Any:
    """Closed form of the mean gradient (Flanagan and Belytschko 1981), node by node."""
    for a in range(8):
        t = TURNS[a]
        for axis in range(3):
            y, z = (axis + 1) % 3, (axis + 2) % 3
            b[a, axis] = (
                x[t[1], y] * ((x[t[5], z] - x[t[2], z]) - (x[t[3], z] - x[t[4], z]))
                + x[t[2], y] * (x[t[1], z] - x[t[3], z])
                + x[t[3], y] * ((x[t[2], z] - x[t[7], z]) - (x[t[4], z] - x[t[1], z]))
                + x[t[4], y] * ((x[t[7], z] - x[t[5], z]) - (x[t[1], z] - x[t[3], z]))
                + x[t[5], y] * (x[t[4], z] - x[t[1], z])
                + x[t[7], y] * (x[t[3], z] - x[t[4], z])
            ) / 12.0
    volume = 0.0
    for a in range(8):
        volume += x[a, 0] * b[a, 0]
    return volume


@numba.njit(error_model="numpy", nogil=True)
def plain_cycle(
    x: Any, v: Any, hexes: Any, stress: Any, hourglass: Any, force: Any, inverse_mass: Any, dt: float
) -> float:
    """One step of elastic elements with small arrays, one element at a time."""
    lame, shear, wave = 5.77e5, 3.85e5, 1.346e6
    force[:] = 0.0
    least = 1e30
    for e in range(hexes.shape[0]):
        xe, ve, b = np.empty((8, 3)), np.empty((8, 3)), np.empty((8, 3))
        for a in range(8):
            for i in range(3):
                xe[a, i], ve[a, i] = x[hexes[e, a], i], v[hexes[e, a], i]
        volume = plain_gradient(xe - 0.5 * dt * ve, b)
        gradient = ve.T @ b / volume
        d, w = 0.5 * (gradient + gradient.T), 0.5 * (gradient - gradient.T)
        s = stress[e]
        s += dt * (w @ s - s @ w) + dt * 2.0 * shear * d + dt * lame * np.trace(d) * np.eye(3)
        volume = plain_gradient(xe, b)
        gamma = GAMMA - (GAMMA @ xe) @ b.T / volume
        square = np.sum(b * b)
        hourglass[e] += dt * (0.1 * 2.0 * shear * square / (16.0 * volume)) * (gamma @ ve)
        fe = b @ s + gamma.T @ hourglass[e]
        for a in range(8):
            for i in range(3):
                force[hexes[e, a], i] += fe[a, i]
        least = min(least, volume / np.sqrt(2.0 * square * wave / 1000.0))
    for n in range(x.shape[0]):
        for i in range(3):
            v[n, i] -= dt * force[n, i] * inverse_mass[n]
            x[n, i] += dt * v[n, i]
    return least


def block(law: str, n: int) -> Integrator:
    """Crooked cube of n^3 elements in motion."""
    nodes, hexes = structured_block((n, n, n), (0.01 * n,) * 3)
    nodes += 5e-4 * np.sin(nodes @ np.array([[900.0, 500.0, 700.0], [700.0, 900.0, 500.0], [500.0, 700.0, 900.0]]))
    velocity = 0.2 * np.sin(30.0 * nodes[:, [1, 2, 0]])
    part = SolverPart(1, law, Material(law, law, 1000.0, MATERIALS[law]))
    controls = Controls(1.0, mass_scaling_time_step_s=0.0)
    return Integrator(
        Problem(nodes, hexes, np.zeros(len(hexes), int), (part,), controls, initial_velocity=velocity), 1e9
    )


def steps(run: Integrator, count: int) -> None:
    """Advance a run without outputs."""
    for _ in range(count):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=True)
        run.drift(dt, run.time_s + dt)


def best_rate(cycle: Any, elements: int) -> float:
    """Million element cycles per second: the best of some rounds, after one that compiles."""
    cycle(2)
    count = max(2_000_000 // elements, 3)
    rates = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        cycle(count)
        rates.append(elements * count / (time.perf_counter() - began) / 1e6)
    return max(rates)


def plain_rate(n: int) -> float:
    """Rate of the peer."""
    run = block("elastic", n)
    p = run.problem
    x, v = p.nodes.copy(), p.initial_velocity.copy()
    state = np.zeros((len(p.hexes), 3, 3)), np.zeros((len(p.hexes), 4, 3))
    inverse = 1.0 / run.user_order(run.mass[:, None])[:, 0]
    force = np.zeros_like(x)

    def cycle(count: int) -> None:
        for _ in range(count):
            plain_cycle(x, v, p.hexes, *state, force, inverse, 1e-5)

    elements = len(p.hexes)
    cycle(1)
    began = time.perf_counter()
    count = max(100_000 // elements, 1)
    cycle(count)
    return elements * count / (time.perf_counter() - began) / 1e6


def main() -> None:
    """Print the table."""
    sizes = [int(a) for a in sys.argv[1:]] or [32]
    most = min(numba.get_num_threads(), 2)
    for n in sizes:
        numba.set_num_threads(1)
        peer = plain_rate(n)
        print(f"\n{n**3} elements; million element cycles per second, best of {ROUNDS}; plain elastic loop {peer:.2f}")
        print(
            f"{'law':>20} {'1 thread':>10} {'x plain':>8} {f'{most} threads':>10} {'gain':>6} {'cost over elastic':>18}"
        )
        elastic: tuple[float, ...] = ()
        for law in MATERIALS:
            run = block(law, n)
            one = best_rate(lambda count, run=run: steps(run, count), n**3)
            numba.set_num_threads(most)
            many = best_rate(lambda count, run=run: steps(run, count), n**3)
            numba.set_num_threads(1)
            elastic = elastic or (one, many)
            cost = f"{elastic[0] / one:.2f} / {elastic[1] / many:.2f}"
            print(f"{law:>20} {one:10.2f} {one / peer:8.1f} {many:10.2f} {many / one:6.2f} {cost:>18}")


if __name__ == "__main__":
    main()
