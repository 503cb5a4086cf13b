"""A keyword deck in memory: meshes as arrays, cards as entries, and everything else as it stands in its file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from replay.decks.keyword.entries import Entry

#: What it means for a run of ours that a keyword is not simulated; the longest prefix that fits says it.
MEANINGS = {
    "": "not understood: nothing of it takes part in a run",
    "AIRBAG": "no airbag is simulated",
    "BOUNDARY": "this condition is not applied: what it holds or drives moves freely",
    "COMMENT": "a remark; no effect",
    "CONSTRAINED": "this joint or tie is not made: what it holds together comes apart",
    "CONTACT": "this contact of the deck is not taken over: the play's own contacts hold",
    "CONTROL": "a setting of another solver's run: the play's own settings hold",
    "CONTROL_UNITS": "units are declared with --units or in the settings file",
    "DAMPING": "this damping is not applied",
    "DATABASE": "asks another solver for an output; no effect",
    "DEFINE": "a definition that only cards which are not simulated can use",
    "DEFINE_TRANSFORMATION": "used by *INCLUDE_TRANSFORM where one names it",
    "ELEMENT": "these elements are not simulated: their mass and stiffness are missing",
    "ELEMENT_MASS": "this point mass is missing from masses and centres of gravity",
    "ELEMENT_SHELL": "shells are read and weighed, not simulated: their stiffness is missing",
    "HOURGLASS": "the play's own hourglass control holds for all parts",
    "INITIAL": "this initial state is not applied: the play sets the motion",
    "INTERFACE": "no data are exchanged with another run",
    "LOAD": "this load is not applied",
    "PARAMETER_DUPLICATION": "of two parameters of one name the later holds",
    "PART_CONTACT": "its friction is not taken over: the play's own contacts hold",
    "PART_INERTIA": "the mass and inertia given by hand are not used: mesh and density make them",
    "RIGIDWALL": "this wall is not there",
    "TITLE": "a title; no effect",
}


@dataclass(frozen=True)
class Remark:
    """Something of a deck that a run does not use, or that a reader should know.

    Parameters
    ----------
    keyword
        With its asterisk; empty for lines outside any keyword.
    file, line
        Where.
    meaning
        What it means for the run.
    """

    keyword: str
    file: Path
    line: int
    meaning: str


@dataclass(frozen=True)
class Kept:
    """A keyword that is kept as it stands."""

    keyword: str
    file: Path
    line: int
    text: str


@dataclass(frozen=True)
class Collision:
    """A number that two definitions claim; the first one holds."""

    kind: str
    number: int
    first: str
    second: str


@dataclass(frozen=True)
class Elements:
    """Elements of one kind.

    Parameters
    ----------
    ids, parts
        Numbers of elements and of their parts, (m,).
    nodes
        Numbers of their nodes, (m, k), 0 where there is none.
    files, lines
        Index into the deck's `files`, and line, (m,).
    """

    ids: np.ndarray
    parts: np.ndarray
    nodes: np.ndarray
    files: np.ndarray
    lines: np.ndarray

    @classmethod
    def none(cls, width: int) -> Elements:
        """No element, of so many nodes."""
        empty = np.zeros(0, dtype=np.int64)
        return cls(empty, empty, np.zeros((0, width), dtype=np.int64), empty, empty)

    def only(self, chosen: np.ndarray) -> Elements:
        """Those of a mask or of rows."""
        return Elements(
            self.ids[chosen], self.parts[chosen], self.nodes[chosen], self.files[chosen], self.lines[chosen]
        )


@dataclass
class KeywordDeck:
    """What keyword files say, in their own units and numbers.

    Parameters
    ----------
    files
        Every file that was read, in order.
    title
        The first ``*TITLE``.
    node_ids, nodes, node_constraints
        Numbers (n,), coordinates (n, 3) in the deck's unit, constraint codes tc and rc (n, 2).
    solids, shells
        Elements; a solid has up to ten nodes.
    entries
        Cards that a form understands, in order.
    kept
        Keywords that none understands, as they stand.
    remarks
        Everything that a run does not use, with its place and meaning.
    collisions
        Numbers given twice.
    facts
        Text of the comment lines that decks of ours carry; see `replay.decks.facts`.
    keywords
        How many keywords the files hold; each is in the meshes, the entries, `kept` or `spent`.
    spent
        Keywords that the reading itself used up: headers, includes, parameters.
    """

    files: list[Path] = field(default_factory=list)
    title: str = ""
    node_ids: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    nodes: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    node_constraints: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    solids: Elements = field(default_factory=lambda: Elements.none(10))
    shells: Elements = field(default_factory=lambda: Elements.none(10))
    entries: list[Entry] = field(default_factory=list)
    kept: list[Kept] = field(default_factory=list)
    remarks: list[Remark] = field(default_factory=list)
    collisions: list[Collision] = field(default_factory=list)
    facts: str = ""
    keywords: int = 0
    spent: int = 0

    def of_kind(self, kind: str) -> dict[int, Entry]:
        """Entries that define numbers of a kind (``part``, ``material``, ``curve``...), by number."""
        found: dict[int, Entry] = {}
        for entry in self.entries:
            if entry.kind == kind:
                found.setdefault(entry.id, entry)
        return found

    def named(self, keyword: str) -> Iterator[Entry]:
        """Entries of one canonical keyword."""
        return (entry for entry in self.entries if entry.keyword == keyword)

    def curve(self, number: int) -> np.ndarray | None:
        """Points of a curve with its scales and offsets applied, (k, 2), or None where it is not there."""
        entry = self.of_kind("curve").get(number)
        if entry is None:
            return None
        head = entry.rows[0]
        given = {f.name: v for f, v in zip(head.fields, head.values)}
        scale = [float(given[name] or 1.0) for name in ("sfa", "sfo")]
        offset = [float(given[name] or 0.0) for name in ("offa", "offo")]
        points = np.array([[float(v or 0.0) for v in row.values[:2]] for row in entry.rows[1:]]).reshape(-1, 2)
        return (points + offset) * scale


def meaning_of(keyword: str) -> str:
    """What it means for a run that this keyword is not simulated."""
    words = keyword.split("_")
    known = ("_".join(words[:n]) for n in range(len(words), -1, -1))
    return next(MEANINGS[name] for name in known if name in MEANINGS)
