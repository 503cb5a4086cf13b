"""A play with settings replaced, each by its dotted path: a row of the table of plays, a member of an ensemble."""

from __future__ import annotations

import copy
import difflib
import typing
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from replay.documents import blocks_of
from replay.play.description import Play


def overridden(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a play's data with settings replaced.

    Parameters
    ----------
    data
        As read from ``play.yaml``, or resolved.
    overrides
        Dotted path (``solver.contact.friction``) to value; paths that `unknown_setting` accepts.
    """
    result = copy.deepcopy(dict(data))
    for path, value in overrides.items():
        block, keys = result, _keys(path)
        for key in keys[:-1]:
            inner = block.get(key)
            block[key] = inner if isinstance(inner, dict) else {}
            block = block[key]
        block[keys[-1]] = value
    return result


def _keys(path: str) -> list[str]:
    """Keys of a dotted path; what lies below `gates` and `withhold` is one key with dots of its own."""
    first, _, rest = path.partition(".")
    return [first, rest] if first in ("gates", "withhold") and rest else path.split(".")


def unknown_setting(path: str) -> str | None:
    """Return why `path` names no setting of a play, with the nearest that does; None where it names one."""
    models: list[type[BaseModel]] = [Play]
    keys = _keys(path)
    for depth, key in enumerate(keys):
        fields = {name: info for model in models for name, info in model.model_fields.items()}
        if key not in fields:
            near = difflib.get_close_matches(key, list(fields), n=1)
            below = ".".join(keys[:depth]) or "a play"
            meant = f"; did you mean `{'.'.join([*keys[:depth], near[0]])}`?" if near else ""
            return f"{below} has no setting {key!r}{meant}"
        annotation = fields[key].annotation
        models = list(blocks_of(annotation))
        if not models and depth + 1 < len(keys):
            free = typing.get_origin(annotation) is dict
            return None if free else f"{'.'.join(keys[: depth + 1])} is one value and has no settings below it"
    return None
