"""Sealing: the same results give the same bytes, and nothing is dropped or kept in silence."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import shutil
import subprocess
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from replay.bundle import package_facts, seal, verify
from replay.errors import InputError, ReplayError
from replay.gates.package import VIDEO_PACKAGE

from .conftest import commit, fabricate, fabricate_records, fabricate_source


def payload(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {n.removeprefix("demo/data/"): archive.read(n) for n in archive.namelist() if n.startswith("demo/data/")}


def crate(path: Path) -> dict[str, dict]:
    return {e["@id"]: e for e in json.loads(payload(path)["ro-crate-metadata.json"])["@graph"]}


def test_the_same_results_give_the_same_bytes(tmp_path, source_root):
    digests = []
    for name in ("one", "two"):
        results = fabricate(tmp_path / name)
        records = fabricate_records(tmp_path / name / "records")
        target = results / "bundle" / "demo.zip"
        digests.append(seal(results, target, source_root=source_root, job_records=records))
        assert hashlib.sha256(target.read_bytes()).hexdigest() == digests[-1]
        assert (results / "bundle/demo.zip.sha256").read_text() == f"{digests[-1]}  demo.zip\n"
        assert sorted(p.name for p in target.parent.iterdir()) == ["demo.zip", "demo.zip.sha256"]
    assert digests[0] == digests[1]
    assert seal(tmp_path / "one/results/demo", target, source_root=source_root, job_records=records) == digests[0]


def test_nothing_of_the_machine_enters_what_two_runs_are_compared_by(tmp_path, sealed):
    files = payload(sealed())
    assert not [name for name, data in files.items() if b"/tmp/" in data or b"/home/" in data]
    assert set(json.loads(files["machine.json"])) >= {"processor", "cores", "python", "programs"}


def test_the_listing_names_every_file_with_its_class(sealed):
    files = payload(sealed())
    rows = {row["path"]: row for row in csv.DictReader(io.StringIO(files["artifacts.csv"].decode()))}
    assert set(rows) == set(files) - {"artifacts.csv", "ro-crate-metadata.json"}
    driver = rows["results/driver/driver_6dof.csv"]
    assert (driver["class"], driver["stage"], int(driver["bytes"])) == ("exact", "driver", 19)
    assert driver["sha256"] == hashlib.sha256(files["results/driver/driver_6dof.csv"]).hexdigest()
    histories = rows["results/replay/histories.csv"]
    assert (histories["class"], histories["rtol"], histories["unit"]) == ("tolerance", "1e-06", "m")
    for volatile in ("results/replay/run.log", "machine.json"):
        assert (rows[volatile]["class"], rows[volatile]["bytes"], rows[volatile]["sha256"]) == ("volatile", "", "")


def test_the_listing_does_not_depend_on_what_is_volatile(sealed):
    one, other = payload(sealed()), payload(sealed(log=b"took half an hour\n"))
    assert one["results/replay/run.log"] != other["results/replay/run.log"]
    assert one["artifacts.csv"] == other["artifacts.csv"]


def test_the_hash_of_the_results_is_that_of_a_line_of_shell_and_times_do_not_enter_it(sealed, tmp_path):
    one, other = verify(sealed()), verify(sealed(log=b"took half an hour\n"))
    assert one.results_sha256 == other.results_sha256
    (tmp_path / "artifacts.csv").write_bytes(payload(sealed())["artifacts.csv"])
    command = "grep '^results/' artifacts.csv | sha256sum"
    said = subprocess.run(command, shell=True, cwd=tmp_path, stdout=subprocess.PIPE, text=True, check=True)
    assert said.stdout.split()[0] == one.results_sha256
    assert verify(sealed(rejected=True)).results_sha256 != one.results_sha256


def test_checkpoints_logs_and_strays_are_left_out_by_name(tmp_path, source_root):
    results = fabricate(tmp_path)
    (results / "driver" / "stray.txt").write_text("not listed")
    (results / "measures").mkdir()
    (results / "measures" / "half.csv").write_text("unfinished")
    (results / "driver" / ".lock").touch()
    seal(results, tmp_path / "demo.zip", source_root=source_root)
    files = payload(tmp_path / "demo.zip")
    left = {entry["path"]: entry["reason"] for entry in json.loads(files["bundle.json"])["left_out"]}
    assert left == {
        "results/replay/checkpoint/": "serves an interrupted run alone",
        "results/logs/": "speaks of one machine",
        "results/driver/stray.txt": "not listed by its stage's manifest",
        "results/measures/": "the stage did not finish",
    }
    assert not [name for name in files if any(name.startswith(path) for path in left)]


def test_a_rejected_play_is_sealed_too_and_says_so(sealed):
    path = sealed(rejected=True)
    assert verify(path).verdict == "REJECTED"
    files = payload(path)
    assert files["README.md"].startswith(b"# Replay of the play demo: REJECTED\n")
    with zipfile.ZipFile(path) as archive:
        assert b"Replay-Verdict: REJECTED\n" in archive.read("demo/bag-info.txt")
    entities = crate(path)
    failed = {i: e for i, e in entities.items() if e.get("actionStatus", "").endswith("FailedActionStatus")}
    assert set(failed) == {"#run", "#run-shake"}
    assert "gate shake failed: hourglass_ratio = 0.2" in failed["#run-shake"]["error"]
    assert entities["./"]["name"] == "Replay of the play demo: REJECTED"


def test_an_interrupted_run_is_sealed_and_says_that_nothing_was_judged(tmp_path, source_root):
    results = fabricate(tmp_path)
    shutil.rmtree(results / "verdict")
    (results / "replay" / "manifest.json").unlink()
    seal(results, tmp_path / "demo.zip", source_root=source_root)
    assert verify(tmp_path / "demo.zip").verdict == "NOT JUDGED"


def test_actions_carry_what_was_read_and_made_and_when(sealed):
    entities = crate(sealed())
    action = entities["#run-driver"]
    assert action["startTime"] == "2023-11-14T22:13:20+00:00"
    assert action["description"] == "replay driver demo --results results"
    assert action["object"] == {"@id": "results/reconstruction/kinematics.csv"}
    made = {e["@id"] for e in action["result"]}
    assert made == {"results/driver/driver_6dof.csv", "results/driver/manifest.json"}
    assert "startTime" not in entities["#run-decks"]
    assert entities["./"]["datePublished"] == "2023-11-14T22:16:00+00:00"


def test_steps_stand_in_the_order_of_the_workflow_and_name_the_programs_they_stand_on(sealed):
    entities = crate(sealed())
    steps = {e["name"]: int(e["position"]) for e in entities.values() if e["@type"] == "HowToStep"}
    chain = ["settings", "inputs", "reconstruction", "driver", "replay"]
    assert sorted(chain, key=steps.get) == chain
    assert steps["shake"] < steps["verdict"]
    tool = entities["#stage-driver"]
    programs = {entities[e["@id"]]["name"]: entities[e["@id"]]["softwareVersion"] for e in tool["softwareRequirements"]}
    assert {"python", "numpy", "numba"} <= set(programs)
    assert programs["numpy"] == np.__version__


def test_the_readme_has_three_commands_and_the_way_without_the_program(sealed):
    readme = payload(sealed())["README.md"].decode()
    for command in ("verify demo.zip", "show demo.zip", "rerun demo.zip --into again"):
        assert f"    replay {command}\n" in readme
    assert "sha256sum --quiet -c manifest-sha256.txt" in readme
    assert "make -C again run PLAY=demo RESOLUTION=tiny" in readme


def test_an_interrupted_run_says_so_in_every_paper_whatever_an_older_verdict_said(tmp_path, source_root):
    results = fabricate(tmp_path)
    (results / "replay" / "manifest.json").unlink()
    seal(results, tmp_path / "demo.zip", source_root=source_root, unfinished=["replay", "fidelity"])
    assert verify(tmp_path / "demo.zip").verdict == "INTERRUPTED"
    files = payload(tmp_path / "demo.zip")
    assert b"the run ended before replay, fidelity; nothing was judged" in files["README.md"]
    whole = crate(tmp_path / "demo.zip")["#run"]
    assert whole["actionStatus"].endswith("FailedActionStatus")
    assert "ended before replay, fidelity" in whole["error"]
    with zipfile.ZipFile(tmp_path / "demo.zip") as archive:
        assert b"Replay-Verdict: INTERRUPTED\n" in archive.read("demo/bag-info.txt")


def test_a_file_that_changed_since_its_stage_is_not_sealed(tmp_path, source_root):
    results = fabricate(tmp_path)
    (results / "driver" / "driver_6dof.csv").write_text("time_s,x_m\n0.0,9.0\n")
    with pytest.raises(InputError, match=r"driver_6dof.csv: changed since"):
        seal(results, tmp_path / "demo.zip", source_root=source_root)
    assert not (tmp_path / "demo.zip").exists()
    assert not list(tmp_path.glob(".sealing*"))


def test_what_may_not_be_shared_goes_in_by_hash_and_reason(tmp_path, source_root):
    results = fabricate(tmp_path)
    play = tmp_path / "plays" / "demo"
    play.mkdir(parents=True)
    (play / "play.yaml").write_text("name: demo\n")
    (play / "video.mp4").write_bytes(b"frames")
    withhold = {"plays/demo/video.mp4": "belongs to the league", "results/inputs/kinovea_clicks.csv": "not ours"}
    seal(results, tmp_path / "demo.zip", source_root=source_root, play_folder=play, withhold=withhold)
    files = payload(tmp_path / "demo.zip")
    assert "plays/demo/play.yaml" in files
    assert not set(withhold) & set(files)
    facts = json.loads(files["bundle.json"])
    left = {entry["path"]: entry for entry in facts["left_out"]}
    assert left["plays/demo/video.mp4"]["sha256"] == hashlib.sha256(b"frames").hexdigest()
    assert left["results/inputs/kinovea_clicks.csv"]["reason"] == "not ours"
    assert facts["minimum_package"]["kinovea_clicks.csv"] == {"present": True, "hashed": True}
    row = f"| `plays/demo/video.mp4` | belongs to the league | `{hashlib.sha256(b'frames').hexdigest()}` |"
    assert row in files["README.md"].decode()
    with pytest.raises(InputError, match="is no artifact"):
        seal(results, tmp_path / "b.zip", source_root=source_root, withhold={"results/none.csv": "x"})
    with pytest.raises(InputError, match="to withhold"):
        seal(results, tmp_path / "b.zip", source_root=source_root, play_folder=play, withhold={"plays/demo/no": "x"})


@pytest.mark.parametrize("git", [False, True])
def test_what_is_withheld_is_not_smuggled_out_by_the_source_snapshot(tmp_path, git):
    """Plays lie in the checkout: the film is in the source tree, and in the difference to its commit."""
    root = fabricate_source(tmp_path / "source")
    play = root / "config/plays/demo"
    play.mkdir(parents=True)
    (play / "play.yaml").write_text("name: demo\n")
    (play / "video.mp4").write_bytes(b"an older film")
    if git:
        commit(root)
    film = b"every frame of the league's film"
    (play / "video.mp4").write_bytes(film)
    (root / "src/copy.mp4").write_bytes(film)
    withhold = {"plays/demo/video.mp4": "belongs to the league"}
    path = tmp_path / "demo.zip"
    seal(fabricate(tmp_path), path, source_root=root, play_folder=play, withhold=withhold)
    files = payload(path)
    assert not [name for name, data in files.items() if film in data]
    assert b"video.mp4" not in files["source/dirty.diff"]
    told = json.loads(files["source/source.json"])["withheld"]
    assert told == ["config/plays/demo/video.mp4", "src/copy.mp4"]


def test_extra_files_go_in_but_take_no_other_place(tmp_path, source_root):
    results = fabricate(tmp_path)
    (tmp_path / "gate.json").write_text("{}")
    extra = {"results/bundle/gate.json": tmp_path / "gate.json"}
    seal(results, tmp_path / "demo.zip", source_root=source_root, extra_files=extra)
    assert payload(tmp_path / "demo.zip")["results/bundle/gate.json"] == b"{}"
    with pytest.raises(ReplayError, match=r"README.md: two files"):
        seal(results, tmp_path / "b.zip", source_root=source_root, extra_files={"README.md": tmp_path / "gate.json"})
    with pytest.raises(ReplayError, match=r"leads out of the bundle"):
        seal(results, tmp_path / "b.zip", source_root=source_root, extra_files={"../x": tmp_path / "gate.json"})


def test_the_minimum_package_is_found_item_by_item(tmp_path, source_root):
    results = fabricate(tmp_path)
    facts = package_facts(results, source_root)
    assert all(facts.values())
    assert all(present and hashed for present, hashed in facts.values())
    assert {"kinovea_clicks.csv", "Config.json", "qc_summary.txt", "run-deck entry point", "source code"} <= set(facts)
    shutil.rmtree(results / "decks")
    facts = package_facts(results, tmp_path)
    assert facts["run-deck entry point"] == (False, False)
    assert facts["source code"] == (False, False)


def test_the_package_items_are_those_the_gate_asks_for(tmp_path, source_root):
    assert set(VIDEO_PACKAGE) <= set(package_facts(fabricate(tmp_path), source_root))


def test_the_snapshot_unpacks_to_the_source_that_ran(tmp_path):
    root = fabricate_source(tmp_path / "source")
    head = commit(root)
    results = fabricate(tmp_path)
    seal(results, tmp_path / "clean.zip", source_root=root)
    files = payload(tmp_path / "clean.zip")
    assert json.loads(files["source/source.json"]) == {"commit": head, "dirty": False, "untracked": []}
    assert files["source/dirty.diff"] == b""

    (root / "src/replay/__init__.py").write_text('__version__ = "0.1.1"\n')
    (root / "src/replay/new.py").write_text("x = 1\n")
    (root / "notes.txt").write_text("mine")
    seal(results, tmp_path / "dirty.zip", source_root=root)
    files = payload(tmp_path / "dirty.zip")
    assert json.loads(files["source/source.json"]) == {
        "commit": head,
        "dirty": True,
        "untracked": ["src/replay/new.py"],
    }
    assert b'+__version__ = "0.1.1"' in files["source/dirty.diff"]
    with tarfile.open(fileobj=io.BytesIO(files["source/source.tar"])) as tar:
        names = tar.getnames()
        assert tar.extractfile("src/replay/__init__.py").read() == b'__version__ = "0.1.1"\n'
    assert "src/replay/new.py" in names
    assert "notes.txt" not in names


def test_without_git_the_bundle_says_so(sealed):
    files = payload(sealed())
    assert "not a git checkout" in json.loads(files["source/source.json"])["note"]
    with tarfile.open(fileobj=io.BytesIO(files["source/source.tar"])) as tar:
        assert "src/replay/__init__.py" in tar.getnames()


def test_sealing_nothing_or_elsewhere_is_refused(tmp_path, source_root):
    (tmp_path / "demo").mkdir()
    with pytest.raises(InputError, match="no stage has finished"):
        seal(tmp_path / "demo", tmp_path / "demo.zip", source_root=source_root)
    with pytest.raises(InputError, match="results folder does not exist"):
        seal(tmp_path / "other", tmp_path / "demo.zip", source_root=source_root)
    with pytest.raises(InputError, match=r"Snakefile: the file does not exist"):
        seal(fabricate(tmp_path), tmp_path / "demo.zip", source_root=tmp_path / "demo")
    renamed = (tmp_path / "results/demo").rename(tmp_path / "results/other")
    with pytest.raises(InputError, match="holds stages of demo"):
        seal(renamed, tmp_path / "demo.zip", source_root=source_root)
