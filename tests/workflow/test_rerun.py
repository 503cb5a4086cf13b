"""A bundle is enough: run again where nothing else of the project is to be had, it comes out byte for byte."""

from __future__ import annotations

import re
import site
import sys
import venv
import zipfile
from pathlib import Path

import pytest

from tests.workflow.conftest import Checkout

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def stranger(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with every dependency but without the project: no path of it leads to a checkout."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False, symlinks=True)
    packages = next(p for p in map(Path, site.getsitepackages()) if (p / "snakemake").is_dir())
    own = next((folder / "lib").glob("python*/site-packages"))
    # Links in a .pth file found by another .pth file are not followed, so that an editable install stays behind.
    (own / "dependencies.pth").write_text(f"{packages}\n")
    script = folder / "bin" / "replay"
    script.write_text(f"#!{folder}/bin/python\nimport sys\nfrom replay.cli import main\nsys.exit(main())\n")
    script.chmod(0o755)
    return folder


@pytest.fixture(scope="module")
def again(finished: Checkout, stranger: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The demo's bundle run again in an empty folder; the folder and what was printed."""
    into = tmp_path_factory.mktemp("laboratory") / "again"
    options = ("--into", str(into), "--yes", "--environment", str(stranger), "--cores", "2")
    return into, finished.run("replay", "rerun", str(finished.bundle("demo")), *options)


def test_the_environment_of_the_second_laboratory_has_no_project_in_it(stranger: Path, finished: Checkout) -> None:
    probe = f"{stranger}/bin/python", "-c", "import importlib.util as u, numba; print(u.find_spec('replay'))"
    lone = Checkout(stranger)
    assert lone.run("env", "-u", "PYTHONPATH", *probe).strip() == "None"


def test_every_exact_artifact_comes_out_byte_for_byte(again: tuple[Path, str], finished: Checkout) -> None:
    into, said = again
    assert re.search(r"the runs agree: exact \d{3} same; volatile 1 not compared\n", said), said
    assert "different source" not in said
    bundles = (finished.bundle("demo"), into / "source/results/demo/bundle/demo.zip")
    contents = []
    for path in bundles:
        with zipfile.ZipFile(path) as archive:
            names = [n for n in archive.namelist() if n.startswith("demo/data/results/")]
            contents.append({name: archive.read(name) for name in names})
    assert contents[0] == contents[1]
    assert len(contents[0]) > 80


def test_with_one_parameter_changed_the_first_artifact_that_differs_is_named_with_its_unit(
    again: tuple[Path, str], finished: Checkout, stranger: Path
) -> None:
    into, _ = again
    play = into / "plays/demo/play.yaml"
    play.write_text(play.read_text().replace("before_t0_s: 0.010", "before_t0_s: 0.012"))
    there = Checkout(into / "source")
    for stage in ("settings", "inputs", "reconstruct", "drive"):
        options = ["--plays", "../plays"] + (["--resolution", "tiny"] if stage == "settings" else [])
        there.run(str(stranger / "bin/replay"), stage, "demo", *options)
    said = there.run("replay", "compare", str(finished.bundle("demo")), "results/demo", expect=1)
    lines = said.splitlines()
    assert lines[0].startswith("the runs differ: exact ")
    assert lines[1] == "first to differ, in the order of the workflow:"
    assert lines[2].startswith(
        "  results/settings/play.json (exact): differs, worst at window.before_t0_s: 0.01 s -> 0.012 s"
    )
    assert "(by 0.002 s, relative 0.2)" in lines[2]
    driver = next(line for line in lines if "driver_6dof.csv" in line)
    assert re.search(r"worst at line \d+, \w+: .* (m|rad)/s\^2", driver), driver


def test_the_python_that_runs_the_tests_is_the_one_the_environment_was_made_of(stranger: Path) -> None:
    assert (stranger / "bin" / "python").resolve() == Path(sys.executable).resolve()
