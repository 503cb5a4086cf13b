"""YAML and JSON settings read into pydantic models, with every mistake named by line.

A user mends a settings file best when all its problems are on one screen, each with the line,
the dotted path, what was found, what was expected (with its unit) and what to do.
"""

from __future__ import annotations

import difflib
import json
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError
from pydantic_core import PydanticCustomError

from replay.errors import InputError, InputErrors
from replay.files import read_text

ModelT = TypeVar("ModelT", bound=BaseModel)
Path_ = tuple[str | int, ...]

LARGEST_SETTINGS = 100_000
"""No settings file is longer; a table that is named in its place is not parsed for a minute."""
_UNITS = (
    ("_m_per_s2", "m/s^2"),
    ("_m_per_s", "m/s"),
    ("_rad_per_s", "rad/s"),
    ("_hz", "Hz"),
    ("_kg", "kg"),
    ("_px", "px"),
    ("_m", "m"),
    ("_s", "s"),
)


class Setting(BaseModel):
    """Base of every settings model: frozen, unknown keys refused, NaN and infinity refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)


def _refuse_bool(value: Any) -> Any:
    if isinstance(value, bool):
        kind, message = "setting", "is a truth value"
        raise PydanticCustomError(kind, message, {"expected": "a number", "mend": "write the number"})
    return value


Number = Annotated[float, BeforeValidator(_refuse_bool)]
"""A finite float; ``yes`` and ``true`` are no numbers."""


def refuse(found: str, expected: str = "", mend: str = "") -> typing.NoReturn:
    """Raise, inside a validator, an error that reaches the user with its expectation and mend."""
    kind, template = "setting", "{found}"
    raise PydanticCustomError(kind, template, {"found": found, "expected": expected, "mend": mend})


def unit_of(name: str) -> str:
    """Unit that a setting's name carries as its suffix, or an empty string."""
    return next((unit for suffix, unit in _UNITS if name.endswith(suffix)), "")


def load_yaml(path: Path, model: type[ModelT], *, context: Mapping[str, Any] | None = None) -> ModelT:
    """Read a YAML file into `model`.

    Parameters
    ----------
    path
        The file; UTF-8, BOM and CRLF accepted.
    model
        Frozen pydantic model.
    context
        What the model's validators may need (``folder``: where named files must lie).

    Raises
    ------
    InputError, InputErrors
        Syntax errors alone; otherwise every problem of the file at once, in file order.
    """
    text = _settings_text(path)
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        lines, twice = _lines(root)
        data = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise _syntax(path, text, error) from None
    except RecursionError:
        raise _too_deep(path) from None
    return _validate(path, model, data, lines, twice, context)


def load_json(path: Path, model: type[ModelT], *, context: Mapping[str, Any] | None = None) -> ModelT:
    """Read a JSON file into `model`; as `load_yaml`."""
    text = _settings_text(path)
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        mend = "correct the syntax at that line (a comma after the last entry and comments are not JSON)"
        raise InputError(
            path, f"is not JSON: {error.msg}", line=error.lineno, expected="one JSON object", mend=mend
        ) from None
    except RecursionError:
        raise _too_deep(path) from None
    # JSON is read a second time as YAML, only for the line of every key.
    try:
        lines, twice = _lines(yaml.compose(text.replace("\t", " "), Loader=yaml.SafeLoader))
    except yaml.YAMLError as error:
        raise _syntax(path, text, error) from None
    except RecursionError:
        raise _too_deep(path) from None
    return _validate(path, model, data, lines, twice, context)


def check_settings(
    file: Path, model: type[ModelT], data: Any, *, line: int | None = None, context: Mapping[str, Any] | None = None
) -> ModelT:
    """Check data that lie in no settings file of their own; every problem names `file`, `line` and the dotted path."""
    return _validate(file, model, data, {} if line is None else {(): line}, [], context)


def _too_deep(path: Path) -> InputError:
    return InputError(path, "nests brackets too deep to be read", mend="remove the brackets that are not closed")


