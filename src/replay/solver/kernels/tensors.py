"""Small tensor algebra on tuples.

A vector is a 3-tuple, a matrix three row tuples, a symmetric tensor a 6-tuple in the order
xx, yy, zz, xy, yz, zx (tensor shear components, not engineering ones).
"""

from __future__ import annotations

import math

from replay.solver.kernels.device import device


@device
def add(a, b):
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@device
def subtract(a, b):
    """Difference of two vectors."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@device
def scale(s, a):
    """Multiple of a vector."""
    return (s * a[0], s * a[1], s * a[2])


@device
def add_scaled(a, s, b):
    """Vector ``a + s b``."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@device
def dot(a, b):
    """Inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@device
def cross(a, b):
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@device
def apply(m, a):
    """Matrix times vector."""
    return (dot(m[0], a), dot(m[1], a), dot(m[2], a))


@device
def column(m, j):
    """Column `j` of a matrix."""
    return (m[0][j], m[1][j], m[2][j])


@device
def trace(s):
    """Trace of a symmetric tensor."""
    return s[0] + s[1] + s[2]


@device
def contract(a, b):
    """Double contraction a:b of two symmetric tensors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@device
def add_sym(a, b):
    """Sum of two symmetric tensors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


@device
def add_scaled_sym(a, s, b):
    """Symmetric tensor ``a + s b``."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2], a[3] + s * b[3], a[4] + s * b[4], a[5] + s * b[5])


@device
def scale_sym(s, a):
    """Multiple of a symmetric tensor."""
    return (s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5])


@device
def add_trace(a, p):
    """Symmetric tensor ``a + p I``."""
    return (a[0] + p, a[1] + p, a[2] + p, a[3], a[4], a[5])


@device
def deviator(a):
    """Symmetric tensor without its mean."""
    return add_trace(a, -(a[0] + a[1] + a[2]) * (1.0 / 3.0))


@device
def symmetric_part(m):
    """Symmetric part of a matrix as a 6-tuple."""
    return (
        m[0][0],
        m[1][1],
        m[2][2],
        0.5 * (m[0][1] + m[1][0]),
        0.5 * (m[1][2] + m[2][1]),
        0.5 * (m[2][0] + m[0][2]),
    )


@device
def axial_vector(m):
    """Vector w of the skew part W of a matrix: ``W a = w x a``."""
    return (0.5 * (m[2][1] - m[1][2]), 0.5 * (m[0][2] - m[2][0]), 0.5 * (m[1][0] - m[0][1]))


@device
def cayley(w):
    """Rotation ``(I - W/2)^-1 (I + W/2)`` of the increment `w` (axial vector of W, [rad]); exactly orthogonal.

    With W taken at mid-step this is the exact rotation of a rigid turn: its displacement seen
    from the mid-configuration is skew, of magnitude 2 tan(angle/2) (Hughes and Winget 1980).
    """
    a = 0.5 * w[0]
    b = 0.5 * w[1]
    c = 0.5 * w[2]
    k = 2.0 / (1.0 + a * a + b * b + c * c)
    return (
        (1.0 - k * (b * b + c * c), k * (a * b - c), k * (a * c + b)),
        (k * (a * b + c), 1.0 - k * (a * a + c * c), k * (b * c - a)),
        (k * (a * c - b), k * (b * c + a), 1.0 - k * (a * a + b * b)),
    )


@device
def congruence(m, s):
    """Symmetric tensor ``m s m^T``: the rotation of a stress, or a push-forward."""
    r0 = (
        m[0][0] * s[0] + m[0][1] * s[3] + m[0][2] * s[5],
        m[0][0] * s[3] + m[0][1] * s[1] + m[0][2] * s[4],
        m[0][0] * s[5] + m[0][1] * s[4] + m[0][2] * s[2],
    )
    r1 = (
        m[1][0] * s[0] + m[1][1] * s[3] + m[1][2] * s[5],
        m[1][0] * s[3] + m[1][1] * s[1] + m[1][2] * s[4],
        m[1][0] * s[5] + m[1][1] * s[4] + m[1][2] * s[2],
    )
    r2 = (
        m[2][0] * s[0] + m[2][1] * s[3] + m[2][2] * s[5],
        m[2][0] * s[3] + m[2][1] * s[1] + m[2][2] * s[4],
        m[2][0] * s[5] + m[2][1] * s[4] + m[2][2] * s[2],
    )
    return (dot(r0, m[0]), dot(r1, m[1]), dot(r2, m[2]), dot(r0, m[1]), dot(r1, m[2]), dot(r2, m[0]))


