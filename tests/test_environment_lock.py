"""The lock holds what pyproject.toml asks for, with hashes, and what is installed is what it says."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from replay.doctor import lock_finding


def pins(lock: Path) -> dict[str, list[tuple[Version, str]]]:
    found: dict[str, list[tuple[Version, str]]] = {}
    for line in lock.read_text(encoding="utf-8").splitlines():
        match = re.match(r"^([A-Za-z0-9_.\-]+)==([^\s;\\]+)\s*(?:;\s*([^\\]*))?", line)
        if match:
            found.setdefault(match[1].lower(), []).append((Version(match[2]), (match[3] or "").strip()))
    return found


def test_every_requirement_is_pinned_within_its_range(repository: Path) -> None:
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    locked = pins(repository / "environment.lock")
    for text in [*project["dependencies"], *project["optional-dependencies"]["dev"]]:
        requirement = Requirement(text)
        assert requirement.name.lower() in locked, f"{requirement.name} is not in environment.lock: make lock"
        for version, _ in locked[requirement.name.lower()]:
            assert requirement.specifier.contains(version), f"{requirement} does not admit the locked {version}"


def test_every_pin_carries_a_hash(repository: Path) -> None:
    text = (repository / "environment.lock").read_text(encoding="utf-8")
    for block in re.split(r"\n(?=[A-Za-z0-9])", text):
        if "==" in block.split("\n")[0] and not block.startswith("#"):
            assert "--hash=sha256:" in block, block.split("\n")[0]


def test_the_lock_names_no_host(repository: Path) -> None:
    text = (repository / "environment.lock").read_text(encoding="utf-8")
    assert "://" not in text


def test_what_is_installed_is_what_is_locked(repository: Path) -> None:
    finding = lock_finding(repository / "environment.lock")
    assert finding.ok, finding.line()


def test_a_fresh_resolution_keeps_the_lock(repository: Path, tmp_path: Path) -> None:
    resolver = shutil.which("uv")
    if resolver is None:
        pytest.skip("no resolver (uv) on this machine: drift is checked by range only")
    fresh = tmp_path / "environment.lock"
    shutil.copy(repository / "environment.lock", fresh)
    command = [resolver, "pip", "compile", "--quiet", "--universal", "--generate-hashes", "--python-version", "3.11"]
    command += ["--extra", "dev", "--custom-compile-command", "make lock", "pyproject.toml", "-o", str(fresh)]
    ran = subprocess.run(command, cwd=repository, capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        pytest.skip(f"the resolver could not reach its index: {ran.stderr.strip()[:200]}")
    assert pins(fresh) == pins(repository / "environment.lock")
