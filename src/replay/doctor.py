"""``replay doctor``: is this machine and environment fit for a run? One line each, with the mend."""

from __future__ import annotations

import fcntl
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from replay.play import estimate

_NEEDED_DISK_GB = 5.0
_NEEDED_MEMORY_GB = 4.0
_THREE_LOOKS_S = 60
_PIN = re.compile(r"^(?P<name>[A-Za-z0-9_.\-]+)==(?P<version>[^\s;\\]+)(?:\s*;\s*(?P<marker>[^\\]+?))?\s*\\?$")


@dataclass(frozen=True)
class Finding:
    """One line of the examination."""

    what: str
    ok: bool
    found: str
    mend: str = ""

    def line(self) -> str:
        """The finding as printed."""
        mark = "ok  " if self.ok else "MEND"
        return f"{mark} {self.what:<12} {self.found}" + (f"  ->  {self.mend}" if not self.ok and self.mend else "")


def examine(root: Path | None = None, *, on_a_node: bool = False) -> int:
    """Print every finding.

    Parameters
    ----------
    root
        The checkout; by default the current folder.
    on_a_node
        Also submit a job of a minute that examines a compute node, and print what it finds.

    Returns
    -------
    int
        0 when everything is fit, 1 when something needs mending.
    """
    findings = []
    for finding in _findings(root or Path.cwd(), on_a_node=on_a_node):
        print(finding.line(), flush=True)
        findings.append(finding)
    return 0 if all(finding.ok for finding in findings) else 1


def _findings(root: Path, *, on_a_node: bool) -> Iterator[Finding]:
    version = ".".join(map(str, sys.version_info[:3]))
    yield Finding("python", sys.version_info >= (3, 11), version, "use Python 3.11 or later")
    yield lock_finding(root / "environment.lock")
    yield Finding("threads", True, f"{len(os.sched_getaffinity(0))} available to this process")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    yield Finding("memory", memory >= _NEEDED_MEMORY_GB, f"{memory:.0f} GB", f"{_NEEDED_MEMORY_GB:.0f} GB are needed")
    free = shutil.disk_usage(root).free / 1e9
    yield Finding("disk", free >= _NEEDED_DISK_GB, f"{free:.0f} GB free", f"free at least {_NEEDED_DISK_GB:.0f} GB")
    results = root / "results" if (root / "results").is_dir() else root
    yield _writable("results", results)
    yield _locks(results)
    yield _kernels(root)
    yield _gpu()
    if not shutil.which("sbatch"):
        yield Finding("slurm", not on_a_node, "none: runs on this machine", "log in where sbatch is found")
        return
    if job := os.environ.get("SLURM_JOB_ID"):
        yield Finding("slurm", True, f"inside job {job}")
        return
    yield from slurm_findings()
    if on_a_node:
        yield _node(root)


def lock_finding(lock: Path) -> Finding:
    """Compare the installed versions with the lock.

    Parameters
    ----------
    lock
        Requirements file with pinned versions.
    """
    from packaging.markers import Marker

    if not lock.is_file():
        return Finding("environment", False, f"{lock.name} is not here", "run from the root of the checkout")
    pins, wrong = 0, []
    for line in lock.read_text(encoding="utf-8").splitlines():
        match = _PIN.match(line.strip())
        if not match or (match["marker"] and not Marker(match["marker"]).evaluate()):
            continue
        pins += 1
        try:
            installed = importlib.metadata.version(match["name"])
        except importlib.metadata.PackageNotFoundError:
            installed = "nothing"
        if installed != match["version"]:
            wrong.append(f"{match['name']} {installed} instead of {match['version']}")
    if wrong:
        return Finding("environment", False, "; ".join(wrong[:3]) + (" ..." if len(wrong) > 3 else ""), "make install")
    return Finding("environment", True, f"all {pins} packages as locked")


def _writable(what: str, folder: Path) -> Finding:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return Finding(what, True, f"{folder} is writable")
    except OSError as error:
        return Finding(what, False, f"{folder}: {error.strerror}", "choose or free a folder that can be written")


def _locks(folder: Path) -> Finding:
    """File locks keep two runs out of one folder; some shared file systems are mounted without them."""
    try:
        with tempfile.TemporaryFile(dir=folder) as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        mend = "use a file system that is mounted with locks: two runs here would not see each other"
        return Finding("locks", False, f"{folder}: {error.strerror}", mend)
    return Finding("locks", True, "two runs of one folder see each other")


