"""A dumb reader of meshes in keyword files, and masses from it: no array, no shared code with what it checks."""

from __future__ import annotations

from pathlib import Path

# Faces of a hex, each a cycle of corners, outwards.
FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def read_mesh(path: Path) -> tuple[dict[int, tuple[float, ...]], dict[int, tuple[int, list[int]]], dict]:
    """Nodes, solids and shells of a file in standard columns: number to coordinates, and to part and nodes."""
    nodes: dict[int, tuple[float, ...]] = {}
    solids: dict[int, tuple[int, list[int]]] = {}
    shells: dict[int, tuple[int, list[int]]] = {}
    keyword, waiting = "", None
    for line in path.read_text(encoding="latin-1").split("\n"):
        if line.startswith("$") or not line.strip():
            continue
        if line.startswith("*"):
            keyword = line.split()[0].upper()
            continue
        columns = [line[k : k + 8] for k in range(0, 80, 8)]
        if keyword == "*NODE":
            nodes[int(line[:8])] = tuple(float(line[8 + 16 * k : 24 + 16 * k]) for k in range(3))
        elif keyword == "*ELEMENT_SOLID" and waiting is None and not line[16:].strip():
            waiting = (int(columns[0]), int(columns[1]))
        elif keyword == "*ELEMENT_SOLID":
            number, part = waiting or (int(columns[0]), int(columns[1]))
            corners = columns[:8] if waiting else columns[2:]
            solids[number], waiting = (part, [int(c) for c in corners]), None
        elif keyword == "*ELEMENT_SHELL":
            shells[int(columns[0])] = (int(columns[1]), [int(c) for c in columns[2:6]])
    return nodes, solids, shells


def hex_volume(corners: list[tuple[float, ...]]) -> float:
    """Volume of a trilinear hex: each bilinear face has the flux of four triangles round its middle."""
    total = 0.0
    for face in FACES:
        points = [corners[k] for k in face]
        middle = tuple(sum(p[j] for p in points) / 4 for j in range(3))
        for a, b in zip(points, [*points[1:], points[0]]):
            total += determinant(a, b, middle) / 6
    return total


def quad_area(corners: list[tuple[float, ...]]) -> float:
    """Area of a flat quadrilateral by its diagonals."""
    d, e = ([q - p for p, q in zip(corners[a], corners[b])] for a, b in ((0, 2), (1, 3)))
    cross = (d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0])
    return 0.5 * sum(c * c for c in cross) ** 0.5


def determinant(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
