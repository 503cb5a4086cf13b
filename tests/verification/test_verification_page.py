"""The page lists every problem that the tests check."""

from __future__ import annotations

import ast
from pathlib import Path


def reported(function: ast.FunctionDef) -> set[str]:
    """Names in one test: constant strings, and the constant heads of f-strings."""
    assigned = {
        target.id: node.value
        for node in ast.walk(function)
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    names: set[str] = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "report":
            first = node.args[0]
            value = assigned.get(first.id, first) if isinstance(first, ast.Name) else first
            if isinstance(value, ast.JoinedStr):
                value = value.values[0]
            if isinstance(value, ast.Constant):
                names.add(str(value.value))
    return names


def problem_names() -> set[str]:
    """Beginnings of the names that tests report under."""
    names: set[str] = set()
    for path in sorted(Path(__file__).parent.glob("test_*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for function in (node for node in tree.body if isinstance(node, ast.FunctionDef)):
            names |= reported(function)
    return names


def test_the_page_lists_every_problem(repository: Path) -> None:
    names = problem_names()
    assert len(names) >= 10
    page = (repository / "docs" / "verification.md").read_text(encoding="utf-8")
    missing = sorted(name for name in names if f"| {name}" not in page)
    assert not missing, f"write the page anew (REPLAY_VERIFICATION_TABLE=docs/verification.md): {missing} missing"
