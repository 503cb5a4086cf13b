"""What a run promises: the same bits whatever the threads, wherever it is stopped; and a file of everything."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import replay.solver.run as run_module
from replay.errors import ResumeError
from replay.solver import ENERGY_TABLE, HISTORY_TABLE, PART_ENERGY_TABLE, TIME_STEP_TABLE, Controls, Problem, solve
from replay.solver.checkpoint import Checkpoints, identity
from replay.solver.integrator import Integrator
from replay.solver.vtkhdf import read_states

Layered = Callable[..., Problem]


def hashes(folder: Path) -> dict[str, str]:
    return {
        p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


class Tip:
    """A recorder: the greatest speed at each history time."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []

    def sample(self, view: Any) -> None:
        f = view.deformation_gradient()
        self.rows.append([view.time_s, np.abs(view.velocities).max(), view.stress.min(), np.linalg.det(f).min()])

    def state(self) -> dict[str, np.ndarray]:
        return {"rows": np.array(self.rows).reshape(-1, 4)}

    def restore(self, state: Any) -> None:
        self.rows = state["rows"].tolist()

    def write(self, folder: Path) -> None:
        (folder / "tip.json").write_text(json.dumps(self.rows))


def test_one_and_two_threads_give_the_same_bytes(layered: Layered, tmp_path: Path) -> None:
    # enough blocks that a second thread is really used
    problem = layered(end=3e-4, counts=(48, 8, 8))
    one = solve(problem, tmp_path / "1", threads=1, progress=None)
    two = solve(problem, tmp_path / "2", threads=2, progress=None)
    assert one.steps > 100
    assert one.state_hash == two.state_hash
    assert hashes(tmp_path / "1") == hashes(tmp_path / "2")


def test_a_run_leaves_the_files_it_promises(layered: Layered, tmp_path: Path) -> None:
    problem = layered(end=2e-3)
    summary = solve(problem, tmp_path, recorders=[Tip()], progress=None)
    assert sorted(hashes(tmp_path)) == [
        "energy.csv", "histories.csv", "part_energy.csv", "run.json", "states.vtkhdf", "states.xdmf", "timestep.csv",
        "tip.json",
    ]  # fmt: skip
    energy = ENERGY_TABLE.read(tmp_path / "energy.csv")
    assert np.allclose(energy["time_s"], np.linspace(0, 2e-3, 11), rtol=1e-15, atol=0)
    assert np.abs(energy["closure"]).max() < 1e-12
    assert energy["ratio"].between(0.99, 1.01).all()
    steps = TIME_STEP_TABLE.read(tmp_path / "timestep.csv")
    assert steps["step"].iloc[-1] == summary.steps
    assert set(steps["pid"]) <= {20, 30, 40, 50}
    parts = PART_ENERGY_TABLE.read(tmp_path / "part_energy.csv")
    last = parts[parts["time_s"] == parts["time_s"].max()]
    assert last["internal_J"].sum() == pytest.approx(energy["internal_J"].iloc[-1], rel=1e-12)
    assert last["kinetic_J"].sum() == pytest.approx(energy["kinetic_J"].iloc[-1], rel=2e-2)
    motion = HISTORY_TABLE.read(tmp_path / "histories.csv")
    assert motion[motion["pid"] == 10]["qw"].notna().all()
    assert motion[motion["pid"] == 20]["qw"].isna().all()
    written = json.loads((tmp_path / "run.json").read_text())
    assert written["state_hash"] == summary.state_hash
    assert written["ran_to_end"] is True
    with read_states(tmp_path / "states.vtkhdf") as states:
        assert len(states) == 6


def test_the_users_numbers_come_back(layered: Layered, tmp_path: Path) -> None:
    plain = layered(end=1e-3)
    n, m = len(plain.nodes), len(plain.hexes)
    problem = layered(end=1e-3, node_ids=np.arange(n) * 3 + 7, element_ids=np.arange(m)[::-1] * 5 + 1000)
    solve(problem, tmp_path, progress=None)
    table = TIME_STEP_TABLE.read(tmp_path / "timestep.csv")
    rows = (m - 1) - (table["element_id"].to_numpy() - 1000) // 5
    pids = [problem.part_of(int(row)).pid for row in rows]
    assert pids == table["pid"].tolist()


@pytest.mark.parametrize("stop_at", [1, 57, 200])
def test_a_stopped_run_resumes_bit_identical_at_any_step(
    layered: Layered, tmp_path: Path, stop_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = layered(end=1.5e-3)
    whole = solve(problem, tmp_path / "whole", recorders=[Tip()], progress=None)
    assert whole.steps > 205

    class StopAt(run_module.Signals):
        count = 0

        def take(self) -> signal.Signals | None:
            StopAt.count += 1
            return signal.SIGTERM if StopAt.count == stop_at else None

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "Signals", StopAt)
        with pytest.raises(SystemExit):
            solve(problem, tmp_path / "halves", recorders=[Tip()], progress=None)
    assert (tmp_path / "halves" / "checkpoint").is_dir()
    again = solve(problem, tmp_path / "halves", recorders=[Tip()], progress=None)
    assert again.state_hash == whole.state_hash
    assert hashes(tmp_path / "halves") == hashes(tmp_path / "whole")


_CHILD = """
import pickle, sys
from pathlib import Path
from replay.solver import solve
problem = pickle.loads(Path(sys.argv[1]).read_bytes())
solve(problem, sys.argv[2], threads=1)
"""