@device
def left_cauchy_green(f):
    """Symmetric tensor ``b = F F^T``."""
    return (dot(f[0], f[0]), dot(f[1], f[1]), dot(f[2], f[2]), dot(f[0], f[1]), dot(f[1], f[2]), dot(f[2], f[0]))


@device
def right_cauchy_green(f):
    """Symmetric tensor ``C = F^T F``."""
    u = column(f, 0)
    v = column(f, 1)
    w = column(f, 2)
    return (dot(u, u), dot(v, v), dot(w, w), dot(u, v), dot(v, w), dot(w, u))


@device
def adjugate(s):
    """Adjugate of a symmetric tensor: ``s^-1 det s``."""
    return (
        s[1] * s[2] - s[4] * s[4],
        s[0] * s[2] - s[5] * s[5],
        s[0] * s[1] - s[3] * s[3],
        s[4] * s[5] - s[3] * s[2],
        s[3] * s[5] - s[0] * s[4],
        s[3] * s[4] - s[1] * s[5],
    )


@device
def largest_eigenvalue_bound(s):
    """Upper bound of the largest eigenvalue of a symmetric tensor, exact where the two smaller ones agree.

    Mean plus the most that three numbers of given spread can exceed it:
    ``m + sqrt(2/3 |dev s|^2)`` (Wolkowicz and Styan 1980).
    """
    m = (s[0] + s[1] + s[2]) * (1.0 / 3.0)
    d = add_trace(s, -m)
    return m + math.sqrt((2.0 / 3.0) * contract(d, d))


@device
def _polar_step(x):
    """One step of scaled Newton iteration towards the orthogonal factor: mean of X and of its inverse transposed."""
    c0 = cross(x[1], x[2])
    c1 = cross(x[2], x[0])
    c2 = cross(x[0], x[1])
    inverse = 1.0 / dot(x[0], c0)
    size = dot(x[0], x[0]) + dot(x[1], x[1]) + dot(x[2], x[2])
    inverse_size = (dot(c0, c0) + dot(c1, c1) + dot(c2, c2)) * inverse * inverse
    # Frobenius scaling: the singular values are drawn together before they are averaged
    factor = math.sqrt(math.sqrt(inverse_size / size))
    a = 0.5 * factor
    b = 0.5 * inverse / factor
    return (
        add_scaled(scale(a, x[0]), b, c0),
        add_scaled(scale(a, x[1]), b, c1),
        add_scaled(scale(a, x[2]), b, c2),
    )


@device
def polar_rotation(f):
    """Orthogonal factor R of ``F = R U`` (three rows), for condition numbers up to about 1000.

    Newton's iteration with Frobenius scaling (Higham 1986); eight steps reach rounding.
    """
    x = _polar_step(_polar_step(_polar_step(_polar_step(f))))
    return _polar_step(_polar_step(_polar_step(_polar_step(x))))


@device
def transposed_product(r, f):
    """Symmetric part of ``R^T F`` as a 6-tuple: the right stretch U if R is the orthogonal factor of F."""
    r0 = column(r, 0)
    r1 = column(r, 1)
    r2 = column(r, 2)
    f0 = column(f, 0)
    f1 = column(f, 1)
    f2 = column(f, 2)
    return (
        dot(r0, f0),
        dot(r1, f1),
        dot(r2, f2),
        0.5 * (dot(r0, f1) + dot(r1, f0)),
        0.5 * (dot(r1, f2) + dot(r2, f1)),
        0.5 * (dot(r2, f0) + dot(r0, f2)),
    )


@device
def commuting_product(a, b):
    """Product of two symmetric tensors with the same principal axes (6-tuple)."""
    return (
        a[0] * b[0] + a[3] * b[3] + a[5] * b[5],
        a[3] * b[3] + a[1] * b[1] + a[4] * b[4],
        a[5] * b[5] + a[4] * b[4] + a[2] * b[2],
        a[0] * b[3] + a[3] * b[1] + a[5] * b[4],
        a[3] * b[5] + a[1] * b[4] + a[4] * b[2],
        a[0] * b[5] + a[3] * b[4] + a[5] * b[2],
    )
