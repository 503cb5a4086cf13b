"""Two players through the whole workflow: one command to a sealed bundle, nothing run twice."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.workflow.conftest import Checkout, make_checkout
from tests.workflow.test_the_main_job import STAGES

pytestmark = pytest.mark.slow
PLAY = "collision-demo"


@pytest.fixture(scope="module")
def collided(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    """The collision at `tiny`, of which the first two milliseconds, in which the heads meet, are replayed."""
    checkout = make_checkout(repository, tmp_path_factory.mktemp("collision") / "replay")
    file = checkout.root / "config/plays" / PLAY / "play.yaml"
    whole = file.read_text(encoding="utf-8")
    short = whole.replace("duration_s: 0.030", "duration_s: 0.002")
    assert short != whole
    file.write_text(short, encoding="utf-8")
    assert set(checkout.planned(PLAY)) == {*STAGES, "place"}
    checkout.replay(PLAY, cores=1)
    return checkout


def test_a_collision_passes_the_gates_of_its_numerics_and_is_sealed(collided: Checkout) -> None:
    gates = {}
    for stage in ("assembly", "placement", "shake", "replay"):
        gate = json.loads((collided.root / "results" / PLAY / stage / "gate.json").read_text())
        gates[gate["gate"]] = gate
        assert gate["verdict"] in ("pass", "warn"), [c for c in gate["checks"] if c["verdict"] == "fail"]
    checks = {check["name"]: check for check in gates["numerics"]["checks"]}
    assert checks["momentum_drift"]["value"] < 1e-10
    assert 0.99 < checks["energy_ratio_min"]["value"] <= checks["energy_ratio_max"]["value"] < 1.01
    assert "verified" in collided.run("replay", "verify", str(collided.bundle(PLAY)))


def test_the_page_of_a_collision_has_the_blow_and_published_numbers(collided: Checkout) -> None:
    folder = collided.root / "results" / PLAY / "report"
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "This run beside published numbers" in page
    assert {"first_contact.png", "blow_force.svg", "brain_damage_sections.png"} <= {
        figure.name for figure in (folder / "figures").iterdir()
    }


def test_a_second_run_of_a_collision_does_nothing(collided: Checkout) -> None:
    assert "Nothing to be done" in collided.replay(PLAY, cores=1)


def test_a_laboratorys_test_has_no_reconstruction_and_no_fidelity(collided: Checkout) -> None:
    assert set(collided.planned("drop")) == {*STAGES, "place"} - {"reconstruct", "fidelity"}
