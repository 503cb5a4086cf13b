"""Five hundred pairs of soft blocks that strike each other at random."""

from __future__ import annotations

import hashlib

import numba
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.contact_scenes import Block, Steps, elastic, scene

from replay.solver import ContactControls, Problem
from replay.solver.run import state_hash

PAIRS = 500
BATCH = 50


def strike(seed: int) -> Problem:
    """Two blocks of random shape, mesh, density, stiffness, pose, speed and friction, just before they meet."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.01, 0.04, (2, 3))
    counts = np.clip(np.rint(size / rng.uniform(0.006, 0.014, (2, 1))), 1, 4).astype(int)
    density = 1000.0 * 10.0 ** np.array([1, -1]) ** rng.integers(0, 2) if rng.random() < 0.3 else 1000.0 * np.ones(2)
    density = density * rng.uniform(0.7, 1.4, 2)
    modulus = 10.0 ** rng.uniform(6.5, 7.5, 2)
    turns = rng.uniform(-180, 180, (2, 3))
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    # apart along the direction by what both reach along it, and a little
    reach = [np.abs(Rotation.from_euler("xyz", t, degrees=True).inv().apply(direction)) @ s / 2
             for t, s in zip(turns, size)]  # fmt: skip
    aside = np.cross(direction, rng.normal(size=3))
    centre = direction * (sum(reach) + 2e-4) + aside / np.linalg.norm(aside) * rng.uniform(0, 0.4) * size.min()
    wave = np.sqrt(modulus / density)
    speed = rng.uniform(0.01, 0.06) * wave.min()
    slide = rng.uniform(-0.5, 0.5) * speed * aside / np.linalg.norm(aside)
    blocks = [
        Block(tuple(counts[0]), tuple(size[0]), (0, 0, 0), elastic(modulus[0], 0.3, density[0]), turn_deg=turns[0]),
        Block(tuple(counts[1]), tuple(size[1]), centre, elastic(modulus[1], 0.3, density[1]),
              slide - speed * direction, turn_deg=turns[1]),
    ]  # fmt: skip
    return scene(blocks, ContactControls(friction=float(rng.choice([0.0, 0.1, 0.5]))), end=1.0)


def run(seed: int, threads: int) -> tuple[Steps, str]:
    numba.set_num_threads(threads)
    problem = strike(seed)
    march = Steps(problem)
    longest = max(np.ptp(problem.nodes[problem.hexes[problem.element_part == k]].reshape(-1, 3), axis=0).max()
                  for k in (0, 1))  # fmt: skip
    speed = np.linalg.norm(problem.initial_velocity, axis=1).max()
    # until corners that do not point at each other have met, and a wave has gone through an element and back
    end = (4e-4 + 0.6 * np.ptp(problem.nodes, axis=0).min()) / speed + 3 * longest / np.sqrt(10.0**6.5 / 1400.0)
    for _ in range(400):
        march.step()
        if march.run.time_s > end:
            break
    march.run.forces()
    return march, state_hash(march.run)


@pytest.mark.parametrize("batch", range(PAIRS // BATCH))
def test_random_pairs_keep_energy_and_momentum_and_do_not_pass(batch: int) -> None:
    met = 0
    for seed in range(batch * BATCH, (batch + 1) * BATCH):
        march, _ = run(seed, 1)
        contact, energy = march.run.contact, march.run.energies()
        assert contact is not None
        met += contact.counts[0] > 0
        said = f"seed {seed}"
        assert np.isfinite(march.x).all(), said
        assert march.worst_closure < 1e-11, said
        assert energy.contact_normal + energy.friction >= -1e-6 * energy.initial, said
        assert contact.penetration_over_edge < 0.05, f"{said}: {contact.penetration_over_edge:.3g}"
        scale = np.abs(march.run.mass[:, None] * march.problem.initial_velocity[march.run.layout.node_order]).sum()
        assert np.abs(march.momentum - march.momentum0).max() < 1e-12 * scale, said
    assert met > 0.8 * BATCH


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="numba was started with one thread")
def test_random_pairs_give_the_same_bits_on_one_and_two_threads() -> None:
    digests = [hashlib.sha256(), hashlib.sha256()]
    for seed in range(0, PAIRS, 10):
        for k in (0, 1):
            digests[k].update(run(seed, k + 1)[1].encode())
    assert digests[0].hexdigest() == digests[1].hexdigest()
