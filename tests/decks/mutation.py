"""Damaged keyword files: mutations of real ones, and what must hold for each.

`python -m tests.decks.mutation FOLDER COUNT [SEED]` runs many; the suite runs a few.
"""

from __future__ import annotations

import contextlib
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from replay.decks.keyword import read_keyword
from replay.decks.keyword.blocks import read_blocks
from replay.errors import InputError, InputErrors
from replay.models.readiness import surrogate_inspection
from replay.stages.foreign_deck import open_deck

MOST_SECONDS = 5
# A deck with everything that the reader understands, for the mutations to break.
RICH = """*KEYWORD
*TITLE
everything
*PARAMETER
R    young  210000.0I      one         1
*PARAMETER_EXPRESSION
R    twice 2*&young
*PART
block
         1         1      &one         0         2
*PART_CONTACT
other
         2         1         2
       0.2       0.1
*SECTION_SOLID
         1         1
*MAT_ELASTIC_TITLE
steel
         1  7.85E-09    &young       0.3
*MAT_CRUSHABLE_FOAM
         2  8.43E-11      10.5       0.0         5      0.35       0.1
*DEFINE_CURVE
         5
                 0.0                 0.0
                 0.2                0.35
                 0.8                 1.5
*HOURGLASS
         2         4       0.1
*NODE
       1,0.,0.,0.
       2           100.0             0.0             0.0       0       0
       3           100.0           100.0             0.0
       4             0.0        1.0+2               0.0       7       7
       5             0.0             0.0           100.0
       6           100.0             0.0           100.0
       7           100.0           100.0           100.0
       8             0.0           100.0           100.0
       9             0.0             0.0           200.0
      10           100.0             0.0           200.0
      11           100.0           100.0           200.0
      12             0.0           100.0           200.0
*ELEMENT_SOLID
       1       1       1       2       3       4       5       6       7       8
*ELEMENT_SOLID (ten nodes format)
       2       2
       5       6       7       8       9      10      11      12
*ELEMENT_SHELL
       3       1       1       2       3       4
*SET_NODE_LIST_TITLE
facemask mount left
         4
         1         2         3         4
*SET_PART_LIST
         5
         1         2
*SET_SEGMENT
         6
         1         2         3         4
*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_MPP_ID
         3pads
         0       200
         1         2         3         3
       0.5       0.4
       1.0       1.0
*INITIAL_VELOCITY_GENERATION
         5         1       0.0       1.0       2.0       3.0
       0.0       0.0       0.0       0.0       0.0       1.0
*BOUNDARY_PRESCRIBED_MOTION_RIGID
         1         1         0         5       1.0
*DEFINE_TRANSFORMATION
         9
    TRANSL       1.0       2.0       3.0
    ROTATE       0.0       0.0       1.0       0.0       0.0       0.0      90.0
*INCLUDE_TRANSFORM
inner.k
      1000      1000      1000      1000      1000      1000      1000
      1000
       1.0       1.0       1.0       1.0
         9
*RIGIDWALL_PLANAR
         0
*END
"""
INNER = """*KEYWORD
*NODE
       1             0.0             0.0           300.0
       2           100.0             0.0           300.0
       3             0.0           100.0           300.0
       4             0.0             0.0           400.0
*ELEMENT_SOLID
       1       1       1       2       3       4       4       4       4       4
*PART
tetrahedron
         1         1         1
*MAT_RIGID
         1  7.85E-09  210000.0       0.3
       1.0       7.0       7.0
"""
_WORDS = (
    "*END", "*NODE", "*PART", "*INCLUDE\ndeck.k", "*INCLUDE\nnowhere.k", "*KEYWORD LONG=Y", "*KEYWORD I10=Y", "*",
    "*ELEMENT_SOLID", "*SET_NODE_LIST_TITLE", "*MAT_024", "*PARAMETER\nR        x       1.0", "*FOO_BAR",
    "*DEFINE_CURVE", "*CONTACT_TIED_NODES_TO_SURFACE_ID", "*INCLUDE_TRANSFORM", "*COMMENT",
)  # fmt: skip
_FIELDS = (
    "1e999", "-1", "nan", "inf", "99999999999999999999", "0", "&x", "&", "-&one", "1.0-3", "1.0D3", "x", "1,2", "$",
    "1_0", "٣", "é", "\t", "1..0", "--1", "1e", "+", "0x10", "1 2", "\u2028", ",,,,,,,,,,,,", " " * 120 + "junk",
)  # fmt: skip


