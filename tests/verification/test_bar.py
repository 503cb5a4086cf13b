"""Waves and vibrations of a bar: speed, stress, reflection, frequency and its order of convergence."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from marching import March, controls, crossing_period, elastic, one_part, rate

from replay.solver.blocks import structured_block

MODULUS, DENSITY, LENGTH, COUNT = 210e9, 7800.0, 0.1, 100
SPEED = np.sqrt(MODULUS / DENSITY)


def struck(poisson: float, *, confined: bool, far: str, viscous: bool) -> March:
    """Bar whose near end starts to move at 1 m/s; the step is spread over the first element."""
    h = LENGTH / COUNT
    nodes, hexes = structured_block((COUNT, 1, 1), (LENGTH, h, h))
    velocity, held = np.zeros_like(nodes), np.zeros(nodes.shape, bool)
    near, end = nodes[:, 0] == 0, np.isclose(nodes[:, 0], LENGTH)
    velocity[near, 0], held[near, 0] = 1.0, True
    velocity[np.isclose(nodes[:, 0], h), 0] = 0.5
    if far == "fixed":
        held[end, 0] = True
    if confined:
        held[:, 1:] = True
    visc = {} if viscous else {"bulk_viscosity_linear": 0.0, "bulk_viscosity_quadratic": 0.0}
    return March(
        one_part(
            nodes, hexes, elastic(MODULUS, poisson, DENSITY), controls(1.0, **visc), initial_velocity=velocity,
            fixed=held,
        )
    )  # fmt: skip


def front(stress: np.ndarray) -> float:
    """Place where the stress passes half of the plateau, in bar lengths; the step began at 0.01 / 2."""
    centre = (np.arange(COUNT) + 0.5) / COUNT
    k = int(np.flatnonzero(stress < 0.5)[0])
    return float(np.interp(-0.5, -stress[[k - 1, k]], centre[[k - 1, k]])) - 0.5 / COUNT


@pytest.mark.parametrize(
    ("poisson", "confined", "speed"),
    [(0.0, False, 5188.745), (0.3, True, 6020.183), (0.45, True, 10105.54), (0.49, True, 21465.42)],
)
def test_wave_front_runs_at_the_speed_of_sound(
    report: Callable[..., None], poisson: float, confined: bool, speed: float
) -> None:
    march = struck(poisson, confined=confined, far="free", viscous=True)
    times, places = [0.3 * LENGTH / speed, 0.8 * LENGTH / speed], []
    for t in times:
        march.until(t)
        places.append(front(-march.stress[:, 0] / (DENSITY * speed)))
    measured = (places[1] - places[0]) * LENGTH / (times[1] - times[0])
    kind = f"confined bar, nu {poisson}" if confined else "bar, nu 0"
    report(f"wave in a steel {kind}", "front speed [m/s]", speed, measured, 0.01)


def test_stress_behind_the_front_and_after_reflection(report: Callable[..., None]) -> None:
    impedance = DENSITY * SPEED
    name = "wave in a steel bar, nu 0"
    for far, factor in (("fixed", 2.0), ("free", -1.0)):
        march = struck(0.0, confined=False, far=far, viscous=True)
        march.until(0.8 * LENGTH / SPEED)
        stress = -march.stress[:, 0] / impedance
        if far == "fixed":
            report(name, "plateau stress over rho c v", 1.0, stress[10:60].mean(), 0.01)
            assert stress.max() < 1.05
        march.until(1.8 * LENGTH / SPEED)
        reflected = (-march.stress[:, 0] / impedance)[50:90].mean()
        # a free end sends back the opposite stress: the two cancel
        report(name, f"stress added at a {far} end over rho c v", factor - 1 if far == "fixed" else -1.0,
               reflected - 1.0, 0.01)  # fmt: skip


def test_overshoot_with_and_without_bulk_viscosity(report: Callable[..., None]) -> None:
    for viscous, most in ((False, 0.15), (True, 0.05)):
        march = struck(0.0, confined=False, far="free", viscous=viscous)
        march.until(0.8 * LENGTH / SPEED)
        overshoot = (-march.stress[:, 0] / (DENSITY * SPEED)).max() - 1.0
        kind = "with" if viscous else "without"
        report("wave in a steel bar, nu 0", f"overshoot {kind} bulk viscosity", 0.0, overshoot, most)
        assert overshoot > 0 or viscous


@pytest.mark.parametrize(("support", "exact"), [("fixed-free", 12971.86), ("free-free", 25943.73)])
def test_bar_frequency_converges_with_the_second_order(report: Callable[..., None], support: str, exact: float) -> None:
    errors = []
    for count in (10, 20, 40):
        h = LENGTH / count
        nodes, hexes = structured_block((count, 1, 1), (LENGTH, h, h))
        velocity, held = np.zeros_like(nodes), np.zeros(nodes.shape, bool)
        if support == "fixed-free":
            held[nodes[:, 0] == 0] = True
            velocity[:, 0] = 1e-3 * np.sin(np.pi * nodes[:, 0] / (2 * LENGTH))
        else:
            velocity[:, 0] = -1e-3 * np.cos(np.pi * nodes[:, 0] / LENGTH)
        settings = controls(1.0, time_step_factor=0.4, bulk_viscosity_linear=0.0, bulk_viscosity_quadratic=0.0)
        march = March(
            one_part(nodes, hexes, elastic(MODULUS, 0.0, DENSITY), settings, initial_velocity=velocity, fixed=held)
        )
        times, tip = march.record(3.3 / exact, lambda m: m.u[-1, 0])
        frequency = 1 / crossing_period(times, tip)
        errors.append(abs(frequency / exact - 1))
    report(f"steel bar, {support}, 40 elements", "first frequency [Hz]", exact, frequency, 0.005)
    orders = rate(errors)
    report(f"steel bar, {support}, 40 elements", "order of convergence", 2.0, orders[-1], 0.1)
