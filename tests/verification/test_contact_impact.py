"""Rigid bodies that strike each other, and momentum between bodies that deform."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.contact_scenes import Block, Steps, elastic, rigid, scene

from replay.solver import ContactControls, ContactPair


def struck(restitution: float) -> Steps:
    """A block of 1 kg at 2 m/s against one of 3 kg at rest."""
    blocks = [
        Block((2, 2, 2), (0.1, 0.1, 0.1), (-0.0501, 0, 0), rigid(1000.0), (2.0, 0, 0)),
        Block((2, 2, 2), (0.1, 0.1, 0.1), (0.0501, 0, 0), rigid(3000.0)),
    ]
    # to rounding, not to the thousandth of the default
    contact = ContactControls(
        most_iterations=500, tolerance=1e-15, pairs=(ContactPair((1,), (2,), restitution=restitution),)
    )
    return Steps(scene(blocks, contact), rigid_step_s=1e-5).until(1e-3)


@pytest.mark.parametrize(("restitution", "first", "second", "lost"), [(1.0, -1.0, 1.0, 0.0), (0.0, 0.5, 0.5, 1.5)])
def test_rigid_impact(
    report: Callable[..., None], restitution: float, first: float, second: float, lost: float
) -> None:
    march = struck(restitution)
    name = f"rigid 1:3 impact, restitution {restitution:.0f}"
    velocity = march.run.bodies.velocity[:, 0]
    report(name, "velocity of 1 kg [m/s]", first, velocity[0], 1e-12)
    report(name, "velocity of 3 kg [m/s]", second, velocity[1], 1e-12)
    report(name, "energy lost over all there is", lost / 2, march.run.energies().contact_normal / 2, 1e-12)
    assert np.abs(march.momentum - march.momentum0).max() < 1e-12 * 2.0


def test_restitution_in_between() -> None:
    velocity = struck(0.5).run.bodies.velocity[:, 0]
    assert velocity[1] - velocity[0] == pytest.approx(0.5 * 2.0, rel=1e-9)


def test_momentum_and_impulses_balance_to_rounding(report: Callable[..., None]) -> None:
    blocks = [
        Block((4, 4, 3), (0.04, 0.04, 0.03), (0.003, 0.002, 0.0172), elastic(1e7, 0.3, 1000.0), (1.0, 0.5, -3.0),
              turn_deg=(4, -3, 20)),
        Block((5, 5, 3), (0.06, 0.06, 0.03), (0, 0, -0.0165), elastic(2e7, 0.3, 3000.0), (0, 0, 0.5)),
    ]  # fmt: skip
    march = Steps(scene(blocks, ContactControls(friction=0.3)))
    n = march.run.layout.n_free
    of_first = np.isin(march.run.layout.node_order[:n], march.nodes_of(0))

    def momentum_of_first() -> np.ndarray:
        rows = march.run.nodal[:n][of_first, 4:7]
        return np.asarray(np.einsum("n,ni->i", march.run.mass[:n][of_first], rows))

    start = momentum_of_first()
    march.until(2e-3)
    contact = march.run.contact
    assert contact is not None
    impulse = contact.pair_sums[0, :3]
    size = np.abs(impulse).max()
    assert size > 0.01
    name = "two deforming blocks, friction 0.3"
    report(name, "change of total momentum over the impulse", 0.0,
           np.abs(march.momentum - march.momentum0).max() / size, 1e-12)  # fmt: skip
    report(name, "impulse of the pair against the momentum of one block", 0.0,
           np.abs(momentum_of_first() - start - impulse).max() / size, 1e-12)  # fmt: skip
    assert march.worst_closure < 1e-12
