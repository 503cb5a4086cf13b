"""LS-DYNA keyword files: reading anybody's, and what is needed to write them anew."""

from replay.decks.keyword.deck import Collision, Elements, Kept, KeywordDeck, Remark
from replay.decks.keyword.entries import Entry
from replay.decks.keyword.reader import read_keyword

__all__ = ["Collision", "Elements", "Entry", "Kept", "KeywordDeck", "Remark", "read_keyword"]
