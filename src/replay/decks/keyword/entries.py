"""Cards that a form understands, as named values: parts, sections, materials, sets, curves, contacts, loads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from replay.decks.keyword.blocks import Block
from replay.decks.keyword.fields import Line, Value, lookup, mistake, shown, split, to_float, to_int
from replay.decks.keyword.forms import Field, Form, canonical, form_of

# Keywords under which several definitions may stand.
_MANY = ("PART", "PART_CONTACT", "PART_INERTIA", "SECTION_SOLID", "HOURGLASS")
_CONTACT_SIDES = {0: "segment_set", 1: "shell_set", 2: "part_set", 3: "part", 4: "node_set", 6: "part_set"}


@dataclass(frozen=True)
class Row:
    """One card: its fields (a form's, in order) with what they hold, and its line.

    A field that is blank in the file is None.
    """

    fields: tuple[Field, ...]
    values: tuple[Value, ...]
    line: int


@dataclass(frozen=True)
class Entry:
    """A keyword with its cards.

    Parameters
    ----------
    keyword
        Canonical, without asterisk and options.
    title
        Of a ``_TITLE`` or ``_ID`` card, or of a part.
    rows
        Its cards.
    file, line
        Of the keyword.
    extra
        Lines beyond the form, verbatim.
    heading
        The keyword's line as it stands.
    cid
        Number of an ``_ID`` card.
    mpp
        Lines that ``_MPP`` puts before the cards, verbatim.
    """

    keyword: str
    title: str
    rows: tuple[Row, ...]
    file: Path
    line: int
    extra: tuple[str, ...] = ()
    heading: str = ""
    cid: int = 0
    mpp: tuple[str, ...] = ()

    def get(self, name: str, default: Value = None) -> Value:
        """Value of the first field of this name; the default where it is blank or missing."""
        for row in self.rows:
            for field, value in zip(row.fields, row.values):
                if field.name == name:
                    return default if value is None else value
        return default

    def number(self, name: str, default: float = 0.0) -> float:
        """As `get`, a number."""
        value = self.get(name)
        return float(value) if isinstance(value, int | float) else default

    def whole(self, name: str, default: int = 0) -> int:
        """As `get`, a whole number."""
        value = self.get(name)
        return int(value) if isinstance(value, int | float) else default

    @property
    def id(self) -> int:
        """Number that the keyword defines; 0 where it defines none."""
        for row in self.rows:
            for field, value in zip(row.fields, row.values):
                if field.defines and isinstance(value, int):
                    return value
        return self.cid

    @property
    def kind(self) -> str:
        """Kind of what it defines: ``part``, ``material``, ``curve``...; empty where it defines nothing."""
        if self.keyword.startswith("CONTACT_"):
            return "contact" if self.cid else ""
        return next((field.kind for row in self.rows for field in row.fields if field.defines), "")

    def members(self) -> tuple[int, ...]:
        """Numbers in a set, in order, without the zeros that fill its last card."""
        return tuple(v for row in self.rows[1:] for v in row.values if isinstance(v, int) and v > 0)

    def references(self) -> Iterator[tuple[str, str, int, int]]:
        """Kind, field, number and line of everything the cards refer to."""
        for row in self.rows:
            for field, value in zip(row.fields, row.values):
                if field.kind and field.width == 10 and not field.defines and isinstance(value, int) and value:
                    yield field.kind, field.name, value, row.line

    def mapped(self, change: Callable[[Field, Value], Value]) -> Entry:
        """The same with every value replaced."""
        rows = (replace(row, values=tuple(map(change, row.fields, row.values))) for row in self.rows)
        return replace(self, rows=tuple(rows))


def read_entries(block: Block, parameters: Mapping[str, Value]) -> list[Entry]:
    """Cards of a block whose keyword has a form; a part, section or hourglass card each is an entry of its own.

    Raises
    ------
    InputError
        At the first field that does not hold what its form says, or a card that is missing.
    """
    keyword = canonical(block.keyword)
    form = form_of(keyword)
    assert form is not None
    lines = block.lines
    title, cid = "", 0
    mpp: tuple[str, ...] = ()
    if keyword.startswith("CONTACT_"):
        cid, title, mpp, lines = _contact_heads(block, lines)
    elif block.options and lines:
        title, lines = lines[0].text.strip(), lines[1:]
    if not lines:
        raise mistake(block, form.cards[0][0].name, f"*{keyword} has no card", "at least one card")
    rows: list[Row] = []
    extra: list[str] = []
    for line in lines:
        card = form.card(len(rows))
        if card is None:
            extra.append(line.text)
        else:
            rows.append(_row(line, card, block.width, parameters))
    entry = Entry(keyword, title, tuple(rows), block.file, block.number, tuple(extra), block.heading, cid, mpp)
    entry = _with_sides(entry) if keyword.startswith("CONTACT_") else entry
    return _separate(entry, form, block) if keyword in _MANY else [_checked(entry, block)]


def _contact_heads(block: Block, lines: list[Line]) -> tuple[int, str, tuple[str, ...], list[Line]]:
    cid, title = 0, ""
    mpp: tuple[str, ...] = ()
    if "ID" in block.options or "TITLE" in block.options:
        if not lines:
            raise mistake(block, "cid", "the card with number and title is missing", "a card: cid, heading")
        first, lines = lines[0], lines[1:]
        text = first.text[: block.width].split(",")[0].strip()
        number = to_int(text) if text else 0
        if number is None or number < 0:
            raise mistake(first, "cid", f"{shown(text)} is no number of a contact", "a whole number")
        cid, title = number, first.text[block.width :].strip()
    if "MPP" in block.options and lines:
        count = 2 if len(lines) > 1 and lines[1].text.strip().startswith("&") else 1
        mpp, lines = tuple(line.text for line in lines[:count]), lines[count:]
    return cid, title, mpp, lines


def _row(line: Line, card: tuple[Field, ...], width: int, parameters: Mapping[str, Value]) -> Row:
    if len(card) == 1 and card[0].width == 80:
        return Row(card, (line.text.strip(),), line.number)
    texts = split(line.text, [field.width if width == 10 else 20 for field in card])
    return Row(card, tuple(_value(line, f, t, parameters) for f, t in zip(card, texts)), line.number)


def _value(line: Line, field: Field, text: str, parameters: Mapping[str, Value]) -> Value:
    if text.startswith(("&", "-&")):
        text = lookup(line, field.name, text, parameters)
    if not text:
        return None
    if field.kind == "text":
        return text
    whole = to_int(text)
    if field.defines or field.kind in ("part", "section", "material", "node", "element"):
        if whole is None or whole < 0 or (field.defines and whole == 0):
            raise mistake(line, field.name, f"{shown(text)} is no number of a {field.kind.replace('_', ' ')}",
                             "a positive whole number")  # fmt: skip
        return whole
    value = to_float(text)
    if value is None:
        raise mistake(line, field.name, f"{shown(text)} is no number", "a finite number")
    plain = whole is not None and not any(c in text for c in ".eEdD")
    return whole if plain and whole is not None else value


def _separate(entry: Entry, form: Form, block: Block) -> list[Entry]:
    """One entry a part, section or hourglass card: they may share a keyword."""
    size = len(form.cards)
    if len(entry.rows) % size:
        raise mistake(block, form.cards[-1][0].name, f"*{entry.keyword} ends after {len(entry.rows)} cards",
                          f"a multiple of {size} cards (a title may be blank)")  # fmt: skip
    groups = (entry.rows[k : k + size] for k in range(0, len(entry.rows), size))
    entries = [replace(entry, rows=rows) for rows in groups]
    if entry.kind == "part":
        entries = [replace(e, title=str(e.get("title", ""))) for e in entries]
    return [_checked(e, block) for e in entries]


def _checked(entry: Entry, block: Block) -> Entry:
    defining = next((f for row in entry.rows for f in row.fields if f.defines), None)
    if defining is not None and not entry.id:
        raise mistake(block, defining.name, "it is blank", "a positive whole number")
    return entry


def _with_sides(entry: Entry) -> Entry:
    """Give the two sides of a contact their kinds, which other fields of the card name."""
    kinds = {
        name: _CONTACT_SIDES.get(entry.whole(of), "") for name, of in (("ssid", "sstyp"), ("msid", "mstyp"))
    }  # fmt: skip

    def typed(field: Field) -> Field:
        return replace(field, kind=kinds[field.name]) if field.name in kinds else field

    rows = (replace(row, fields=tuple(map(typed, row.fields))) for row in entry.rows)
    return replace(entry, rows=tuple(rows))
