"""Checks at the door: a wrong problem is refused in a full sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from replay.errors import InputError
from replay.solver import Controls, Material, Problem, SolverPart, initial_velocity_about_axis
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.layout import arrange

RUBBER = Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3})
BONE = Material("bone", "rigid", 2000.0, {})


def values() -> dict[str, Any]:
    nodes, hexes = structured_block((2, 1, 1), (2.0, 1.0, 1.0))
    return {
        "nodes": nodes, "hexes": hexes, "element_part": np.zeros(2, int), "parts": (SolverPart(3, "pad", RUBBER),),
        "controls": Controls(1e-3), "element_ids": np.array([71, 72]), "node_ids": np.arange(12) + 100,
    }  # fmt: skip


def swapped(hexes: np.ndarray) -> np.ndarray:
    hexes = hexes.copy()
    hexes[1, [0, 1]] = hexes[1, [1, 0]]
    hexes[1, [4, 5]] = hexes[1, [5, 4]]
    return hexes


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"hexes": swapped(values()["hexes"])}, r"element 72 of part 'pad' has volume .*\n.*positive volumes"),
    ({"hexes": values()["hexes"] + 5}, "element 71 names a node row that does not exist|element 72 names"),
    ({"hexes": np.zeros((0, 8), int), "element_part": np.zeros(0, int), "element_ids": np.zeros(0, int)}, "no element"),
    ({"hexes": values()["hexes"].astype(float)}, "its numbers are float64"),
    ({"hexes": values()["hexes"][:, :4]}, r"its shape is \(2, 4\)"),
    (
        {"nodes": np.vstack([values()["nodes"], [[9, 9, 9]]]), "node_ids": np.arange(13)},
        "node 12 belongs to no element",
    ),
    ({"nodes": np.where(values()["nodes"] == 1, np.nan, values()["nodes"])}, "holds nan"),
    ({"element_part": np.array([0, 1])}, "a part that does not exist"),
    ({"element_ids": np.array([71, 71])}, "71 occurs twice"),
    ({"parts": (SolverPart(3, "a", RUBBER), SolverPart(3, "b", RUBBER))}, "a part number occurs twice"),
    ({"initial_velocity": np.zeros((3, 3))}, r"initial_velocity: its shape is \(3, 3\)"),
    ({"fixed": np.zeros(12, bool)}, "fixed"),
    ({"parts": (SolverPart(3, "a", BONE),), "initial_stress": np.ones((2, 6))}, "part 'a' of the law 'rigid'"),
    ({"controls": Controls(0.0)}, "controls.termination_time_s: it is 0.0"),
    ({"controls": Controls(1.0, time_step_factor=1.1)}, "the stability limit"),
    ({"controls": Controls(1.0, hourglass_method="stifness")}, "'stifness' is no hourglass method"),
    ({"controls": Controls(1.0, bulk_viscosity_linear=-0.1)}, "controls.bulk_viscosity_linear"),
    ({"controls": Controls(1.0, gravity_m_per_s2=(0.0, float("nan"), 0.0))}, "controls.gravity_m_per_s2"),
]


@pytest.mark.parametrize(("changes", "found"), WRONG)
def test_a_wrong_problem_is_refused(changes: dict[str, Any], found: str) -> None:
    with pytest.raises(InputError, match=found):
        Problem(**{**values(), **changes})


def test_an_axis_needs_two_points() -> None:
    nodes = values()["nodes"]
    with pytest.raises(InputError, match="P and Q are one point"):
        initial_velocity_about_axis(nodes, (0, 0, 0), 3.0, (1, 1, 1), (1, 1, 1))
    v = initial_velocity_about_axis(nodes, (1, 0, 0), 3.0, (0, 0, 0), (0, 0, 2))
    assert np.allclose(v - [1, 0, 0], np.cross([0, 0, 3.0], nodes))


def test_bodies_join_where_rigid_parts_share_nodes() -> None:
    nodes, hexes = structured_block((5, 1, 1), (5.0, 1.0, 1.0))
    parts = tuple(SolverPart(k, f"p{k}", m) for k, m in enumerate((BONE, BONE, RUBBER, BONE)))
    layout = arrange(Problem(nodes, hexes, np.array([0, 1, 2, 2, 3]), parts, Controls(1.0)))
    assert layout.body_parts == ((0, 1), (3,))
    assert layout.n_free == 4
    assert (layout.body_end - layout.body_begin).tolist() == [12, 8]


def test_every_element_is_computed_once_and_comes_back_in_its_row() -> None:
    nodes, hexes = structured_block((5, 4, 3), (5.0, 4.0, 3.0))
    rng = np.random.default_rng(0)
    part = rng.integers(0, 3, len(hexes))
    parts = tuple(SolverPart(k, f"p{k}", m) for k, m in enumerate((RUBBER, RUBBER, RUBBER)))
    problem = Problem(nodes, hexes, part, parts, Controls(1.0))
    layout = arrange(problem)
    rows = np.concatenate([group.rows[group.filled] for group in layout.groups])
    assert sorted(rows.tolist()) == list(range(len(hexes)))
    assert sorted(layout.node_order.tolist()) == list(range(len(nodes)))
    stress = rng.normal(size=(len(hexes), 6))
    run = Integrator(Problem(nodes, hexes, part, parts, Controls(1.0), initial_stress=stress), 1.0)
    assert np.array_equal(run.element_values("stress", 6), stress)


def test_mass_scaling_reaches_its_step_and_says_what_it_added() -> None:
    nodes, hexes = structured_block((6, 2, 2), (0.06, 0.02, 0.02))
    nodes[nodes[:, 0] > 0.0501, 0] = 0.052  # one layer of thin elements
    parts = (SolverPart(1, "thick", RUBBER), SolverPart(2, "thin", RUBBER))
    part = (nodes[hexes].mean(axis=1)[:, 0] > 0.05).astype(int)
    plain = Integrator(Problem(nodes, hexes, part, parts, Controls(1.0, mass_scaling_time_step_s=0.0)), 1e9)
    before = plain.forces().step_s
    target = 1.5 * before
    controls = Controls(1.0, mass_scaling_time_step_s=target, time_step_factor=0.8)
    velocity = np.ones_like(nodes)
    run = Integrator(Problem(nodes, hexes, part, parts, controls, initial_velocity=velocity), 1e9)
    assert run.forces().step_s * 0.8 == pytest.approx(target, rel=1e-6)
    assert run.added_mass.by_part_kg[0] == 0.0
    assert run.added_mass.elements.tolist() == [0, 4]
    assert run.added_mass.total_kg == pytest.approx(run.mass.sum() - plain.mass.sum(), rel=1e-12)
    energies = run.energies(run.velocities())
    assert energies.added_mass_kinetic == pytest.approx(1.5 * run.added_mass.total_kg, rel=1e-12)
