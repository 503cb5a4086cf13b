"""docs/accuracy.md holds what is measured, not what was hoped.

`REPLAY_WRITE_DOCS=1 pytest tests/motion/test_accuracy.py` writes the table again.
"""

import os

import pytest

from replay.motion.accuracy import CASES, HEADER, line, measure, table

BEGIN, END = "<!-- table of protocol mode: begin -->\n", "<!-- table of protocol mode: end -->\n"


@pytest.fixture(scope="module")
def page(repository):
    path = repository / "docs" / "accuracy.md"
    if os.environ.get("REPLAY_WRITE_DOCS") == "1":
        text = path.read_text()
        before, rest = text.split(BEGIN)
        path.write_text(before + BEGIN + "\n" + table() + "\n" + END + rest.split(END)[1])
    return path.read_text()


def check(page, case):
    written = next(row for row in page.split("\n") if row.startswith(f"| {case.name} |"))
    measured = line(measure(case))
    a, b = ([float(cell) for cell in row.strip().strip("|").split("|")[1:]] for row in (written, measured))
    # another processor's mathematics may round the last digit shown the other way
    assert a == pytest.approx(b, rel=0.02, abs=0.011)


def test_table_has_every_case(page):
    assert HEADER in page
    for case in CASES:
        assert f"| {case.name} |" in page


@pytest.mark.parametrize("case", [CASES[0], CASES[-1]], ids=["demo", "broadcast"])
def test_table_is_what_is_measured(page, case):
    check(page, case)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES[1:-1], ids=lambda case: case.name)
def test_rest_of_the_table_is_what_is_measured(page, case):
    check(page, case)