def _settings_text(path: Path) -> str:
    text = read_text(path)
    if len(text) > LARGEST_SETTINGS:
        found = f"is {len(text)} characters long"
        mend = "name the settings file, not a table or a mesh"
        raise InputError(path, found, expected=f"settings, at most {LARGEST_SETTINGS} characters", mend=mend)
    return text


def _lines(root: yaml.Node | None) -> tuple[dict[Path_, int], list[tuple[Path_, int]]]:
    """One-based line of every key or item by path, and the keys written twice."""
    lines: dict[Path_, int] = {(): 1}
    twice: list[tuple[Path_, int]] = []

    def walk(node: yaml.Node | None, at: Path_) -> None:
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                path = (*at, str(key.value))
                if path in lines:
                    twice.append((path, key.start_mark.line + 1))
                lines[path] = key.start_mark.line + 1
                walk(value, path)
        elif isinstance(node, yaml.SequenceNode):
            for index, value in enumerate(node.value):
                lines[(*at, index)] = value.start_mark.line + 1
                walk(value, (*at, index))

    walk(root, ())
    return lines, twice


def _syntax(path: Path, text: str, error: yaml.YAMLError) -> InputError:
    mark = getattr(error, "problem_mark", None)
    line = mark.line + 1 if mark else None
    problem = getattr(error, "problem", None) or "cannot be parsed"
    rows = text.split("\n")
    if line and line <= len(rows) and "\t" in rows[line - 1]:
        return InputError(
            path,
            "a tab is used to indent",
            line=line,
            expected="spaces",
            mend="replace the tab by spaces (two for each level)",
        )
    return InputError(path, f"is not YAML: {problem}", line=line, mend="correct the syntax at or just before that line")


def _validate(
    path: Path,
    model: type[ModelT],
    data: Any,
    lines: Mapping[Path_, int],
    twice: list[tuple[Path_, int]],
    context: Mapping[str, Any] | None,
) -> ModelT:
    errors = [
        InputError(path, "the key is written twice", line=line, column=_dotted(at), mend="keep one of the two")
        for at, line in twice
    ]
    if not isinstance(data, dict):
        raise InputError(path, "holds no settings", expected="`key: value` lines", mend="start from a shipped example")
    value: ModelT | None = None
    try:
        value = model.model_validate(data, context=dict(context or {}))
    except ValidationError as error:
        for problem in error.errors(include_url=False):
            if _other_branch(problem):
                continue
            errors.append(_sentence(path, model, data, lines, problem))
    if errors:
        errors.sort(key=lambda e: e.line or 0)
        raise errors[0] if len(errors) == 1 else InputErrors(errors)
    assert value is not None
    return value


def _is_label(part: str | int) -> bool:
    """Whether a part of pydantic's location names a branch of a union, not a key of the file."""
    return isinstance(part, str) and (part.endswith(("]", ")")) or part[:1].isupper())


def _other_branch(problem: Mapping[str, Any]) -> bool:
    """Whether a problem belongs to the branch of a union (a name, or a block) that the user did not take."""
    if not any(_is_label(part) for part in problem["loc"]):
        return False
    block = isinstance(problem["input"], dict)
    return block if problem["type"] == "literal_error" else problem["type"].startswith("model_")


