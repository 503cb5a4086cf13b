"""A deck with every law, for all tests of the room."""

from __future__ import annotations

import numpy as np
import pytest

from replay.decks import DeckInput, DeckPart, Driver, InitialVelocity, PartSet, axis_through

ELASTIC = {"youngs_modulus_pa": 3.356e9, "poisson_ratio": 0.43}
FOAM = {"youngs_modulus_pa": 10.5e6, "plateau_stress_pa": 0.35e6, "densification_strain": 0.65}
BRAIN = {
    "bulk_modulus_pa": 2.19e9,
    "shear_modulus_pa": 6e3,
    "prony_ratios": [0.5, 0.3],
    "prony_times_s": [0.01, 0.1],
}
PARTS = (
    DeckPart(60000001, "brain", "viscohyperelastic", 1012.345678, BRAIN, "head"),
    DeckPart(60000002, "csf", "fluid", 1040.0, {"bulk_modulus_pa": 2.19e9, "shear_modulus_pa": 1e3}, "head"),
    DeckPart(60000003, "skull", "rigid", 1357.0, {"youngs_modulus_pa": 12.04e9, "poisson_ratio": 0.22}, "head"),
    DeckPart(60009020, "scalp", "elastic", 1200.0, {"youngs_modulus_pa": 16.7e6, "poisson_ratio": 0.42}, "head"),
    DeckPart(10000174, "comfort_pad_crown", "crushable_foam", 84.3, FOAM, "helmet"),
    DeckPart(10000180, "comfort_pad_jaw", "crushable_foam", 84.3, FOAM, "helmet"),
    DeckPart(10000184, "energy_pad_crown", "crushable_foam", 84.3, FOAM, "helmet"),
    DeckPart(10000181, "chin_cup", "crushable_foam", 84.3, FOAM, "helmet"),
    DeckPart(10000001, "shell", "elastic", 1500.0, ELASTIC, "helmet"),
)


@pytest.fixture
def deck() -> DeckInput:
    """A column of hexes, one a part, tied to each other by shared nodes, at awkward coordinates."""
    rng = np.random.default_rng(5)
    count = len(PARTS)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) * 0.0213
    nodes = np.vstack([square + np.array([0, 0, 0.0171 * k]) for k in range(count + 1)])
    nodes = nodes + rng.normal(scale=1e-3, size=nodes.shape) - 0.11
    hexes = np.arange(8)[None] + 4 * np.arange(count)[:, None]
    omega = np.array([2.0, 45.01, -0.7])
    speed, p, q = axis_through([0.01, -0.02, 0.03], omega)
    time = np.linspace(0, 0.03, 61)
    return DeckInput(
        title="a test deck",
        nodes=nodes,
        node_ids=60_000_001 + np.arange(len(nodes)),
        hexes=hexes,
        element_ids=10_000_001 + np.arange(count),
        element_part=np.arange(count),
        parts=PARTS,
        part_sets=(
            PartSet(10000099, "H1_pads_set1", (10000174, 10000180)),
            PartSet(10000100, "H1_pads_set2", (10000184,)),
            PartSet(99, "all_parts", tuple(part.pid for part in PARTS)),
        ),
        initial_velocities=(InitialVelocity(99, (0.2, 8.3232, 0.0), speed, p, q),),
        driver=Driver(60000003, time, np.cos(np.outer(time, [90, 50, 70])), 40 * np.sin(np.outer(time, [80, 30, 60]))),
        notes=("pads share nodes with the scalp",),
    )
