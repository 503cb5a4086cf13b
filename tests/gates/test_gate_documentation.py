"""docs/gates.md: its tables are those of limits.yaml, its example runs."""

from __future__ import annotations

import re
from pathlib import Path

from replay.gates.handbook import limits_markdown

MARK = "<!-- limits: written by python -m replay.gates.handbook -->\n\n"


def test_tables_of_the_documentation_are_those_of_the_limits(repository: Path):
    page = (repository / "docs" / "gates.md").read_text(encoding="utf-8")
    assert page.split(MARK)[1] == limits_markdown()


def test_example_of_the_documentation_runs(repository: Path):
    page = (repository / "docs" / "gates.md").read_text(encoding="utf-8")
    examples = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    assert examples
    for example in examples:
        exec(compile(example, "docs/gates.md", "exec"), {})