def _kernels(root: Path) -> Finding:
    """Where compiled kernels go: what is set, the home folder, or beside the workflow."""
    named = os.environ.get("NUMBA_CACHE_DIR")
    if named or os.access(Path.home(), os.W_OK):
        return _writable("jit cache", Path(named or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"))
    return _writable("jit cache", root / ".numba_cache")


def _said(*command: str, timeout_s: float = 30.0) -> str | None:
    """What a command prints, or None where it fails, hangs or is not there."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout if done.returncode == 0 else None


def slurm_findings() -> Iterator[Finding]:
    """Yield what a season would meet on this Slurm account, before it is queued."""
    try:
        version = importlib.metadata.version("snakemake-executor-plugin-slurm")
        yield Finding("plug-in", True, f"snakemake-executor-plugin-slurm {version}")
    except importlib.metadata.PackageNotFoundError:
        yield Finding("plug-in", False, "Snakemake cannot submit to Slurm", "make install")
    settings = _said("scontrol", "show", "config")
    if settings is None:
        mend = "ask whether slurmctld is down, or log in to a node that belongs to the cluster"
        yield Finding("slurm", False, "sbatch is here but the controller does not answer", mend)
        return
    config = dict(re.findall(r"^(\w+)\s*=\s*(.*?)\s*$", settings, re.MULTILINE))
    yield Finding("slurm", True, f"{config.get('SLURM_VERSION', '')}, cluster {config.get('ClusterName', '?')}")
    yield _accounting(config)
    yield _memory_of_jobs(config)
    yield from _partitions()
    wait = _seconds(config.get("KillWait", "30"))
    preempt = config.get("PreemptMode", "OFF")
    mend = f"KillWait {wait} s is short for a last checkpoint; the run goes on from the one before"
    yield Finding("end of a job", wait >= 2, f"{wait} s from SIGTERM to SIGKILL; pre-emption {preempt}", mend)


def _accounting(config: dict[str, str]) -> Finding:
    if "slurmdbd" not in config.get("AccountingStorageType", ""):
        return Finding("account", True, "no accounting database: no account is asked for")
    found = _said("sacctmgr", "-nP", "show", "assoc", f"user={os.environ.get('USER', '')}", "format=account")
    accounts = sorted(set(found.split())) if found else []
    enforced = "associations" in config.get("AccountingStorageEnforce", "")
    mend = "ask the administrators for an account, then name it in profiles/slurm/config.yaml (slurm_account)"
    none = "none is yours" if enforced else "none is yours, none is asked for"
    told = f"yours: {', '.join(accounts)}" if accounts else none
    return Finding("account", bool(accounts) or not enforced, told, mend)


def _memory_of_jobs(config: dict[str, str]) -> Finding:
    """Squeue must remember a finished job for three looks; else sacct must answer, or the workflow waits for ever."""
    age = _seconds(config.get("MinJobAge", "300"))
    database = "slurmdbd" in config.get("AccountingStorageType", "")
    mend = "ask the administrators for MinJobAge=300, or look more often: seconds-between-status-checks in the profile"
    told = f"squeue remembers a finished job for {age} s" + (", sacct for longer" if database else "")
    return Finding("status", age >= _THREE_LOOKS_S or database, told, mend)


def _partitions() -> Iterator[Finding]:
    """Whether the partitions that are up take a coarse play, and which one is taken by default."""
    rows = [line.split("|") for line in (_said("sinfo", "-h", "-o", "%P|%a|%l|%c|%m") or "").splitlines()]
    up = [row for row in rows if len(row) == 5 and row[1] == "up"]
    names = [row[0].rstrip("*") for row in up]
    default = next((row[0].rstrip("*") for row in up if row[0].endswith("*")), None)
    told = f"{', '.join(dict.fromkeys(names))}; default {default or 'none'}" if up else "none is up"
    mend = "wait until one is up" if not up else "name one in profiles/slurm/config.yaml (slurm_partition)"
    yield Finding("partitions", default is not None, told, mend)
    for resolution in ("coarse", "medium", "fine"):
        asked = estimate(resolution, 0.03)
        fits = [
            row[0].rstrip("*")
            for row in up
            if _leading(row[3]) >= asked.threads
            and _leading(row[4]) >= asked.memory_mb
            and _minutes(row[2]) >= asked.minutes
        ]
        needs = f"{asked.threads} cores, {asked.memory_mb / 1000:.1f} GB, {asked.minutes} min"
        told = f"{needs} a replay of 30 ms: " + (", ".join(dict.fromkeys(fits)) or "no partition has nodes for it")
        mend = "lower most_threads in config/config.yaml to the cores of a node, or name another partition"
        yield Finding(resolution, bool(fits) or resolution != "coarse", told, mend)


def _leading(text: str) -> int:
    found = re.match(r"\d+", text)
    return int(found[0]) if found else 0


def _seconds(text: str) -> int:
    return _leading(text)


def _minutes(text: str) -> float:
    """Minutes of a time limit as sinfo prints it: infinite, days-hh:mm:ss, hh:mm:ss, mm:ss."""
    if not text[:1].isdigit():
        return float("inf")
    days, _, clock = text.rpartition("-")
    parts = [int(part) for part in clock.split(":")]
    hours, minutes = ([0, *parts] if len(parts) == 2 else parts)[:2]
    return 1440.0 * int(days or 0) + 60.0 * hours + minutes


def _node(root: Path) -> Finding:
    """What this very examination says on a compute node: the folder, the environment, the disk, the cache."""
    ask = ("srun", "-n1", "--time=2", "--mem=1000", "--immediate=300", f"--chdir={root.resolve()}", "--quiet")
    try:
        call = [*ask, sys.executable, "-m", "replay.cli", "doctor"]
        done = subprocess.run(call, capture_output=True, text=True, timeout=600, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return Finding("node", False, f"no job ran ({type(error).__name__})", "look with squeue why it waits")
    lines = done.stdout.splitlines()
    wrong = [line.removeprefix("MEND").strip() for line in lines if line.startswith("MEND")]
    if wrong or not lines:
        said = "; ".join(wrong) or (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        mend = "the checkout and its .venv must lie on a file system that compute nodes see at the same path"
        return Finding("node", False, said, "as told there" if wrong else mend)
    return Finding("node", True, f"a job ran, {len(lines)} checks are well there")


def _gpu() -> Finding:
    try:
        from numba import cuda

        found = "CUDA device found (the solver runs on the CPU)" if cuda.is_available() else "none: the CPU is used"
    except (ImportError, OSError) as error:
        found = f"none: the CPU is used ({error})"
    return Finding("gpu", True, found)
