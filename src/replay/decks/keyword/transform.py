"""``*INCLUDE_TRANSFORM``: numbers shifted, units scaled and nodes moved while a file is read.

The steps of ``*DEFINE_TRANSFORMATION`` are applied to the nodes in the order of their list, as OpenRadioss does with
the same cards.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from replay.decks.keyword.entries import Entry
from replay.decks.keyword.fields import Line, Value, lookup, mistake, shown, split, to_float, to_int
from replay.decks.keyword.forms import DIMENSIONS, Field
from replay.decks.keyword.mesh import ElementRows, NodeRows

# Offset that shifts each kind of number.
_OFFSETS = ("idnoff", "ideoff", "idpoff", "idmoff", "idsoff", "idfoff", "iddoff", "idroff")
_OFFSET_OF = {
    "node": "idnoff", "element": "ideoff", "part": "idpoff", "material": "idmoff", "eos": "idmoff",
    "node_set": "idsoff", "part_set": "idsoff", "solid_set": "idsoff", "shell_set": "idsoff", "segment_set": "idsoff",
    "curve": "idfoff", "system": "iddoff", "transform": "iddoff", "section": "idroff", "hourglass": "idroff",
    "contact": "idroff",
}  # fmt: skip
# Powers of mass, length, time.
_POWERS = {
    "length": (0, 1, 0), "time": (0, 0, 1), "mass": (1, 0, 0), "density": (1, -3, 0), "pressure": (1, -1, -2),
    "rate": (0, 0, -1), "velocity": (0, 1, -1), "viscosity": (1, -1, -1),
}  # fmt: skip


@dataclass(frozen=True)
class Transform:
    """What an include does to numbers, units and nodes.

    Parameters
    ----------
    offsets
        Name of the offset (``idnoff``...) to its value.
    mass, length, time
        Factors of the units.
    matrix
        Affine map of coordinates after their scaling, (3, 4).
    """

    offsets: Mapping[str, int] = field(default_factory=dict)
    mass: float = 1.0
    length: float = 1.0
    time: float = 1.0
    matrix: np.ndarray = field(default_factory=lambda: np.eye(3, 4))

    def then(self, outer: Transform) -> Transform:
        """One after the other: this one first, then that of the file around it."""
        offsets = {name: self.offsets.get(name, 0) + outer.offsets.get(name, 0) for name in _OFFSETS}
        square = outer.matrix[:, :3] @ self.matrix[:, :3]
        moved = outer.matrix[:, :3] @ self.matrix[:, 3] * outer.length + outer.matrix[:, 3]
        return Transform(
            offsets, self.mass * outer.mass, self.length * outer.length, self.time * outer.time,
            np.column_stack([square, moved]),
        )  # fmt: skip

    def factor(self, dimension: str) -> float:
        """Factor of a number of this dimension."""
        m, l, t = _POWERS[dimension]  # noqa: E741
        return self.mass**m * self.length**l * self.time**t

    def shift(self, kind: str) -> int:
        """Offset of a number of this kind."""
        return self.offsets.get(_OFFSET_OF[kind], 0) if kind in _OFFSET_OF else 0

    def nodes(self, rows: NodeRows) -> NodeRows:
        """Nodes renumbered, scaled and moved."""
        if self._is_nothing():
            return rows
        points = rows.coordinates * self.length
        points = np.einsum("ij,nj->ni", self.matrix[:, :3], points) + self.matrix[:, 3]
        return replace(rows, ids=rows.ids + self.shift("node"), coordinates=points)

    def elements(self, rows: ElementRows) -> ElementRows:
        """Elements renumbered."""
        nodes = np.where(rows.nodes > 0, rows.nodes + self.shift("node"), 0)
        return replace(rows, ids=rows.ids + self.shift("element"), parts=rows.parts + self.shift("part"), nodes=nodes)

    def entry(self, entry: Entry) -> Entry:
        """Cards renumbered and scaled."""
        if self._is_nothing():
            return entry

        def change(f: Field, value: Value) -> Value:
            if not isinstance(value, int | float) or not f.kind:
                return value
            if f.kind in DIMENSIONS:
                return value * self.factor(f.kind)
            return int(value) + self.shift(f.kind) if value > 0 else value

        cid = entry.cid + self.shift("contact") if entry.cid else 0
        return replace(entry.mapped(change), cid=cid)

    def _is_nothing(self) -> bool:
        return (
            not any(self.offsets.values())
            and (self.mass, self.length, self.time) == (1.0, 1.0, 1.0)
            and bool((self.matrix == np.eye(3, 4)).all())
        )


def read_transform(
    lines: Sequence[Line], width: int, parameters: Mapping[str, Value], find: Callable[[Line, int], np.ndarray]
) -> Transform:
    """Cards of ``*INCLUDE_TRANSFORM`` below the file's name.

    Parameters
    ----------
    lines
        Up to four: seven offsets; one offset, prefix and suffix; factors of mass, time, length; the transformation.
    width
        Columns of a field.
    parameters
        Known parameters.
    find
        Matrix (3, 4) of a transformation by its number.

    Raises
    ------
    InputError
        At a field that is no number, or whose number is not defined.
    """
    cards = [_texts(line, width, parameters) for line in lines[:4]]
    offsets: dict[str, int] = {}
    for line, texts, names in zip(lines, cards, (_OFFSETS[:7], _OFFSETS[7:])):
        for name, text in zip(names, texts):
            offset = to_int(text) if text else 0
            if offset is None:
                raise mistake(line, name, f"{shown(text)} is no number", "a whole number")
            offsets[name] = offset
    factors = [1.0, 1.0, 1.0]
    if len(cards) > 2:
        for k, name in enumerate(("fctmas", "fcttim", "fctlen")):
            text = cards[2][k]
            value = to_float(text) if text else 1.0
            if value is None or not 1e-30 < value < 1e30:
                raise mistake(lines[2], name, f"{shown(text)} is no factor", "a positive number")
            factors[k] = value
    matrix = np.eye(3, 4)
    if len(cards) > 3 and cards[3][0]:
        number = to_int(cards[3][0])
        if number is None:
            raise mistake(lines[3], "tranid", f"{shown(cards[3][0])} is no number", "a transformation's number, or 0")
        matrix = find(lines[3], number) if number else matrix
    return Transform(offsets, factors[0], factors[2], factors[1], matrix)


def _texts(line: Line, width: int, parameters: Mapping[str, Value]) -> list[str]:
    texts = split(line.text, (width,) * 8)
    return [lookup(line, "field", t, parameters) if t.startswith(("&", "-&")) else t for t in texts]


def transformation(line: Line, number: int, known: Mapping[int, Entry]) -> np.ndarray:
    """Matrix (3, 4) of a ``*DEFINE_TRANSFORMATION``.

    Raises
    ------
    InputError
        When it is not defined before, or holds a step that is not known.
    """
    if number not in known:
        raise mistake(line, "tranid", f"transformation {number} is not defined", "a *DEFINE_TRANSFORMATION before it")
    total, points = np.eye(4), {}
    for row in known[number].rows[1:]:
        option = str(row.values[0] or "").upper()
        a = [float(v) if isinstance(v, int | float) else 0.0 for v in row.values[1:8]]
        step = np.eye(4)
        if option == "POINT":
            points[int(a[0])] = np.array(a[1:4])
        elif option == "TRANSL":
            step[:3, 3] = a[:3]
        elif option == "SCALE":
            step[:3, :3] = np.diag([v or 1.0 for v in a[:3]])
        elif option == "ROTATE" and (any(a[3:7]) or not {int(a[0]), int(a[1])} <= set(points)):
            step = _rotation(np.array(a[:3]), np.array(a[3:6]), a[6])
        elif option == "ROTATE":
            p, q = points[int(a[0])], points[int(a[1])]
            step = _rotation(q - p, p, a[2])
        elif option == "MIRROR":
            tail, head = np.array(a[:3]), np.array(a[3:6])
            normal = _unit(head - tail)
            step[:3, :3] -= 2 * np.outer(normal, normal)
            step[:3, 3] = 2 * normal * (normal @ tail)
        else:
            place = Line(known[number].file, row.line, "")
            raise mistake(
                place, "option", f"{shown(option)} is not understood", "TRANSL, ROTATE, SCALE, MIRROR or POINT",
                "transform the mesh before the export",
            )  # fmt: skip
        total = step @ total
    return total[:3]


def _rotation(axis: np.ndarray, centre: np.ndarray, degrees: float) -> np.ndarray:
    n, angle = _unit(axis), np.deg2rad(degrees)
    cross = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = turn, centre - turn @ centre
    return step


def _unit(vector: np.ndarray) -> np.ndarray:
    length = float(np.sqrt(vector @ vector))
    return vector / length if length > 0 else np.array([0.0, 0.0, 1.0])
