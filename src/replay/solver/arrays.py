"""Arrays at the solver's door: the right shape, finite, whole numbers where rows are meant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError

#: What messages call the arrays that a caller hands over.
WHERE = "solver problem"


def checked_array(value: Any, name: str, shape: Sequence[int | None]) -> NDArray[np.float64]:
    """Own float64 copy of `value`.

    Parameters
    ----------
    value
        Anything that is an array.
    name
        Path of the setting, for the message.
    shape
        Wanted lengths; None stands for any.

    Raises
    ------
    InputError
        For another shape, NaN or infinity.
    """
    array = np.array(value, dtype=float, order="C")
    _check_shape(array, name, shape)
    if not np.isfinite(array).all():
        row = np.argwhere(~np.isfinite(array))[0]
        raise InputError(WHERE, f"row {row[0]} holds {array[tuple(row)]}", column=name, expected="finite numbers")
    return array


def checked_integers(value: Any, name: str, shape: Sequence[int | None]) -> NDArray[np.int64]:
    """Own int64 copy of `value`; as `checked_array`, and numbers that are not whole are refused."""
    array = np.array(value)
    _check_shape(array, name, shape)
    if not np.issubdtype(array.dtype, np.integer):
        raise InputError(WHERE, f"its numbers are {array.dtype}", column=name, expected="whole numbers")
    return array.astype(np.int64)


def checked_rows(value: Any, name: str, count: int) -> NDArray[np.int64]:
    """Distinct rows of `count` nodes.

    Raises
    ------
    InputError
        For a row that does not exist, one that occurs twice, or none at all.
    """
    rows = checked_integers(value, name, (None,))
    if not len(rows):
        raise InputError(WHERE, "names no node", column=name, expected="at least one node")
    if rows.min() < 0 or rows.max() >= count:
        raise InputError(WHERE, "names a node row that does not exist", column=name, expected=f"rows 0 to {count - 1}")
    if len(np.unique(rows)) < len(rows):
        raise InputError(WHERE, "names a node twice", column=name, expected="distinct nodes")
    return rows


def _check_shape(array: NDArray[Any], name: str, shape: Sequence[int | None]) -> None:
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape)):
        wanted = ", ".join("any" if k is None else str(k) for k in shape)
        raise InputError(WHERE, f"its shape is {array.shape}", column=name, expected=f"({wanted})")
