"""A run that goes wrong stops at once and says where."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from replay.errors import InstabilityError
from replay.solver import Controls, Material, Problem, SolverPart, solve
from replay.solver.blocks import structured_block
from replay.solver.vtkhdf import read_states

RUBBER = Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3})
QUIET = Controls(1e-2, history_interval_s=1e-4, plot_interval_s=1e-3, mass_scaling_time_step_s=0.0)


def column(velocity: Callable[[np.ndarray], np.ndarray], controls: Controls = QUIET, **fields: object) -> Problem:
    nodes, hexes = structured_block((8, 2, 2), (0.08, 0.02, 0.02))
    return Problem(
        nodes, hexes, np.zeros(len(hexes), int), (SolverPart(4, "pad", RUBBER),), controls,
        initial_velocity=velocity(nodes), element_ids=np.arange(len(hexes)) + 501,
        node_ids=np.arange(len(nodes)) + 9001, **fields,
    )  # type: ignore[arg-type]  # fmt: skip


def test_an_inverted_element_stops_the_run_with_its_number(tmp_path: Path) -> None:
    # the ends fly at each other far above the speed of sound
    unlimited = dataclasses.replace(QUIET, speed_limit_m_per_s=1e9)
    problem = column(lambda x: np.where(x[:, :1] > 0.04, -400.0, 400.0) * [1.0, 0.0, 0.0], unlimited)
    with pytest.raises(InstabilityError, match="turned inside out") as caught:
        solve(problem, tmp_path, progress=None)
    assert "part 4 (pad)" in str(caught.value)
    assert any(f"element {501 + k} " in str(caught.value) for k in range(32))
    assert "mend:" in str(caught.value)


def test_a_runaway_node_stops_the_run_and_the_last_good_state_is_there(tmp_path: Path) -> None:
    force = np.zeros((81, 3))
    force[40] = [0.0, 0.0, 2000.0]
    problem = column(lambda x: 0.1 * np.ones_like(x), nodal_forces=force)
    with pytest.raises(InstabilityError, match=r"node 9041 .* runs away .*limit 1\.732 m/s"):
        solve(problem, tmp_path, progress=None)
    summary = json.loads((tmp_path / "run.json").read_text())
    assert summary["ran_to_end"] is False
    assert "9041" in summary["stopped"]
    with read_states(tmp_path / "states.vtkhdf") as states:
        assert len(states) >= 1


def test_a_rigid_body_that_runs_away_stops_the_run_with_its_part(tmp_path: Path) -> None:
    nodes, hexes = structured_block((2, 2, 2), (0.02, 0.02, 0.02))
    bone = SolverPart(7, "skull", Material("bone", "rigid", 1000.0, {}))
    problem = Problem(nodes, hexes, np.zeros(8, int), (bone,), Controls(1e-2, speed_limit_m_per_s=5.0),
                      nodal_forces=np.full((27, 3), 10.0))  # fmt: skip
    with pytest.raises(InstabilityError, match=r"node 1 of part 7 \(skull\).*runs away 5\.\d+ m/s"):
        solve(problem, tmp_path, progress=None)


def test_a_value_that_is_no_number_stops_the_run_within_one_step(tmp_path: Path) -> None:
    class Poison:
        def sample(self, view) -> None:
            if view.step > 0:
                view._integrator.groups[0].stress[0, 0, 0] = np.nan
                self.step = view.step

        def state(self) -> dict:
            return {}

        def restore(self, state: dict) -> None: ...

        def write(self, folder: Path) -> None: ...

    poison = Poison()
    with pytest.raises(InstabilityError) as caught:
        solve(column(lambda x: 0.1 * x), tmp_path, recorders=[poison], progress=None)
    step = int(str(caught.value).split("(step ")[1].split(")")[0])
    assert step <= poison.step + 1
    assert "not a number" in str(caught.value) or "not numbers" in str(caught.value)


def test_a_collapsed_time_step_stops_the_run(tmp_path: Path) -> None:
    controls = Controls(1e-2, time_step_floor_s=1e-3, mass_scaling_time_step_s=0.0)
    with pytest.raises(InstabilityError, match=r"below the floor of 0\.001 s, in element 5\d\d of part 4 \(pad\)"):
        solve(column(lambda x: 0.1 * x, controls), tmp_path, progress=None)
