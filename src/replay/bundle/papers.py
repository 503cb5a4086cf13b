"""The papers a bundle carries beside the run's own files: README, machine, and what it is."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from replay.bundle.contents import LeftOut, Run
from replay.bundle.source import Source

_PROGRAMS = ("h5py", "numba", "numpy", "opencv-python-headless", "pandas", "scipy", "snakemake")


def readme_text(run: Run, *, resolution: str, with_play: bool) -> str:
    """Text of the README: the verdict, three commands, and what lies where."""
    play = run.play
    make = [f"make -C again run PLAY={play}"]
    if with_play:
        make.append(f'PLAYS="$PWD/{play}/data/plays"')
    if resolution:
        make.append(f"RESOLUTION={resolution}")
    return f"""# Replay of the play {play}: {run.verdict}

{run.line}

Process outputs and diagnostics of a reproduced motion. No statement on injury.

Verify, look, run again:

    replay verify {play}.zip
    replay show {play}.zip
    replay rerun {play}.zip --into again

The last shows every command and asks before it runs them; then it compares, artifact by artifact.

Without the `replay` program, any machine with unzip, sha256sum, make and Python 3.11 does the same:

    unzip {play}.zip && (cd {play} && sha256sum --quiet -c manifest-sha256.txt)
    mkdir again && tar -xf {play}/data/source/source.tar -C again
    {" ".join(make)}

| where | what |
|---|---|
| `results/` | every stage's files and its manifest: inputs, driver, decks, histories, gates, verdict, report |
| `plays/` | the play as it was described |
| `source/` | the source it ran with (`source.tar`), its commit (`source.json`), what differed from it (`dirty.diff`) |
| `Snakefile`, `workflow/`, `environment.lock` | the workflow, and every dependency with its hash |
| `artifacts.csv` | every file with size, hash, class, stage and unit |
| `bundle.json` | play, verdict, the minimum reproducibility package, and what was left out and why |
| `machine.json` | the machine and the installed versions (differs from machine to machine) |
| `ro-crate-metadata.json` | the run as a Workflow Run RO-Crate: one action a stage |
{_withheld(run)}
`replay compare {play}.zip OTHER.zip` compares two runs: files of class `exact` byte for byte, files of
class `tolerance` number by number. `replay agree {play}.zip OTHER.zip` compares two laboratories' digitisations
of one video.
"""


def _withheld(run: Run) -> str:
    """Say which files are named by hash alone."""
    rows = [f"| `{left.path}` | {left.reason} | `{left.sha256}` |" for left in run.left_out if left.sha256]
    if not rows:
        return ""
    return "\n".join(
        [
            "\nWithheld; whoever has them can check them by their hash:\n",
            "| file | why | sha256 |",
            "|---|---|---|",
            *rows,
            "",
        ]
    )


def bundle_facts(
    run: Run, source: Source, facts: dict[str, tuple[bool, bool]], left_out: Sequence[LeftOut]
) -> dict[str, Any]:
    """Content of ``bundle.json``."""
    return {
        "format": "replay bundle 1",
        "play": run.play,
        "verdict": run.verdict,
        "line": run.line,
        "failures": run.failures,
        "stages": {stage: manifest.status for stage, manifest in run.manifests.items()},
        "minimum_package": {name: {"present": p, "hashed": h} for name, (p, h) in sorted(facts.items())},
        "source": source.to_json(),
        "left_out": [left.to_json() for left in left_out],
    }


def machine_facts() -> dict[str, Any]:
    """Content of ``machine.json``: kind of machine and versions; no host, user or folder."""
    return {
        "system": platform.system(),
        "kernel": platform.release(),
        "machine": platform.machine(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "libc": " ".join(platform.libc_ver()),
        "programs": {name: version_of(name) for name in _PROGRAMS},
    }


def _processor() -> str:
    path = Path("/proc/cpuinfo")
    if not path.is_file():
        return platform.processor()
    lines = (line for line in path.read_text(errors="replace").splitlines() if line.startswith("model name"))
    return next(lines, ":").partition(":")[2].strip()


def version_of(program: str) -> str:
    """Version of an installed distribution, or ``absent``."""
    try:
        return importlib.metadata.version(program)
    except importlib.metadata.PackageNotFoundError:
        return "absent"