def mutated(text: str, chance: random.Random) -> str:
    """The text with one to four things wrong."""
    rows = text.split("\n")
    for _ in range(chance.randint(1, 4)):
        k = chance.randrange(len(rows))
        row, kind = rows[k], chance.randrange(14)
        if kind == 0 and row:
            at = chance.randrange(len(row))
            rows[k] = row[:at] + chr(chance.randrange(1, 256)) + row[at + 1 :]
        elif kind == 1 and row:
            at = chance.randrange(len(row))
            rows[k] = row[:at] + row[at + 1 :]
        elif kind == 2:
            at = chance.randrange(len(row) + 1)
            rows[k] = row[:at] + chance.choice(_FIELDS) + row[at:]
        elif kind == 3:
            del rows[k]
        elif kind == 4:
            rows.insert(k, rows[chance.randrange(len(rows))])
        elif kind == 5:
            j = chance.randrange(len(rows))
            rows[k], rows[j] = rows[j], rows[k]
        elif kind == 6:
            rows = rows[: k + 1]
        elif kind == 7:
            width = chance.choice((8, 10, 16, 20))
            at = width * chance.randrange(10)
            rows[k] = row[:at].ljust(at) + chance.choice(_FIELDS).rjust(width) + row[at + width :]
        elif kind == 8:
            rows.insert(k, chance.choice(_WORDS))
        elif kind == 9:
            rows[k] = row.swapcase()
        elif kind == 10:
            rows[k] = ",".join(row.split())
        elif kind == 11:
            rows[k] = row[chance.randrange(1, 12) :]
        elif kind == 12 and k + 1 < len(rows):
            rows[k : k + 2] = [row + rows[k + 1]]
        elif kind == 13 and row[:1] == "*":
            rows[k] = row + chance.choice(("_TITLE", "_ID", "_MPP", " +", " %", "+", " (x)", "_LONG", "  junk"))
        if not rows:
            rows = [""]
    return "\n".join(rows)


@contextlib.contextmanager
def time_limit(seconds: int) -> Iterator[None]:
    def stop(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)  # processor time: others may use the machine
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def outcome(path: Path) -> str:
    """``read`` or ``refused``; anything that must not be raises.

    Read: every keyword is accounted for, every node line is a node, every line cut off is remarked, and looking at the
    helmet ends without a traceback. Refused: every error has file, line, field, what was found and what was expected.
    """
    with time_limit(MOST_SECONDS):
        try:
            deck = read_keyword(path)
        except (InputError, InputErrors) as refusal:
            for error in getattr(refusal, "errors", [refusal]):
                assert error.file, error
                assert error.line is not None, error
                assert error.line >= 1, error
                assert error.column, error
                assert error.found, error
                assert error.expected, error
            return "refused"
        blocks = [block for file in deck.files for block in read_blocks(file)]
        nodes = sum(
            bool(line.text.strip()) for b in blocks if b.keyword == "NODE" and not b.options for line in b.lines
        )
        assert nodes == len(deck.node_ids) + sum(c.kind == "node" for c in deck.collisions)
        meshes = sum(b.keyword in ("NODE", "ELEMENT_SOLID", "ELEMENT_SHELL") and not b.options for b in blocks)
        headings = {(entry.file, entry.line) for entry in deck.entries}
        assert deck.keywords == len(blocks) == meshes + len(headings) + len(deck.kept) + deck.spent
        assert {(k.file, k.line) for k in deck.kept} <= {(r.file, r.line) for r in deck.remarks}
        try:
            source = open_deck([path], units="mm-tonne-s")
            surrogate_inspection(source.helmet, source.settings)
        except (InputError, InputErrors):
            return "read, no mesh"
    return "read"


def bases(folder: Path) -> list[str]:
    """Texts to damage: the real decks, small ones more often, and the rich one."""
    texts = {p.name: p.read_text(encoding="latin-1") for p in sorted(folder.glob("*.k"))}
    small = [t for t in texts.values() if len(t) < 100_000]
    return [*texts.values(), *small * 16, *[RICH] * 80]


def run(folder: Path, count: int, seed: int) -> Counter[str]:
    """Damage and read so many decks."""
    chance, texts, seen = random.Random(seed), bases(folder), Counter[str]()
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "deck.k"
        (path.parent / "inner.k").write_text(INNER)
        for number in range(count):
            text = mutated(chance.choice(texts), chance)
            path.write_text(text, encoding="utf-8", newline="")
            try:
                seen[outcome(path)] += 1
            except Exception:
                Path(f"failed_{seed}_{number}.k").write_text(text, encoding="utf-8", newline="")
                print(f"case {number} of seed {seed} failed", file=sys.stderr)
                raise
    return seen


if __name__ == "__main__":
    begin = time.process_time()
    print(dict(run(Path(sys.argv[1]), int(sys.argv[2]), int((sys.argv[3:] or ["1"])[0]))))
    print(f"{time.process_time() - begin:.0f} s of processor time")
