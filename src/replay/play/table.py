"""Plays as a table, ``config/plays.tsv``: a line a play, made of a described one with settings replaced by column.

    play          base      window.duration_s   helmet.mass_kg   model.resolution
    week1_q2_07   demo      0.020                                tiny
    week1_q3_11   wearable                      1.95

An empty `base` is the folder of the play's own name; an empty cell leaves what the base says.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from replay.documents import check_settings
from replay.errors import InputError, InputErrors
from replay.files import read_text, write_text
from replay.play.description import Play, load_play
from replay.play.overrides import overridden, unknown_setting

PLAY, BASE = "play", "base"
_NAME = re.compile(r"[a-z0-9_-]+")
_ASK = f"`{PLAY}`, `{BASE}`, and settings of a play by their dotted path"


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Parameters
    ----------
    play
        Name of the play.
    base
        Folder of the plays that it is made of; its own name where it is described there.
    overrides
        Dotted path to value, for the cells that are not empty.
    file, line
        Where it was written.
    """

    play: str
    base: str
    overrides: Mapping[str, Any]
    file: Path
    line: int

    @property
    def is_a_folder(self) -> bool:
        """Whether it only names a described play and changes nothing."""
        return self.base == self.play and not self.overrides


def read_plays_table(path: Path) -> dict[str, Row]:
    """Read the table of plays.

    Parameters
    ----------
    path
        Tab-separated, UTF-8; empty lines and lines that begin with # are passed over. A value is written as in
        ``play.yaml``: ``0.02``, ``coarse``, ``[0, 0, 0.01]``.

    Returns
    -------
    dict of str to Row
        In file order.

    Raises
    ------
    InputError, InputErrors
        With line and column: headings that are no settings, names that are none or come twice, cells that are no
        values. Whether a value suits its setting is said when that play is written out, and stops that play alone.
    """
    lines = [
        (number, [cell.strip() for cell in text.split("\t")])
        for number, text in enumerate(read_text(path).split("\n"), start=1)
        if text.strip() and not text.startswith("#")
    ]
    if not lines:
        raise InputError(path, "holds no heading", expected=_ASK, mend="write the heading, separated by tabs")
    number, head = lines[0]
    errors = _check_heading(path, number, head)
    rows: dict[str, Row] = {}
    for line, cells in lines[1:] if not errors else ():
        if len(cells) > len(head):
            found = f"{len(cells)} cells where the heading has {len(head)}"
            errors.append(InputError(path, found, line=line, mend="one tab between two cells, none after the last"))
            continue
        given = dict(zip(head, cells))
        name = given.pop(PLAY)
        base = given.pop(BASE, "") or name
        for column, value in ((PLAY, name), (BASE, base)):
            if not _NAME.fullmatch(value):
                mend = "small letters, digits, - and _"
                errors.append(InputError(path, f"{value!r} is no name of a play", line=line, column=column, mend=mend))
        if name in rows:
            found = f"{name!r} stands in line {rows[name].line} too"
            errors.append(InputError(path, found, line=line, column=PLAY, mend="give every line a name of its own"))
        overrides = {}
        for column, cell in given.items():
            if cell:
                try:
                    overrides[column] = yaml.safe_load(cell)
                except yaml.YAMLError:
                    mend = "write it as in play.yaml: a number, a word, a list in brackets"
                    errors.append(InputError(path, f"{cell!r} is no value", line=line, column=column, mend=mend))
        rows.setdefault(name, Row(name, base, overrides, path, line))
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(errors)
    return rows


def _check_heading(path: Path, line: int, head: list[str]) -> list[InputError]:
    if PLAY not in head:
        mend = "name the first column `play`; put tabs between the columns" if len(head) == 1 else "add the column"
        return [InputError(path, f"has no column `{PLAY}`", line=line, expected=_ASK, mend=mend)]
    errors = []
    for k, column in enumerate(head):
        if column in (PLAY, BASE) or not column:
            reason = None if column else "a heading is empty"
        elif column in ("name", "source.kind") or column.partition(".")[0] == "withhold":
            reason = "is not a column's to set"
        else:
            reason = unknown_setting(column)
        if column in head[:k]:
            reason = "the heading comes twice"
        if reason:
            errors.append(InputError(path, reason, line=line, column=column, expected=_ASK, mend="correct the heading"))
    return errors


def write_out(row: Row, plays: Path, into: Path) -> Path:
    """Write a row of the table as a play folder of its own, with the tracks it names: what is run, and sealed.

    Parameters
    ----------
    row
        The row.
    plays
        Folder of the described plays; holds ``row.base``.
    into
        Folder of the plays written out.

    Returns
    -------
    pathlib.Path
        The new ``play.yaml``, written last.

    Raises
    ------
    InputError, InputErrors
        What is wrong with the base names its ``play.yaml``; what is wrong with an override names line and column
        of the table.
    """
    source = plays / row.base / "play.yaml"
    if not source.is_file():
        found = f"no play is described in {source.parent}"
        raise InputError(
            row.file, found, line=row.line, column=BASE, expected="a folder with play.yaml", mend="correct the name"
        )
    base = load_play(source)
    data = overridden(yaml.safe_load(read_text(source)), row.overrides)
    play = check_settings(row.file, Play, data, line=row.line, context={"folder": source.parent})
    play = play.lying_in(base.folder)
    folder = into / row.play
    folder.mkdir(parents=True, exist_ok=True)
    for path in (*play.files, *(play.file(name) for name in play.withhold)):
        _link(path, folder / path.name)
    written = {**data, "name": row.play}
    for block, files in (("source", play.source.files), ("model", play.model.files)):
        if block in data:
            written[block] = {key: Path(v).name if v in files else v for key, v in data[block].items()}
    changes = ", ".join(f"{path} = {value}" for path, value in row.overrides.items()) or "nothing changed"
    text = f"# The play {row.base} with {changes}; written from {row.file.name}, change it there.\n"
    target = folder / "play.yaml"
    write_text(target, text + yaml.safe_dump(written, sort_keys=False, allow_unicode=True, width=100))
    return target


def _link(source: Path, target: Path) -> None:
    """Give a track a second name, or copy it where the file system has no second names."""
    target.unlink(missing_ok=True)
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
