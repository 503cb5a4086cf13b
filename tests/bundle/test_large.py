"""A bundle of any size is sealed and verified in bounded memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from replay.bundle import seal
from replay.manifest import Artifact, write_manifest

from .conftest import fabricate

SIZE = 128 << 20
ROOM = 48 << 20
LIMITED = f"""
import resource, sys
from replay.bundle import verify
pages = int(open("/proc/self/statm").read().split()[0])
most = pages * resource.getpagesize() + {ROOM}
resource.setrlimit(resource.RLIMIT_AS, (most, most))
if sys.argv[2] == "whole":
    open(sys.argv[1], "rb").read()
print(verify(sys.argv[1]).text())
"""


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory, source_root: Path) -> Path:
    """A bundle with one file of 128 MB (a hole on the disk, but bytes like any other in the archive)."""
    results = fabricate(tmp_path_factory.mktemp("large"))
    with (results / "replay" / "states.vtkhdf").open("wb") as stream:
        stream.truncate(SIZE)
    states = [Artifact.exact("states.vtkhdf", "states")]
    write_manifest(results / "replay", stage="replay", play="demo", artifacts=states)
    seal(results, results / "bundle" / "demo.zip", source_root=source_root)
    return results / "bundle" / "demo.zip"


def limited(path: Path, how: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", LIMITED, str(path), how]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.skipif(not Path("/proc/self/statm").is_file(), reason="needs /proc to know the memory in use")
def test_verifying_takes_a_fraction_of_the_bundle_s_size_in_memory(large):
    assert large.stat().st_size > SIZE
    done = limited(large, "stream")
    assert done.returncode == 0, done.stderr
    assert "verified" in done.stdout
    assert "MemoryError" in limited(large, "whole").stderr, "the limit does not bite"


def test_a_byte_changed_deep_inside_is_still_found(large):
    with large.open("r+b") as stream:
        stream.seek(SIZE // 2)
        stream.write(b"\1")
    try:
        done = limited(large, "stream")
    finally:
        with large.open("r+b") as stream:
            stream.seek(SIZE // 2)
            stream.write(b"\0")
    assert "data/results/replay/states.vtkhdf: changed since it was sealed" in done.stderr
