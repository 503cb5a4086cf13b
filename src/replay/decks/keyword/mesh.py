"""Nodes and elements of keyword files as arrays: whole columns at once, and line by line where that cannot be.

The quick way takes fixed columns of plain numbers. A block with anything else (commas, FORTRAN exponents, parameters,
mistakes) is read again line by line, which also knows where a mistake stands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from replay.decks.keyword.blocks import I10, LONG, Block
from replay.decks.keyword.fields import Line, Value, lookup, mistake, shown, split, to_float, to_int

_LARGEST_DIGITS = 18


@dataclass(frozen=True)
class NodeRows:
    """Nodes of one block: numbers (n,), coordinates (n, 3), constraint codes (n, 2), lines (n,)."""

    ids: np.ndarray
    coordinates: np.ndarray
    constraints: np.ndarray
    lines: np.ndarray


@dataclass(frozen=True)
class ElementRows:
    """Elements of one block: numbers (m,), parts (m,), node numbers (m, 10) with 0 where there is none, lines (m,)."""

    ids: np.ndarray
    parts: np.ndarray
    nodes: np.ndarray
    lines: np.ndarray


def read_nodes(block: Block, parameters: Mapping[str, Value]) -> NodeRows:
    """Nodes of a ``*NODE`` block.

    Raises
    ------
    InputError
        At the first field that is no number.
    """
    wide = 20 if block.layout == LONG else 16
    number = {LONG: 20, I10: 10}.get(block.layout, 8)
    widths = (number, wide, wide, wide, number, number)
    lines = _filled(block)
    quick = _columns(lines, widths)
    if quick is not None:
        whole = _all([_whole(quick[k]) for k in (0, 4, 5)])
        real = _all([_real(quick[k]) for k in (1, 2, 3)])
        if whole and real and whole[0].min() > 0:
            return NodeRows(whole[0], np.stack(real, axis=1), np.stack(whole[1:], axis=1), _numbers(lines))
    names = ("nid", "x", "y", "z", "tc", "rc")
    table = np.zeros((len(lines), 6))
    ids = np.zeros(len(lines), dtype=np.int64)
    for row, line in enumerate(lines):
        fields = split(line.text, widths)
        ids[row] = _identity(line, "nid", fields[0], parameters)
        for k in range(1, 6):
            table[row, k] = _number(line, names[k], fields[k], parameters)
            if k > 3 and (table[row, k] % 1 or abs(table[row, k]) > 1000):
                raise mistake(line, names[k], f"{shown(fields[k])} is no constraint code", "a whole number, 0 to 7")
    return NodeRows(ids, table[:, 1:4].copy(), table[:, 4:].astype(np.int64), _numbers(lines))


def read_elements(block: Block, parameters: Mapping[str, Value], *, shell: bool) -> ElementRows:
    """Elements of an ``*ELEMENT_SOLID`` or ``*ELEMENT_SHELL`` block.

    A solid stands on one line (number, part, eight nodes) or on two (number, part; up to ten nodes).

    Raises
    ------
    InputError
        At the first field that is no number, or a second line that is missing.
    """
    number = {LONG: 20, I10: 10}.get(block.layout, 8)
    lines = _filled(block)
    two = not shell and bool(lines) and _is_first_of_two(lines[0].text, number)
    if two and len(lines) % 2 == 0 and all(_is_first_of_two(line.text, number) for line in lines[::2]):
        heads, tails = _columns(lines[::2], (number,) * 2), _columns(lines[1::2], (number,) * 10)
        quick = None if heads is None or tails is None else [*heads, *tails]
    else:
        quick = None if two else _columns(lines, (number,) * 10)
    if quick is not None:
        columns = _all([_whole(column) for column in quick])
        if columns and min(column.min() for column in columns[:3]) > 0:
            nodes = np.zeros((len(columns[0]), 10), dtype=np.int64)
            nodes[:, : len(columns) - 2] = np.stack(columns[2:], axis=1)
            return ElementRows(columns[0], columns[1], nodes, _numbers(lines[::2] if two else lines))
    return _elements_line_by_line(lines, number, parameters, shell=shell)


def _elements_line_by_line(
    lines: Sequence[Line], number: int, parameters: Mapping[str, Value], *, shell: bool
) -> ElementRows:
    rows, places = [], []
    k = 0
    while k < len(lines):
        line, fields = lines[k], split(lines[k].text, (number,) * 10)
        values = [_identity(line, "eid", fields[0], parameters), _identity(line, "pid", fields[1], parameters)]
        places.append(line.number)
        if not shell and not any(fields[2:]):
            k += 1
            if k == len(lines):
                raise mistake(line, "n1", "the line of its nodes is missing", "a second line with up to ten nodes")
            line, fields = lines[k], ["", "", *split(lines[k].text, (number,) * 10)]
        nodes = fields[2:12]
        values += [_identity(line, f"n{j + 1}", text, parameters, blank=j > 2) for j, text in enumerate(nodes)]
        rows.append(values + [0] * (12 - len(values)))
        k += 1
    table = np.array(rows, dtype=np.int64).reshape(-1, 12)
    return ElementRows(table[:, 0], table[:, 1], table[:, 2:], np.array(places, dtype=np.int64))


def _is_first_of_two(text: str, number: int) -> bool:
    if "," in text:
        return not any(field.strip() for field in text.split(",")[2:])
    return not text[2 * number :].strip()


def _filled(block: Block) -> list[Line]:
    return [line for line in block.lines if line.text.strip()]


def _numbers(lines: Sequence[Line]) -> np.ndarray:
    return np.array([line.number for line in lines], dtype=np.int64)


def _columns(lines: Sequence[Line], widths: Sequence[int]) -> list[np.ndarray] | None:
    """Bytes of each column, (n, width) uint8; None where lines are not plain columns."""
    total = sum(widths)
    texts = [line.text for line in lines]
    if not texts or any("," in text or "&" in text for text in texts):
        return None
    try:
        packed = np.array(texts, dtype=f"S{total}")
    except UnicodeEncodeError:
        return None
    table = packed.view(np.uint8).reshape(len(texts), total)
    edges = np.cumsum([0, *widths])
    return [np.ascontiguousarray(table[:, a:b]) for a, b in pairwise(edges)]


def _all(columns: Sequence[np.ndarray | None]) -> list[np.ndarray] | None:
    """The columns, if every one of them could be read."""
    found = [column for column in columns if column is not None]
    return found if len(found) == len(columns) else None


def _whole(column: np.ndarray) -> np.ndarray | None:
    """Whole numbers without sign; blank is 0; None where a field is anything else."""
    value = np.zeros(len(column), dtype=np.int64)
    began = np.zeros(len(column), dtype=bool)
    ended = np.zeros(len(column), dtype=bool)
    if (
        column.shape[1] > _LARGEST_DIGITS
        and ((column[:, :-_LARGEST_DIGITS] != 32) & (column[:, :-_LARGEST_DIGITS] != 0)).any()
    ):
        return None
    for place in column.T:
        digit = (place >= 48) & (place <= 57)
        empty = (place == 32) | (place == 0)
        if not (digit | empty).all() or (digit & ended).any():
            return None
        value = np.where(digit, value * 10 + (place - 48), value)
        ended |= began & empty
        began |= digit
    return value


def _real(column: np.ndarray) -> np.ndarray | None:
    """Finite numbers as C writes them; blank is 0; None where a field is anything else."""
    if not np.isin(column, np.frombuffer(b"0123456789+-.eE \0", dtype=np.uint8)).all():
        return None
    text = column.view(f"S{column.shape[1]}").ravel().copy()
    text[((column == 32) | (column == 0)).all(axis=1)] = b"0"
    try:
        value = text.astype(np.float64)
    except ValueError:
        return None
    return value if np.isfinite(value).all() else None


def _identity(line: Line, name: str, text: str, parameters: Mapping[str, Value], *, blank: bool = False) -> int:
    if text.startswith(("&", "-&")):
        text = lookup(line, name, text, parameters)
    if blank and not text:
        return 0
    value = to_int(text)
    if value is None or value < (0 if blank else 1):
        raise mistake(line, name, f"{shown(text)} is no number of a node, element or part", "a positive whole number")
    return value


def _number(line: Line, name: str, text: str, parameters: Mapping[str, Value]) -> float:
    if text.startswith(("&", "-&")):
        text = lookup(line, name, text, parameters)
    value = to_float(text) if text else 0.0
    if value is None:
        raise mistake(line, name, f"{shown(text)} is no number", "a finite number")
    return value
