"""The helmet on the head: seated by contact, moved a little, or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.errors import InputError
from replay.files import read_json
from replay.models import Model, build_model, read_model
from replay.play import Contact, FrictionPair
from replay.solver import PENETRATION_TABLE, Controls, seat
from replay.solver.integrator import Integrator
from replay.stages import assemble, settings
from replay.stages.frame import Workspace
from replay.stages.problem import chin_straps, contact_of, helmet_problem, resting_problem, unresolved_pairs


@pytest.fixture(scope="module")
def tiny() -> Model:
    return build_model("nfl", "tiny", seat="contact")


def assembled(repository: Path, folder: Path, offset: float, seat: str = "contact") -> Workspace:
    """The demo's assembly at `tiny`, its helmet moved forward."""
    play = folder / "plays" / "demo"
    play.mkdir(parents=True)
    for file in (repository / "config" / "plays" / "demo").iterdir():
        text = file.read_text(encoding="utf-8")
        if file.name == "play.yaml":
            text = text.replace("  model: classic\n", f"  model: classic\n  offset_m: [{offset}, 0.0, 0.0]\n", 1)
            text = text.replace("helmet_seat: shared_nodes", f"helmet_seat: {seat}")
            assert "offset_m" in text
            assert f"helmet_seat: {seat}" in text
        (play / file.name).write_text(text, encoding="utf-8")
    workspace = Workspace("demo", folder / "plays", folder / "results")
    settings.run(workspace, resolution="tiny")
    return workspace


def test_a_helmet_in_its_nominal_seat_is_inside_nothing(tiny: Model) -> None:
    found = seat(resting_problem(tiny, Controls(1.0), Contact()))
    assert found.deepest_before_m == 0.0
    assert not len(found.rows)


def test_a_millimetre_of_overlap_is_projected_and_ten_are_refused(repository: Path, tmp_path: Path) -> None:
    for offset, verdict in ((1e-3, "pass"), (10e-3, "fail")):
        workspace = assembled(repository, tmp_path / str(offset), offset)
        refusal = assemble.run(workspace)
        folder = workspace.results / "demo" / "assembly"
        gate = {check["name"]: check for check in read_json(folder / "gate.json")["checks"]}
        table = PENETRATION_TABLE.read(folder / "penetrations.csv")
        assert gate["projection_over_edge"]["verdict"] == verdict
        assert table["depth_m"].max() == pytest.approx(offset, rel=0.1)
        assert "scalp" in gate["projection_over_edge"]["detail"]
        assert "comfort_pad_back at (" in gate["projection_over_edge"]["detail"]
        assert (refusal is not None) == (verdict == "fail")
        if verdict == "pass":
            model = read_model(folder / "model.h5")
            assert seat(resting_problem(model, Controls(1.0), Contact())).deepest_before_m == 0.0


def test_friction_pairs_are_those_of_the_article(tiny: Model) -> None:
    contact = contact_of(tiny, Contact())
    skin = {(part.pid,) for part in tiny.parts if part.role in ("scalp", "face")}
    assert [pair.friction for pair in contact.pairs] == [0.5] * 5
    assert {pair.first for pair in contact.pairs} == skin
    assert contact.pairs[0].second == tiny.part_sets["H1_pads_set1"]
    assert unresolved_pairs(tiny, Contact()) == []
    strange = Contact(pairs=(FrictionPair(first="scalp", second="hair", friction=0.1),))
    assert unresolved_pairs(tiny, strange) == ["scalp-hair"]


def test_straps_hold_the_chin_cup_to_the_shell(tiny: Model) -> None:
    shells, straps = chin_straps(tiny)
    assert len(straps) == 4
    roles = {role: set(np.unique(tiny.hexes[tiny.elements_of(role=role)]).tolist()) for role in ("shell", "chin_cup")}
    for strap in straps:
        assert int(strap.nodes[0]) in roles["shell"]
        assert int(strap.nodes[1]) in set(shells[0].nodes.tolist()) <= roles["chin_cup"]


def test_the_flying_helmet_keeps_its_parts_together(tiny: Model) -> None:
    problem = helmet_problem(tiny, 0.4, Controls(1e-3), Contact())
    run = Integrator(problem, 1e9)
    for _ in range(50):
        dt = 0.9 * run.forces().step_s
        run.kick(dt, drift=False)
        run.drift(dt, run.time_s + dt)
    assert np.abs(run.nodal[:, 4:7] - [0.4, 0.0, 0.0]).max() < 1e-9


def test_a_helmet_on_the_scalps_nodes_asks_for_no_contact_and_cannot_be_moved(
    repository: Path, tmp_path: Path, tiny: Model
) -> None:
    joined = build_model("nfl", "tiny")
    problem = helmet_problem(joined, 0.4, Controls(1e-3), Contact())
    assert problem.contact is None
    assert (problem.straps, problem.rigid_sets) == ((), ())
    assert helmet_problem(tiny, 0.4, Controls(1e-3), Contact()).contact is not None
    with pytest.raises(InputError, match="shares nodes with the head"):
        assembled(repository, tmp_path, 1e-3, seat="shared_nodes")
