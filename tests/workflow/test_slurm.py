"""A season on a real Slurm: through the profile to sealed bundles, past scancel, a time limit and kill -9."""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.workflow.conftest import Checkout, make_checkout
from tests.workflow.slurm_node import SlurmNode, why_not

pytestmark = [pytest.mark.slow, pytest.mark.slurm]
# One play that runs, one that the table spoils; the window is long enough to be disturbed in.
TABLE = "play\tbase\thelmet.mass_kg\nwearable\t\t\nspoilt\twearable\theavy\n"


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SlurmNode]:
    reason = why_not()
    if reason:
        pytest.skip(f"no Slurm: {reason}")
    slurm = SlurmNode(tmp_path_factory.mktemp("slurm") / "node")
    slurm.start()
    yield slurm
    slurm.stop()


@pytest.fixture(scope="module")
def checkout(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    there = make_checkout(repository, tmp_path_factory.mktemp("cluster") / "replay")
    (there.root / "config/plays.tsv").write_text(TABLE)
    return there


def submit(checkout: Checkout, *targets: str) -> subprocess.Popen[str]:
    quick = ["--seconds-between-status-checks", "2", "--slurm-init-seconds-before-status-checks", "2"]
    call = ["snakemake", *targets, "--profile", "profiles/slurm", "--latency-wait", "10", *quick]
    return checkout.start(*call, "--config", "resolution=tiny", "checkpoint_every_s=1")


def solver(checkout: Checkout, command: str) -> int | None:
    """Number of the process that runs `replay impact`, once it has a checkpoint to go on from."""
    if not list((checkout.root / "results/wearable/replay/checkpoint").glob("step-*")):
        return None
    for process in Path("/proc").iterdir():
        try:
            arguments = (process / "cmdline").read_bytes().split(b"\0")
            there = (process / "cwd").samefile(checkout.root)
        except OSError:
            continue
        if there and command.encode() in arguments and arguments[0].endswith(b"python") and b"wearable" in arguments:
            return int(process.name)
    return None


def running(node: SlurmNode) -> str:
    return node.ask("squeue", "-h", "-t", "RUNNING", "-o", "%i").split()[0]


def results_hash(checkout: Checkout) -> str:
    said = checkout.run("replay", "verify", str(checkout.bundle("wearable")))
    return re.search(r"^results ([0-9a-f]{64})", said, re.MULTILINE)[1]  # type: ignore[index]


@pytest.fixture(scope="module")
def disturbed(node: SlurmNode, checkout: Checkout) -> str:
    """What the season said whose solver was ended three times: by scancel, by kill -9, by its time limit."""
    season = submit(checkout, "season")
    output = checkout.root / "said.txt"
    try:
        for ending in ("scancel", "kill -9", "time limit"):
            pid = node.wait_for(lambda: solver(checkout, "impact"), f"no solver to end by {ending}", 400)
            job = running(node)
            if ending == "scancel":
                node.ask("scancel", job)
            elif ending == "kill -9":
                os.kill(pid, signal.SIGKILL)
            else:
                os.kill(pid, signal.SIGSTOP)  # so that it lasts longer than a minute, the least limit there is
                node.ask("scontrol", "update", f"JobId={job}", "TimeLimit=1")
            node.wait_for(lambda pid=pid: not Path(f"/proc/{pid}").exists(), f"{ending} did not end the solver", 300)
        said, _ = season.communicate(timeout=900)
    finally:
        if season.poll() is None:
            os.killpg(season.pid, signal.SIGKILL)
    output.write_text(said)
    assert season.returncode == 1, f"a season with a spoilt play does not succeed\n{said[-5000:]}"
    return said


def test_a_play_through_the_profile_ends_in_a_sealed_bundle(disturbed: str, checkout: Checkout) -> None:
    assert "verified" in checkout.run("replay", "verify", str(checkout.bundle("wearable")))


def test_an_ended_solver_went_on_from_its_checkpoint_each_time(disturbed: str, checkout: Checkout) -> None:
    log = (checkout.root / "results/wearable/logs/impact.log").read_text()
    begun = float(re.search(r"goes on from ([\d.e-]+) s", log)[1])  # type: ignore[index]
    assert begun > 0.0


def test_the_bundle_has_the_hash_of_a_run_that_nothing_disturbed(
    disturbed: str, checkout: Checkout, fresh: Checkout
) -> None:
    fresh.replay("wearable")
    assert results_hash(checkout) == results_hash(fresh)


def test_a_failing_play_stands_on_the_page_with_its_log_and_stops_no_other(disturbed: str, checkout: Checkout) -> None:
    with (checkout.root / "results/plays.csv").open(newline="") as stream:
        rows = {row["play"]: row for row in csv.DictReader(stream)}
    assert rows["wearable"]["verdict"].startswith("ACCEPTED")
    assert rows["spoilt"]["verdict"] == "FAILED"
    assert "plays.tsv:3: helmet.mass_kg" in rows["spoilt"]["reason"]
    assert "heavy" in (checkout.root / "results" / rows["spoilt"]["log"]).read_text()
    assert "spoilt" in (checkout.root / "results/index.html").read_text()


def test_nothing_is_run_twice(disturbed: str, node: SlurmNode, checkout: Checkout) -> None:
    planned = checkout.run("snakemake", "results/wearable/bundle/wearable.zip", "-n", "--config", "resolution=tiny")
    assert "Nothing to be done" in planned


def test_the_doctor_knows_the_account(node: SlurmNode, checkout: Checkout, repository: Path) -> None:
    here = Checkout(repository)
    said = here.start("replay", "doctor", "--node")
    text, _ = said.communicate(timeout=300)
    assert re.search(r"^ok +slurm .*cluster suite", text, re.MULTILINE), text
    assert re.search(r"^ok +partitions +suite; default suite", text, re.MULTILINE), text
    assert re.search(r"^ok +node +a job ran", text, re.MULTILINE), text


def test_a_script_beside_the_decks_replays_one_play_and_goes_on_after_its_warning(
    disturbed: str, node: SlurmNode, checkout: Checkout, tmp_path: Path
) -> None:
    replay = checkout.root / "results/wearable/replay"
    before = {p.name: p.read_bytes() for p in replay.iterdir() if p.is_file() and p.name != ".lock"}
    for path in replay.iterdir():
        if path.is_file():
            path.unlink()
    folder = checkout.root / "results/wearable/decks/replay"
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {"PATH": path, "PYTHONPATH": f"{checkout.root}/src"}
    job = subprocess.run(
        ["sbatch", "--parsable", "--cpus-per-task=1", "--mem=1000", "submit.slurm.sh"],
        cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip
    waiting = ("squeue", "-h", "-t", "PD,R,CG", "-o", "%i")
    node.wait_for(lambda: job not in node.ask(*waiting).split(), "the job goes on and on", 400)
    after = {p.name: p.read_bytes() for p in replay.iterdir() if p.is_file() and p.name != ".lock"}
    assert after == before, (folder / f"slurm-{job}.out").read_text()
