"""Two equal bars that strike each other: the closed form of contact in one dimension."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.contact_scenes import Block, Steps, elastic, scene

from replay.solver import ContactControls

LENGTH, MODULUS, DENSITY = 0.1, 210e9, 7800.0
STRESS, DURATION = 20.236106e6, 38.54496e-6


def closing_bars(count: int, *, viscous: bool = False, friction: float = 0.0) -> Steps:
    """Bars of `count` elements that touch and close at 1 m/s."""
    h = LENGTH / count
    steel = elastic(MODULUS, 0.0, DENSITY)
    quiet = {} if viscous else {"bulk_viscosity_linear": 0.0, "bulk_viscosity_quadratic": 0.0}
    bars = [
        Block((count, 1, 1), (LENGTH, h, h), (-side * LENGTH / 2, 0, 0), steel, (side * 0.5, 0, 0)) for side in (1, -1)
    ]
    return Steps(scene(bars, ContactControls(friction=friction), controls=quiet))


def history(march: Steps, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Times, and the force between the bars [N]."""
    rows = []
    last, kick = 0.0, 0.0
    while march.run.time_s < end:
        t = march.run.time_s
        march.step()
        contact = march.run.contact
        assert contact is not None
        impulse, before = contact.pair_sums[0, 0], last
        last, kick = impulse, float(contact.arrays()["kick"][0])
        rows.append((t, abs(impulse - before) / kick))
    return np.array(rows)[:, 0], np.array(rows)[:, 1]


@pytest.mark.parametrize("count", [20, 100])
def test_closing_loses_the_energy_of_the_end_nodes_and_no_more(report: Callable[..., None], count: int) -> None:
    march = closing_bars(count)
    march.until(60e-6)
    energy = march.run.energies()
    report(f"two steel bars, {count} elements each", "energy lost at closure over 1/(2N)", 1.0,
           energy.contact_normal / energy.initial * 2 * count, 1e-12)  # fmt: skip
    assert march.worst_closure < 1e-12


def test_force_duration_and_exchange_of_velocities(report: Callable[..., None]) -> None:
    count = 100
    name = f"two steel bars, {count} elements each"
    march = closing_bars(count)
    t, force = history(march, 60e-6)
    area = (LENGTH / count) ** 2
    plateau = (t > 0.1 * DURATION) & (t < 0.9 * DURATION)
    report(name, "contact stress [Pa]", STRESS, force[plateau].mean() / area, 0.01)
    pressed = force > 0
    report(name, "contact time [s]", DURATION, t[pressed][-1], 0.01)
    # pressed from first to last without a gap: one release, no chatter
    assert pressed[: int(np.flatnonzero(pressed)[-1]) + 1].all()
    left = march.nodes_of(0)
    mass = march.run.user_order(march.run.mass)[left]
    velocity = (mass @ march.v[left, 0]) / mass.sum()
    # the energy that closing cost is missing, and what little still rings
    assert -0.5 < velocity < -0.49
    assert np.abs(march.momentum - march.momentum0).max() < 1e-12 * 0.5 * mass.sum()


def test_bulk_viscosity_takes_its_known_share(report: Callable[..., None]) -> None:
    march = closing_bars(100, viscous=True).until(60e-6)
    left = march.nodes_of(0)
    mass = march.run.user_order(march.run.mass)[left]
    report("two steel bars, 100 elements each", "final speed over impact speed, with bulk viscosity", 0.98,
           -2 * (mass @ march.v[left, 0]) / mass.sum(), 0.01)  # fmt: skip
