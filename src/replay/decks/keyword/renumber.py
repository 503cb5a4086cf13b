"""A deck renumbered into a block, in SI, as one include file: nothing dangles, and nothing that is left out is lost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from replay.decks.keyword.columns import curve_lines, entry_lines, joined, node_lines, shell_lines, solid_lines
from replay.decks.keyword.deck import Elements, KeywordDeck
from replay.decks.keyword.entries import Entry, Row
from replay.decks.keyword.fields import Value
from replay.decks.keyword.forms import DIMENSIONS, Field
from replay.decks.keyword.units import Units

_SETS = ("node_set", "part_set", "solid_set", "shell_set", "segment_set")
_FIRST_SET = 201
# Curves whose axes are known from the field that names them: strain and stress, rate and factor.
_CURVE_AXES = {"lcid": ("", "pressure"), "lcss": ("", "pressure"), "lcsr": ("rate", "")}
_ORDER = ("part", "section", "material", "hourglass", *_SETS, "contact")


@dataclass(frozen=True)
class Dangling:
    """A reference to a number that nothing defines."""

    place: str
    keyword: str
    field: str
    kind: str
    number: int


@dataclass(frozen=True)
class Renumbered:
    """The include file and what became of everything.

    Parameters
    ----------
    text
        The include file.
    left_out
        Verbatim text of everything that is not in it.
    numbers
        Kind to old and new numbers.
    changes
        One sentence each.
    """

    text: str
    left_out: str
    numbers: Mapping[str, Mapping[int, int]]
    changes: tuple[str, ...]


@dataclass
class _Numbers:
    """Old to new numbers by kind, and what had no new one."""

    of: dict[str, dict[int, int]] = field(default_factory=dict)
    dropped: dict[tuple[str, str], set[int]] = field(default_factory=dict)

    def number(self, old: Iterable[int], kind: str, first: int) -> None:
        """Give new numbers in order; those that are given already stay."""
        table = self.of.setdefault(kind, {})
        taken, new = set(table.values()), first
        for value in old:
            if value not in table:
                while new in taken:
                    new += 1
                table[value] = new
                taken.add(new)


def dangling(deck: KeywordDeck) -> list[Dangling]:
    """Everything in a deck that names a number that nothing defines; fields that are blank or 0 name nothing."""
    defined: dict[str, set[int]] = {"node": set(deck.node_ids.tolist())}
    defined["element"] = set(deck.solids.ids.tolist()) | set(deck.shells.ids.tolist())
    for entry in deck.entries:
        if entry.kind:
            defined.setdefault(entry.kind, set()).add(entry.id)
    return [
        Dangling(f"{entry.file}:{line}", f"*{entry.keyword}", name, kind, number)
        for entry in deck.entries
        for kind, name, number, line in entry.references()
        if kind not in DIMENSIONS and kind not in ("text", "system", "eos") and number > 0
        and number not in defined.get(kind, ())
    ]  # fmt: skip


def renumbered(
    deck: KeywordDeck,
    units: Units,
    base: int,
    *,
    points_m: np.ndarray,
    solids: Elements,
    parts: Mapping[int, int],
    sets: Mapping[int, int],
    own_materials: Mapping[int, Callable[[int], Sequence[str]]],
    title: str,
) -> Renumbered:
    """Write a deck anew.

    Parameters
    ----------
    deck
        As read.
    units
        Of the deck.
    base
        Numbers begin above it: 10,000,000 or 20,000,000.
    points_m
        Where the deck's nodes are to be, (n, 3) [m].
    solids
        Those that stay.
    parts
        Old to new numbers of the parts that stay.
    sets
        New numbers of part sets that have their fixed places.
    own_materials
        Number of a ``*MAT`` to the lines that stand for it, given its new number.
    title
        First comment of the file.
    """
    shells = deck.shells.only(np.isin(deck.shells.parts, list(parts)))
    numbers = _Numbers()
    numbers.of["part"], numbers.of["part_set"] = dict(parts), dict(sets)
    used = np.isin(deck.node_ids, np.concatenate([solids.nodes.ravel(), shells.nodes.ravel()]))
    numbers.number(deck.node_ids[used].tolist(), "node", base + 1)
    numbers.number([*solids.ids.tolist(), *shells.ids.tolist()], "element", base + 1)
    chosen = _chosen(deck, set(parts))
    for kind in ("section", "material", "hourglass", "curve"):
        numbers.number([e.id for e in chosen if e.kind == kind], kind, base + 1)
    needed = {number for e in chosen if e.kind == "part" for kind, _, number, _ in e.references() if kind == "material"}
    numbers.number([mid for mid in own_materials if mid in needed], "material", base + 1)
    first = base + _FIRST_SET
    for kind in _SETS:
        taken = {n for other in _SETS for n in numbers.of.get(other, {}).values()}
        first = max(first, 1 + max((n for n in taken if n > base + _FIRST_SET - 1), default=0))
        numbers.number([e.id for e in chosen if e.kind == kind], kind, first)
    contacts = [e for e in chosen if e.keyword.startswith("CONTACT_")]
    mine = [replace(e, cid=base + k) for k, e in enumerate(contacts, 1)]
    numbers.of["contact"] = {e.cid: new.cid for e, new in zip(contacts, mine) if e.cid}
    chosen = [e for e in chosen if not e.keyword.startswith("CONTACT_")] + mine

    row = {old: k for k, old in enumerate(deck.node_ids.tolist())}
    old_nodes = list(numbers.of["node"])
    points = points_m[[row[n] for n in old_nodes]]
    lines = [f"$ {title}", "$ units: m, kg, s, N, Pa, J (SI)"]
    for kind in _ORDER:
        for entry in chosen:
            own = kind == "material" and entry.id in own_materials
            if (entry.kind or "contact") == kind and not own:
                lines += _written(entry, numbers, units)
    for old, write_own in own_materials.items():
        if old in numbers.of["material"]:
            lines += write_own(numbers.of["material"][old])
    lines += _curves(deck, chosen, numbers, units)
    lines += node_lines(np.array([numbers.of["node"][n] for n in old_nodes], dtype=np.int64), points)
    for elements, write_elements, width in ((solids, solid_lines, 10), (shells, shell_lines, 4)):
        if len(elements.ids):
            lines += write_elements(
                _mapped(elements.ids, numbers.of["element"]),
                _mapped(elements.parts, numbers.of["part"]),
                _trimmed(_mapped(elements.nodes, {**numbers.of["node"], 0: 0}), width),
            )
    changes = [
        f"*{keyword}: {len(values)} references to a {kind.replace('_', ' ')} that is not there were taken out"
        for (keyword, kind), values in sorted(numbers.dropped.items())
    ]
    written = {id(e) for e in deck.entries if e in chosen or (e.kind == "curve" and e.id in numbers.of["curve"])}
    written |= {id(e) for e in contacts}
    left = _left_out(deck, written, contacts)
    return Renumbered(joined(lines), left, numbers.of, tuple(changes))


def _chosen(deck: KeywordDeck, parts: set[int]) -> list[Entry]:
    """Entries that go into the include: parts that stay, and what they and the contacts need."""
    mine = [e for e in deck.entries if e.kind == "part" and e.id in parts]
    need: dict[str, set[int]] = {}
    for entry in mine:
        for kind, _, number, _ in entry.references():
            need.setdefault(kind, set()).add(number)
    materials = [e for e in deck.entries if e.kind == "material" and e.id in need.get("material", set())]
    curves = {n for e in materials for kind, name, n, _ in e.references() if kind == "curve" and name in _CURVE_AXES}
    first: dict[tuple[str, int], Entry] = {}
    for entry in deck.entries:
        kind = entry.kind
        wanted = (
            (kind == "part" and entry.id in parts)
            or (kind in ("section", "hourglass", "material") and entry.id in need.get(kind, set()))
            or (kind == "curve" and entry.id in curves)
            or kind in _SETS
        )
        if wanted:
            first.setdefault((kind, entry.id), entry)
    return [*first.values(), *(e for e in deck.entries if e.keyword.startswith("CONTACT_"))]


def _written(entry: Entry, numbers: _Numbers, units: Units) -> list[str]:
    def change(f: Field, value: Value) -> Value:
        if not isinstance(value, int | float) or not f.kind or not value:
            return value
        if f.kind in DIMENSIONS:
            return float(value) * units.factor(f.kind)
        new = numbers.of.get(f.kind, {}).get(int(value), 0)
        if not new and value > 0:
            numbers.dropped.setdefault((entry.keyword, f.kind), set()).add(int(value))
        return new

    moved = entry.mapped(change)
    return entry_lines(_packed(moved) if entry.kind in _SETS else moved)


def _packed(entry: Entry) -> Entry:
    """A set without gaps where members were taken out."""
    if entry.kind == "segment_set":
        return replace(entry, rows=(entry.rows[0], *(r for r in entry.rows[1:] if all(r.values[:3]))))
    members = entry.members()
    if len(entry.rows) < 2:
        return entry
    fields = entry.rows[1].fields
    rows = [Row(fields[: len(members[k : k + 8])], members[k : k + 8], 0) for k in range(0, len(members), 8)]
    return replace(entry, rows=(entry.rows[0], *rows))


def _curves(deck: KeywordDeck, chosen: Sequence[Entry], numbers: _Numbers, units: Units) -> list[str]:
    lines: list[str] = []
    axes = {
        n: _CURVE_AXES[name]
        for e in chosen if e.kind == "material"
        for kind, name, n, _ in e.references() if kind == "curve" and name in _CURVE_AXES
    }  # fmt: skip
    for old, new in numbers.of.get("curve", {}).items():
        points = deck.curve(old)
        assert points is not None
        scale = [units.factor(axis) if axis else 1.0 for axis in axes[old]]
        lines += curve_lines(new, (points[:, 0] * scale[0]).tolist(), (points[:, 1] * scale[1]).tolist())
    return lines


def _mapped(values: np.ndarray, table: Mapping[int, int]) -> np.ndarray:
    flat, back = np.unique(values, return_inverse=True)
    return np.array([table[v] for v in flat.tolist()], dtype=np.int64)[back].reshape(values.shape)


def _trimmed(nodes: np.ndarray, width: int) -> np.ndarray:
    """Without columns at the end that no element uses: eight nodes are written as eight."""
    while nodes.shape[1] > min(width, 8) and not nodes[:, -1].any():
        nodes = nodes[:, :-1]
    return nodes


def _left_out(deck: KeywordDeck, written: set[int], contacts: Sequence[Entry]) -> str:
    pieces = [f"$ {kept.file.name}:{kept.line}\n{kept.text}" for kept in deck.kept]
    for entry in deck.entries:
        place = f"$ {entry.file.name}:{entry.line}\n"
        if id(entry) not in written:
            pieces.append(place + "\n".join([*entry_lines(entry), *entry.extra]) + "\n")
        elif entry.extra or entry.mpp:
            what = "$ cards of this keyword that are not in the include\n"
            pieces.append(place + what + "\n".join([entry.heading, *entry.mpp, *entry.extra]) + "\n")
    head = "$ What is not in the include file, in the units and numbers of the deck it is from. Include it nowhere.\n"
    return head + "".join(pieces)
