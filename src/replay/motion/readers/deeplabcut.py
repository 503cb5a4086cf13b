"""DeepLabCut's CSV: headings ``scorer``, (``individuals``,) ``bodyparts``, ``coords``; x, y, likelihood a part."""

from __future__ import annotations

from pathlib import Path

from replay.errors import InputError
from replay.motion.readers.cells import rows_of
from replay.motion.readers.numerals import number_at
from replay.motion.readers.observations import Context, Observation
from replay.motion.readers.predictions import choose_individual, weight_of

NAME = "deeplabcut"
_MISSING = ("", "nan")


def recognises(text: str) -> bool:
    """A first cell ``scorer``."""
    return text.lstrip().casefold().startswith("scorer,")


def read(path: Path, context: Context) -> list[Observation]:
    """Read one individual's body parts; the likelihood becomes the weight.

    Raises
    ------
    InputError
        Headings that do not match, several individuals and none named, indices that are no frames, likelihoods
        outside [0, 1].
    """
    rows = rows_of(path)
    depth = next((i for i, (_, row) in enumerate(rows[:5]) if row[0].casefold() == "coords"), None)
    headings = {row[0].casefold(): row for _, row in rows[: (depth or 0) + 1]}
    if depth is None or "bodyparts" not in headings or len({len(row) for row in headings.values()}) > 1:
        raise InputError(
            path,
            "the headings are not scorer, (individuals,) bodyparts, coords",
            line=1,
            expected="the CSV that DeepLabCut's analyze_videos writes",
            mend="export it again with save_as_csv",
        )
    parts, coords = headings["bodyparts"], [c.casefold() for c in headings["coords"]]
    individuals = headings.get("individuals", [""] * len(parts))
    chosen = choose_individual(path, individuals[1:], context)
    columns: dict[str, dict[str, int]] = {}
    for index in range(1, len(parts)):
        if individuals[index] in (chosen, "single"):
            columns.setdefault(parts[index], {})[coords[index]] = index
    for part, where in columns.items():
        if "x" not in where or "y" not in where:
            raise InputError(path, f"body part {part!r} has no x and y", line=rows[depth][0], mend="export it again")
    out = []
    for line, row in rows[depth + 1 :]:
        if len(row) != len(parts):
            found = f"{len(row)} cells where the headings have {len(parts)}"
            raise InputError(path, found, line=line, mend="complete the row or remove it")
        frame = number_at(path, row[0], line, "index")
        if frame != round(frame):
            raise InputError(path, f"{row[0]} is no frame", line=line, column="index", expected="a whole number")
        for part, where in columns.items():
            x, y = row[where["x"]], row[where["y"]]
            if x.casefold() in _MISSING or y.casefold() in _MISSING:
                continue
            weight = weight_of(path, row[where["likelihood"]] if "likelihood" in where else "1", line, part, context)
            if weight is not None:
                u, v = (number_at(path, cell, line, part) for cell in (x, y))
                out.append(Observation(round(frame), part, u, v, weight, line))
    return out
