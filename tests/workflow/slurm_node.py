"""A Slurm of one node on this machine, by hand: key, sockets, ports and folder of its own; no service, no cgroup."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

PROGRAMS = ("slurmctld", "slurmd", "munged", "sbatch", "squeue", "scancel", "scontrol", "srun")
PUBLISHED = Path("/etc/slurm/slurm.conf")
CONFIG = """\
ClusterName=suite
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={daemon}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
ReturnToService=2
MinJobAge=600
KillWait=10
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory} State=UNKNOWN
PartitionName=suite Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def why_not() -> str:
    """Why no Slurm can be started here, or an empty string."""
    missing = [name for name in PROGRAMS if not shutil.which(name, path=os.environ["PATH"] + ":/usr/sbin:/sbin")]
    if missing:
        return f"not installed: {', '.join(missing)} (Debian: slurmctld slurmd slurm-client munge)"
    if os.getuid() != 0:
        return "a Slurm of one's own needs root here: it starts jobs for the user and publishes its configuration"
    if PUBLISHED.exists() and not PUBLISHED.is_symlink():
        return "this machine belongs to a Slurm already"
    return ""


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class SlurmNode:
    """A running controller and node; `stop` ends them."""

    folder: Path

    def start(self) -> None:
        """Start munge, the controller and the node, and wait until the node takes jobs."""
        host = socket.gethostname().split(".")[0]
        for name in ("state", "spool", "munge"):
            (self.folder / name).mkdir(parents=True)
        for place in (self.folder, *self.folder.parents):
            if place.stat().st_uid == 0 and place != Path("/tmp"):
                place.chmod(place.stat().st_mode | 0o055)
        key = self.folder / "munge" / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20
        text = CONFIG.format(
            host=host, controller=_free_port(), daemon=_free_port(), folder=self.folder,
            cpus=max(2, os.cpu_count() or 1), memory=int(0.9 * memory),
        )  # fmt: skip
        (self.folder / "slurm.conf").write_text(text)
        # Snakemake's plug-in strips SLURM_* from a job's environment: only the usual place reaches it.
        PUBLISHED.parent.mkdir(exist_ok=True)
        PUBLISHED.unlink(missing_ok=True)
        PUBLISHED.symlink_to(self.folder / "slurm.conf")
        options = {"key-file": key, "socket": "munge.socket", "pid-file": "munged.pid", "log-file": "munged.log",
                   "seed-file": "munged.seed"}  # fmt: skip
        self._run("munged", "--force", *(f"--{name}={self.folder / value}" for name, value in options.items()))
        self._run("slurmctld", "-c")
        self._run("slurmd", "-c")
        self.wait_for(lambda: "idle" in self.ask("sinfo", "-h", "-o", "%T"), "the node takes no jobs")

    def ask(self, *command: str) -> str:
        """What one of Slurm's commands prints."""
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60).stdout

    def wait_for(self, ready, otherwise: str, seconds: float = 300.0):
        """Wait for something to come true, and return it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if found := ready():
                return found
            time.sleep(0.2)
        raise AssertionError(otherwise)

    def stop(self) -> None:
        """End the jobs and the three programs."""
        self.ask("scancel", "--signal=KILL", "--user=root", "--full")
        for name in ("slurmd", "slurmctld", "munged"):
            pid = self.folder / f"{name}.pid"
            if pid.is_file():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(int(pid.read_text()), signal.SIGTERM)
        PUBLISHED.unlink(missing_ok=True)

    def _run(self, *command: str) -> None:
        path = os.environ["PATH"] + ":/usr/sbin:/sbin"
        done = subprocess.run(command, env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command[0]}: {done.stderr}"
