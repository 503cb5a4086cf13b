"""`replay solve`: any model of hexahedra under its own controls."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pandas as pd
import pytest
import yaml

from replay.cli import main
from replay.controls import SolveControls
from replay.documents import Setting
from replay.errors import InputError
from replay.files import hold_folder
from replay.models import Model, Part, build_model, read_model, write_model
from replay.solver import PENETRATION_TABLE
from replay.solver.blocks import structured_block
from replay.solver.checkpoint import Checkpoints
from replay.stages.solver_model import open_model

WRITE = os.environ.get("REPLAY_WRITE_DOCS") == "1"
_MARKS = ("<!-- keys: written by tests/stages/test_solve_tool.py -->\n", "<!-- end of keys -->")


def settings_of(kind: Any) -> type[Setting] | None:
    """The settings model inside of an annotation, where there is one."""
    if isinstance(kind, type) and issubclass(kind, Setting):
        return kind
    return next((found for part in get_args(kind) if (found := settings_of(part))), None)


def key_rows(model: type[Setting], path: str = "") -> list[str]:
    rows = []
    for name, info in model.model_fields.items():
        inner = settings_of(info.annotation)
        many = "[]" if inner is not None and "tuple" in str(info.annotation) else ""
        default = "required" if info.is_required() else ""
        if not default and inner is None:
            value = info.get_default(call_default_factory=True)
            default = json.dumps(value) if value not in ((), None, {}) else "none"
        rows.append(f"| `{path}{name}{many}` | {default} | {info.description} |")
        if inner is not None:
            rows += key_rows(inner, f"{path}{name}{many}.")
    return rows


def test_the_page_lists_every_key_with_its_default(repository: Path) -> None:
    page = repository / "docs" / "solver.md"
    text = page.read_text(encoding="utf-8")
    table = "\n".join(["| key | default | meaning |", "|---|---|---|", *key_rows(SolveControls)]) + "\n"
    head, rest = text.split(_MARKS[0])
    wanted = head + _MARKS[0] + table + _MARKS[1] + rest.split(_MARKS[1])[1]
    if WRITE:
        page.write_text(wanted, encoding="utf-8")
    assert page.read_text(encoding="utf-8") == wanted, "REPLAY_WRITE_DOCS=1 pytest tests/stages/test_solve_tool.py"


def test_the_defaults_are_the_articles() -> None:
    c = SolveControls()
    assert (c.hourglass.method, c.hourglass.coefficient) == (4, 0.10)
    assert (c.bulk_viscosity.quadratic, c.bulk_viscosity.linear) == (1.2, 0.06)
    assert (c.time_step_factor, c.mass_scaling_time_step_s, c.termination_time_s) == (0.9, 1.92e-7, 0.030)


@pytest.fixture(scope="module")
def two_blocks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model file: a soft block on a rigid one, 1 mm apart and of other meshes, numbered by hundreds."""
    lower, below = structured_block((2, 3, 2), (0.02, 0.02, 0.01))
    upper, above = structured_block((3, 2, 2), (0.02, 0.02, 0.01), (0.0, 0.0, 0.0105))
    nodes = np.concatenate([lower, upper])
    hexes = np.concatenate([below, above + len(lower)])
    parts = (Part(10, "plate", "skull", "head", "steel"), Part(20, "pad", "comfort_pad", "helmet", "rubber"))
    elastic = {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3}
    model = Model(
        nodes=nodes, node_ids=100 * np.arange(1, len(nodes) + 1), hexes=hexes.astype(np.int32),
        element_ids=1000 + np.arange(len(hexes)), element_part=np.repeat([0, 1], [len(below), len(above)]),
        element_region=np.zeros(len(hexes), int), parts=parts, region_names=("none",),
        part_sets={"all": (10, 20)}, part_set_ids={"all": 1},
        materials={
            "steel": {"law": "rigid", "density_kg_per_m3": 2000.0, "parameters": {}},
            "rubber": {"law": "elastic", "density_kg_per_m3": 1000.0, "parameters": elastic},
        },
        info={}, node_sets={"top": np.flatnonzero(nodes[:, 2] > 0.0204)},
    )  # fmt: skip
    path = tmp_path_factory.mktemp("model") / "blocks.h5"
    write_model(path, model)
    return path


