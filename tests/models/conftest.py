"""Models are built once for all tests of the room."""

from __future__ import annotations

import pytest

from replay.models import Model, build_model


@pytest.fixture(scope="session")
def tiny() -> Model:
    return build_model("nfl", "tiny")


@pytest.fixture(scope="session")
def coarse() -> Model:
    return build_model("nfl", "coarse")


@pytest.fixture(scope="session", params=["tiny", "coarse"])
def model(request: pytest.FixtureRequest) -> Model:
    built: Model = request.getfixturevalue(request.param)
    return built
