"""Tests of tissue: the table, its units, and how far each point can be trusted."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replay.errors import InputError, InputErrors
from replay.files import read_text
from replay.tables import Column, TableFormat

#: How a point came to be, and by how much its error is widened in a fit.
STATUSES: dict[str, float] = {"measured": 1.0, "derived": 1.0, "unverified": 1.25}
#: The table's modes and the laboratory's test for each; None is not fitted, only shown.
RECORDED_MODES: dict[str, str | None] = {
    "compression_nominal": "compression",
    "tension_nominal": "tension",
    "simple_shear": "simple_shear",
    "initial_modulus": None,
}
TEST_TABLE = TableFormat(
    "tests of a material",
    (
        Column("mode", f"one of {', '.join(RECORDED_MODES)}", "text"),
        Column("rate_per_s", "nominal strain rate, or rate of shear"),
        Column("strain", "nominal strain, or amount of shear; positive"),
        Column("stress_kPa", "nominal stress, or shear stress; positive. Of `initial_modulus`: Young's modulus"),
        Column("sd_kPa", "standard deviation over specimens", may_be_empty=True),
        Column("status", f"one of {', '.join(STATUSES)}, with any remark beside it", "text"),
        Column("source", "publication or protocol", "text"),
    ),
)


@dataclass(frozen=True)
class Curve:
    """Points of one test at one rate.

    Parameters
    ----------
    mode
        A test of the laboratory.
    rate_per_s
        Rate [1/s].
    strains : (n,) float64
        Increasing.
    stresses_pa, deviations_pa : (n,) float64
        Nominal [Pa]; the second is NaN where it is not known.
    statuses
        One of `STATUSES` a point.
    sources
        Where the points come from.
    """

    mode: str
    rate_per_s: float
    strains: NDArray[np.float64]
    stresses_pa: NDArray[np.float64]
    deviations_pa: NDArray[np.float64]
    statuses: tuple[str, ...]
    sources: tuple[str, ...]

    @property
    def name(self) -> str:
        """For tables and legends."""
        return f"{self.mode.replace('_', ' ')} at {self.rate_per_s:g} per s"


def read_tests(path: str | Path) -> tuple[Curve, ...]:
    """Read a table of tests.

    Raises
    ------
    InputError, InputErrors
        For a heading without unit, a status or mode that is not known, a stress or strain that is not positive; with
        file, line and column.
    """
    _refuse_headings_without_unit(path)
    frame = TEST_TABLE.read(path)
    lines: Sequence[int] = frame.attrs["lines"]
    errors = []
    statuses = []
    for line, row in zip(lines, frame.itertuples(index=False)):
        words = set(re.findall(r"[a-z]+", row.status.lower())) & set(STATUSES)
        statuses.append(next(iter(words)) if len(words) == 1 else "")
        if len(words) != 1:
            errors.append(_bad(path, line, "status", f"{row.status!r} is not known", ", ".join(STATUSES)))
        if row.mode not in RECORDED_MODES:
            errors.append(_bad(path, line, "mode", f"{row.mode!r} is not known", ", ".join(RECORDED_MODES)))
        least_strain = 0.0 if row.mode == "initial_modulus" else 1e-9
        least = {"rate_per_s": 1e-12, "stress_kPa": 1e-12, "strain": least_strain}
        for name, floor in least.items():
            value = getattr(row, name)
            if not value >= floor:
                errors.append(_bad(path, line, name, f"it is {value!r}", "a positive number"))
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(errors)
    curves = _curves(frame.assign(status=statuses))
    if not curves:
        raise InputError(
            path, "no row can be fitted", expected="rows of compression_nominal, tension_nominal or simple_shear"
        )
    return curves


def _bad(path: str | Path, line: int, column: str, found: str, expected: str) -> InputError:
    return InputError(path, found, line=line, column=column, expected=expected, mend="correct it or remove the row")


def _refuse_headings_without_unit(path: str | Path) -> None:
    """Say so where a column is there by its name but not in its unit, rather than that it is missing."""
    first = next(iter(read_text(path).splitlines()), "")
    headings = [cell.strip() for cell in first.split(",")]
    for name in ("rate_per_s", "stress_kPa", "sd_kPa"):
        stem = name.partition("_")[0]
        for heading in headings:
            if name not in headings and heading.partition("_")[0] == stem:
                raise InputError(
                    path, f"the heading {heading!r} does not have the unit of {name!r}", line=1, column=heading,
                    expected=", ".join(TEST_TABLE.names), mend=f"convert the column and call it {name}",
                )  # fmt: skip


def _curves(frame: pd.DataFrame) -> tuple[Curve, ...]:
    curves = []
    for mode, test in RECORDED_MODES.items():
        if test is None:
            continue
        for rate, rows in frame[frame["mode"] == mode].groupby("rate_per_s", sort=True):
            ordered = rows.sort_values("strain", kind="stable")
            curves.append(
                Curve(
                    test,
                    float(rate),
                    ordered["strain"].to_numpy(float),
                    1e3 * ordered["stress_kPa"].to_numpy(float),
                    1e3 * ordered["sd_kPa"].to_numpy(float),
                    tuple(ordered["status"]),
                    tuple(dict.fromkeys(ordered["source"])),
                )
            )
    return tuple(curves)
