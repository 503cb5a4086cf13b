"""What every test may ask for."""

from __future__ import annotations

from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared(repository: Path) -> Path:
    """Reference files beside the checkout; a test that needs them skips elsewhere."""
    folder = repository.parent / "shared"
    if not folder.is_dir():
        pytest.skip(f"the reference files are not here: {folder.name}/ beside the checkout is missing")
    return folder
