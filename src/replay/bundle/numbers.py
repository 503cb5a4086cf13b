"""How far two files of numbers are apart: the worst entry, where it is, and by how much.

Reads CSV (cells by column), JSON (values by dotted path), HDF5 (datasets) and NumPy arrays;
any other kind of file is equal or it is not.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
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


Entries = Iterator[tuple[str, Any]]


def worst(path: str, old: BinaryIO, new: BinaryIO, rtol: float, atol: float) -> Apart | None:
    """Find the worst entry of two files of one kind.

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
        What is not a number, or is missing on one side, is never within.
    """
    reader = _READERS.get(PurePosixPath(path).suffix)
    if reader is None:
        return None
    found: Apart | None = None
    excess = -1.0
    try:
        before, after = dict(reader(old)), dict(reader(new))
    except (ValueError, OSError, KeyError, RecursionError, csv.Error) as error:
        return Apart("the file", "cannot be read", str(error).splitlines()[0], math.nan, math.nan, within=False)
    for where in [*before, *(name for name in after if name not in before)]:
        one = _compare(where, before.get(where), after.get(where), rtol, atol)
        if one is not None and one[1] > excess:
            found, excess = one
    return found


def _compare(where: str, old: Any, new: Any, rtol: float, atol: float) -> tuple[Apart, float] | None:
    """Compare one value or array; return its worst entry, and how far beyond tolerance (1 = at it) that is."""
    if old is None or new is None:
        if old is new:
            return None
        pair = ["missing" if side is None else "there" for side in (old, new)]
        return Apart(where, pair[0], pair[1], math.nan, math.nan, within=False), math.inf
    a, b = np.asarray(old), np.asarray(new)
    if a.dtype.kind not in "iufb" or b.dtype.kind not in "iufb" or a.shape != b.shape:
        if a.shape == b.shape and bool(np.all(a == b)):
            return None
        texts = [_short(x) for x in (a, b)]
        return Apart(where, texts[0], texts[1], math.nan, math.nan, within=False), math.inf
    a, b = a.astype(np.float64), b.astype(np.float64)
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    if bool(same.all()):
        return None
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        gap = np.where(same, 0.0, np.abs(b - a))
        allowed = atol + rtol * np.abs(a)
        beyond = np.where(same, 0.0, np.where(allowed > 0, gap / allowed, np.inf))
    beyond = np.where(np.isnan(beyond), np.inf, beyond)
    at = _worst_index(beyond, gap)
    place = where if not a.ndim else f"{where}[{', '.join(str(int(i)) for i in at)}]"
    size = abs(float(a[at]))
    relative = float(gap[at]) / size if size else math.inf
    one = Apart(place, repr(float(a[at])), repr(float(b[at])), float(gap[at]), relative, bool(beyond.max() <= 1.0))
    return one, float(beyond[at])


def _worst_index(beyond: NDArray[np.float64], gap: NDArray[np.float64]) -> tuple[Any, ...]:
    """Where `beyond` is largest; among equals, where the gap is."""
    top = beyond == beyond.max()
    candidates = np.where(top, np.where(np.isnan(gap), np.inf, gap), -1.0)
    return np.unravel_index(int(np.argmax(candidates)), gap.shape)


def _short(values: NDArray[Any]) -> str:
    return str(values.item())[:80] if values.size == 1 else f"shape {values.shape}, {values.dtype}"


def _csv_entries(stream: BinaryIO) -> Entries:
    """One entry a cell; a missing row or column is a missing entry."""
    rows = csv.reader(io.TextIOWrapper(stream, "utf-8-sig", newline=""))
    header = next(rows, [])
    for line, row in enumerate(rows, 2):
        for column, cell in zip([*header, *(f"column {i}" for i in range(len(header), len(row)))], row):
            try:
                value: Any = float(cell) if cell.strip() else cell
            except ValueError:
                value = cell
            yield f"line {line}, {column}", value


def _json_entries(stream: BinaryIO) -> Entries:
    def walk(value: Any, path: str) -> Entries:
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

    yield from walk(json.load(stream), "")


def _hdf_entries(stream: BinaryIO) -> Entries:
    found: list[tuple[str, Any]] = []

    def visit(name: str, thing: Any) -> None:
        if isinstance(thing, h5py.Dataset):
            found.append((name, thing[()]))

    with h5py.File(stream, "r") as file:
        file.visititems(visit)
    yield from found


def _npy_entries(stream: BinaryIO) -> Entries:
    yield "array", np.load(stream, allow_pickle=False)


def _npz_entries(stream: BinaryIO) -> Entries:
    with np.load(stream, allow_pickle=False) as arrays:
        for name in arrays.files:
            yield name, arrays[name]


_READERS: dict[str, Callable[[BinaryIO], Entries]] = {
    ".csv": _csv_entries,
    ".json": _json_entries,
    ".h5": _hdf_entries,
    ".hdf5": _hdf_entries,
    ".vtkhdf": _hdf_entries,
    ".npy": _npy_entries,
    ".npz": _npz_entries,
}
