"""The sources a stage stands on: held against what Python really takes them from."""

from __future__ import annotations

import ast
import importlib
import inspect
from pathlib import Path
from types import ModuleType

import pytest

from replay.cli import _STAGES
from replay.sources import sources_of

WORKFLOW = sorted({module for module, _ in _STAGES.values()} | {"season", "write_out"})


def taken_by(file: Path, package: Path) -> set[Path]:
    """Files of the package that define what a module imports, asked of the living objects."""
    found: set[Path] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("replay"):
            continue
        module = importlib.import_module(node.module or "")
        for alias in node.names:
            there = hasattr(module, alias.name)
            thing = getattr(module, alias.name) if there else importlib.import_module(f"{node.module}.{alias.name}")
            origin = thing if isinstance(thing, ModuleType) else inspect.getmodule(thing)
            if isinstance(thing, ModuleType) or inspect.isclass(thing) or inspect.isfunction(thing):
                found.add(Path(inspect.getsourcefile(origin or module) or ""))
    return {path for path in found if package in path.parents}


@pytest.mark.parametrize("stage", WORKFLOW)
def test_whatever_a_stage_takes_from_the_package_is_among_its_sources(repository: Path, stage: str) -> None:
    package = repository / "src" / "replay"
    sources = set(sources_of(package / "stages" / f"{stage}.py"))
    for file in sorted(path for path in sources if path.suffix == ".py"):
        missing = taken_by(file, package) - sources
        assert not missing, f"{file.name} takes from {sorted(p.name for p in missing)}"


def test_data_beside_the_code_counts(repository: Path) -> None:
    package = repository / "src" / "replay"
    names = {path.relative_to(package).as_posix() for path in sources_of(package / "stages" / "assemble.py")}
    assert {"gates/limits.yaml", "models/data/helmets/classic.yaml", "models/data/anatomy.npz"} <= names


def test_a_stage_does_not_stand_on_what_it_never_asks(repository: Path) -> None:
    package = repository / "src" / "replay"

    def of(stage: str) -> set[str]:
        return {path.relative_to(package).as_posix() for path in sources_of(package / "stages" / f"{stage}.py")}

    assert "solver/run.py" not in of("assemble") | of("fidelity") | of("reconstruct")
    assert "solver/run.py" in of("impact") & of("shake") & of("sensitivity")
    assert not {name for name in of("reconstruct") if name.startswith(("bundle/", "report/", "models/"))}


def test_every_rule_of_the_workflow_names_the_sources_of_its_own_command(repository: Path) -> None:
    import re

    commands = {name: module for name, (module, _) in _STAGES.items()} | {"season": "season", "write-out": "write_out"}
    rules = "".join(path.read_text() for path in sorted((repository / "workflow" / "rules").glob("*.smk")))
    blocks = re.split(r"^rule (\w+):", rules, flags=re.MULTILINE)[1:]
    named = 0
    for rule, body in zip(blocks[::2], blocks[1::2]):
        command = re.search(r'"replay ([\w-]+)', body)
        if command:
            assert f'code=code("{commands[command[1]]}")' in body, rule
            named += 1
    assert named >= len(_STAGES)
