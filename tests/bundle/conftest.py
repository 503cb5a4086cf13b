"""A small play that never was: every stage's folder with the names of a real one, in a second."""

from __future__ import annotations

import base64
import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from replay.bundle import seal
from replay.files import write_json
from replay.manifest import Artifact, write_manifest

GIT = ("git", "-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false")


def _stage(
    results: Path, name: str, files: dict[str, bytes], *, inputs: tuple[str, ...] = (), **options: object
) -> None:
    folder = results / name
    artifacts = []
    for path, content in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)
        if path.endswith(".log"):
            artifacts.append(Artifact.volatile(path, "what the stage printed"))
        elif path == "histories.csv":
            artifacts.append(Artifact.tolerance(path, "histories", rtol=1e-6, atol=1e-9, unit="m"))
        else:
            artifacts.append(Artifact.exact(path, f"{path} of {name}"))
    write_manifest(
        folder,
        stage=name,
        play=results.name,
        artifacts=artifacts,
        inputs={path: results / path for path in inputs},
        versions={"replay": "0.1.0", "python": "3.11"},
        **options,  # type: ignore[arg-type]
    )


def _gate(name: str, verdict: str, value: float = 0.2) -> bytes:
    check = {"name": "hourglass_ratio", "value": value, "unit": "1", "limit": 0.1, "verdict": verdict, "source": "x"}
    return json.dumps({"gate": name, "verdict": verdict, "checks": [check]}).encode()


def fabricate(folder: Path, *, rejected: bool = False, shift: float = 0.0, log: bytes = b"took 3 s\n") -> Path:
    """Write ``results/demo`` under `folder`.

    Parameters
    ----------
    folder
        Where; nothing of it enters the files.
    rejected
        Whether the shake gate stops the play.
    shift
        Added to one value of the histories (class tolerance) and to nothing else.
    log
        Content of the one volatile file.
    """
    results = folder / "results" / "demo"
    numbers = np.random.default_rng(7).normal(size=(40, 2))
    tracks = {"clicks": "kinovea_clicks.csv", "landmarks": "helmet_landmarks.csv", "camera": "Config.json"}
    play = {
        "name": "demo",
        "source": {"kind": "clicks", **tracks},
        "helmet": {"model": "classic", "mass_kg": 1.83},
        "model": {"preset": "nfl", "resolution": "tiny"},
        "gates": {},
    }
    _stage(results, "settings", {"play.json": json.dumps(play).encode()})
    raw = {name: f"{name}\n1,2\n".encode() for name in tracks.values()}
    _stage(results, "inputs", raw, inputs=("settings/play.json",))
    outputs = [f"{name}.csv" for name in ("poses_per_frame", "kinematics", "initial_conditions_t0", "qc_per_frame")]
    motion = dict.fromkeys([*outputs, "qc_summary.txt"], b"time_s,x_m\n0.0,1.0\n0.1,1.5\n")
    motion["gate.json"] = _gate("reconstruction", "pass")
    _stage(results, "reconstruction", motion, inputs=("inputs/kinovea_clicks.csv",))
    _stage(results, "driver", {"driver_6dof.csv": b"time_s,x_m\n0.0,1.0\n"}, inputs=("reconstruction/kinematics.csv",))
    _stage(results, "decks", {"velodyne/velodyne.card": b"*END\n"}, inputs=("driver/driver_6dof.csv",))
    stopped = (
        {"status": "stopped", "stopped_by": "stopped by gate shake: hourglass_ratio = 0.2 > 0.1"} if rejected else {}
    )
    _stage(results, "shake", {"gate.json": _gate("shake", "fail" if rejected else "pass")}, **stopped)
    rows = "".join(f"{i * 1e-4!r},{float(a) + (shift if i == 3 else 0.0)!r}\n" for i, (a, _) in enumerate(numbers))
    if not rejected:
        files = {"histories.csv": f"time_s,x_m\n{rows}".encode(), "states.vtkhdf": numbers.tobytes(), "run.log": log}
        _stage(results, "replay", files, inputs=("driver/driver_6dof.csv",))
        (results / "replay" / "checkpoint").mkdir()
        (results / "replay" / "checkpoint" / "000100.h5").write_bytes(b"x" * 1000)
    (results / "logs").mkdir()
    (results / "logs" / "impact.log").write_text(str(folder))
    status = "rejected" if rejected else "accepted"
    gates = {"reconstruction": "pass", "shake": "fail" if rejected else "pass"}
    cause = {
        "gate": "shake",
        "check": "hourglass_ratio",
        "verdict": "fail",
        "sentence": "hourglass_ratio 0.2 (limit 0.1)",
    }
    verdict = {
        "play": "demo",
        "status": status,
        "line": f"demo: {status}",
        "gates": gates,
        "stopped_by": "shake" if rejected else "",
        "not_evaluated": [],
        "causes": [cause] if rejected else [],
        "loosened": [],
    }
    _stage(results, "verdict", {"verdict.json": json.dumps(verdict).encode()}, inputs=("shake/gate.json",))
    return results


def fabricate_source(root: Path) -> Path:
    """Write the least of a source tree, not under git."""
    files = {
        "Snakefile": "rule all:\n    input: []\n",
        "environment.lock": "numpy==2.0.0\n",
        "pyproject.toml": "[project]\n",
        "CITATION.cff": "cff-version: 1.2.0\n",
        "config/config.yaml": "plays: [demo]\n",
        "workflow/rules/replay.smk": "rule impact:\n    shell: 'replay impact'\n",
        "src/replay/__init__.py": '__version__ = "0.1.0"\n',
    }
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def commit(root: Path) -> str:
    """Put a tree under git, and return the commit."""
    for command in (("init", "-q"), ("add", "-A"), ("commit", "-q", "-m", "x", "--date", "2020-01-01T00:00:00Z")):
        subprocess.run([*GIT, "-C", str(root), *command], check=True)
    return subprocess.run(
        ["git", "-C", str(root), "rev-parse", "HEAD"], check=True, capture_output=True, text=True
    ).stdout.strip()


def fabricate_records(folder: Path) -> Path:
    """Write records as Snakemake does, for two stages."""
    for start, stage in ((1_700_000_000, "driver"), (1_700_000_100, "replay")):
        name = base64.urlsafe_b64encode(f"results/demo/{stage}/manifest.json".encode()).decode()
        command = f"replay {stage} demo --results /home/somebody/work/results"
        record = {
            "rule": stage,
            "shellcmd": command,
            "starttime": start + 0.5,
            "endtime": start + 60.0,
            "incomplete": False,
        }
        write_json(folder / name, record)
    return folder


@pytest.fixture(scope="session")
def source_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fabricate_source(tmp_path_factory.mktemp("source"))


@pytest.fixture(scope="session")
def sealed(tmp_path_factory: pytest.TempPathFactory, source_root: Path) -> Callable[..., Path]:
    """Seal a fabricated play; the same options give the same file."""
    made: dict[str, Path] = {}

    def make(**options: object) -> Path:
        key = repr(sorted(options.items()))
        if key not in made:
            folder = tmp_path_factory.mktemp("run")
            results = fabricate(folder, **options)  # type: ignore[arg-type]
            records = fabricate_records(folder / "records")
            made[key] = results / "bundle" / "demo.zip"
            seal(results, made[key], source_root=source_root, job_records=records)
        return made[key]

    return make
