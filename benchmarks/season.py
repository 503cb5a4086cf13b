"""What a play costs in a season, beside the same play alone: many short synthetic plays in one command.

    python benchmarks/season.py 100                                 # on this machine, two cores
    python benchmarks/season.py 100 --profile profiles/slurm        # through Slurm

A copy of the checkout gets a table of so many wearable plays, each with a helmet mass of its own, at `tiny` with a
window of 3 ms. First one of them runs alone, then the whole season. Printed: processor time a play of everything the
command started (Snakemake included, where it runs on this machine), how many plays have a verdict, how many jobs were
run for each rule, and whether a second command finds anything to do. Processor time hardly minds a busy machine; wall
clock does.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
NEEDED = ("Snakefile", "workflow", "profiles", "config", "src", "environment.lock", "pyproject.toml", "CITATION.cff",
          "LICENSE", "README.md")  # fmt: skip


def checkout(root: Path, plays: int) -> Path:
    """Copy what a run needs, with a table of so many plays."""
    root.mkdir(parents=True)
    for name in NEEDED:
        source = REPOSITORY / name
        if source.is_dir():
            shutil.copytree(source, root / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, root / name)
    rows = [f"play_{k:03d}\twearable\t0.003\t{1.70 + 0.2 * k / plays:.4f}" for k in range(plays)]
    head = "play\tbase\twindow.duration_s\thelmet.mass_kg"
    (root / "config/plays.tsv").write_text("\n".join([head, *rows]) + "\n")
    return root


def run(root: Path, arguments: list[str]) -> tuple[float, float, str]:
    """Run the season; processor time of all it started on this machine, wall clock [s], and what it said."""
    environment = {**os.environ, "PYTHONPATH": str(root / "src")}
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    call = ["snakemake", "season", *arguments, "--config", "resolution=tiny"]
    done = subprocess.run(call, cwd=root, env=environment, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    said = done.stdout + done.stderr
    if done.returncode:
        raise SystemExit(said[-4000:])
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, time.monotonic() - began, said


def table(root: Path) -> list[dict[str, str]]:
    """Rows of the season's table."""
    with (root / "results/plays.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def main() -> None:
    """Run one play alone and the season, and print what they cost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plays", type=int)
    parser.add_argument("--profile", help="of Snakemake (default: this machine, two cores)")
    options = parser.parse_args()
    arguments = ["--profile", options.profile] if options.profile else ["--cores", "2"]
    with tempfile.TemporaryDirectory() as folder:
        single, many = checkout(Path(folder) / "one", 1), checkout(Path(folder) / "many", options.plays)
        run(single, arguments)  # compiles what is not compiled, and is thrown away
        shutil.rmtree(single / "results")
        alone, _, _ = run(single, arguments)
        spent, wall, said = run(many, arguments)
        rows = table(many)
        verdicts = Counter(row["verdict"] for row in rows)
        jobs_alone, jobs = (sum(float(row["cpu_s"]) for row in found) / len(found) for found in (table(single), rows))
        ran = Counter(re.findall(r"^ *(?:local)?rule (\w+):$|Finished jobid: \d+ \(Rule: (\w+)\)", said, re.MULTILINE))
        finished = Counter(name for pair in ran.elements() for name in pair[1:] if name)
        again = run(many, [*arguments, "-n"])[2]
    print(f"{len(rows)} plays in {wall:.0f} s: {dict(verdicts)}")
    print(f"jobs finished, each rule: {sorted(set(finished.values()))}; again: {'Nothing to be done' in again}")
    print(f"everything on this machine, a play: {spent / len(rows):.1f} s, alone {alone:.1f} s: "
          f"{spent / len(rows) / alone:.2f}")  # fmt: skip
    print(f"its jobs by Snakemake's own account: {jobs:.1f} s, alone {jobs_alone:.1f} s: {jobs / jobs_alone:.2f}")


if __name__ == "__main__":
    main()
