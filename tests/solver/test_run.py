"""What a run promises: the same bits whatever the threads, wherever it is stopped; and a file of everything."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
import pickle
import re
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
from linked import everything
from scipy.spatial.transform import Rotation

import replay.solver.progress as progress_module
import replay.solver.run as run_module
from replay.errors import ReplayError, ResumeError
from replay.solver import (
    ENERGY_TABLE,
    HISTORY_TABLE,
    PART_ENERGY_TABLE,
    TIME_STEP_TABLE,
    Controls,
    Problem,
    RunSummary,
    solve,
)
from replay.solver.checkpoint import Checkpoints, identity
from replay.solver.integrator import Integrator
from replay.solver.link_histories import JOINT_TABLE, RIGID_SET_TABLE, STRAP_TABLE, TIE_TABLE
from replay.solver.outputs import States
from replay.solver.recorders import ELEMENT_TABLE, NODE_TABLE, element_recorder, node_recorder
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

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "Signals", stopping(stop_at))
        with pytest.raises(SystemExit):
            solve(problem, tmp_path / "halves", recorders=[Tip()], progress=None)
    assert (tmp_path / "halves" / "checkpoint").is_dir()
    again = solve(problem, tmp_path / "halves", recorders=[Tip()], progress=None)
    assert again.state_hash == whole.state_hash
    assert hashes(tmp_path / "halves") == hashes(tmp_path / "whole")


@pytest.mark.parametrize("stop_at", sorted(np.random.default_rng(20261125).integers(2, 200, 6).tolist()))
def test_a_run_with_joints_straps_and_ties_resumes_bit_identical_at_any_step(
    linked_run: tuple[RunSummary, Path], tmp_path: Path, stop_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, folder = linked_run
    assert whole.steps >= 200
    problem = everything()
    with monkeypatch.context() as patch:
        patch.setattr(run_module, "Signals", stopping(stop_at))
        with pytest.raises(SystemExit):
            solve(problem, tmp_path, recorders=chosen(problem), progress=None)
    again = solve(problem, tmp_path, recorders=chosen(problem), progress=None)
    assert again.state_hash == whole.state_hash
    assert hashes(tmp_path) == hashes(folder)


def test_the_ledger_of_a_linked_run_closes_with_every_column_at_work(linked_run: tuple[RunSummary, Path]) -> None:
    energy = ENERGY_TABLE.read(linked_run[1] / "energy.csv")
    assert np.abs(energy["closure"]).max() < 1e-10
    last = energy.iloc[-1]
    for column in ("internal_J", "joint_spring_J", "joint_damper_J", "strap_J", "external_work_J"):
        assert abs(last[column]) > 1e-6 * last["kinetic_J"], column
    assert abs(last["tie_J"]) < 1e-6 * last["kinetic_J"]
    assert energy["ratio"].between(0.98, 1.02).all()


def test_histories_of_links_say_what_the_links_did(linked_run: tuple[RunSummary, Path]) -> None:
    folder = linked_run[1]
    joints, straps = JOINT_TABLE.read(folder / "joints.csv"), STRAP_TABLE.read(folder / "straps.csv")
    times = np.linspace(0.0, 4e-3, 11)
    for table in (joints, straps, TIE_TABLE.read(folder / "ties.csv")):
        assert np.allclose(table["time_s"], times, rtol=1e-12)
    angle, moment = joints["angle_y_rad"], joints["moment_y_N_m"]
    assert angle.abs().max() > 1e-3
    assert moment.abs().max() > 0.2 * 0.3 * angle.abs().max()
    stretch = straps["length_m"] - straps["natural_length_m"]
    assert (straps["tension_N"][stretch <= 0] == 0).all()
    assert straps["natural_length_m"].iloc[0] - straps["natural_length_m"].iloc[-1] == pytest.approx(5e-4, rel=1e-12)
    sets = RIGID_SET_TABLE.read(folder / "rigid_sets.csv")
    assert sets["rigid_set"].tolist() == ["foot", "head"] * 11
    # the neck's angle is the turn between its bodies
    foot, head = (sets[sets["rigid_set"] == name] for name in ("foot", "head"))
    turn = Rotation.from_quat(foot[["qx", "qy", "qz", "qw"]]).inv() * Rotation.from_quat(head[["qx", "qy", "qz", "qw"]])
    assert np.abs(turn.as_rotvec() - joints[["angle_x_rad", "angle_y_rad", "angle_z_rad"]]).to_numpy().max() < 1e-9


def test_nodes_and_elements_that_were_asked_for_have_histories(linked_run: tuple[RunSummary, Path]) -> None:
    problem, folder = everything(), linked_run[1]
    nodes, elements = (
        NODE_TABLE.read(folder / "node_histories.csv"),
        ELEMENT_TABLE.read(folder / "element_histories.csv"),
    )
    assert nodes["node_id"].tolist() == [3, 40] * 11
    assert np.array_equal(nodes[nodes["node_id"] == 40][["x_m", "y_m", "z_m"]].iloc[0], problem.nodes[39])
    assert elements["element_id"].tolist() == [5] * 11
    assert (elements["volume_ratio"].iloc[0], elements["stress_xx_Pa"].iloc[0]) == (1.0, 0.0)
    assert (
        np.abs(elements["pressure_Pa"] + elements[["stress_xx_Pa", "stress_yy_Pa", "stress_zz_Pa"]].mean(axis=1)).max()
        < 1e-9
    )


@pytest.fixture(scope="module")
def linked_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunSummary, Path]:
    """A run with joints, straps and ties, and its folder."""
    folder, problem = tmp_path_factory.mktemp("linked"), everything()
    return solve(problem, folder, recorders=chosen(problem), progress=None), folder


def chosen(problem: Problem) -> list[Any]:
    return [node_recorder(problem, np.array([2, 39])), element_recorder(problem, np.array([4]))]


def stopping(at: int) -> type:
    """Signals of which SIGTERM comes after some step."""

    class StopAt(run_module.Signals):
        count = 0

        def take(self) -> signal.Signals | None:
            StopAt.count += 1
            return signal.SIGTERM if StopAt.count == at else None

    return StopAt


def test_two_threads_pull_at_joints_straps_and_ties_alike(linked_run: tuple[RunSummary, Path], tmp_path: Path) -> None:
    problem = everything()
    solve(problem, tmp_path, recorders=chosen(problem), threads=2, progress=None)
    assert hashes(tmp_path) == hashes(linked_run[1])


def test_a_full_disk_is_one_message_and_costs_no_earlier_checkpoint(
    layered: Layered, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = layered(end=1e-3)
    store = Checkpoints(tmp_path, identity(problem))
    store.write(1, {"a": np.ones(5)})

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ReplayError, match=r"cannot be written \(No space left on device\)\n.*free disk space"):
        store.write(2, {"a": np.ones(5)})
    with pytest.raises(ReplayError, match=r"states.partial: cannot be written \(No space left on device\)"):
        States(problem, tmp_path, np.ones(len(problem.hexes)), resume_at=None).sync()
    assert [p.name for p in tmp_path.glob("*.checkpoint")] == ["step-000000000001.checkpoint"]
    assert not list(tmp_path.glob(".step*"))


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


def test_what_a_killed_writer_left_is_cleared_away(layered: Layered, tmp_path: Path) -> None:
    store = Checkpoints(tmp_path / "checkpoint", identity(layered(end=1e-3)))
    for end in ("write", "clear"):
        store.write(1, {"a": np.ones(5)})
        (tmp_path / "checkpoint" / ".step-000000000002.checkpoint.x1y2.checkpoint").write_bytes(b"half a fi")
        if end == "write":
            store.write(3, {"a": np.ones(5)})
            assert len(list((tmp_path / "checkpoint").iterdir())) == 2
        else:
            store.clear()
            assert not (tmp_path / "checkpoint").exists()


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
    assert store.damaged == [files[1]]
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


def test_a_progress_line_says_where_the_run_is_and_comes_every_five_seconds_at_most(
    layered: Layered, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter(np.arange(0.0, 1e4, 0.5))
    monkeypatch.setattr(progress_module.time, "monotonic", lambda: float(next(clock)))
    note = io.StringIO()
    run = Integrator(layered(end=2e-3), 1e9)
    progress = progress_module.Progress(note, 2e-3)
    bound = run.forces()
    progress.estimate(run, bound)
    for _ in range(16 * 25):
        dt = 0.4 * run.forces().step_s
        run.kick(dt, drift=True)
        run.drift(dt, run.time_s + dt)
        progress.step(run, bound)
    lines = note.getvalue().splitlines()[1:]
    # 25 looks at the clock, half a second apart
    assert len(lines) == 2
    holder = f"by element {bound.element + 1} ({run.problem.part_of(bound.element).name})"
    for line in lines:
        assert re.search(r"\d+\.\d %  t \d\.\d+ ms  dt \S+ s", line), line
        assert holder in line
        assert re.search(r"energy ratio [01]\.\d+  \d+ (s|min) left", line), line


def test_outputs_fall_on_their_times_to_the_last_bit(layered: Layered, tmp_path: Path) -> None:
    problem = layered(controls=Controls(7e-4, history_interval_s=1e-4, plot_interval_s=3e-4, speed_limit_m_per_s=100,
                                        mass_scaling_time_step_s=0.0))  # fmt: skip
    solve(problem, tmp_path, progress=None)
    times = pd.read_csv(tmp_path / "energy.csv")["time_s"].tolist()
    assert times == [0.0, 1e-4, 2e-4, pytest.approx(3e-4, rel=1e-15), 4e-4, 5e-4, pytest.approx(6e-4, rel=1e-15), 7e-4]
    with read_states(tmp_path / "states.vtkhdf") as states:
        assert np.allclose(states.times_s, [0.0, 3e-4, 6e-4, 7e-4], rtol=1e-15)
