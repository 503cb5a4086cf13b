"""Running a bundle again: shown and asked first, nothing unsafe unpacked, what comes out compared."""

from __future__ import annotations

import hashlib
import io
import json
import stat
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.bundle.conftest import fabricate, fabricate_source

from replay.bundle import seal
from replay.cli import main
from replay.files import write_json
from replay.manifest import Artifact, write_manifest

sealing = sys.modules["replay.bundle.seal"]


def play_folder(root: Path) -> Path:
    folder = root / "plays" / "demo"
    folder.mkdir(parents=True)
    (folder / "play.yaml").write_text("name: demo\n")
    (folder / "video.mp4").write_bytes(b"frames")
    return folder


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("sealed")
    path = root / "demo.zip"
    seal(fabricate(root), path, source_root=fabricate_source(root / "source"), play_folder=play_folder(root))
    return path


@pytest.fixture
def environment(tmp_path: Path, bundle: Path) -> Path:
    """An environment whose Python writes down how it was called, and makes the bundle that was sealed."""
    python = tmp_path / "environment" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(
        '#!/bin/sh\necho "$PYTHONPATH" > called\necho "$VIRTUAL_ENV" >> called\necho "$@" >> called\n'
        f"mkdir -p results/demo/bundle && cp {bundle} results/demo/bundle/demo.zip\n"
    )
    python.chmod(0o755)
    return python.parents[1]


