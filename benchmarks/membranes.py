"""What falx, tentorium and an open foramen magnum do to the brain's strain: the table of docs/model.md, made again.

    python benchmarks/membranes.py                        # the demo's bare head at coarse, seven runs of 30 ms
    python benchmarks/membranes.py --resolution tiny --duration 0.005

Printed by region: the largest 95th percentile over time of the maximum principal Green-Lagrange strain, and by how much
each of the other models changes it; then the same of the tensile pressure.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import pandas as pd

from replay.measures import regional_summary
from replay.models import build_model
from replay.motion import Kinematics, build_driver, reconstruct
from replay.play import Play, load_play
from replay.solver import solve
from replay.stages.impact import brain_recorder
from replay.stages.problem import controls_of, driven_problem

PLAY = Path(__file__).resolve().parents[1] / "config" / "plays" / "demo"
# Name, law of the brain, which membranes, outlet; the first of each law is what the others are compared with.
RUNS = (
    ("visco-elastic", "viscohyperelastic", (), "closed"),
    ("falx", "viscohyperelastic", ("falx",), "closed"),
    ("tentorium", "viscohyperelastic", ("tentorium",), "closed"),
    ("both", "viscohyperelastic", ("falx", "tentorium"), "closed"),
    ("outlet", "viscohyperelastic", (), "open"),
    ("brain_isv", "brain_isv", (), "closed"),
    ("both, brain_isv", "brain_isv", ("falx", "tentorium"), "closed"),
)
TOLD = {"mps_green_lagrange_p95": "strain", "tensile_pressure_p95_Pa": "tensile pressure, Pa"}


def driver_of(play: Play) -> Kinematics:
    """The play's motion as a replay is told it."""
    motion, t0 = reconstruct(play).driving
    return build_driver(motion, t0, play.window).motion


def peaks(
    play: Play, driver: Kinematics, resolution: str, law: str, sheets: tuple[str, ...], outlet: str
) -> dict[str, dict]:
    """Peaks by region of one replay of the bare head."""
    model = build_model(
        play.model.preset, resolution, helmet=False, brain=law, membranes="cables" if sheets else "none", outlet=outlet
    )
    controls = controls_of(play, play.window.duration_s, checkpoint_every_s=0.0)
    problem = driven_problem(model, driver, controls, play.solver.contact)
    kept = tuple(strap for strap in problem.straps if strap.name.rpartition("_")[0] in sheets)
    with tempfile.TemporaryDirectory() as folder:
        solve(replace(problem, straps=kept), Path(folder), recorders=[brain_recorder(model)], progress=None)
        return regional_summary(pd.read_csv(Path(folder) / "brain_histories.csv"))


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--resolution", default="coarse", choices=["tiny", "coarse", "medium", "fine"])
    parser.add_argument("--duration", type=float, default=0.030, help="length of each run [s]")
    asked = parser.parse_args()
    play = load_play(PLAY)
    play = play.model_copy(update={"window": play.window.model_copy(update={"duration_s": asked.duration})})
    driver, found = driver_of(play), {}
    for name, law, sheets, outlet in RUNS:
        found[name] = peaks(play, driver, asked.resolution, law, sheets, outlet)
        print(f"{name}: done", flush=True)
    for key, words in TOLD.items():
        print(f"\n| {words} | {' | '.join(found)} |\n|---|{'---:|' * len(found)}")
        least = 1e-3 * max(entry[key] or 0.0 for entry in found["visco-elastic"].values())
        for region in found["visco-elastic"]:
            cells, reference = [], 0.0
            for name, _, sheets, outlet in RUNS:
                value = found[name][region][key] or 0.0
                if not sheets and outlet == "closed":
                    reference = value
                    cells.append(f"{value:.4g}")
                else:
                    cells.append(f"{100 * (value / reference - 1):+.0f} %" if reference > least else "none")
            print(f"| {region} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
