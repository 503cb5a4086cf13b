"""The pages say what the code does: file formats are written from the formats themselves.

`REPLAY_WRITE_DOCS=1 pytest tests/test_documentation.py` writes the pages again.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import re
from pathlib import Path

import pytest

import replay
from replay.tables import TableFormat

WRITE = os.environ.get("REPLAY_WRITE_DOCS") == "1"
PREFACE = """# File formats

Everything a run writes lies under `results/<play>/`, one folder a stage. Every stage writes a `manifest.json` last:
each file with its bytes, SHA-256, class and meaning. Numbers are SI unless a name says otherwise (`_percent`, `_ms`);
a column carries its unit in its name; CSV files have commas, decimal points, LF, and floats in the shortest form that
reads back to the same bits. This page is generated from the formats in the code.

## Folders

| folder | what it holds |
|---|---|
| `settings/` | `play.json`: the play with every default and override spelled out |
| `inputs/` | checked copies of the raw tracks, `inputs.json` |
| `reconstruction/` | the protocol's five files, `kinematics.csv`, `gate.json` |
| `driver/` | `driver_6dof.csv`, `initial_velocity.json`; of a collision `starts.json` |
| `assembly/` | `model.h5`, `parts.csv`, mass properties, inspection, preview, the helmet and assembly gates |
| `placement/` | of a collision: `scene.h5` with both players, `placement.json`, its gate |
| `decks/velodyne`, `decks/lsdyna`, `decks/openradioss` | the run decks of the same replay for other solvers |
| `decks/replay` | a batch script for this program's own solver |
| `shake/` | the helmet's millisecond of free flight and its gate |
| `replay/` | the run: ledger, time steps, histories, states, brain, and the numerics gate |
| `sensitivity/` | the same run at half the hourglass coefficient, and its gate |
| `fidelity/` | target against applied motion, and its gate |
| `measures/` | head, brain and action measures |
| `verdict/` | `verdict.json`, and the package gate |
| `report/` | `report.html` |
| `bundle/` | `<play>.zip` and its SHA-256 |
| `logs/` | what the commands printed and how long they took: of one machine, never sealed |

Beside the plays lie `index.html` and `plays.csv`, the season's page and table; `plays.d/<play>/`, a row of the table of
plays written out as a play; and `<play>.<ensemble>/`: `001/` and on, the stages of each member that are its own
(`settings/member.json` names those it shares), and `bands/` with `bands.csv`, `members.csv` and `ensemble.html`.

## Gates

Every `gate*.json` is `{"gate", "verdict", "checks": [{"name", "value", "unit", "limit", "verdict", "source"}]}` with
verdicts `pass`, `warn`, `fail`, and `vacuous` for a check without power; `detail` and `loosened_from` where there is
something to say.

## States

`states.vtkhdf` is a temporal VTKHDF unstructured grid (ParaView 5.12 and later); `states.xdmf` names the same data
for VisIt. `model.h5` holds the mesh as HDF5 datasets (`nodes/coordinates_m`, `elements/connectivity`, ...) and one
JSON document with parts, sets, materials and notes; of a player with a body also his joints (numbers of two rigid
parts, centre, axes in rows, stiffness for positive and negative angles, damping ratios) and the names of node sets that
move as one body.

## Tables
"""


def formats() -> list[TableFormat]:
    found: dict[int, TableFormat] = {}
    for module in pkgutil.walk_packages(replay.__path__, "replay."):
        for value in vars(importlib.import_module(module.name)).values():
            if isinstance(value, TableFormat):
                found[id(value)] = value
    return sorted(found.values(), key=lambda table: table.title)


def formats_page() -> str:
    lines = [PREFACE]
    for table in formats():
        lines += [f"### {table.title[0].upper()}{table.title[1:]}", "", "| column | meaning |", "|---|---|"]
        for column in table.columns:
            notes = []
            if column.aliases:
                notes.append(f"also read as {', '.join(f'`{a}`' for a in column.aliases)}")
            if column.may_be_empty:
                notes.append("may be empty")
            note = f" ({'; '.join(notes)})" if notes else ""
            lines.append(f"| `{column.name}` | {column.meaning.replace('|', chr(92) + '|')}{note} |")
        lines.append("")
    return "\n".join(lines)


def test_the_page_of_file_formats_is_that_of_the_code(repository: Path) -> None:
    page = repository / "docs" / "file-formats.md"
    if WRITE:
        page.write_text(formats_page(), encoding="utf-8")
    assert page.read_text(encoding="utf-8") == formats_page(), "REPLAY_WRITE_DOCS=1 pytest tests/test_documentation.py"


def pages(repository: Path) -> list[Path]:
    return sorted([*repository.glob("*.md"), *(repository / "docs").glob("*.md")])


def test_every_link_between_pages_leads_somewhere(repository: Path) -> None:
    broken = [
        f"{page.name}: {target}"
        for page in pages(repository)
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
        if "://" not in target and not (page.parent / target).exists()
    ]
    assert not broken, broken


@pytest.mark.parametrize("word", ["make run", "make test"])
def test_the_readme_shows_the_two_commands_first(repository: Path, word: str) -> None:
    assert word in "\n".join((repository / "README.md").read_text(encoding="utf-8").splitlines()[:8])


def test_every_command_of_the_quickstart_exists(repository: Path) -> None:
    from replay.cli import _parser

    known = set(_parser()._subparsers._group_actions[0].choices)  # type: ignore[union-attr]
    text = (repository / "docs" / "quickstart.md").read_text(encoding="utf-8")
    used = set(re.findall(r"^    replay (\w+)", text, flags=re.MULTILINE))
    assert used, "the quickstart shows no command"
    assert used <= known, used - known
