"""Many plays and one play many times, on this machine: a failing play, killed members, the same bands."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import time
from pathlib import Path

import pytest

from tests.workflow.conftest import Checkout, make_checkout

pytestmark = pytest.mark.slow
TABLE = """\
# a season of three lines
play\tbase\twindow.duration_s\thelmet.mass_kg
short\twearable\t0.003\t
spoilt\twearable\t0.003\theavy
nowhere\tnobody\t\t
"""
ENSEMBLE = "title: Two masses\nvary:\n  helmet.mass_kg: [1.75, 1.9]\n"
PLAYS = ("season", "results/short.mass/bands/manifest.json")
CONFIG = ("--cores", "2", "--keep-going", "--config", "resolution=tiny", "checkpoint_every_s=1")


@pytest.fixture(scope="module")
def season(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Checkout, str]:
    there = make_checkout(repository, tmp_path_factory.mktemp("season") / "replay")
    (there.root / "config/plays.tsv").write_text(TABLE)
    (there.root / "config/plays/wearable/mass.ensemble.yaml").write_text(ENSEMBLE)
    return there, there.run("snakemake", *PLAYS, *CONFIG, expect=1)


def rows(checkout: Checkout) -> dict[str, dict[str, str]]:
    with (checkout.root / "results/plays.csv").open(newline="") as stream:
        return {row["play"]: row for row in csv.DictReader(stream)}


def bands(checkout: Checkout) -> bytes:
    folder = checkout.root / "results/short.mass/bands"
    return b"".join((folder / name).read_bytes() for name in ("bands.csv", "members.csv", "manifest.json"))


def test_plays_that_fail_stop_no_other_and_are_listed_with_their_logs(season: tuple[Checkout, str]) -> None:
    checkout, _ = season
    found = rows(checkout)
    assert list(found) == ["short", "spoilt", "nowhere"]
    assert found["short"]["verdict"] in ("ACCEPTED", "ACCEPTED WITH WARNINGS", "REJECTED")
    for play, where in (("spoilt", "plays.tsv:4: helmet.mass_kg"), ("nowhere", "plays.tsv:5: base")):
        assert found[play]["verdict"] == "FAILED"
        assert where in found[play]["reason"]
        assert (checkout.root / "results" / found[play]["log"]).is_file()
    page = (checkout.root / "results/index.html").read_text()
    assert 'href="short/report/report.html"' in page
    assert f'href="{found["spoilt"]["log"]}"' in page


def test_a_play_of_the_table_is_sealed_with_the_description_it_was_run_by(season: tuple[Checkout, str]) -> None:
    checkout, _ = season
    checkout.run("replay", "verify", str(checkout.bundle("short")))
    assert "0.003" in (checkout.root / "results/plays.d/short/play.yaml").read_text()
    shown = checkout.run("replay", "show", str(checkout.bundle("short")))
    assert shown.startswith("short:")


def test_the_table_says_what_each_play_cost(season: tuple[Checkout, str]) -> None:
    found = rows(season[0])["short"]
    assert float(found["cpu_s"]) > 0
    assert float(found["wall_s"]) > 0
    assert float(found["memory_mb"]) > 100


def test_another_line_of_the_table_runs_nothing_again(season: tuple[Checkout, str]) -> None:
    checkout, _ = season
    table = checkout.root / "config/plays.tsv"
    table.write_text(TABLE + "more\twearable\t0.004\t\n")
    try:
        assert checkout.planned("short") == []
        assert "settings" in checkout.planned("more")
    finally:
        table.write_text(TABLE)


def test_members_share_what_does_not_vary(season: tuple[Checkout, str]) -> None:
    folder = season[0].root / "results/short.mass"
    made = sorted(p.parent.relative_to(folder).as_posix() for p in folder.rglob("manifest.json"))
    own = ("assembly", "fidelity", "measures", "replay", "settings", "shake")
    assert made == sorted(["bands", *(f"{k}/{stage}" for k in ("001", "002") for stage in own)])
    masses = [
        json.loads((folder / k / "assembly/mass_properties.json").read_text())["assemblies"]["helmet"]["mass_kg"]
        for k in ("001", "002")
    ]
    assert masses == pytest.approx([1.75, 1.9], abs=1e-3)


def test_an_ensemble_whose_members_were_killed_ends_in_the_same_bands(
    season: tuple[Checkout, str], tmp_path: Path
) -> None:
    before = bands(season[0])
    shutil.copytree(season[0].root, tmp_path / "replay", symlinks=True)
    copy = Checkout(tmp_path / "replay")
    for member in ("001", "002"):
        for stage in ("replay", "fidelity", "measures"):
            shutil.rmtree(copy.root / f"results/short.mass/{member}/{stage}")
    shutil.rmtree(copy.root / "results/short.mass/bands")
    run = copy.start("snakemake", PLAYS[1], *CONFIG)
    deadline, killed = time.monotonic() + 300, set()
    while len(killed) < 2 and run.poll() is None and time.monotonic() < deadline:
        for process in Path("/proc").iterdir():
            try:
                arguments = (process / "cmdline").read_bytes().split(b"\0")
                there = (process / "cwd").samefile(copy.root)
            except OSError:
                continue
            if len(killed) == 2:
                break
            if there and b"impact" in arguments and arguments[0].endswith(b"python") and process.name not in killed:
                os.kill(int(process.name), signal.SIGKILL)
                killed.add(process.name)
        time.sleep(0.1)
    said, _ = run.communicate(timeout=600)
    assert len(killed) == 2
    assert run.returncode == 0, said[-4000:]
    assert bands(copy) == before
