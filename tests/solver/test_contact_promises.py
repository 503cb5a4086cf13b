"""What a run with contact promises: the same bits whatever the threads, wherever it is stopped; and its files."""

from __future__ import annotations

import dataclasses
import json
import signal
from pathlib import Path

import numpy as np
import pytest
from tests.contact_scenes import Block, elastic, rigid, scene

import replay.solver.run as run_module
from replay.solver import CONTACT_TABLE, ENERGY_TABLE, ContactControls, ContactPair, Problem, solve

SOFT = elastic(1e7, 0.3, 1000.0)


def pile(end: float = 4e-3, fine: int = 1) -> Problem:
    """A soft block struck by a soft and by a rigid one, with friction."""
    blocks = [
        Block((4 * fine, 4 * fine, 3 * fine), (0.05, 0.05, 0.03), (0, 0, 0), SOFT),
        Block((3 * fine, 4 * fine, 3 * fine), (0.03, 0.04, 0.03), (0, 0, 0.0305), SOFT, (1.0, 0.3, -4.0),
              turn_deg=(0, 0, 25)),
        Block((3, 3, 2), (0.04, 0.04, 0.02), (0.002, 0, -0.0254), rigid(2000.0), (0, 0.5, 2.0), turn_deg=(0, 0, 10)),
    ]  # fmt: skip
    controls = {"history_interval_s": end / 12, "plot_interval_s": end / 3, "speed_limit_m_per_s": 1000.0}
    contact = ContactControls(friction=0.2, pairs=(ContactPair((1,), (2,), friction=0.5, name="soft on soft"),))
    return scene(blocks, contact, end, controls)


def test_one_and_two_threads_give_the_same_bytes(tmp_path: Path) -> None:
    problem = pile(end=1.5e-3, fine=4)
    one = solve(problem, tmp_path / "1", threads=1, progress=None)
    two = solve(problem, tmp_path / "2", threads=2, progress=None)
    assert one.contact["steps"] > 50
    assert one.state_hash == two.state_hash
    for name in ("contact.csv", "energy.csv", "histories.csv"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()


@pytest.mark.parametrize("stop_at", [2, 33, 70])
def test_a_run_stopped_in_contact_resumes_bit_identical(
    tmp_path: Path, stop_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = pile()
    whole = solve(problem, tmp_path / "whole", progress=None)
    assert whole.steps > 75

    class StopAt(run_module.Signals):
        count = 0

        def take(self) -> signal.Signals | None:
            StopAt.count += 1
            return signal.SIGTERM if StopAt.count == stop_at else None

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "Signals", StopAt)
        with pytest.raises(SystemExit):
            solve(problem, tmp_path / "halves", progress=None)
    again = solve(problem, tmp_path / "halves", progress=None)
    assert again.state_hash == whole.state_hash
    for name in ("contact.csv", "energy.csv", "states.vtkhdf", "run.json"):
        assert (tmp_path / "halves" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_contact_histories_agree_with_the_ledger_and_with_each_other(tmp_path: Path) -> None:
    summary = solve(pile(), tmp_path, progress=None)
    table = CONTACT_TABLE.read(tmp_path / "contact.csv")
    last = table[table["time_s"] == table["time_s"].max()]
    assert list(zip(last["pid_a"], last["pid_b"])) == [(1, 2), (1, 3)]
    ledger = json.loads((tmp_path / "run.json").read_text())["energies"]
    # the ledger speaks of the middle of the last step
    assert last["normal_J"].sum() == pytest.approx(ledger["contact_normal_J"], rel=1e-2)
    assert last["friction_J"].sum() == pytest.approx(ledger["friction_J"], rel=1e-2)
    assert (last["friction_J"] > 0).all()
    for _, pair in table.groupby("pid_b"):
        step = np.diff(pair["time_s"])
        force = pair["force_z_N"].to_numpy()[1:]
        assert np.allclose(np.cumsum(force * step), pair["impulse_z_N_s"].to_numpy()[1:], rtol=1e-9)
    assert summary.contact["penetration_over_edge"] < 0.05


def test_rows_of_the_ledger_have_the_momentum_of_the_motion_and_not_that_of_corrections(tmp_path: Path) -> None:
    """A correction of penetration rides on the velocities of one step; a row taken in it showed 6e-6 of drift."""
    problem = pile()
    every_step = dataclasses.replace(problem.controls, history_interval_s=2e-5)
    summary = solve(dataclasses.replace(problem, controls=every_step), tmp_path, progress=None)
    assert summary.contact["penetration_over_edge"] > 1e-5, "there was something to correct"
    table = ENERGY_TABLE.read(tmp_path / "energy.csv")
    momentum = np.stack([table[f"momentum_{axis}_N_s"] for axis in "xyz"], axis=1)
    assert np.abs(momentum - momentum[0]).max() < 1e-13 * np.linalg.norm(momentum[0])


def test_a_run_without_contact_has_no_contact_file(tmp_path: Path) -> None:
    blocks = [Block((1, 1, 1), (1, 1, 1), (0, 0, 0), SOFT, (1.0, 0, 0))]
    assert solve(scene(blocks, None, 1e-3), tmp_path, progress=None).contact == {}
    assert not (tmp_path / "contact.csv").exists()
