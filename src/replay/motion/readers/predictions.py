"""What the files of pose networks share: individuals, and a likelihood that becomes a weight."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from replay.errors import InputError
from replay.motion.readers.numerals import number_at
from replay.motion.readers.observations import Context


def choose_individual(path: Path, names: Sequence[str], context: Context) -> str:
    """The individual that the play names, or the only one.

    Raises
    ------
    InputError
        Several and none named, or none of that name.
    """
    known = [name for name in dict.fromkeys(names) if name != "single"] or [""]
    if context.individual is None:
        if len(known) > 1:
            raise InputError(
                path,
                f"holds {len(known)} individuals: {', '.join(known[:8])}",
                expected="one, or its name in the play",
                mend=f"add `individual: {known[0]}` (or another) to source in play.yaml",
            )
        return known[0]
    if context.individual not in known:
        raise InputError(
            path,
            f"holds no individual {context.individual!r}",
            expected=f"one of {', '.join(known[:8])}",
            mend="correct source.individual in play.yaml",
        )
    return context.individual


def weight_of(path: Path, text: str, line: int, column: str, context: Context) -> float | None:
    """Weight of a prediction: its likelihood; None where that is too small (or not given) to be used.

    SLEAP's scores may exceed 1 a little and count as 1.

    Raises
    ------
    InputError
        A likelihood that is none.
    """
    if text.casefold() in ("", "nan"):
        return None
    likelihood = number_at(path, text, line, column)
    if not 0.0 <= likelihood <= 1.5:
        raise InputError(
            path,
            f"the likelihood is {text}",
            line=line,
            column=column,
            expected="between 0 and 1",
            mend="check that the columns are x, y, likelihood in this order",
        )
    return min(likelihood, 1.0) if likelihood >= max(context.least_likelihood, 1e-6) else None
