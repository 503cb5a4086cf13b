"""``replay rerun``: make a bundle again from itself alone, and compare what comes out with what was sealed."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.bundle import SealedRun, compare, foreign_content, open_run, shown, verify
from replay.bundle.unpack import find_withheld, source_files, unpack_play, unpack_source
from replay.errors import BundleError, InputError, ReplayError

_PLAY = re.compile(r"[a-z0-9_][a-z0-9_-]*")
_RESOLUTION = re.compile(r"[a-z]+")
# Of this process's environment, what the run again may see: nothing that names another Python or another source.
_HIDDEN = ("PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP", "VIRTUAL_ENV", "CONDA_PREFIX")


@dataclass(frozen=True)
class Plan:
    """What a run again will do.

    Parameters
    ----------
    play
        Name of the play.
    root
        Where the source goes; the commands run there.
    environment
        The Python environment.
    prepare, run
        Commands that make the environment, and the one that runs the workflow.
    result
        The bundle that comes out.
    """

    play: str
    root: Path
    environment: Path
    prepare: tuple[tuple[str, ...], ...]
    run: tuple[str, ...]
    result: Path

    def text(self) -> str:
        """List the commands as they could be typed."""
        commands = [shlex.join(command) for command in (*self.prepare, self.run)]
        return "\n".join([f"  in {self.root}:", *(f"    {command}" for command in commands)])


def rerun(
    bundle: Path,
    into: Path,
    *,
    yes: bool = False,
    environment: Path | None = None,
    withheld: Path | None = None,
    cores: int | None = None,
) -> int:
    """Unpack a bundle's source and play, install its locked environment, run its workflow, compare the results.

    Parameters
    ----------
    bundle
        Archive or unpacked bundle; it is verified first.
    into
        New folder for all of it.
    yes
        Do not ask.
    environment
        A Python environment to use as it is, instead of installing the one that the lock names.
    withheld
        Folder with the files that the bundle names by hash alone.
    cores
        For the workflow; all by default.

    Returns
    -------
    int
        0 when the runs agree, 1 when they do not or the answer was no.

    Raises
    ------
    BundleError
        When the bundle does not verify or its source snapshot is unsafe; nothing was written then.
    InputError
        When the folder is not empty, or a withheld file is missing.
    ReplayError
        When a command fails.
    """
    if into.exists() and (not into.is_dir() or any(into.iterdir())):
        raise InputError(into, "the folder is not empty", mend="name a new folder")
    report = verify(bundle)
    with foreign_content(bundle), open_run(bundle) as run:
        plan = _plan(run, into.resolve(), environment, cores)
        supplied = find_withheld(run, plan.play, withheld)
        print(report.text())
        print("\n".join(shown(line) for line in _origin(run)))
        print(f"this runs code that came with the bundle:\n{plan.text()}")
        if not (yes or _consent()):
            print("nothing was done")
            return 1
        unpack_source(run, plan.root)
        unpack_play(run, plan.play, into / "plays", supplied)
    _execute(plan)
    comparison = compare(bundle, plan.result)
    print(f"\n{bundle} against {plan.result}")
    print(comparison.text())
    return 0 if comparison.agree else 1


def _plan(run: SealedRun, into: Path, environment: Path | None, cores: int | None) -> Plan:
    facts = run.json("bundle.json") or {}
    play, settings = str(facts.get("play", "")), run.json("results/settings/play.json") or {}
    resolution = str(settings.get("model", {}).get("resolution", ""))
    if not _PLAY.fullmatch(play) or not (resolution == "" or _RESOLUTION.fullmatch(resolution)):
        message = f"{run.path.name}: play {shown(play)!r} at {shown(resolution)!r} is no name that a command may hold"
        raise BundleError(message)
    files = set(source_files(run))
    missing = [name for name in ("Snakefile", "environment.lock", "pyproject.toml") if name not in files]
    described = any(name.startswith(f"plays/{play}/") for name in run.files)
    if missing or not described:
        what = f"its source lacks {', '.join(missing)}" if missing else "it lacks the play as it was described"
        message = f"{run.path.name}: cannot be run again: {what}"
        raise BundleError(message)
    if elsewhere := _tracks_elsewhere(run, facts, play):
        names = ", ".join(map(shown, elsewhere))
        message = (
            f"{run.path.name}: cannot be run again: the play names {names} outside its own folder\n"
            "    mend: ask for a bundle of the play with its tracks beside play.yaml"
        )
        raise BundleError(message)
    root = into / "source"
    prepare: tuple[tuple[str, ...], ...] = ()
    if environment is None:
        environment = root / ".venv"
        prepare = _installation()
    python = environment.resolve() / "bin" / "python"
    if not prepare and not python.is_file():
        raise InputError(
            environment, "is no Python environment: it has no bin/python", mend="name a virtual environment"
        )
    config = ["plays_folder=../plays", "table=", *([f"resolution={resolution}"] if resolution else [])]
    target = f"results/{play}/bundle/{play}.zip"
    command = (str(python), "-m", "snakemake", target, "--cores", str(cores or "all"), "--config", *config)
    return Plan(play, root, python.parents[1], prepare, command, root / target)


def _tracks_elsewhere(run: SealedRun, facts: dict[str, Any], play: str) -> list[str]:
    """Tracks that the play took from outside its folder: the description would not find them again."""
    described = [*run.files, *(entry["path"] for entry in facts.get("left_out", []))]
    beside = {name.rpartition("/")[2] for name in described if name.startswith(f"plays/{play}/")}
    inputs = run.json("results/inputs/inputs.json") or {}
    return [entry["file"] for entry in inputs.get("files", []) if entry["file"] not in beside]


def _installation() -> tuple[tuple[str, ...], ...]:
    """Commands that make the locked environment: those of the project's own Makefile."""
    python = ".venv/bin/python"
    if uv := shutil.which("uv"):
        install = (uv, "pip", "install", "--quiet", "--python", python)
        make: tuple[str, ...] = (uv, "venv", "--quiet", "--python", sys.executable, ".venv")
    else:
        install = (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
        make = (sys.executable, "-m", "venv", ".venv")
    return (
        make,
        (*install, "--require-hashes", "-r", "environment.lock"),
        (*install, "--no-deps", "--no-build-isolation", "-e", "."),
    )


def _origin(run: SealedRun) -> Sequence[str]:
    """Where the bundle was made, and what of that may keep the bytes from being the same here."""
    source = (run.json("bundle.json") or {}).get("source", {})
    commit = source.get("commit")
    changed = ", with changes that no commit holds" if source.get("dirty") else ""
    lines = [f"source: commit {commit[:12]}{changed}" if commit else "source: a snapshot, of no commit that is known"]
    machine = run.json("machine.json") or {}
    lines.append(f"made on: {machine.get('processor')}, Python {machine.get('python')}")
    here = ".".join(map(str, sys.version_info[:2]))
    if not str(machine.get("python", here)).startswith(f"{here}."):
        lines.append(f"this is Python {here}: the bytes of class exact are promised for one version and machine type")
    return lines


def _consent() -> bool:
    try:
        return input("go on? [y/N] ").strip().lower() in ("y", "yes")
    except EOFError:
        message = "nobody is here to ask\n    mend: read the commands above, then add --yes"
        raise ReplayError(message) from None


def _execute(plan: Plan) -> None:
    environment = {name: value for name, value in os.environ.items() if name not in _HIDDEN}
    environment["PATH"] = f"{plan.environment / 'bin'}{os.pathsep}{environment.get('PATH', os.defpath)}"
    # Before whatever replay an environment of one's own may hold.
    environment["PYTHONPATH"] = str(plan.root / "src")
    environment["PYTHONNOUSERSITE"] = "1"
    for command in (*plan.prepare, plan.run):
        print(f"\n$ {shlex.join(command)}", flush=True)
        try:
            code = subprocess.run(command, cwd=plan.root, env=environment, check=False).returncode
        except OSError as error:
            raise _failure(command, str(error)) from None
        if code:
            raise _failure(command, f"ended with exit code {code}")


def _failure(command: Sequence[str], why: Any) -> ReplayError:
    return ReplayError(
        f"{shlex.join(command)}: {why}\n    mend: what it printed says more; the folder is left as it is"
    )
