"""What this core could do at best: its arithmetic and its memory, and how near a kernel comes.

    python benchmarks/roofline.py [elements along an edge]

Arithmetic is multiplication and addition in separate instructions, as the solver's (fused ones differ in the
last bit between kinds of CPU, and are off). A kernel's operations are counted in its machine code, where the lane
loop is one straight line; its bytes are what it must move once: every array of the run read or written, each node once.
"""

from __future__ import annotations

import re
import sys
import time
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from element_cycles import MATERIALS, best_rate, block, steps

from replay.solver.elements import ElementGroup, law_kernel
from replay.solver.integrator import Integrator

#: Values in the fast cache that the arithmetic runs over, and pairs of operations on each.
VALUES = 256
LINKS = 16


@dataclass(frozen=True)
class Machine:
    """One core.

    Parameters
    ----------
    flops_per_s
        Multiplications and additions in double precision [1/s].
    bytes_per_s
        Moved by ``a = b + s c`` on arrays beyond every cache but the last [1/s]; a write counts twice, for its
        line is read first.
    """

    flops_per_s: float
    bytes_per_s: float


@numba.njit(forceinline=True, error_model="numpy")
def _four_links(v: float) -> float:
    v = v * 0.999999 + 1e-9
    v = v * 0.999998 + 1e-9
    v = v * 0.999997 + 1e-9
    return v * 0.999996 + 1e-9


@numba.njit(error_model="numpy")
def _multiply_and_add(x: Any, rounds: int) -> None:
    for _ in range(rounds):
        for k in range(x.shape[0]):
            x[k] = _four_links(_four_links(_four_links(_four_links(x[k]))))


@numba.njit(error_model="numpy")
def _triad(a: Any, b: Any, c: Any, s: float) -> None:
    for k in range(a.shape[0]):
        a[k] = b[k] + s * c[k]


def _best(call: Any, work: float, rounds: int = 7) -> float:
    call()
    seconds = []
    for _ in range(rounds):
        began = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - began)
    return work / min(seconds)


def measure_machine() -> Machine:
    """Measure one core, now."""
    x = np.ones(VALUES)
    flops = _best(lambda: _multiply_and_add(x, 2000), 2.0 * 2000 * LINKS * VALUES)
    a, b, c = (np.ones(8_000_000) for _ in range(3))
    return Machine(flops, _best(lambda: _triad(a, b, c, 0.5), 4.0 * a.nbytes))


def operations(group: ElementGroup, nodal: np.ndarray) -> float:
    """Floating-point operations of one element, counted in the machine code of its lane loop."""
    arguments = group.kernel_arguments(nodal, 0.0)
    _, connectivity, place, _, _, _, *fields = arguments
    mass, reference, stress, hourglass, state, parameters, *rest = fields
    run_block = law_kernel(group.group.law).py_func.__globals__["run_block"]
    whole = (
        0, 1, 0, nodal, connectivity, place, mass, reference, stress, hourglass, state, parameters, 0, *rest,
    )  # fmt: skip
    run_block.compile(tuple(numba.typeof(a) for a in whole))
    text = next(iter(run_block.inspect_asm().values()))
    return float(len(re.findall(r"\bv(?:add|sub|mul|div|sqrt|max|min)pd\b", text)))


def bytes_moved(run: Integrator) -> float:
    """Bytes that a step must move per element: read and written once, a line written is read first."""
    group = run.groups[0]
    arguments = group.kernel_arguments(run.nodal, 0.0)
    _, connectivity, place, *_, force, step, work = arguments
    mass, reference, stress, hourglass, state = arguments[6:11]
    read = sum(a.nbytes for a in (connectivity, place, mass, reference))
    kept = sum(2 * a.nbytes for a in (stress, hourglass, state, step, work))
    nodes = run.nodal.nbytes * 3 + run.mass.nbytes * 8  # gathered, kicked; mass, inverse mass, load, slots
    return (read + kept + 3 * force.nbytes + nodes) / len(run.problem.hexes)


def main() -> None:
    """Print the table of all laws."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    numba.set_num_threads(1)
    machine = measure_machine()
    print(f"one core: {machine.flops_per_s / 1e9:.1f} Gflop/s, {machine.bytes_per_s / 1e9:.1f} GB/s; {n**3} elements")
    print(f"{'law':>20} {'flops':>7} {'bytes':>7} {'M/s':>7} {'arithmetic':>11} {'memory':>8} {'of the roof':>12}")
    for law in MATERIALS:
        run = block(law, n)
        rate = best_rate(lambda count, run=run: steps(run, count), n**3)
        flops, moved = operations(run.groups[0], run.nodal), bytes_moved(run)
        roofs = machine.flops_per_s / flops / 1e6, machine.bytes_per_s / moved / 1e6
        share = rate / min(roofs)
        print(f"{law:>20} {flops:7.0f} {moved:7.0f} {rate:7.2f} {roofs[0]:11.1f} {roofs[1]:8.1f} {share:12.2f}")


if __name__ == "__main__":
    main()
