"""The verification table: every problem with a known answer reports reference, result and error here.

``REPLAY_VERIFICATION_TABLE=docs/verification.md pytest tests/verification`` writes the page.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

_HEAD = """# Verification

Problems with known answers, and what the solver makes of them. This page is written by the tests
that check it: `REPLAY_VERIFICATION_TABLE=docs/verification.md pytest tests/verification`.
The error is relative to the reference, or absolute where the reference is zero. Each problem is a test in
`tests/verification`, where its mesh and settings stand.

| problem | quantity | reference | result | error | tolerance |
|---|---|---:|---:|---:|---:|
"""


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    problem: str
    quantity: str
    reference: float
    result: float
    tolerance: float

    @property
    def error(self) -> float:
        """Relative to the reference, absolute where that is zero."""
        difference = abs(self.result - self.reference)
        return difference / abs(self.reference) if self.reference else difference

    def text(self) -> str:
        """One line of Markdown; an error at rounding is only named so, since its digits mean nothing."""
        error = f"{self.error:.2g}" if self.error > 1e-9 else "rounding"
        result = f"{self.result:.6g}" if self.reference or self.error > 1e-9 else "0"
        return (
            f"| {self.problem} | {self.quantity} | {self.reference:.7g} | {result} | {error} | {self.tolerance:.2g} |"
        )


Report = Callable[[str, str, float, float, float], None]


@pytest.fixture(scope="session")
def table(repository: Path) -> Iterator[list[Row]]:
    """Rows of the session; written to the page that the environment asks for."""
    rows: list[Row] = []
    yield rows
    wanted = os.environ.get("REPLAY_VERIFICATION_TABLE")
    if wanted:
        ordered = sorted(rows, key=lambda row: row.problem)
        (repository / wanted).write_text(_HEAD + "".join(row.text() + "\n" for row in ordered), encoding="utf-8")


@pytest.fixture
def report(table: list[Row]) -> Report:
    """Enter a result in the table and hold it to its tolerance."""

    def enter(problem: str, quantity: str, reference: float, result: float, tolerance: float) -> None:
        row = Row(problem, quantity, float(reference), float(result), float(tolerance))
        table.append(row)
        said = f"{problem}, {quantity}: {result!r} against {reference!r}, error {row.error:.3g}"
        assert row.error <= tolerance, said

    return enter
