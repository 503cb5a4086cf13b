"""What a keyword deck has no card for, as comments beside the cards: ``$replay`` lines of one JSON text.

Roles, regions, the exact constants of a law that a *MAT only approximates, the pose: other programs skip the lines,
ours reads them back, so that a deck gives back the model it was written from to the last bit. Where a card was edited
since, the card holds.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from replay.decks.deck import DeckPart
from replay.decks.keyword import KeywordDeck
from replay.decks.keyword.columns import FACTS_SCHEMA
from replay.decks.keyword.entries import Entry
from replay.decks.keyword.fields import split, to_float
from replay.decks.lsdyna import material_lines


def read_facts(deck: KeywordDeck) -> dict[str, Any] | None:
    """Facts of a deck of ours; None for any other, and for one whose lines are damaged."""
    try:
        facts = json.loads(deck.facts)
    except (json.JSONDecodeError, RecursionError):
        return None
    return facts if isinstance(facts, dict) and facts.get("schema") == FACTS_SCHEMA else None


def same_card(entry: Entry, part: DeckPart) -> bool:
    """Whether a ``*MAT`` card still says what we would write for this part."""
    lines = material_lines(replace(part, pid=entry.id))
    if lines[0] != f"*{entry.keyword}":
        return False
    cards: Sequence[str] = [line for line in lines[1:] if not line.startswith("$")]
    for row, text in zip(entry.rows, cards):
        written = [to_float(field) for field in split(text, [10] * len(row.fields))][: len(row.fields)]
        read = [float(v) if isinstance(v, int | float) else None for v in row.values]
        if read != written:
            return False
    return True
