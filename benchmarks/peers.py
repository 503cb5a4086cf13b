"""Other explicit solvers on the same mesh, as they come from their own packages; skipped with a reason where absent.

    python benchmarks/peers.py [elements along an edge]

Akantu (``pip install akantu``) integrates its hexahedron fully, eight points an element; CalculiX (``ccx``, from a
distribution's packages) runs its reduced hexahedron C3D8R. Both run one elastic cube on one thread in double
precision, with nothing written. Set-up is not counted: each is timed over two numbers of steps.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from replay.solver.blocks import structured_block

YOUNG_PA, POISSON, DENSITY_KG_PER_M3, EDGE_M = 1e6, 0.3, 1000.0, 0.01
ONE_THREAD = {**os.environ, "OMP_NUM_THREADS": "1", "CCX_NPROC_EQUATION_SOLVER": "1"}

AKANTU = """
import sys, time
import akantu as aka
import numpy as np
data = np.load(sys.argv[1])
aka.parseInput(sys.argv[2])
mesh = aka.Mesh(3)
door = aka.MeshAccessor(mesh)
kind = aka._hexahedron_8
door.resizeNodes(len(data["nodes"]))
door.resizeConnectivity(len(data["hexes"]), kind)
mesh.getNodes()[:] = data["nodes"]
mesh.getConnectivity(kind)[:] = data["hexes"]
door.makeReady()
model = aka.SolidMechanicsModel(mesh)
model.initFull(_analysis_method=aka._explicit_lumped_mass)
model.setTimeStep(0.8 * model.getStableTimeStep())
model.getVelocity()[:] = data["velocity"]
model.solveStep()
began = time.perf_counter()
for _ in range(int(sys.argv[3])):
    model.solveStep()
print("seconds", time.perf_counter() - began)
"""


def akantu_rate(n: int) -> float | str:
    """Million element cycles per second of Akantu, or why there is no number."""
    if importlib.util.find_spec("akantu") is None:
        return "not installed (pip install akantu)"
    nodes, hexes = structured_block((n, n, n), (EDGE_M * n,) * 3)
    steps = max(200_000 // n**3, 3)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        velocity = 0.2 * np.sin(30.0 * nodes[:, [1, 2, 0]])
        np.savez(folder / "mesh.npz", nodes=nodes, hexes=hexes, velocity=velocity)
        law = f"name = m\n rho = {DENSITY_KG_PER_M3}\n E = {YOUNG_PA}\n nu = {POISSON}\n finite_deformation = 1"
        (folder / "material.dat").write_text(f"material elastic [\n {law}\n]\n", encoding="utf-8")
        (folder / "run.py").write_text(AKANTU, encoding="utf-8")
        command = [sys.executable, "run.py", "mesh.npz", "material.dat", str(steps)]
        done = subprocess.run(command, cwd=folder, env=ONE_THREAD, capture_output=True, text=True, check=False)
    said = [line.split() for line in done.stdout.splitlines() if line.startswith("seconds")]
    return n**3 * steps / float(said[0][1]) / 1e6 if said else f"failed: {done.stderr.strip()[-200:]}"


def _calculix_step() -> float:
    """About what CalculiX chooses [s]; what it really chose is read from what it says."""
    return float(0.38 * EDGE_M / np.sqrt(YOUNG_PA * 1.346 / DENSITY_KG_PER_M3))


def _calculix_deck(n: int, steps: int) -> str:
    nodes, hexes = structured_block((n, n, n), (EDGE_M * n,) * 3)
    step = _calculix_step()
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k},{x:.9g},{y:.9g},{z:.9g}" for k, (x, y, z) in enumerate(nodes, 1)]
    lines += ["*ELEMENT, TYPE=C3D8R, ELSET=CUBE"]
    lines += [f"{k}," + ",".join(map(str, corners)) for k, corners in enumerate(hexes + 1, 1)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{YOUNG_PA},{POISSON}", "*DENSITY", f"{DENSITY_KG_PER_M3}"]
    lines += ["*SOLID SECTION, ELSET=CUBE, MATERIAL=M", "*INITIAL CONDITIONS, TYPE=VELOCITY", "ALL,1,0.1"]
    lines += [f"*STEP, NLGEOM, INC={10 * steps}", "*DYNAMIC, EXPLICIT", f"{step:.6g},{step * steps:.6g}"]
    return "\n".join([*lines, "*END STEP", ""])


def calculix_rate(n: int) -> float | str:
    """Million element cycles per second of CalculiX, or why there is no number."""
    if shutil.which("ccx") is None:
        return "not installed (Debian: calculix-ccx)"
    seconds, cycles = [], []
    for steps in (2, 2 + max(100_000 // n**3, 3)):
        with tempfile.TemporaryDirectory() as name:
            Path(name, "cube.inp").write_text(_calculix_deck(n, steps), encoding="utf-8")
            began = time.perf_counter()
            done = subprocess.run(
                ["ccx", "cube"], cwd=name, env=ONE_THREAD, capture_output=True, text=True, check=False
            )
            seconds.append(time.perf_counter() - began)
        if "Job finished" not in done.stdout:
            return f"failed: {done.stdout.strip()[-200:]}"
        chosen = re.search(r"SELECTED time increment:(\S+)", done.stdout)
        assert chosen
        cycles.append(n**3 * steps * _calculix_step() / float(chosen[1]))
    return (cycles[1] - cycles[0]) / (seconds[1] - seconds[0]) / 1e6


def main() -> None:
    """Print one line a peer."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 32
    for name, rate in (("Akantu", akantu_rate), ("CalculiX", calculix_rate)):
        answer = rate(n)
        print(f"{name:>10}: " + (answer if isinstance(answer, str) else f"{answer:.3f} M element cycles/s"))


if __name__ == "__main__":
    main()
