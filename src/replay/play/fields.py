"""Kinds of values that the settings of a play are made of."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo

from replay.documents import Number, refuse

Vector3 = tuple[Number, Number, Number]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]


def existing_file(name: str, info: ValidationInfo) -> str:
    """Refuse a name that is no file in the play's folder."""
    folder = (info.context or {}).get("folder")
    if folder is None or (Path(folder) / name).is_file():
        return name
    refuse(
        "the file does not exist",
        f"a file in {Path(folder).resolve().name}/",
        "correct the name, or put the file there",
    )


InputFile = Annotated[str, Field(min_length=1), AfterValidator(existing_file)]


def _unit_quaternion(value: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    length = float(np.linalg.norm(value))
    if abs(length - 1.0) > 1e-3:
        refuse(f"has length {length:.4g}", "a unit quaternion (x, y, z, w)", "divide by its length, scalar part last")
    x, y, z, w = (float(v) / length for v in value)
    return x, y, z, w


Quaternion = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_unit_quaternion)]
