"""The shipped plays, reconstructed once for all tests of this room."""

import pytest

from replay.motion import reconstruct
from replay.play import load_play


@pytest.fixture(scope="session")
def demo(repository):
    return reconstruct(load_play(repository / "config" / "plays" / "demo"))


@pytest.fixture(scope="session")
def broadcast(repository):
    return reconstruct(load_play(repository / "config" / "plays" / "broadcast"))
