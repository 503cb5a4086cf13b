"""``*PARAMETER`` and ``*PARAMETER_EXPRESSION``: names for numbers, and the arithmetic that makes them."""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable, Mapping

from replay.decks.keyword.fields import Line, Value, lookup, mistake, shown, split, to_float, to_int

_LONGEST = 500
_WHAT = "numbers, parameters, + - * / ** ( ) and functions such as sqrt, sin, min"

_OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Pow: lambda a, b: math.pow(a, b),
}
_FUNCTIONS: dict[str, Callable[..., float]] = {
    "abs": abs,
    "acos": math.acos,
    "asin": math.asin,
    "atan": math.atan,
    "atan2": math.atan2,
    "ceil": math.ceil,
    "cos": math.cos,
    "exp": math.exp,
    "float": float,
    "floor": math.floor,
    "int": math.trunc,
    "log": math.log,
    "log10": math.log10,
    "max": max,
    "min": min,
    "mod": math.fmod,
    "nint": round,
    "sign": math.copysign,
    "sin": math.sin,
    "sqrt": math.sqrt,
    "tan": math.tan,
}


def read_parameters(lines: list[Line], known: Mapping[str, Value], *, expression: bool, width: int) -> dict[str, Value]:
    """Values by lower-case name, those already known among them; later ones may use earlier ones.

    A name's first letter says its kind: R a real, I a whole number, C a text.

    Raises
    ------
    InputError
        For a name without kind, a value that is none, or an expression that cannot be computed.
    """
    values = dict(known)
    for line in lines:
        for name, text in _pairs(line, expression=expression, width=width):
            kind, word = name[:1].upper(), name[1:].strip().lower()
            if kind not in ("R", "I", "C") or not word:
                raise mistake(
                    line, "prmr", f"{shown(name)} is no name", "R, I or C, then the name", "write R before it"
                )
            values[word] = _value(line, kind, word, text, values, expression=expression)
    return values


def _pairs(line: Line, *, expression: bool, width: int) -> list[tuple[str, str]]:
    if not line.text.strip():
        return []
    if expression:
        name, _, text = line.text.partition(",") if "," in line.text[:width] else (line.text[:width], "", "")
        return [(name.strip(), (text or line.text[width:]).strip())]
    fields = split(line.text, (width,) * 8)
    return [(a, b) for a, b in zip(fields[::2], [*fields[1::2], ""]) if a or b]


def _value(line: Line, kind: str, word: str, text: str, values: Mapping[str, Value], *, expression: bool) -> Value:
    if kind == "C":
        return text
    if not expression:
        if text.startswith(("&", "-&")):
            text = lookup(line, word, text, values)
        number = to_int(text) if kind == "I" else to_float(text)
        if number is None:
            raise mistake(line, word, f"{shown(text)} is no number", "a whole number" if kind == "I" else "a number")
        return number
    try:
        result = evaluate(text, values)
    except (ValueError, ArithmeticError, SyntaxError, TypeError, RecursionError, MemoryError) as error:
        raise mistake(line, word, f"{shown(text)} cannot be computed ({type(error).__name__})", _WHAT) from None
    return int(result) if kind == "I" else float(result)


def evaluate(text: str, values: Mapping[str, Value]) -> float:
    """Value of an expression by FORTRAN's rules: a quotient of two whole numbers is cut to a whole number.

    Raises
    ------
    ValueError, ArithmeticError, SyntaxError, TypeError
        When it is none, or has no finite value.
    """
    if len(text) > _LONGEST:
        message = "too long"
        raise ValueError(message)
    with warnings.catch_warnings(action="ignore"):  # what Python thinks of the spelling is nothing to a user
        tree = ast.parse(text.strip().replace("&", "").lower(), mode="eval")
    result = _compute(tree.body, values)
    if not math.isfinite(result):
        message = "not finite"
        raise ValueError(message)
    return result


def _compute(node: ast.expr, values: Mapping[str, Value]) -> float:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return _bounded(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        value = math.pi if node.id == "pi" and "pi" not in values else values.get(node.id)
        if not isinstance(value, int | float):
            raise ValueError(node.id)
        return value
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        value = _compute(node.operand, values)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.BinOp):
        a, b = _compute(node.left, values), _compute(node.right, values)
        if isinstance(node.op, ast.Div):
            return math.trunc(a / b) if isinstance(a, int) and isinstance(b, int) else a / b
        if type(node.op) in _OPERATORS:
            return _bounded(_OPERATORS[type(node.op)](a, b))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS:
        return _FUNCTIONS[node.func.id](*(_compute(argument, values) for argument in node.args))
    raise SyntaxError


def _bounded(value: float) -> float:
    """Keep whole numbers of any length out of the arithmetic."""
    return float(value) if abs(value) > 2**53 else value
