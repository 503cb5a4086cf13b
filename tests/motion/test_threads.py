"""Same clicks, same bytes: for any number of threads that the linear algebra is offered."""

import os
import subprocess
import sys

import pytest

READ_OUT = """
import hashlib
import replay
import numpy as np
from replay.motion.readout import ANGULAR, read_out

rng = np.random.default_rng(7)
time = np.arange(60) / 60.0
level = np.cumsum(np.exp(-((time - 0.5) / 0.02) ** 2))[:, None] * [0.3, -0.2, 0.1] + 0.01 * rng.standard_normal((60, 3))
drawn = read_out(time, level, np.tile(np.eye(3) / 0.01**2, (60, 1, 1)), ANGULAR, rng, draws=50)
print(hashlib.sha256(drawn.rate.tobytes()).hexdigest())
"""


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core offers no second thread")
def test_a_read_out_is_the_same_for_any_number_of_threads():
    def digest(threads: int) -> str:
        offered = {name: str(threads) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        found = subprocess.run(
            [sys.executable, "-c", READ_OUT], env=os.environ | offered, capture_output=True, text=True, check=True
        )
        return found.stdout

    assert digest(1) == digest(2)