def _sentence(
    path: Path, model: type[BaseModel], data: Any, lines: Mapping[Path_, int], problem: Mapping[str, Any]
) -> InputError:
    at, owner = _resolve(model, data, tuple(problem["loc"]))
    kind, ctx = problem["type"], problem.get("ctx", {})
    name = str(next((part for part in reversed(at) if isinstance(part, str)), ""))
    unit = unit_of(name)
    unit_text = f" [{unit}]" if unit else ""
    value = problem.get("input")
    line = next((lines[at[:n]] for n in range(len(at), -1, -1) if at[:n] in lines), None)
    found, expected, mend = f"{_shown(value)}{unit_text}: {problem['msg']}", "", "correct the value"
    if kind == "missing":
        found = "is missing"
        expected = _description(owner, name) or "a value"
        mend = f"add `{name}:` with its value{unit_text}"
    elif kind == "extra_forbidden":
        known = _names(owner)
        close = difflib.get_close_matches(name, known, n=1)
        found = "is no known setting"
        expected = f"one of {', '.join(known)}"
        mend = f"did you mean `{close[0]}`?" if close else "remove it or correct its name"
    elif kind in ("literal_error", "union_tag_invalid"):
        choices = str(ctx.get("expected") or ctx.get("expected_tags"))
        shown = ctx.get("tag", value)
        plain = [c.strip(" '") for c in choices.replace(" or ", ",").split(",")]
        close = difflib.get_close_matches(str(shown), plain, n=1, cutoff=0.4)
        found, expected = f"{_shown(shown)} is not a choice", choices
        mend = f"did you mean `{close[0]}`?" if close else "choose one of these"
    elif kind == "union_tag_not_found":
        found, expected = "does not say its `kind`", "a `kind:` key"
        mend = "add `kind:` as the first key of this block"
    elif kind == "setting":
        found = f"{_shown(value)}{unit_text}: {ctx['found']}" if "found" in ctx else f"{_shown(value)} {problem['msg']}"
        expected, mend = ctx.get("expected", ""), ctx.get("mend", "") or mend
    elif kind in ("float_parsing", "int_parsing", "float_type", "int_type", "int_from_float"):
        found, expected = f"{_shown(value)} is not a number", f"a number{unit_text}"
        mend = "use a decimal point" if isinstance(value, str) and "," in value else "write a number without its unit"
    elif kind in _BOUNDS and ctx:
        sign, key = _BOUNDS[kind]
        found, expected = f"{_shown(value)}{unit_text} is out of range", f"{sign} {ctx[key]}{unit_text}"
        meaning = _description(owner, name)
        mend = f"correct the value: {meaning}" if meaning else mend
    return InputError(path, found, line=line, column=_dotted(at), expected=expected, mend=mend)


_BOUNDS = {
    "greater_than": (">", "gt"),
    "greater_than_equal": (">=", "ge"),
    "less_than": ("<", "lt"),
    "less_than_equal": ("<=", "le"),
}


def _resolve(model: type[BaseModel], data: Any, loc: Path_) -> tuple[Path_, type[BaseModel] | None]:
    """Path in the file (union tags taken out) and the model that owns its last key."""
    at: list[str | int] = []
    owner: type[BaseModel] | None = model
    current: Any = data
    last: Any = None
    tagged = False
    for part in loc:
        is_tag = isinstance(current, dict) and not tagged and bool(at) and current.get("kind") == part
        if is_tag:
            tagged = True
            last = next((m for m in blocks_of(last) if _tag(m) == part), None)
            owner = last if isinstance(last, type) else owner
            continue
        if _is_label(part):
            continue
        tagged = False
        if isinstance(part, str):
            inner = list(blocks_of(last)) if at and last is not None else []
            if inner and not (isinstance(last, type) and last is owner):
                owner = inner[0]
            info = owner.model_fields.get(part) if owner else None
            last = info.annotation if info else None
        at.append(part)
        if isinstance(current, dict):
            current = current.get(part)
        elif isinstance(current, list) and isinstance(part, int) and part < len(current):
            current = current[part]
        else:
            current = None
    return tuple(at), owner


def blocks_of(annotation: Any) -> Iterator[type[BaseModel]]:
    """Settings models that an annotation admits."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    elif typing.get_origin(annotation) in (typing.Union, types.UnionType, Annotated):
        for inner in typing.get_args(annotation):
            yield from blocks_of(inner)


def _tag(model: type[BaseModel]) -> Any:
    info = model.model_fields.get("kind")
    return typing.get_args(info.annotation)[0] if info else None


def _names(owner: type[BaseModel] | None) -> list[str]:
    return list(owner.model_fields) if owner else []


def _description(owner: type[BaseModel] | None, name: str) -> str:
    info = owner.model_fields.get(name) if owner else None
    return (info.description or "") if info else ""


def _dotted(at: Path_) -> str:
    out = ""
    for part in at:
        out += f"[{part}]" if isinstance(part, int) else (f".{part}" if out else str(part))
    return out


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
