"""The limits as shipped."""

from __future__ import annotations

import pytest

from replay.gates import Limits


@pytest.fixture(scope="session")
def limits() -> Limits:
    return Limits.load()
