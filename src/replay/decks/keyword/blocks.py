"""Keyword files as blocks: one keyword, its options, and the lines below it, each with its place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from replay.decks.keyword.fields import Line, mistake, shown
from replay.errors import InputError

LONGEST_LINE = 4096
STANDARD, LONG, I10 = "standard", "long", "i10"
_SUFFIXES = {"+": LONG, "-": STANDARD, "%": I10}
_OPTIONS = ("TITLE", "ID", "MPP")
_LAYOUT = re.compile(r"\b(LONG|I10)\s*=\s*([A-Z]+)")


@dataclass(frozen=True)
class Block:
    """One keyword with its lines.

    Parameters
    ----------
    keyword
        Upper case, without the asterisk, the options below and the sign of its layout: ``SET_NODE_LIST``.
    options
        Of ``TITLE``, ``ID``, ``MPP``: each puts cards before the others.
    layout
        ``standard`` (columns of 10, or 8 in meshes), ``long`` (20) or ``i10`` (10 for all numbers of meshes).
    file, number
        File, and one-based line of the keyword.
    heading
        The keyword's line as it stands in the file.
    raw
        The lines below it as they stand in the file, comments among them.
    """

    keyword: str
    options: frozenset[str]
    layout: str
    file: Path
    number: int
    heading: str
    raw: tuple[str, ...]

    @cached_property
    def lines(self) -> list[Line]:
        """Lines that hold data: no comments, nothing blank at the end; a blank one between is a card of defaults.

        Raises
        ------
        InputError
            For a tab: nobody knows how many columns it stands for.
        """
        kept = [Line(self.file, self.number + k, text) for k, text in enumerate(self.raw, 1) if text[:1] != "$"]
        tabbed = next((line for line in kept if "\t" in line.text), None)
        if tabbed is not None:
            raise mistake(
                tabbed, "line", "a tab stands in it", "blanks: the format counts columns", "replace tabs by blanks"
            )
        while kept and not kept[-1].text.strip():
            kept.pop()
        return kept

    @property
    def width(self) -> int:
        """Columns of a field."""
        return 20 if self.layout == LONG else 10

    def text(self) -> str:
        """As it stands in the file."""
        return "\n".join((self.heading, *self.raw)).rstrip("\n") + "\n"


def read_blocks(file: Path, layout: str = STANDARD) -> Iterator[Block]:
    """Blocks of one file in order, up to ``*END``.

    Text before the first keyword and after ``*END`` comes as a block whose keyword is empty: nothing of a file is lost.

    Parameters
    ----------
    file
        The file. Comments and titles may be in any encoding that has ASCII inside.
    layout
        Layout that holds until the file's ``*KEYWORD`` says otherwise: an included file inherits it.

    Raises
    ------
    InputError
        When it cannot be read as text.
    """
    rows = _text(file).split("\n")
    heads = [k for k, row in enumerate(rows) if row[:1] == "*"]
    if not heads:
        raise InputError(
            file, f"{shown(rows[0])}: the file has no keyword", line=1, column="keyword",
            expected="a line that starts with * (LS-DYNA keyword)", mend="export the model as a keyword file",
        )  # fmt: skip
    if any(row.strip() and row[:1] != "$" for row in rows[: heads[0]]):
        yield Block("", frozenset(), layout, file, 1, rows[0], tuple(rows[1 : heads[0]]))
    for begin, end in zip(heads, [*heads[1:], len(rows)]):
        heading = rows[begin]
        name, options, own = _heading(file, begin + 1, heading)
        if name == "KEYWORD":
            layout = _file_layout(heading, layout)
        if name == "END":
            rest = tuple(rows[begin + 1 :])
            if any(row.strip() and row[:1] != "$" for row in rest):
                yield Block("", frozenset(), layout, file, begin + 1, heading, rest)
            return
        yield Block(name, options, own or layout, file, begin + 1, heading, tuple(rows[begin + 1 : end]))


def _text(file: Path) -> str:
    if not file.is_file():
        raise InputError(file, "the file does not exist", line=1, column="file", expected="a keyword file",
                         mend="check the name and the folder")  # fmt: skip
    data = file.read_bytes()
    if b"\0" in data:
        row = data[: data.index(b"\0")].count(b"\n") + 1
        raise InputError(
            file, "holds zero bytes: it is binary, encrypted or UTF-16", line=row, column="file",
            expected="text, one byte a character", mend="save it as plain text (ASCII or UTF-8)",
        )  # fmt: skip
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if max(map(len, text.split("\n"))) > LONGEST_LINE:
        number, row_text = next((k, t) for k, t in enumerate(text.split("\n"), 1) if len(t) > LONGEST_LINE)
        raise InputError(
            file, f"the line has {len(row_text)} characters", line=number, column="line",
            expected=f"at most {LONGEST_LINE}; a card has 80, or 200 in the long layout", mend="break the line",
        )  # fmt: skip
    return text


def _heading(file: Path, number: int, heading: str) -> tuple[str, frozenset[str], str]:
    """Keyword, options and layout of a line such as ``*Set_Node_List_Title + (made by hand)``."""
    words = heading[1:].split()
    if not words:
        raise InputError(file, "an asterisk without a keyword", line=number, column="keyword",
                         expected="a keyword, such as *NODE", mend="remove the line")  # fmt: skip
    name = words[0].split("(")[0].split(",")[0].upper()
    own = _SUFFIXES.get(words[1], "") if len(words) > 1 else ""
    if name[-1:] in _SUFFIXES and len(name) > 1:
        own, name = _SUFFIXES[name[-1]], name[:-1]
    options = set()
    while (tail := name.rpartition("_"))[2] in _OPTIONS and tail[0]:
        options.add(tail[2])
        name = tail[0]
    return name, frozenset(options), own


def _file_layout(heading: str, layout: str) -> str:
    for key, value in _LAYOUT.findall(heading.upper()):
        if key == "LONG":
            layout = LONG if value in ("Y", "K") else STANDARD
        elif value == "Y" and layout == STANDARD:
            layout = I10
    return layout
