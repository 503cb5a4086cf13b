"""A checkout of its own for every kind of run: the workflow is tested as a user has it, by its commands."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

WHAT_A_RUN_NEEDS = (
    "Snakefile",
    "workflow",
    "profiles",
    "config",
    "src",
    "environment.lock",
    "pyproject.toml",
    "CITATION.cff",
    "LICENSE",
    "README.md",
)


@dataclass(frozen=True)
class Checkout:
    """A copy of what a run needs, at a place of its own."""

    root: Path

    def start(self, *command: str) -> subprocess.Popen[str]:
        """Start a command of the environment in the checkout, in a process group of its own."""
        environment = {
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(self.root / "src"),
        }
        return subprocess.Popen(
            command,
            cwd=self.root,
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def run(self, *command: str, expect: int = 0) -> str:
        """Run a command to its end and return what it printed."""
        process = self.start(*command)
        output, _ = process.communicate(timeout=900)
        assert process.returncode == expect, f"{' '.join(command)}: exit {process.returncode}\n{output[-6000:]}"
        return output

    def bundle(self, play: str) -> Path:
        """Path of a play's bundle."""
        return self.root / "results" / play / "bundle" / f"{play}.zip"

    def replay(self, play: str, *, cores: int = 2, resolution: str = "tiny", config: tuple[str, ...] = ()) -> str:
        """Run the whole workflow for one play."""
        target = f"results/{play}/bundle/{play}.zip"
        threads = [f"{rule}={cores}" for rule in ("shake", "impact", "sensitivity")]
        call = ("snakemake", "--cores", str(cores), target, "--set-threads", *threads, "--config")
        return self.run(*call, f"resolution={resolution}", *config)

    def planned(self, play: str) -> list[str]:
        """Rules that the workflow would run now."""
        target = f"results/{play}/bundle/{play}.zip"
        output = self.run("snakemake", target, "-n", "--quiet", "rules", "--config", "resolution=tiny")
        table = re.findall(r"^(\w+) +\d+$", output, flags=re.MULTILINE)
        return [rule for rule in table if rule not in ("all", "total")]


def make_checkout(repository: Path, root: Path) -> Checkout:
    root.mkdir(parents=True)
    for name in WHAT_A_RUN_NEEDS:
        source = repository / name
        if source.is_dir():
            shutil.copytree(source, root / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            shutil.copy2(source, root / name)
    return Checkout(root)


@pytest.fixture(scope="session")
def finished(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    """A checkout in which the demo play has run to its bundle, on two cores; tests must not change it."""
    checkout = make_checkout(repository, tmp_path_factory.mktemp("finished") / "replay")
    checkout.replay("demo")
    return checkout


@pytest.fixture
def fresh(repository: Path, tmp_path: Path) -> Checkout:
    """A checkout in which nothing has run."""
    return make_checkout(repository, tmp_path / "replay")


@pytest.fixture
def copied(finished: Checkout, tmp_path: Path) -> Checkout:
    """A copy of the finished checkout, free to be changed; file times are kept."""
    shutil.copytree(finished.root, tmp_path / "replay", symlinks=True)
    return Checkout(tmp_path / "replay")
