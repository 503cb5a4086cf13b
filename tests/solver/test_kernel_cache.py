"""Compiled kernels on disk: jobs that start at one moment, other CPUs, folders that cannot be written, spoilt files."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from replay.solver.kernels.cache import KernelFiles

RUN = """
import sys, tempfile
import numpy as np
from replay.solver import Controls, Material, Problem, SolverPart, solve
from replay.solver.blocks import structured_block
nodes, hexes = structured_block((4, 2, 2), (0.004, 0.002, 0.002))
rubber = Material("rubber", "elastic", 1000.0, {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3})
problem = Problem(nodes, hexes, np.zeros(len(hexes), int), (SolverPart(1, "block", rubber),),
                  controls=Controls(1e-4, history_interval_s=1e-5, plot_interval_s=1e-4),
                  initial_velocity=np.sin(900.0 * nodes))
with tempfile.TemporaryDirectory() as folder:
    print(solve(problem, folder, threads=1, progress=None).state_hash)
"""
TWO_KINDS = """
import numpy as np
from replay.solver.kernels.cache import cache_folder
from replay.solver.kernels.device import compiled
def doubled(values):
    return values + values
doubled = compiled(doubled)
print(doubled(np.ones(3, np.KIND)).dtype, *(p.name for p in sorted(cache_folder().glob("*doubled*"))))
"""


def start(script: str, folder: Path, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", script],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def said(process: subprocess.Popen[str]) -> str:
    output, errors = process.communicate(timeout=600)
    assert process.returncode == 0, errors
    return output.strip()


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_two_cold_starts_with_one_empty_cache_are_both_right_and_leave_a_whole_one(tmp_path: Path) -> None:
    both = [start(RUN, tmp_path) for _ in range(2)]
    first, second = (said(process) for process in both)
    made = files(tmp_path)
    assert first == second
    assert made
    assert not [name for name in made if name.startswith(".")], "a temporary file was left behind"
    assert said(start(RUN, tmp_path)) == first
    assert files(tmp_path) == made, "a warm start compiled something again"


def test_versions_compiled_at_the_same_moment_for_two_kinds_of_number_keep_a_file_each(tmp_path: Path) -> None:
    both = [start(TWO_KINDS.replace("KIND", kind), tmp_path) for kind in ("float32", "float64")]
    assert [said(process).split()[0] for process in both] == ["float32", "float64"]
    for kind in ("float32", "float64"):
        shown = said(start(TWO_KINDS.replace("KIND", kind), tmp_path)).split()
        assert shown[0] == kind
        assert len(shown) == 3


def test_code_of_another_cpu_is_left_alone_and_not_run(tmp_path: Path) -> None:
    script = TWO_KINDS.replace("KIND", "float64")
    said(start(script, tmp_path))
    mine = files(tmp_path)
    shown = said(start(script, tmp_path, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES=""))
    assert len(shown.split()) == 3, "the other CPU was given this one's code"
    assert {name: data for name, data in files(tmp_path).items() if name in mine} == mine


def test_a_folder_that_cannot_be_written_costs_a_compilation_and_nothing_else(tmp_path: Path) -> None:
    wall = tmp_path / "a file where the folder should be"
    wall.write_text("")
    assert said(start(TWO_KINDS.replace("KIND", "float64"), wall)) == "float64"


def test_a_read_only_cache_still_serves_what_it_has(tmp_path: Path) -> None:
    script = TWO_KINDS.replace("KIND", "float64")
    said(start(script, tmp_path))
    before = files(tmp_path)
    paths = [tmp_path, *tmp_path.rglob("*")]
    for path in paths:
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        assert said(start(script, tmp_path)).startswith("float64")
        assert said(start(script.replace("float64", "float32"), tmp_path)).startswith("float32")
    finally:
        for path in paths:
            path.chmod(0o755 if path.is_dir() else 0o644)
    if os.getuid() != 0:  # root writes where it likes
        assert files(tmp_path) == before


def test_a_home_that_cannot_be_written_sends_the_kernels_to_a_folder_of_ones_own(tmp_path: Path) -> None:
    wall = tmp_path / "no home"
    wall.write_text("")
    script = (
        "from replay.solver.kernels.cache import cache_folder as f; p = f().parent; print(p, oct(p.stat().st_mode))"
    )
    found = said(start(script, Path(), NUMBA_CACHE_DIR="", XDG_CACHE_HOME=str(wall), TMPDIR=str(tmp_path)))
    assert found == f"{tmp_path}/replay-{os.getuid()} 0o40700"


def test_a_temporary_folder_that_others_can_write_is_not_trusted_with_code(tmp_path: Path) -> None:
    wall, theirs = tmp_path / "no home", tmp_path / f"replay-{os.getuid()}"
    wall.write_text("")
    theirs.mkdir()
    theirs.chmod(0o777)
    script = "from replay.solver.kernels.cache import cache_folder; print(cache_folder().parent)"
    found = said(start(script, Path(), NUMBA_CACHE_DIR="", XDG_CACHE_HOME=str(wall), TMPDIR=str(tmp_path)))
    assert found != str(theirs)
    assert found.startswith(str(tmp_path))


def test_a_spoilt_or_foreign_file_is_as_good_as_none(tmp_path: Path) -> None:
    kept = KernelFiles(tmp_path, "kernel")
    kept.save("mine", [1, 2, 3])
    assert kept.load("mine") == [1, 2, 3]
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    for broken in (b"", whole[:-5], b"not a pickle"):
        path.write_bytes(broken)
        assert kept.load("mine") is None
    path.write_bytes(whole.replace(b"mine", b"ours"))
    assert kept.load("mine") is None