BLOCKS: dict[str, Any] = {
    "termination_time_s": 2e-3,
    "mass_scaling_time_step_s": 0.0,
    "gravity_m_per_s2": [0.0, 0.0, -9.81],
    "ties": [{"name": "seam", "tied_parts": [20], "master_parts": [10], "tolerance_m": 1e-3}],
    "rigid_sets": [{"name": "lid", "node_set": "top"}],
    "joints": [
        {"name": "hinge", "second": "lid", "centre_m": [0.01, 0.01, 0.02], "flexion_n_m_per_rad": 1.0,
         "lateral_n_m_per_rad": 1.0, "torsion_n_m_per_rad": 0.5, "centre_stiffness_n_per_m": 1e4}
    ],
    "initial_velocities": [
        {"parts": [10], "velocity_m_per_s": [0.5, 0.0, 0.0]},
        {"part_set": "all", "omega_rad_per_s": 20.0, "p_m": [0.01, 0.01, 0.0], "q_m": [0.01, 0.01, 0.1]},
    ],
    "output": {"plot_interval_s": 1e-3, "history_interval_s": 2e-4, "nodes": [100, 7200], "elements": [1012]},
}  # fmt: skip


def written(folder: Path, **changes: Any) -> str:
    path = folder / "controls.yaml"
    path.write_text(yaml.safe_dump({**BLOCKS, **changes}))
    return str(path)


def test_two_blocks_run_with_a_tie_a_joint_and_a_rigid_set(
    two_blocks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["solve", str(two_blocks), "--controls", written(tmp_path), "--out", str(out)]) == 0
    assert "tie seam: 12 nodes tied, moved by up to 0.5 mm\n" in capsys.readouterr().out
    energy = pd.read_csv(out / "energy.csv")
    assert energy["closure"].abs().max() < 1e-10
    assert energy["time_s"].iloc[-1] == 2e-3
    assert energy["joint_spring_J"].iloc[-1] > 0
    nodes = pd.read_csv(out / "node_histories.csv")
    assert nodes["node_id"].tolist() == [100, 7200] * 11
    assert pd.read_csv(out / "element_histories.csv")["element_id"].unique().tolist() == [1012]
    assert pd.read_csv(out / "histories.csv")["pid"].unique().tolist() == [10, 20]
    assert len(pd.read_csv(out / "ties.csv")) == len(pd.read_csv(out / "joints.csv")) == 11
    assert json.loads((out / "controls.json").read_text())["hourglass"] == {"method": 4, "coefficient": 0.1}
    # body 10 starts with what it was given: translation and the turn about P-Q
    first = pd.read_csv(out / "histories.csv").iloc[0]
    assert (first["vx_m_per_s"], first["omega_z_rad_per_s"]) == (pytest.approx(0.5), pytest.approx(20.0))


def thrown(folder: Path, velocity: list[float], contact: dict[str, Any] | None, factor: float = 0.9) -> str:
    """Controls that throw the pad at the plate, both free and elastic."""
    rubber = {"youngs_modulus_pa": 1e6, "poisson_ratio": 0.3}
    return written(
        folder, termination_time_s=3e-3, time_step_factor=factor, gravity_m_per_s2=[0.0, 0.0, 0.0],
        ties=[], rigid_sets=[], joints=[],
        materials=[{"parts": [10], "law": "elastic", "density_kg_per_m3": 2000.0, "parameters": rubber}],
        initial_velocities=[{"parts": [20], "velocity_m_per_s": velocity}], contact=contact,
    )  # fmt: skip


