"""``replay doctor``: is this machine and environment fit for a run? One line each, with the mend."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_NEEDED_DISK_GB = 5.0
_NEEDED_MEMORY_GB = 4.0
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


def examine(root: Path | None = None) -> int:
    """Print every finding.

    Parameters
    ----------
    root
        The checkout; by default the current folder.

    Returns
    -------
    int
        0 when everything is fit, 1 when something needs mending.
    """
    findings = list(_findings(root or Path.cwd()))
    for finding in findings:
        print(finding.line())
    return 0 if all(finding.ok for finding in findings) else 1


def _findings(root: Path) -> Iterator[Finding]:
    version = ".".join(map(str, sys.version_info[:3]))
    yield Finding("python", sys.version_info >= (3, 11), version, "use Python 3.11 or later")
    yield lock_finding(root / "environment.lock")
    yield Finding("threads", True, f"{len(os.sched_getaffinity(0))} available to this process")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    yield Finding("memory", memory >= _NEEDED_MEMORY_GB, f"{memory:.0f} GB", f"{_NEEDED_MEMORY_GB:.0f} GB are needed")
    free = shutil.disk_usage(root).free / 1e9
    yield Finding("disk", free >= _NEEDED_DISK_GB, f"{free:.0f} GB free", f"free at least {_NEEDED_DISK_GB:.0f} GB")
    yield _writable("results", root / "results" if (root / "results").is_dir() else root)
    yield _writable("jit cache", Path(os.environ.get("NUMBA_CACHE_DIR", Path.home() / ".cache")))
    yield _gpu()
    slurm = "sbatch found" if shutil.which("sbatch") else "none: runs on this machine"
    yield Finding("slurm", True, slurm)


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


def _gpu() -> Finding:
    try:
        from numba import cuda

        found = "CUDA device found (the solver runs on the CPU)" if cuda.is_available() else "none: the CPU is used"
    except (ImportError, OSError) as error:
        found = f"none: the CPU is used ({error})"
    return Finding("gpu", True, found)
