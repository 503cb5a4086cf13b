"""The main job as its users run it: one command to a sealed bundle, reruns, kills, two runs, refusals."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from pathlib import Path

import pytest

from tests.workflow.conftest import Checkout

pytestmark = pytest.mark.slow
STAGES = (
    "settings",
    "inputs",
    "reconstruct",
    "drive",
    "assemble",
    "shake",
    "decks",
    "impact",
    "sensitivity",
    "fidelity",
    "measure",
    "verdict",
    "report",
    "seal",
)


def verdict(checkout: Checkout, play: str) -> dict:
    return json.loads((checkout.root / "results" / play / "verdict" / "verdict.json").read_text())


def test_a_dry_run_shows_every_stage(fresh: Checkout) -> None:
    assert set(fresh.planned("demo")) == set(STAGES)


def test_the_demo_play_is_accepted_and_sealed(finished: Checkout) -> None:
    assert verdict(finished, "demo")["status"].startswith("accepted")
    assert "verified" in finished.run("replay", "verify", str(finished.bundle("demo")))
    shown = finished.run("replay", "verdict", "results/demo")
    for gate in ("helmet", "reconstruction", "assembly", "shake", "numerics", "fidelity", "package"):
        assert gate in shown


def test_a_second_run_does_nothing(finished: Checkout) -> None:
    assert "Nothing to be done" in finished.replay("demo")


def test_a_stage_whose_files_are_gone_is_run_again_before_anything_is_sealed(copied: Checkout) -> None:
    import shutil

    shutil.rmtree(copied.root / "results/demo/fidelity")
    copied.bundle("demo").unlink()
    output = copied.run("replay", "seal", "demo", expect=2)
    assert "replay fidelity" in output
    assert {"fidelity", "verdict", "report", "seal"} == set(copied.planned("demo"))


def test_an_edited_click_reruns_from_the_reconstruction_on(copied: Checkout) -> None:
    clicks = copied.root / "config/plays/demo/kinovea_clicks.csv"
    lines = clicks.read_text().splitlines()
    lines[1] = re.sub(r"(\d)$", lambda m: str((int(m[1]) + 1) % 10), lines[1])
    clicks.write_text("\n".join(lines) + "\n")
    planned = set(copied.planned("demo"))
    assert {"inputs", "reconstruct", "drive", "impact", "report", "seal"} <= planned
    assert not {"settings", "assemble", "shake"} & planned


def test_an_edited_solver_source_reruns_from_the_shake_on(copied: Checkout) -> None:
    source = copied.root / "src/replay/solver/run.py"
    source.write_text(source.read_text() + "# edited\n")
    planned = set(copied.planned("demo"))
    assert {"shake", "impact", "sensitivity", "seal"} <= planned
    assert not {"settings", "inputs", "reconstruct", "assemble"} & planned


def test_a_touched_source_reruns_nothing(copied: Checkout) -> None:
    (copied.root / "src/replay/solver/run.py").touch()
    assert copied.planned("demo") == []


def test_one_and_two_threads_give_the_same_bytes(finished: Checkout, fresh: Checkout) -> None:
    fresh.replay("demo", cores=1)
    shown = fresh.run("replay", "compare", str(finished.bundle("demo")), str(fresh.bundle("demo")))
    assert re.search(r"the runs agree: .*\b\d{2,} same", shown), shown
    for path in sorted((finished.root / "results/demo").rglob("manifest.json")):
        other = fresh.root / path.relative_to(finished.root)
        assert path.read_bytes() == other.read_bytes(), path.parent.name


def test_footage_that_cannot_carry_it_is_refused_and_sealed_all_the_same(fresh: Checkout) -> None:
    fresh.replay("broadcast")
    said = verdict(fresh, "broadcast")
    assert said["status"] == "rejected"
    assert said["stopped_by"] == "reconstruction"
    assert "REJECTED" in fresh.run("replay", "verdict", "results/broadcast", expect=3)
    fresh.run("replay", "verify", str(fresh.bundle("broadcast")))
    assert fresh.run("replay", "reconstruct", "broadcast", expect=3).count("Traceback") == 0


def test_a_wearable_runs_to_the_same_bundle(fresh: Checkout) -> None:
    fresh.replay("wearable")
    assert verdict(fresh, "wearable")["status"].startswith("accepted")
    assert (fresh.root / "results/wearable/reconstruction/kinematics.csv").is_file()


@pytest.mark.shared
def test_a_measured_mouthguard_impact_runs_to_a_sealed_bundle(fresh: Checkout, shared: Path) -> None:
    play = fresh.root / "plays" / "mouthguard"
    play.mkdir(parents=True)
    text = (Path(__file__).parent / "mouthguard.yaml").read_text()
    (play / "play.yaml").write_text(text.replace("IMPACT", str(shared / "real/mouthguard/impact_1.csv")))
    fresh.replay("mouthguard", resolution="coarse", config=("plays_folder=plays",))
    assert verdict(fresh, "mouthguard")["status"].startswith("accepted")
    fresh.run("replay", "verify", str(fresh.bundle("mouthguard")))


def test_a_killed_run_goes_on_from_its_checkpoint_to_the_same_bytes(copied: Checkout, finished: Checkout) -> None:
    replay = copied.root / "results/demo/replay"
    for path in sorted(replay.rglob("*"), reverse=True):
        path.unlink() if path.is_file() else path.rmdir()
    run = copied.start("replay", "impact", "demo", "--threads", "2", "--checkpoint-every", "0.5")
    deadline = time.monotonic() + 300
    while not list(replay.glob("checkpoint/*")) and run.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    assert run.poll() is None, "the solver ended before it was killed"
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    assert not (replay / "manifest.json").exists()
    output = copied.run("replay", "impact", "demo", "--threads", "1")
    assert "goes on from" in output
    for name in ("states.vtkhdf", "energy.csv", "histories.csv", "manifest.json"):
        assert (replay / name).read_bytes() == (finished.root / "results/demo/replay" / name).read_bytes(), name


def test_a_second_run_in_the_same_folder_is_refused(copied: Checkout) -> None:
    import fcntl

    with (copied.root / "results/.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        (copied.root / "results/demo/bundle/demo.zip").unlink()
        output = copied.run(
            "snakemake", "--cores", "1", "results/demo/bundle/demo.zip", "--config", "resolution=tiny", expect=1
        )
    assert "another run works in this folder" in output


def test_a_file_changed_behind_the_manifest_is_refused(copied: Checkout) -> None:
    driver = copied.root / "results/demo/driver/driver_6dof.csv"
    driver.write_text(driver.read_text().replace("0.", "0.0", 1))
    output = copied.run("replay", "impact", "demo", expect=2)
    assert "driver_6dof.csv" in output
    assert "replay drive" in output
    assert "Traceback" not in output


def test_the_workflow_report_needs_no_network(copied: Checkout) -> None:
    copied.run("snakemake", "results/demo/bundle/demo.zip", "--report", "report.zip", "--config", "resolution=tiny")
    assert (copied.root / "report.zip").stat().st_size > 10_000
