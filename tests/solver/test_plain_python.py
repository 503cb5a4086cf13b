"""The kernels are plain Python: without the compiler they run, and give the very same bits."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from linked import everything
from numba.core import config

from replay.solver import Problem
from replay.solver.integrator import Integrator
from replay.solver.run import state_hash

_STEPS = 3
CHILD = f"""
import pickle, sys
from pathlib import Path
from numba.core import config
from replay.solver.integrator import Integrator
from replay.solver.run import state_hash
assert config.DISABLE_JIT
run = Integrator(pickle.loads(Path(sys.argv[1]).read_bytes()), 1e9)
for _ in range({_STEPS}):
    dt = 0.9 * run.forces().step_s
    run.kick(dt, drift=True)
    run.drift(dt, run.time_s + dt)
print(state_hash(run))
"""


def march(problem: Problem) -> Integrator:
    """Some steps of a bare loop, as the child takes them."""
    run = Integrator(problem, 1e9)
    for _ in range(_STEPS):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=True)
        run.drift(dt, run.time_s + dt)
    return run


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="there is nothing to compare without the compiler")
@pytest.mark.parametrize("kind", ["all laws", "joints, straps and ties"])
def test_all_laws_and_links_give_the_same_bits_without_the_compiler(
    layered: Callable[..., Problem], tmp_path: Path, kind: str
) -> None:
    problem = layered(end=1e-3, counts=(12, 1, 1)) if kind == "all laws" else everything()
    run = march(problem)
    pickled = tmp_path / "problem.pickle"
    pickled.write_bytes(pickle.dumps(problem))
    child = subprocess.run(
        [sys.executable, "-c", CHILD, str(pickled)], env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    assert child.stdout.strip() == state_hash(run)