def test_it_unpacks_source_and_play_runs_the_workflow_and_compares(tmp_path, bundle, environment, capfd, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/somewhere/else")
    monkeypatch.setenv("VIRTUAL_ENV", "/somewhere/else")
    into = tmp_path / "again"
    options = ["--into", str(into), "--yes", "--environment", str(environment), "--cores", "1"]
    assert main(["rerun", str(bundle), *options]) == 0
    said = capfd.readouterr().out
    assert "this runs code that came with the bundle" in said
    assert "the runs agree: exact" in said
    source = into / "source"
    assert (source / "src/replay/__init__.py").read_text() == '__version__ = "0.1.0"\n'
    assert (into / "plays/demo/play.yaml").read_text() == "name: demo\n"
    path, virtual, arguments = (source / "called").read_text().splitlines()
    assert Path(path) == source / "src"
    assert virtual == ""
    wanted = "-m snakemake results/demo/bundle/demo.zip --cores 1 --config plays_folder=../plays table= resolution=tiny"
    assert arguments == wanted


def test_without_an_environment_it_installs_the_lock_with_its_hashes(tmp_path, bundle, monkeypatch, capsys):
    monkeypatch.setattr("builtins.input", lambda _: "n")
    for tool in ("/usr/bin/uv", None):
        monkeypatch.setattr("shutil.which", lambda _, tool=tool: tool)
        assert main(["rerun", str(bundle), "--into", str(tmp_path / "again")]) == 1
        said = capsys.readouterr().out
        assert "--require-hashes -r environment.lock" in said
        assert ".venv" in said
        assert said.endswith("nothing was done\n")
        assert not (tmp_path / "again").exists()


def test_nobody_to_ask_is_no_consent(tmp_path, bundle, monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert main(["rerun", str(bundle), "--into", str(tmp_path / "again")]) == 1
    assert "add --yes" in capsys.readouterr().err
    assert not (tmp_path / "again").exists()


def test_a_command_that_fails_is_named_and_the_folder_left_as_it_is(tmp_path, bundle, environment, capfd):
    (environment / "bin/python").write_text("#!/bin/sh\necho broken; exit 3\n")
    options = ["--into", str(tmp_path / "again"), "--yes", "--environment", str(environment)]
    assert main(["rerun", str(bundle), *options]) == 1
    assert "snakemake results/demo/bundle/demo.zip" in capfd.readouterr().err
    assert (tmp_path / "again/source/Snakefile").is_file()


def test_a_folder_in_use_or_no_environment_is_refused(tmp_path, bundle, capsys):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").touch()
    assert main(["rerun", str(bundle), "--into", str(tmp_path / "full"), "--yes"]) == 2
    assert "the folder is not empty" in capsys.readouterr().err
    options = ["--into", str(tmp_path / "again"), "--yes", "--environment", str(tmp_path / "none")]
    assert main(["rerun", str(bundle), *options]) == 2
    assert "it has no bin/python" in capsys.readouterr().err


def test_a_changed_byte_runs_nothing(tmp_path, bundle, environment, capsys):
    data = bytearray(bundle.read_bytes())
    data[data.index(b"rule all")] ^= 1
    (tmp_path / "demo.zip").write_bytes(data)
    options = ["--into", str(tmp_path / "again"), "--yes", "--environment", str(environment)]
    assert main(["rerun", str(tmp_path / "demo.zip"), *options]) == 1
    assert "changed since it was sealed" in capsys.readouterr().err
    assert not (tmp_path / "again").exists()


def member(name: str, kind: bytes = tarfile.REGTYPE, link: str = "", **fields) -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type, info.linkname = kind, link
    for field, value in fields.items():
        setattr(info, field, value)
    return info


SNAPSHOTS: dict[str, tuple[list[tarfile.TarInfo], str]] = {
    "a path that climbs out": ([member("../evil")], "leads out of the bundle"),
    "a path that climbs out from inside": ([member("src/../../evil")], "leads out of the bundle"),
    "an absolute path": ([member("/etc/evil")], "absolute path"),
    "a symbolic link": ([member("src/link", tarfile.SYMTYPE, "/etc")], "is a link"),
    "a file through a link": ([member("src", tarfile.SYMTYPE, "/tmp"), member("src/evil")], "is a link"),
    "a hard link": ([member("src/link", tarfile.LNKTYPE, "/etc/passwd")], "is a link"),
    "a hard link inside": ([member("a"), member("b", tarfile.LNKTYPE, "a")], "is a link"),
    "a device": ([member("null", tarfile.CHRTYPE)], "is a link, a folder or a special file"),
    "a named pipe": ([member("pipe", tarfile.FIFOTYPE)], "special file"),
    "a folder": ([member("src", tarfile.DIRTYPE)], "special file"),
    "one name twice": ([member("a"), member("a")], "occurs twice"),
    "names that differ in case alone": ([member("a"), member("A")], "differs in case alone"),
    "a file where a folder is": ([member("a"), member("a/b")], "a file where another entry needs a folder"),
    "a name that hides": ([member("ev\u202eil")], "invisible characters"),
    "another name in an extended header": ([member("a", pax_headers={"path": "../evil"})], "leads out"),
    "a hole that swells": ([member("a", pax_headers={"GNU.sparse.major": "1", "GNU.sparse.minor": "0"})], "tar"),
}


def hostile(root: Path, infos: list[tarfile.TarInfo], monkeypatch: pytest.MonkeyPatch) -> Path:
    """Seal a bundle that verifies, around a snapshot that must not be unpacked."""

    def write(_: object, stream: io.BufferedWriter) -> None:
        with tarfile.open(fileobj=stream, mode="w", format=tarfile.PAX_FORMAT) as tar:
            for info in infos:
                tar.addfile(info)

    monkeypatch.setattr(sealing, "write_snapshot", write)
    path = root / "demo.zip"
    seal(fabricate(root), path, source_root=fabricate_source(root / "source"), play_folder=play_folder(root))
    return path


@pytest.mark.parametrize("what", SNAPSHOTS)
def test_a_hostile_snapshot_is_refused_before_anything_is_written_or_run(tmp_path, what, monkeypatch, capsys):
    infos, reason = SNAPSHOTS[what]
    path = hostile(tmp_path, infos, monkeypatch)
    assert main(["verify", str(path)]) == 0, "verifying neither unpacks nor minds what a file holds"

    def never(*_: object, **__: object) -> None:
        message = "something of a hostile bundle was run"
        raise AssertionError(message)

    monkeypatch.setattr(subprocess, "Popen", never)
    assert main(["rerun", str(path), "--into", str(tmp_path / "again"), "--yes"]) == 1
    said = capsys.readouterr().err
    assert reason in said
    assert "source/source.tar" in said
    assert not (tmp_path / "again").exists()


@pytest.mark.parametrize("play", ["demo; touch evil", "../demo", "$(touch evil)", "--cores"])
def test_a_play_whose_name_would_be_a_command_is_refused(tmp_path, bundle, play, monkeypatch, capsys):
    real = sealing.bundle_facts
    monkeypatch.setattr(sealing, "bundle_facts", lambda *a: real(*a) | {"play": play})
    path = tmp_path / "demo.zip"
    seal(fabricate(tmp_path), path, source_root=fabricate_source(tmp_path / "s"), play_folder=play_folder(tmp_path))
    assert main(["rerun", str(path), "--into", str(tmp_path / "again"), "--yes"]) == 1
    assert "is no name that a command may hold" in capsys.readouterr().err


def test_a_play_whose_tracks_lay_elsewhere_cannot_be_run_again_and_says_which(tmp_path, capsys):
    results = fabricate(tmp_path)
    inputs = results / "inputs"
    write_json(inputs / "inputs.json", {"files": [{"file": "impact_1.csv"}]})
    artifacts = [Artifact.exact("inputs.json", "x")]
    write_manifest(inputs, stage="inputs", play="demo", artifacts=artifacts)
    path = tmp_path / "demo.zip"
    seal(results, path, source_root=fabricate_source(tmp_path / "s"), play_folder=play_folder(tmp_path))
    assert main(["rerun", str(path), "--into", str(tmp_path / "again"), "--yes"]) == 1
    assert "the play names impact_1.csv outside its own folder" in capsys.readouterr().err


def test_programs_of_the_source_keep_their_mode_and_gain_no_other(tmp_path, environment, monkeypatch, bundle):
    programs = [member("Snakefile"), member("environment.lock"), member("pyproject.toml")]
    programs += [member(".ci/run", mode=0o755), member("setuid", mode=0o6777)]
    path = hostile(tmp_path, programs, monkeypatch)
    options = ["--into", str(tmp_path / "again"), "--yes", "--environment", str(environment)]
    main(["rerun", str(path), *options])
    modes = {p.name: stat.S_IMODE(p.stat().st_mode) for p in (tmp_path / "again/source").rglob("*") if p.is_file()}
    assert (modes["run"], modes["setuid"], modes["Snakefile"]) == (0o755, 0o755, 0o644)


@pytest.fixture
def withheld(tmp_path: Path) -> Path:
    """A bundle of a play whose video may not be shared."""
    path = tmp_path / "demo.zip"
    seal(
        fabricate(tmp_path),
        path,
        source_root=fabricate_source(tmp_path / "source"),
        play_folder=play_folder(tmp_path),
        withhold={"plays/demo/video.mp4": "belongs to the league"},
    )
    return path


def test_a_withheld_file_is_asked_for_by_its_hash_and_taken_from_who_has_it(tmp_path, withheld, environment, capsys):
    options = ["--into", str(tmp_path / "again"), "--yes", "--environment", str(environment)]
    (tmp_path / "mine").mkdir()
    for folder in ([], ["--withheld", str(tmp_path / "mine")]):
        assert main(["rerun", str(withheld), *options, *folder]) == 2
        said = capsys.readouterr().err
        assert "was withheld (belongs to the league)" in said
        assert hashlib.sha256(b"frames").hexdigest() in said
    (tmp_path / "mine/video.mp4").write_bytes(b"other frames")
    assert main(["rerun", str(withheld), *options, "--withheld", str(tmp_path / "mine")]) == 2
    assert "this is not it" in capsys.readouterr().err
    assert not (tmp_path / "again").exists()
    (tmp_path / "mine/video.mp4").write_bytes(b"frames")
    main(["rerun", str(withheld), *options, "--withheld", str(tmp_path / "mine")])
    assert (tmp_path / "again/plays/demo/video.mp4").read_bytes() == b"frames"


def stage(results: Path, name: str) -> None:
    write_json(results / name / "a.json", {})
    write_manifest(results / name, stage=name, play="demo", artifacts=[Artifact.exact("a.json", "x")])


@pytest.fixture
def interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    results = fabricate(tmp_path)
    play_folder(tmp_path)
    for name in ("assembly", "sensitivity", "measures", "report"):
        stage(results, name)
    (results / "replay" / "manifest.json").unlink()
    monkeypatch.chdir(tmp_path)
    return lambda *options: main(["seal", "demo", "--plays", "plays", *options])


def test_an_interrupted_run_is_sealed_on_request_and_says_what_it_did_not_come_to(interrupted, tmp_path, capsys):
    assert interrupted() == 2
    assert "replay impact" in capsys.readouterr().err
    assert interrupted("--interrupted") == 0
    assert "INTERRUPTED, sealed and verified" in capsys.readouterr().out
    bundle = tmp_path / "results/demo/bundle/demo.zip"
    assert main(["show", str(bundle)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("demo: INTERRUPTED\n")
    assert "the run ended before replay, fidelity; nothing was judged" in said
    assert "pass  shake" in said
    assert main(["table", str(bundle), "--out", str(tmp_path / "plays")]) == 0
    assert ',INTERRUPTED,"demo: the run ended before replay' in (tmp_path / "plays.csv").read_text()


def test_what_the_play_withholds_is_sealed_by_hash_alone(interrupted, tmp_path, capsys):
    results = tmp_path / "results/demo"
    settings = json.loads((results / "settings/play.json").read_text())
    settings["withhold"] = {"video.mp4": "belongs to the league", "kinovea_clicks.csv": "not ours"}
    (tmp_path / "plays/demo/kinovea_clicks.csv").write_text("clicks")
    film = bytes(range(128, 256)) * 3
    (tmp_path / "plays/demo/video.mp4").write_bytes(film)
    write_json(results / "settings/play.json", settings)
    artifacts = [Artifact.exact("play.json", "x")]
    write_manifest(results / "settings", stage="settings", play="demo", artifacts=artifacts)
    assert interrupted("--interrupted") == 0
    bundle = results / "bundle/demo.zip"
    assert film not in bundle.read_bytes()
    with zipfile.ZipFile(bundle) as archive:
        assert not [name for name in archive.namelist() if name.endswith(("video.mp4", "kinovea_clicks.csv"))]
    capsys.readouterr()
    assert main(["show", str(bundle)]) == 0
    said = capsys.readouterr().out
    assert f"plays/demo/video.mp4 (belongs to the league), sha256 {hashlib.sha256(film).hexdigest()[:12]}" in said
    assert "results/inputs/kinovea_clicks.csv (not ours)" in said
