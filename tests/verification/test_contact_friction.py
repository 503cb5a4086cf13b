"""A block on a plane: Coulomb's friction, sticking and sliding."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.contact_scenes import Block, Steps, elastic, rigid, scene

from replay.solver import ContactControls, Material, PrescribedMotion

G = 9.81


def on_a_plane(material: Material, tilt_deg: float, speed: float = 0.0, friction: float = 0.5) -> Steps:
    """Block of 0.5 kg on a fixed plane; the plane's slope turns gravity instead of the mesh."""
    tilt = np.radians(tilt_deg)
    block = Block((2, 2, 1), (0.1, 0.1, 0.05), (0, 0, 0.025), material, (speed, 0, 0))
    plane = Block((1, 1, 1), (20.0, 2.0, 0.1), (5.0, 0, -0.05), rigid(1000.0))
    still = np.zeros((2, 3))
    held = PrescribedMotion((2,), np.array([0.0, 10.0]), still, np.tile([0, 0, 0, 1.0], (2, 1)), still, still)
    gravity = (G * np.sin(tilt), 0.0, -G * np.cos(tilt))
    problem = scene([block, plane], ContactControls(friction=friction), controls={"gravity_m_per_s2": gravity},
                    prescribed=(held,))  # fmt: skip
    return Steps(problem, rigid_step_s=2e-4)


def slid(march: Steps, end: float) -> tuple[float, float]:
    """Displacement [m] and speed [m/s] of the block along the plane."""
    nodes = march.nodes_of(0)
    start = march.x[nodes].mean(axis=0)
    march.until(end)
    return float((march.x[nodes].mean(axis=0) - start)[0]), float(march.v[nodes].mean(axis=0)[0])


def test_a_block_sticks_below_the_critical_slope(report: Callable[..., None]) -> None:
    march = on_a_plane(rigid(1000.0), 20.0)
    drift, _ = slid(march, 0.5)
    report("block on an incline, mu 0.5, 20 deg", "drift in 0.5 s [m]", 0.0, drift, 1e-6)


@pytest.mark.parametrize(("slope", "exact"), [(30.0, 0.657145), (45.0, 3.468359)])
def test_a_block_slides_above_it(report: Callable[..., None], slope: float, exact: float) -> None:
    march = on_a_plane(rigid(1000.0), slope)
    distance, _ = slid(march, 0.5)
    report(f"block on an incline, mu 0.5, {slope:.0f} deg", "acceleration [m/s^2]", exact, 2 * distance / 0.25, 0.01)
    energy = march.run.energies()
    normal_force = 0.5 * G * np.cos(np.radians(slope))
    assert energy.friction == pytest.approx(0.5 * normal_force * distance, rel=0.01)
    assert march.worst_closure < 1e-12


@pytest.mark.parametrize("offset", [-0.5, 0.5])
def test_the_critical_slope_is_the_angle_of_friction(offset: float) -> None:
    drift, _ = slid(on_a_plane(rigid(1000.0), 26.565 + offset), 0.2)
    assert (drift > 1e-4) == (offset > 0)
    assert offset > 0 or abs(drift) < 1e-6


def test_a_braking_block_stops_where_friction_says(report: Callable[..., None]) -> None:
    march = on_a_plane(rigid(1000.0), 0.0, speed=5.0)
    nodes = march.nodes_of(0)
    start, stop, least = march.x[nodes].mean(axis=0)[0], 0.0, 0.0
    while march.run.time_s < 1.1:
        march.step()
        speed = march.v[nodes].mean(axis=0)[0]
        least = min(least, speed)
        if not stop and speed < 1e-4:
            stop = march.run.time_s
    name = "braking block, 5 m/s, mu 0.5"
    report(name, "stops after [s]", 1.019368, stop, 0.01)
    report(name, "stops at [m]", 2.548420, march.x[nodes].mean(axis=0)[0] - start, 0.01)
    energy = march.run.energies()
    report(name, "heat over m v^2 / 2", 1.0, energy.friction / energy.initial, 0.01)
    assert least > -1e-5  # no reverse creep


def test_a_soft_block_sticks_and_slides_too() -> None:
    # Young's modulus as of soft rubber: the block wobbles, its mean does what a rigid one does
    soft = elastic(2e5, 0.3, 1000.0)
    drift, _ = slid(on_a_plane(soft, 20.0), 0.2)
    distance, _ = slid(on_a_plane(soft, 45.0), 0.2)
    assert abs(drift) < 2e-3
    assert distance == pytest.approx(0.5 * 3.468359 * 0.2**2, rel=0.05)
