"""The house's import rule: one way, top to bottom, and no room knows its neighbour."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOMS = {"motion", "models", "measures", "gates", "decks", "bundle", "report", "laboratory"}
LEAVES = {"controls", "documents", "errors", "files", "tables", "manifest", "play"}
MAY_IMPORT: dict[str, set[str]] = {
    "cli": {"stages", "doctor", *LEAVES},
    "doctor": set(LEAVES),
    "sources": set(),
    "stages": {*ROOMS, "solver", "stages", *LEAVES},
    **{room: {room, "solver", *LEAVES} for room in ROOMS},
    "solver": {"solver", "errors", "files", "tables"},
    "errors": set(),
    "files": {"errors"},
    "tables": {"errors", "files"},
    "manifest": {"errors", "files"},
    "documents": {"errors", "files"},
    "play": {"play", "documents", "errors", "files"},
    "controls": {"documents", "play"},
}
VAGUE = {"utils", "util", "helpers", "helper", "misc", "common", "core"}


def modules(repository: Path) -> list[Path]:
    return sorted((repository / "src" / "replay").rglob("*.py"))


def imported_rooms(path: Path) -> set[tuple[str, int]]:
    rooms: set[tuple[str, int]] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import at line {node.lineno}; name the room"
            module = node.module or ""
            names = [f"{module}.{alias.name}" for alias in node.names] if module == "replay" else [module]
        rooms |= {(name.split(".")[1], node.lineno) for name in names if name.startswith("replay.")}
    return rooms


def test_imports_go_one_way(repository: Path) -> None:
    package = repository / "src" / "replay"
    wrong = []
    for path in modules(repository):
        relative = path.relative_to(package)
        room = relative.parts[0].removesuffix(".py")
        if room == "__init__":
            continue
        assert room in MAY_IMPORT, f"{relative}: a room the map does not know; draw it into CONTRIBUTING.md and here"
        wrong += [
            f"{relative}:{line} imports {target}"
            for target, line in imported_rooms(path)
            if target not in MAY_IMPORT[room] and target != "__version__"
        ]
    assert not wrong, "\n".join(wrong)


def test_the_kernels_know_only_themselves(repository: Path) -> None:
    kernels = repository / "src" / "replay" / "solver" / "kernels"
    for path in sorted(kernels.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("replay"):
                assert (node.module or "").startswith("replay.solver.kernels"), f"{path.name}:{node.lineno}"


def test_every_room_has_a_name_that_says_something(repository: Path) -> None:
    vague = [p for p in modules(repository) if p.stem in VAGUE or p.parent.name in VAGUE]
    assert not vague, f"rooms whose name says nothing: {vague}"


def test_only_the_command_line_parses_arguments(repository: Path) -> None:
    for path in modules(repository):
        if path.name != "cli.py":
            assert "argparse" not in path.read_text(encoding="utf-8"), path


@pytest.mark.parametrize("heavy", ["cv2", "matplotlib", "numba", "h5py", "pandas"])
def test_the_command_line_starts_without_heavy_libraries(heavy: str) -> None:
    import subprocess
    import sys

    code = f"import sys, replay.cli as c; c._parser(); sys.exit({heavy!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