def test_two_blocks_collide_and_keep_momentum_and_energy(
    two_blocks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    controls = thrown(tmp_path, [0.0, 0.0, -2.0], {}, factor=0.3)
    assert main(["solve", str(two_blocks), "--controls", controls, "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "contact: no part lies inside another\n" in text
    told = json.loads((out / "run.json").read_text())["contact"]
    assert told["steps"] > 5
    assert f": contact_unconverged_share {told['unconverged_share']:.4g} (limit < 0.01)" in text
    assert f"pass: penetration_over_edge {told['penetration_over_edge']:.4g} (limit < 0.05)" in text
    energy = pd.read_csv(out / "energy.csv")
    momentum = energy[[f"momentum_{axis}_N_s" for axis in "xyz"]].to_numpy()
    assert np.abs(momentum - momentum[0]).max() < 1e-12 * abs(momentum[0, 2])
    assert energy["closure"].abs().max() < 1e-10
    assert energy["ratio"].between(0.99, 1.01).all()
    # the plate was at rest and took on most of what the pad lost: they met, and parted
    ends = pd.read_csv(out / "histories.csv").groupby("pid")["vz_m_per_s"].last()
    assert ends[10] < -0.5
    assert ends[20] > ends[10] + 0.5
    # 8 g of plate have the momentum that contact gave them
    assert pd.read_csv(out / "contact.csv")["impulse_z_N_s"].iloc[-1] == pytest.approx(8e-3 * ends[10], rel=1e-9)
    assert json.loads((out / "controls.json").read_text())["contact"] == {
        "scheme": "lagrange", "most_iterations": 200, "tolerance": 1e-3, "points": "center_plus_corners",
        "friction": 0.0, "pairs": [], "self_contact": [],
    }  # fmt: skip


def test_without_a_contact_block_they_pass_through_each_other(two_blocks: Path, tmp_path: Path) -> None:
    controls = thrown(tmp_path, [0.0, 0.0, -2.0], None)
    assert main(["solve", str(two_blocks), "--controls", controls, "--out", str(tmp_path / "out")]) == 0
    assert not (tmp_path / "out" / "contact.csv").exists()
    assert pd.read_csv(tmp_path / "out" / "histories.csv").query("pid == 10")["vz_m_per_s"].abs().max() == 0.0


def test_a_friction_pair_by_part_set_drags_as_coulomb_says(two_blocks: Path, tmp_path: Path) -> None:
    pair = {"first": "plate", "second": "all", "friction": 0.3}
    controls = thrown(tmp_path, [5.0, 0.0, -1.0], {"pairs": [pair]})
    out = tmp_path / "out"
    assert main(["solve", str(two_blocks), "--controls", controls, "--out", str(out)]) == 0
    last = pd.read_csv(out / "contact.csv").iloc[-1]
    # it slides all the while: the drag on the plate is the coefficient times the push, less what points aside
    # where the pad spreads
    assert 0.97 < last["impulse_x_N_s"] / (-0.3 * last["impulse_z_N_s"]) <= 1.0 + 1e-9
    assert last["friction_J"] > 0
    assert pd.read_csv(out / "energy.csv")["closure"].abs().max() < 1e-10


def test_parts_of_contact_that_are_not_there_are_told_at_once(
    two_blocks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pair = {"first": "plate", "second": "pads", "friction": 0.3}
    controls = thrown(tmp_path, [0.0, 0.0, -1.0], {"pairs": [pair], "self_contact": ["skin"]})
    assert main(["solve", str(two_blocks), "--controls", controls, "--out", str(tmp_path / "out")]) == 2
    text = capsys.readouterr().err
    assert "2 problems" in text
    assert "contact.pairs[0].second: the model has no part and no part set 'pads'" in text
    assert "contact.self_contact[0]: the model has no part and no part set 'skin'" in text
    assert "plate, pad, all" in text
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("overlap", "code"), [(0.5e-3, 0), (4e-3, 2)])
def test_a_small_overlap_is_taken_out_and_listed_and_a_deep_one_refused(
    two_blocks: Path, tmp_path: Path, overlap: float, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    model = read_model(two_blocks)
    nodes = model.nodes.copy()
    nodes[model.nodes[:, 2] > 0.01025, 2] -= 0.5e-3 + overlap
    path, out = tmp_path / "inside.h5", tmp_path / "out"
    write_model(path, dataclasses.replace(model, nodes=nodes))
    controls = thrown(tmp_path, [0.0, 0.0, 0.0], {})
    assert main(["solve", str(path), "--controls", controls, "--out", str(out)]) == code
    said = capsys.readouterr()
    if code:
        assert "controls.yaml: contact: parts lie inside each other" in said.err
        assert " mm inside " in said.err
        assert not out.exists()
    else:
        assert "contact: deepest initial penetration 0.5 mm, taken out by moves of up to 0." in said.out
        table = PENETRATION_TABLE.read(out / "penetrations.csv")
        assert table["depth_m"].max() == pytest.approx(overlap)
        assert set(table["part"]) == {"plate", "pad"}


def test_every_name_that_is_not_there_is_told_at_once(
    two_blocks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    controls = written(
        tmp_path, rigid_sets=[{"name": "lid", "node_set": "bottom"}], supports=[{"parts": [30]}],
        straps=[{"name": "s", "nodes": [5, 100], "stiffness_n_per_m": 1e3}], output={"elements": [7]},
    )  # fmt: skip
    assert main(["solve", str(two_blocks), "--controls", controls, "--out", str(tmp_path / "out")]) == 2
    text = capsys.readouterr().err
    for found in ("4 problems", "no node set 'bottom'", "no part 30", "no node 5", "no element 7"):
        assert found in text
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"hourglas": {}}, "did you mean `hourglass`"),
        ({"termination_time_s": "30 ms"}, "is not a number"),
        ({"initial_velocities": [{"omega_rad_per_s": 1.0}]}, "turns about no axis"),
        (
            {"initial_velocities": [{"omega_rad_per_s": 1.0, "p_m": [0, 0, 0], "q_m": [0, 0, 0]}]},
            "two points that span the axis",
        ),
        ({"joints": [{"name": "j", "second": 20}]}, "is missing"),
        ({"joints": [{**BLOCKS["joints"][0], "x_axis": [0, 0, 2]}]}, "x_axis and z_axis are parallel"),
        ({"supports": [{"axes": ["x"]}]}, "names its nodes in no way"),
        ({"prescribed_motions": [{"parts": [10], "file": "m.csv"}]}, "the file does not exist"),
        (
            {"joints": [{**BLOCKS["joints"][0], "second": 20}]},
            "controls.yaml: joints.hinge.second: 20 is no rigid part and no rigid set",
        ),
        (
            {"materials": [{"parts": [20], "law": "elastik", "density_kg_per_m3": 1e3}]},
            "did you mean 'elastic'",
        ),
    ],
)  # fmt: skip
def test_wrong_controls_are_one_message(
    two_blocks: Path, tmp_path: Path, changes: dict[str, Any], found: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["solve", str(two_blocks), "--controls", written(tmp_path, **changes)]) == 2
    assert found in capsys.readouterr().err


def test_two_bodies_follow_two_files_of_motion(two_blocks: Path, tmp_path: Path) -> None:
    t = np.linspace(0.0, 2e-3, 5)
    for name, speed in (("a", 1.0), ("b", -2.0)):
        rows = {"time_s": t, "x_m": speed * t, "y_m": 0 * t, "z_m": 0 * t, "qx": 0 * t, "qy": 0 * t, "qz": 0 * t}
        rows |= {"qw": 1 + 0 * t, "vx_m_per_s": speed + 0 * t, "vy_m_per_s": 0 * t, "vz_m_per_s": 0 * t}
        rows |= {f"omega_{axis}_rad_per_s": 0 * t for axis in "xyz"}
        pd.DataFrame(rows).to_csv(tmp_path / f"{name}.csv", index=False)
    controls = written(
        tmp_path, ties=[], joints=[], initial_velocities=[], output={},
        prescribed_motions=[{"parts": [10], "file": "a.csv"}, {"rigid_sets": ["lid"], "file": "b.csv"}],
    )  # fmt: skip
    assert main(["solve", str(two_blocks), "--controls", controls, "--out", str(tmp_path / "out")]) == 0
    plate = pd.read_csv(tmp_path / "out" / "histories.csv").query("pid == 10")
    lid = pd.read_csv(tmp_path / "out" / "rigid_sets.csv")
    assert plate["x_m"].iloc[-1] == pytest.approx(2e-3, rel=1e-12)
    assert lid["x_m"].iloc[-1] == pytest.approx(-4e-3, rel=1e-12)


_CHILD = "import sys; from replay.cli import main; sys.exit(main(sys.argv[1:]))"


def test_after_ctrl_c_the_same_command_goes_on(two_blocks: Path, tmp_path: Path) -> None:
    controls = written(tmp_path, termination_time_s=0.1)
    command = ["solve", str(two_blocks), "--controls", controls, "--threads", "1", "--out"]
    child = subprocess.Popen(
        [sys.executable, "-c", _CHILD, *command, str(tmp_path / "out")], stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 120
    while not (tmp_path / "out" / "states.partial").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    _, text = child.communicate(timeout=120)
    assert child.returncode == 130, text
    assert "state saved" in text
    assert "Traceback" not in text
    assert len(list((tmp_path / "out" / "checkpoint").iterdir())) == 1
    assert main([*command, str(tmp_path / "out")]) == 0
    assert main([*command, str(tmp_path / "whole")]) == 0
    for path in sorted((tmp_path / "whole").iterdir()):
        assert path.read_bytes() == (tmp_path / "out" / path.name).read_bytes(), path.name


def test_two_runs_do_not_write_one_folder(two_blocks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with hold_folder(tmp_path / "out", "this run"):
        assert main(["solve", str(two_blocks), "--controls", written(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "another process is writing this run" in capsys.readouterr().err


def test_a_checkpoint_of_other_controls_is_refused_unless_told(
    two_blocks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["solve", str(two_blocks), "--controls", written(tmp_path), "--out", str(tmp_path / "out")]
    Checkpoints(tmp_path / "out" / "checkpoint", {"version": "0", "code": "0", "model": "0"}).write(1, {})
    assert main(command) == 2
    assert "was written by another version of replay" in capsys.readouterr().err
    assert main([*command, "--anew"]) == 0


def test_a_run_that_stops_itself_exits_3_and_leaves_its_last_good_state(
    two_blocks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    controls = written(tmp_path, speed_limit_m_per_s=0.6, loads=[{"node_set": "top", "force_n": [0.0, 0.0, -500.0]}])
    assert main(["solve", str(two_blocks), "--controls", controls, "--out", str(tmp_path / "out")]) == 3
    assert "of part 20 (pad)" in capsys.readouterr().err
    assert json.loads((tmp_path / "out" / "run.json").read_text())["ran_to_end"] is False
    assert (tmp_path / "out" / "states.vtkhdf").stat().st_size > 1000


def test_the_example_of_the_page_runs(repository: Path, tmp_path: Path) -> None:
    text = (repository / "docs" / "solver.md").read_text(encoding="utf-8")
    match = re.search(r"```yaml\n(.*?)```", text, flags=re.DOTALL)
    assert match
    (tmp_path / "controls.yaml").write_text(match.group(1))
    write_model(tmp_path / "model.h5", build_model("nfl", "tiny"))
    out = tmp_path / "drop"
    arguments = ["solve", str(tmp_path / "model.h5"), "--controls", str(tmp_path / "controls.yaml"), "--out", str(out)]
    assert main(arguments) == 0
    energy = pd.read_csv(out / "energy.csv")
    assert energy["closure"].abs().max() < 1e-10
    assert energy["ratio"].between(0.98, 1.02).all()
    straps = pd.read_csv(out / "straps.csv")
    assert straps["tension_N"].max() > 1.0
    assert set(pd.read_csv(out / "joints.csv")["joint"]) == {"neck"}


def test_a_keyword_deck_is_the_model_that_was_written(two_blocks: Path, tmp_path: Path) -> None:
    deck = tmp_path / "cube.k"
    nodes, hexes = structured_block((1, 1, 2), (1.0, 1.0, 2.0))
    lines = ["*KEYWORD", "*NODE"]
    lines += [f"{k + 1:8d}{x:16.9f}{y:16.9f}{z:16.9f}" for k, (x, y, z) in enumerate(nodes)]
    lines += ["*ELEMENT_SOLID"]
    for k, row in enumerate(hexes):
        lines += [f"{k + 11:8d}{k + 1:8d}", "".join(f"{n + 1:8d}" for n in row)]
    for pid, keyword in ((1, "*MAT_ELASTIC"), (2, "*MAT_FOAMY")):
        lines += ["*PART", f"part {pid}", f"{pid:10d}{pid:10d}{pid:10d}", keyword]
        lines += [f"{pid:10d}{1000.0:10.1f}{1e6:10.3g}{0.3:10.2f}"]
    deck.write_text("\n".join([*lines, "*END", ""]))
    model = open_model(deck)
    assert model.element_ids.tolist() == [11, 12]
    assert np.array_equal(model.nodes[model.hexes], nodes[hexes])
    assert model.parts[0].material.law == "elastic"
    controls = tmp_path / "controls.yaml"
    controls.write_text("termination_time_s: 1.0e-3\n")
    with pytest.raises(InputError, match=r"part 2 has \*MAT_FOAMY, which is not read"):
        from replay.controls import load_controls
        from replay.stages.controlled import build_task

        build_task(model, load_controls(controls), controls)
    controls.write_text(
        "termination_time_s: 1.0e-3\nmaterials:\n  - parts: [2]\n    law: elastic\n    density_kg_per_m3: 500.0\n"
        "    parameters: {youngs_modulus_pa: 1.0e5, poisson_ratio: 0.0}\n"
    )
    assert main(["solve", str(deck), "--controls", str(controls), "--out", str(tmp_path / "out")]) == 0
    with pytest.raises(InputError, match=r"files ending in '\.stl' are not read"):
        open_model(tmp_path / "a.stl")
