"""Decks for other solvers: the article's Velodyne-style card and LS-DYNA keyword files."""

from replay.decks.deck import (
    Cable,
    DeckControls,
    DeckInput,
    DeckPart,
    Driver,
    FrictionPair,
    FrictionType,
    InitialVelocity,
    NumberedSet,
    PartSet,
    axis_through,
    deck_parts,
)
from replay.decks.keyword import KeywordDeck, read_keyword
from replay.decks.lsdyna import write_lsdyna, write_openradioss
from replay.decks.slurm import write_own_submit
from replay.decks.velodyne import read_velodyne, write_velodyne

__all__ = [
    "Cable",
    "DeckControls",
    "DeckInput",
    "DeckPart",
    "Driver",
    "FrictionPair",
    "FrictionType",
    "InitialVelocity",
    "KeywordDeck",
    "NumberedSet",
    "PartSet",
    "axis_through",
    "deck_parts",
    "read_keyword",
    "read_velodyne",
    "write_lsdyna",
    "write_openradioss",
    "write_own_submit",
    "write_velodyne",
]
