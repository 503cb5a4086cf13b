"""How far two files of numbers are apart: the worst entry, where it is, and by how much.

Reads CSV (cells by column), JSON (values by dotted path), HDF5 (datasets) and NumPy arrays; any other
kind of file is equal or it is not. Tables are read row by row and datasets block by block.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import PurePosixPath
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Apart:
    """The worst entry of two files.

    Parameters
    ----------
    where
        Line and column, dotted path, or dataset and index.
    old, new
        Its values, as text.
    absolute, relative
        Differences; NaN where the values are no numbers.
    within
        Whether every entry of the files is within the tolerances.
    """

    where: str
    old: str
    new: str
    absolute: float
    relative: float
    within: bool


@dataclass(frozen=True)
class Entry:
    """One value or block of values of both files.

    Parameters
    ----------
    where
        Its name.
    old, new
        Values, None where one file has none.
    column
        Quantity it belongs to: a difference of class exact counts by the quantity's own greatest value.
    first
        Row of the whole that the block begins at.
    """

    where: str
    old: Any
    new: Any
    column: str
    first: int = 0


Entries = Iterator[Entry]
_BLOCK_VALUES = 1 << 22
_NUMBERS = "iufb"  # kinds of numpy's types


def worst(path: str, old: BinaryIO, new: BinaryIO, rtol: float, atol: float) -> Apart | None:
    """Find the worst entry of two files of one kind: farthest beyond its tolerance, or beside its column's peak.

    Parameters
    ----------
    path
        Name of the file; its suffix says how it is read.
    old, new
        Contents, seekable.
    rtol, atol
        An entry is within when ``|new - old| <= atol + rtol |old|``.

    Returns
    -------
    Apart or None
        None when no entry differs (though bytes may) or the file is of no kind that is read.
        What is not a number, or is missing on one side, is never within and comes first.
    """
    reader = _READERS.get(PurePosixPath(path).suffix)
    if reader is None:
        return None
    peaks: dict[str, float] = {}
    found: dict[str, tuple[float, float, Apart]] = {}
    try:
        for entry in reader(old, new):
            if (odd := _no_number(entry)) is not None:
                return odd
            if np.asarray(entry.old).dtype.kind not in _NUMBERS or not np.size(entry.old):
                continue
            a, b = (np.asarray(side).astype(np.float64) for side in (entry.old, entry.new))
            known = np.abs(a[np.isfinite(a)])
            peaks[entry.column] = max(peaks.get(entry.column, 0.0), float(known.max()) if known.size else 0.0)
            one = _compare(entry, a, b, rtol, atol)
            if one is not None and one[:2] > found.get(entry.column, (-1.0, -1.0))[:2]:
                found[entry.column] = one
    except (ValueError, OSError, KeyError, RecursionError, csv.Error) as error:
        return Apart("the file", "cannot be read", str(error).splitlines()[0], math.nan, math.nan, within=False)
    if not found:
        return None

    def rank(column: str) -> tuple[float, float]:
        excess, gap, _ = found[column]
        return excess, gap / peaks[column] if peaks[column] > 0 else math.inf

    return found[max(found, key=rank)][2]


def _no_number(entry: Entry) -> Apart | None:
    """Say what is wrong with an entry that cannot be compared as numbers; None for numbers and for equal things."""
    if entry.old is None or entry.new is None:
        if entry.old is entry.new:
            return None
        pair = ["missing" if side is None else "there" for side in (entry.old, entry.new)]
        return Apart(entry.where, pair[0], pair[1], math.nan, math.nan, within=False)
    a, b = np.asarray(entry.old), np.asarray(entry.new)
    if a.dtype.kind in _NUMBERS and b.dtype.kind in _NUMBERS and a.shape == b.shape:
        return None
    if a.shape == b.shape and bool(np.all(a == b)):
        return None
    return Apart(entry.where, _short(a), _short(b), math.nan, math.nan, within=False)


def _compare(
    entry: Entry, a: NDArray[np.float64], b: NDArray[np.float64], rtol: float, atol: float
) -> tuple[float, float, Apart] | None:
    """Find the worst of a block: how far beyond tolerance it is (1 = at it), the difference, and its place."""
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    if bool(same.all()):
        return None
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        gap = np.where(same, 0.0, np.abs(b - a))
        allowed = atol + rtol * np.abs(a)
        beyond = np.where(same, 0.0, np.where(allowed > 0, gap / allowed, np.inf))
    beyond, gap = np.where(np.isnan(beyond), np.inf, beyond), np.where(np.isnan(gap), np.inf, gap)
    at = _worst_index(beyond, gap)
    index = ", ".join(str(int(i) + (entry.first if k == 0 else 0)) for k, i in enumerate(at))
    size = abs(float(a[at]))
    relative = float(gap[at]) / size if size else math.inf
    absolute = float(gap[at]) if np.isfinite(gap[at]) else math.nan
    within = bool(beyond.max() <= 1.0)
    place = f"{entry.where}[{index}]" if index else entry.where
    return (
        float(beyond[at]),
        float(gap[at]),
        Apart(place, repr(float(a[at])), repr(float(b[at])), absolute, relative, within),
    )


def _worst_index(beyond: NDArray[np.float64], gap: NDArray[np.float64]) -> tuple[Any, ...]:
    """Where `beyond` is largest; among equals, where the gap is."""
    top = beyond == beyond.max()
    candidates = np.where(top, gap, -1.0)
    return np.unravel_index(int(np.argmax(candidates)), gap.shape)


def _short(values: NDArray[Any]) -> str:
    return str(values.item())[:80] if values.size == 1 else f"shape {values.shape}, {values.dtype}"


def _csv_entries(old: BinaryIO, new: BinaryIO) -> Entries:
    """One entry a cell; a missing row or column is a missing entry."""
    rows = [csv.reader(io.TextIOWrapper(stream, "utf-8-sig", newline="")) for stream in (old, new)]
    headers = [next(reader, []) for reader in rows]
    for line, (before, after) in enumerate(zip_longest(*rows, fillvalue=[]), 2):
        cells = [
            dict(zip([*header, *(f"column {i}" for i in range(len(header), len(row)))], row))
            for header, row in zip(headers, (before, after))
        ]
        for column in dict.fromkeys([*cells[0], *cells[1]]):
            yield Entry(f"line {line}, {column}", _cell(cells[0].get(column)), _cell(cells[1].get(column)), column)


def _cell(text: str | None) -> Any:
    try:
        return float(text) if text and text.strip() else text
    except ValueError:
        return text


def _by_name(before: Mapping[str, Any], after: Mapping[str, Any]) -> Entries:
    for name in [*before, *(name for name in after if name not in before)]:
        yield Entry(name, before.get(name), after.get(name), name)


def _json_entries(old: BinaryIO, new: BinaryIO) -> Entries:
    def walk(value: Any, path: str) -> Iterator[tuple[str, Any]]:
        if isinstance(value, dict):
            yield f"{path} (keys)" if path else "(keys)", " ".join(map(str, value))
            for key, item in value.items():
                yield from walk(item, f"{path}.{key}" if path else str(key))
        elif isinstance(value, list):
            yield f"{path} (length)", len(value)
            for index, item in enumerate(value):
                yield from walk(item, f"{path}[{index}]")
        else:
            yield path, "null" if value is None else value

    yield from _by_name(dict(walk(json.load(old), "")), dict(walk(json.load(new), "")))


def _hdf_entries(old: BinaryIO, new: BinaryIO) -> Entries:
    """Datasets, those of one shape in blocks of rows: the states of a long run do not fit into memory."""
    with h5py.File(old, "r") as before, h5py.File(new, "r") as after:
        for entry in _by_name(_datasets(before), _datasets(after)):
            one, other = entry.old, entry.new
            if one is None or other is None or one.shape != other.shape or not one.shape:
                whole, changed = (None if side is None else side[()] for side in (one, other))
                yield Entry(entry.where, whole, changed, entry.where)
                continue
            rows = max(1, _BLOCK_VALUES * one.shape[0] // max(1, one.size))
            for start in range(0, one.shape[0], rows):
                stop = start + rows
                yield Entry(entry.where, one[start:stop], other[start:stop], entry.where, start)


def _datasets(file: h5py.File) -> dict[str, h5py.Dataset]:
    found: dict[str, h5py.Dataset] = {}
    file.visititems(lambda name, thing: found.update({name: thing}) if isinstance(thing, h5py.Dataset) else None)
    return found


def _npy_entries(old: BinaryIO, new: BinaryIO) -> Entries:
    yield Entry("array", np.load(old, allow_pickle=False), np.load(new, allow_pickle=False), "array")


def _npz_entries(old: BinaryIO, new: BinaryIO) -> Entries:
    with np.load(old, allow_pickle=False) as before, np.load(new, allow_pickle=False) as after:
        yield from _by_name(before, after)


_READERS: dict[str, Callable[[BinaryIO, BinaryIO], Entries]] = {
    ".csv": _csv_entries,
    ".json": _json_entries,
    ".h5": _hdf_entries,
    ".hdf5": _hdf_entries,
    ".vtkhdf": _hdf_entries,
    ".npy": _npy_entries,
    ".npz": _npz_entries,
}
