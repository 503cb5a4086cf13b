"""The batch script beside a deck."""

from __future__ import annotations

from pathlib import Path

from replay.files import write_text

NAME = "submit.slurm.sh"


def write_submit(folder: Path, job: str, command: str, cores: int = 16, hours: int = 12) -> Path:
    """Write ``submit.slurm.sh``; ``sbatch submit.slurm.sh`` in its folder starts the run (step 3.7).

    Parameters
    ----------
    folder
        The deck's folder.
    job
        Name of the job.
    command
        The solver's command lines.
    cores, hours
        What is asked for.
    """
    lines = (
        "#!/bin/bash",
        f"#SBATCH --job-name={job}",
        "#SBATCH --nodes=1",
        f"#SBATCH --ntasks={cores}",
        f"#SBATCH --time={hours:02d}:00:00",
        "#SBATCH --output=slurm-%j.out",
        "set -euo pipefail",
        'cd "$SLURM_SUBMIT_DIR"',
        command,
    )
    path = folder / NAME
    write_text(path, "\n".join(lines) + "\n")
    return path