def launch(problem: Problem, folder: Path) -> subprocess.Popen[bytes]:
    folder.mkdir()
    pickled = folder.parent / f"{folder.name}.pickle"
    pickled.write_bytes(pickle.dumps(problem))
    return subprocess.Popen(
        [sys.executable, "-c", _CHILD, str(pickled), str(folder)], stderr=subprocess.DEVNULL, env=os.environ.copy()
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGUSR1])
def test_a_killed_run_resumes_bit_identical(layered: Layered, tmp_path: Path, number: signal.Signals) -> None:
    solve(layered(end=1e-4), tmp_path / "warm", progress=None)  # compile here, not against the child's clock
    problem = layered(end=0.2)
    object.__setattr__(problem.controls, "checkpoint_period_s", 0.2 if number == signal.SIGKILL else 1e9)
    child = launch(problem, tmp_path / "killed")
    folder = tmp_path / "killed" / "checkpoint"
    deadline = time.monotonic() + 120
    while child.poll() is None and time.monotonic() < deadline:
        started = (tmp_path / "killed" / "states.partial").exists()
        if number == signal.SIGKILL and len(list(folder.glob("*.checkpoint"))) >= 2:
            break
        if number != signal.SIGKILL and started:
            time.sleep(0.3)
            break
        time.sleep(0.02)
    child.send_signal(number)
    if number == signal.SIGUSR1:
        while child.poll() is None and not list(folder.glob("*.checkpoint")):
            time.sleep(0.02)
        child.kill()
    code = child.wait(60)
    assert code == {signal.SIGKILL: -9, signal.SIGTERM: 143, signal.SIGUSR1: -9}[number]
    assert list(folder.glob("*.checkpoint"))
    note = io.StringIO()
    again = solve(problem, tmp_path / "killed", progress=note)
    assert "goes on from" in note.getvalue()
    whole = solve(problem, tmp_path / "whole", progress=None)
    assert again.state_hash == whole.state_hash
    assert hashes(tmp_path / "killed") == hashes(tmp_path / "whole")


def test_a_checkpoint_of_another_model_code_or_version_is_refused(layered: Layered, tmp_path: Path) -> None:
    problem = layered(end=1e-3)
    run = Integrator(problem, 1e9)
    for key, sentence in (("model", "another model"), ("code", "the solver's code"), ("version", "another version")):
        folder = tmp_path / key
        stranger = {**identity(problem), key: "0123"}
        Checkpoints(folder / "checkpoint", stranger).write(3, run.arrays())
        with pytest.raises(ResumeError, match=sentence):
            solve(problem, folder, progress=None)
    # told to, it starts anew
    assert solve(problem, folder, resume=False, progress=None).ran_to_end


def test_anything_that_changes_the_result_changes_the_models_hash(layered: Layered) -> None:
    plain = layered()
    nodes = plain.nodes.copy()
    nodes[5, 1] += 1e-12
    changed = [
        layered(end=4e-3),
        layered(initial_velocity=plain.initial_velocity + 1e-15),
        layered(nodal_forces=np.full_like(nodes, 1e-9)),
        layered(node_ids=np.arange(len(nodes)) + 2),
    ]
    assert len({p.digest() for p in (plain, *changed)}) == 5
    assert layered().digest() == plain.digest()


def test_a_damaged_checkpoint_falls_back_to_the_one_before(layered: Layered, tmp_path: Path) -> None:
    problem = layered(end=1e-3)
    store = Checkpoints(tmp_path, identity(problem))
    for step in (1, 2, 3):
        store.write(step, {"a": np.full(5, float(step))})
    files = sorted(tmp_path.glob("*.checkpoint"))
    assert [f.name for f in files] == ["step-000000000002.checkpoint", "step-000000000003.checkpoint"]
    raw = bytearray(files[1].read_bytes())
    raw[-40] ^= 1
    files[1].write_bytes(raw)
    found = store.read()
    assert found is not None
    assert found["a"].tolist() == [2.0] * 5
    files[0].write_bytes(b"half a fi")
    with pytest.raises(ResumeError, match="no checkpoint is whole"):
        store.read()


def test_progress_speaks_before_the_start_and_then_rarely(layered: Layered, tmp_path: Path) -> None:
    note = io.StringIO()
    solve(layered(end=2e-3), tmp_path, progress=note)
    lines = note.getvalue().splitlines()
    assert len(lines) <= 2
    assert "elements that deform" in lines[0]
    assert "MiB" in lines[0]
    assert "steps of" in lines[0]


def test_outputs_fall_on_their_times_to_the_last_bit(layered: Layered, tmp_path: Path) -> None:
    problem = layered(controls=Controls(7e-4, history_interval_s=1e-4, plot_interval_s=3e-4, speed_limit_m_per_s=100,
                                        mass_scaling_time_step_s=0.0))  # fmt: skip
    solve(problem, tmp_path, progress=None)
    times = pd.read_csv(tmp_path / "energy.csv")["time_s"].tolist()
    assert times == [0.0, 1e-4, 2e-4, pytest.approx(3e-4, rel=1e-15), 4e-4, 5e-4, pytest.approx(6e-4, rel=1e-15), 7e-4]
    with read_states(tmp_path / "states.vtkhdf") as states:
        assert np.allclose(states.times_s, [0.0, 3e-4, 6e-4, 7e-4], rtol=1e-15)
