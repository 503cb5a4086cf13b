"""What a run pays before its first step: the compiler once, and every start after it.

    python benchmarks/start_up.py

A tiny model with one part of every law is run for two steps in a fresh process: first with an empty folder of compiled
kernels (cold), then again (warm). Both count the interpreter, the imports and the steps.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ONE_STEP = """
from element_cycles import MATERIALS, block, steps
for law in MATERIALS:
    steps(block(law, 4), 2)
"""


def seconds(cache: str) -> float:
    """Wall clock of one fresh process [s]."""
    began = time.perf_counter()
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONPATH": str(Path(__file__).parent)}
    subprocess.run([sys.executable, "-c", ONE_STEP], env=environment, check=True)
    return time.perf_counter() - began


def main() -> None:
    """Print both times."""
    with tempfile.TemporaryDirectory() as cache:
        cold, warm = seconds(cache), min(seconds(cache) for _ in range(3))
    print(f"all laws of element_cycles.py: cold {cold:.1f} s, warm {warm:.2f} s")


if __name__ == "__main__":
    main()
