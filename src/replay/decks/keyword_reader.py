"""A small strict reader of the keyword decks that `replay.decks.lsdyna` writes: what was written is what is read.

Not a reader for anybody's deck: it takes the fixed columns of our own and says which line it cannot take.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from replay.errors import InputError
from replay.files import read_text

T = TypeVar("T")


@dataclass
class KeywordDeck:
    """A deck as read.

    Parameters
    ----------
    nodes
        Node number to coordinates [m].
    solids
        Element number to (part number, eight node numbers).
    parts
        Part number to (name, section, material).
    materials
        Material number to (keyword, fields of its first card).
    part_sets
        Set number to (name, part numbers).
    curves
        Curve number to points.
    cards
        Keyword to the fields of its first card, for controls and outputs.
    initial_velocities, prescribed, merged_bodies
        Fields of the cards of *INITIAL_VELOCITY_GENERATION, *BOUNDARY_PRESCRIBED_MOTION_RIGID and
        *CONSTRAINED_RIGID_BODIES.
    """

    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    solids: dict[int, tuple[int, tuple[int, ...]]] = field(default_factory=dict)
    parts: dict[int, tuple[str, int, int]] = field(default_factory=dict)
    materials: dict[int, tuple[str, tuple[float, ...]]] = field(default_factory=dict)
    part_sets: dict[int, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    curves: dict[int, list[tuple[float, float]]] = field(default_factory=dict)
    cards: dict[str, tuple[float, ...]] = field(default_factory=dict)
    initial_velocities: list[tuple[float, ...]] = field(default_factory=list)
    prescribed: list[tuple[float, ...]] = field(default_factory=list)
    merged_bodies: list[tuple[int, int]] = field(default_factory=list)


def read_keyword(path: str | Path) -> KeywordDeck:
    """Read a deck and what it includes.

    Raises
    ------
    InputError
        With file and line for what cannot be read.
    """
    deck = KeywordDeck()
    _read_into(Path(path), deck)
    return deck


def _read_into(path: Path, deck: KeywordDeck) -> None:
    for keyword, start, cards in _blocks(path):
        try:
            _take(path, keyword, cards, deck)
        except (ValueError, IndexError) as error:
            raise InputError(
                path, f"{keyword} cannot be read ({error})", line=start, mend="write the deck again"
            ) from None


def _blocks(path: Path) -> Iterator[tuple[str, int, list[str]]]:
    keyword, start = "", 0
    cards: list[str] = []
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        if line.startswith("$"):
            continue
        if line.startswith("*"):
            if keyword:
                yield keyword, start, cards
            keyword, start, cards = line.strip(), number, []
        elif line.strip():
            cards.append(line)
    if keyword:
        yield keyword, start, cards


def _take(path: Path, keyword: str, cards: list[str], deck: KeywordDeck) -> None:
    if keyword == "*NODE":
        for card in cards:
            x, y, z = _columns(card[8:56], 16, float)
            deck.nodes[int(card[:8])] = (x, y, z)
    elif keyword == "*ELEMENT_SOLID":
        for first, second in zip(cards[::2], cards[1::2]):
            element, part = _columns(first, 8, int)
            deck.solids[element] = (part, tuple(_columns(second, 8, int)))
    elif keyword == "*PART":
        pid, section, material = _columns(cards[1], 10, int)
        deck.parts[pid] = (cards[0].strip(), section, material)
    elif keyword.startswith("*MAT_"):
        fields = tuple(_columns(cards[0], 10, float))
        deck.materials[int(fields[0])] = (keyword, fields[1:])
    elif keyword == "*SET_PART_LIST_TITLE":
        members = [pid for card in cards[2:] for pid in _columns(card, 10, int)]
        deck.part_sets[int(cards[1])] = (cards[0].strip(), tuple(members))
    elif keyword == "*DEFINE_CURVE":
        deck.curves[int(cards[0])] = [(float(card[:20]), float(card[20:40])) for card in cards[1:]]
    elif keyword == "*INITIAL_VELOCITY_GENERATION":
        deck.initial_velocities.append((*_columns(cards[0], 10, float), *_columns(cards[1], 10, float)))
    elif keyword == "*BOUNDARY_PRESCRIBED_MOTION_RIGID":
        deck.prescribed.append(tuple(_columns(cards[0], 10, float)))
    elif keyword == "*CONSTRAINED_RIGID_BODIES":
        lead, follower = _columns(cards[0], 10, int)
        deck.merged_bodies.append((lead, follower))
    elif keyword == "*INCLUDE":
        _read_into(path.parent / cards[0].strip(), deck)
    elif keyword not in ("*KEYWORD", "*TITLE", "*END", "*SECTION_SOLID"):
        deck.cards[keyword] = tuple(_columns(cards[0], 10, float))


def _columns(card: str, width: int, kind: Callable[[str], T]) -> list[T]:
    return [kind(card[k : k + width]) for k in range(0, len(card.rstrip()), width)]
