"""Commands for whoever received a bundle: verify it, compare it with another run."""

from __future__ import annotations

from pathlib import Path

from replay.bundle import compare as compare_runs
from replay.bundle import verify as verify_bundle


def verify(bundle: Path) -> int:
    """Verify a bundle and say what was verified; a bad one raises, naming its first bad file."""
    print(verify_bundle(bundle).text())
    return 0


def compare(old: Path, new: Path) -> int:
    """Compare two runs; 0 when they agree, each artifact by its class."""
    comparison = compare_runs(old, new)
    print(comparison.text())
    return 0 if comparison.agree else 1
