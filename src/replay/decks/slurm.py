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


def write_own_submit(folder: Path, play: str, *, threads: int, memory_mb: int, minutes: int) -> Path:
    """Write ``submit.slurm.sh`` for this program's own solver, outside Snakemake.

    A minute before its limit the solver saves its state and the job goes back into the queue, where it goes on.

    Parameters
    ----------
    folder
        ``results/<play>/decks/replay``; the script finds the checkout from there.
    play
        Name of the play.
    threads, memory_mb, minutes
        What is asked for.
    """
    lines = (
        "#!/bin/bash",
        "# The replay of one play by this program's own solver: `sbatch submit.slurm.sh` in this folder.",
        f"#SBATCH --job-name=replay-{play}",
        "#SBATCH --nodes=1",
        "#SBATCH --ntasks=1",
        f"#SBATCH --cpus-per-task={threads}",
        f"#SBATCH --mem={memory_mb}M",
        f"#SBATCH --time={minutes}",
        "#SBATCH --signal=TERM@60",
        "#SBATCH --requeue",
        "#SBATCH --open-mode=append",
        "#SBATCH --output=slurm-%j.out",
        "set -uo pipefail",
        'cd "$SLURM_SUBMIT_DIR/../../../.."',
        'export PATH="$PWD/.venv/bin:$PATH"',
        f'srun --cpus-per-task="$SLURM_CPUS_PER_TASK" replay impact {play} --threads "$SLURM_CPUS_PER_TASK" --carry-on',
        "code=$?",
        "# 143: the solver saved its state on the signal above; the same job goes on from it",
        'if [ "$code" -eq 143 ]; then scontrol requeue "$SLURM_JOB_ID"; fi',
        'exit "$code"',
    )
    path = folder / NAME
    write_text(path, "\n".join(lines) + "\n")
    return path
