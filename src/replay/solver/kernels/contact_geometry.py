"""The closest point of a bilinear face: Newton's method held inside the face, four triangles where it does not settle.

A face is ``x(u, v) = m + u e + v f + u v h``, u and v from -1 to 1, corners counter-clockwise seen from outside.
"""

from __future__ import annotations

import math

from replay.solver.kernels.device import compiled, device
from replay.solver.kernels.tensors import add, add_scaled, cross, dot, scale, subtract

_MOST_ITERATIONS = 12
_SETTLED = 1e-13
_TINY = 1e-300


@device
def bilinear(a, b, c, d):
    """Coefficients m, e, f, h of a face from its corners."""
    return (
        scale(0.25, add(add(a, b), add(c, d))),
        scale(0.25, subtract(add(b, c), add(a, d))),
        scale(0.25, subtract(add(c, d), add(a, b))),
        scale(0.25, subtract(add(a, c), add(b, d))),
    )


@device
def face_point(face, u, v):
    """Point of a face."""
    return add_scaled(add_scaled(add_scaled(face[0], u, face[1]), v, face[2]), u * v, face[3])


@device
def area_vector(face, u, v):
    """Outward vector whose length is the area per unit of u and v."""
    return cross(add_scaled(face[1], v, face[3]), add_scaled(face[2], u, face[3]))


@device
def shape(u, v):
    """Shares of the four corners in a point."""
    return (
        0.25 * (1.0 - u) * (1.0 - v),
        0.25 * (1.0 + u) * (1.0 - v),
        0.25 * (1.0 + u) * (1.0 + v),
        0.25 * (1.0 - u) * (1.0 + v),
    )


@device
def held(value, step):
    """Coordinate after a step, held in the face."""
    return min(max(value + step, -1.0), 1.0)


def _newton(face, point):
    """Coordinates of the closest point by Newton's method with the sides of the face as bounds, and whether it settled.

    At a bound from which the distance falls outward the coordinate stays; the other is sought alone.
    """
    u = 0.0
    v = 0.0
    for _ in range(_MOST_ITERATIONS):
        away = subtract(point, face_point(face, u, v))
        along_u = add_scaled(face[1], v, face[3])
        along_v = add_scaled(face[2], u, face[3])
        slope_u = dot(away, along_u)
        slope_v = dot(away, along_v)
        uu = dot(along_u, along_u) + _TINY
        vv = dot(along_v, along_v) + _TINY
        free_u = not ((u >= 1.0 and slope_u > 0.0) or (u <= -1.0 and slope_u < 0.0))
        free_v = not ((v >= 1.0 and slope_v > 0.0) or (v <= -1.0 and slope_v < 0.0))
        step_u = 0.0
        step_v = 0.0
        if free_u and free_v:
            mixed = dot(along_u, along_v)
            uv = mixed - dot(away, face[3])
            determinant = uu * vv - uv * uv
            if determinant < 0.05 * uu * vv:
                # far from the face the distance may be no bowl: Gauss and Newton's matrix always is
                uv = mixed
                determinant = max(uu * vv - uv * uv, 1e-12 * uu * vv)
            step_u = (vv * slope_u - uv * slope_v) / determinant
            step_v = (uu * slope_v - uv * slope_u) / determinant
        elif free_u:
            step_u = slope_u / uu
        elif free_v:
            step_v = slope_v / vv
        new_u = held(u, step_u)
        new_v = held(v, step_v)
        change = abs(new_u - u) + abs(new_v - v)
        u = new_u
        v = new_v
        if change <= _SETTLED:
            return u, v, True
    return u, v, False


newton = compiled(_newton)


@device
def _on_segment(point, a, b):
    """Share of b at the closest point of a segment."""
    ab = subtract(b, a)
    return min(max(dot(subtract(point, a), ab) / (dot(ab, ab) + _TINY), 0.0), 1.0)


def _on_triangle(point, a, b, c):
    """Shares of b and c at the closest point of a triangle, and the squared distance."""
    ab = subtract(b, a)
    ac = subtract(c, a)
    ap = subtract(point, a)
    g = dot(ab, ab)
    h = dot(ab, ac)
    k = dot(ac, ac)
    determinant = g * k - h * h
    best_b = 0.0
    best_c = 0.0
    least = 1e300
    if determinant > 1e-12 * g * k:
        s = (k * dot(ap, ab) - h * dot(ap, ac)) / determinant
        t = (g * dot(ap, ac) - h * dot(ap, ab)) / determinant
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            rest = add_scaled(add_scaled(ap, -s, ab), -t, ac)
            return s, t, dot(rest, rest)
    for side in range(3):
        if side == 0:
            s = _on_segment(point, a, b)
            t = 0.0
        elif side == 1:
            t = _on_segment(point, b, c)
            s = 1.0 - t
        else:
            s = 0.0
            t = _on_segment(point, a, c)
        rest = add_scaled(add_scaled(ap, -s, ab), -t, ac)
        square = dot(rest, rest)
        if square < least:
            least = square
            best_b = s
            best_c = t
    return best_b, best_c, least


on_triangle = compiled(_on_triangle)


def _by_triangles(face, point):
    """Coordinates of the closest point of the four triangles about the centre; the first of equals."""
    best_u = 0.0
    best_v = 0.0
    least = 1e300
    for side in range(4):
        u0 = -1.0 if side == 0 or side == 3 else 1.0
        v0 = -1.0 if side < 2 else 1.0
        u1 = 1.0 if side < 2 else -1.0
        v1 = 1.0 if side == 1 or side == 2 else -1.0
        b, c, square = on_triangle(point, face[0], face_point(face, u0, v0), face_point(face, u1, v1))
        if square < least:
            least = square
            best_u = b * u0 + c * u1
            best_v = b * v0 + c * v1
    return best_u, best_v


by_triangles = compiled(_by_triangles)


def _closest(face, point):
    """Coordinates u, v of the point of a face that is closest to `point`."""
    u, v, settled = newton(face, point)
    if not settled:
        u, v = by_triangles(face, point)
    return u, v


closest = compiled(_closest)


@device
def unit(a):
    """Vector of length one along `a`; zero stays zero."""
    size = math.sqrt(dot(a, a))
    return scale(1.0 / size, a) if size > 0.0 else a
