"""No damage to a deck ends in a traceback, a hang, or something silently lost."""

from __future__ import annotations

import random
import string
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.decks.mutation import INNER, RICH, mutated, outcome, run

# Derandomised: a suite that fails only now and then helps nobody; `tests.decks.mutation` runs other seeds.
FEW = settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
KEYWORDS = (
    "*KEYWORD", "*KEYWORD LONG=Y", "*NODE", "*NODE +", "*ELEMENT_SOLID", "*ELEMENT_SHELL", "*PART", "*MAT_ELASTIC",
    "*MAT_024_TITLE", "*SECTION_SHELL", "*SET_NODE_LIST", "*SET_SEGMENT_TITLE", "*DEFINE_CURVE", "*PARAMETER",
    "*PARAMETER_EXPRESSION", "*INCLUDE", "*INCLUDE_TRANSFORM", "*DEFINE_TRANSFORMATION", "*CONTACT_TIED_MPP_ID",
    "*END", "*WHATEVER", "*",
)  # fmt: skip
FIELD = st.one_of(
    st.integers(-3, 12).map(str),
    st.floats(allow_nan=True, allow_infinity=True).map(lambda v: f"{v:.4g}"),
    st.sampled_from(["", "&x", "1.0-3", "R x", "inner.k", "deck.k", "ROTATE", "$", "1e400"]),
    st.text(string.printable, max_size=12),
)
ROW = st.one_of(
    st.sampled_from(KEYWORDS),
    st.lists(FIELD, max_size=11).map(lambda fields: "".join(f"{f:>10}" for f in fields)),
    st.lists(FIELD, max_size=11).map(lambda fields: "".join(f"{f:>8}" for f in fields)),
    st.lists(FIELD, max_size=11).map(",".join),
    st.text(max_size=90),
)


def judge(text: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "inner.k").write_text(INNER)
        path = Path(folder) / "deck.k"
        path.write_text(text, encoding="utf-8", errors="replace", newline="")
        return outcome(path)


def test_the_deck_that_is_damaged_is_whole_before() -> None:
    assert judge(RICH) == "read"


@pytest.mark.parametrize("seed", range(4))
def test_a_rich_deck_with_a_few_things_wrong(seed: int) -> None:
    chance = random.Random(seed)
    seen = {judge(mutated(RICH, chance)) for _ in range(60)}
    assert {"read", "refused"} <= seen


def test_real_decks_with_a_few_things_wrong(shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert sum(run(shared / "real" / "decks", 150, seed=20).values()) == 150


@FEW
@given(st.lists(ROW, max_size=25))
def test_any_lines_at_all(rows: list[str]) -> None:
    judge("\n".join(rows))


@FEW
@given(st.lists(ROW, max_size=4), st.integers(0, len(RICH.split("\n"))))
def test_any_lines_within_a_rich_deck(rows: list[str], at: int) -> None:
    text = RICH.split("\n")
    judge("\n".join([*text[:at], *rows, *text[at:]]))


@FEW
@given(st.binary(max_size=300))
def test_any_bytes_at_all(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "deck.k"
        path.write_bytes(data)
        outcome(path)
