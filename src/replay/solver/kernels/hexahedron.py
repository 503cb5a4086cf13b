"""The one-point hexahedron with uniform gradient, in modal (Walsh) form.

A nodal field of one element is written in the eight patterns of signs of the parent cube:
1, xi, eta, zeta, eta zeta, zeta xi, xi eta, xi eta zeta (Flanagan and Belytschko 1981). The
mean gradient then needs six small vectors instead of eight nodal ones and a few cross
products instead of the 24 cubic sums, and the four last patterns are the hourglass modes.

Node order: (-,-,-) (+,-,-) (+,+,-) (-,+,-) (-,-,+) (+,-,+) (+,+,+) (-,+,+). A modal value is the
signed sum over the nodes (eight times the coefficient); the constant mode is never needed.

    m_c     modal coordinates, 7 vectors             w_c    modal velocities
    V       volume (exact for trilinear faces)       G_c    dV/dm_c, 6 vectors; B_I = sum_c W_cI G_c
    L       (1/V) sum_c w_c (x) G_c                  q_a    hourglass rates: w_a - L m_a, a = 4..7
"""

from __future__ import annotations

import math

from replay.solver.kernels.device import device
from replay.solver.kernels.tensors import (
    add,
    add_scaled,
    apply,
    cross,
    dot,
    largest_eigenvalue_bound,
    scale,
    subtract,
)


@device
def modes_of_component(u):
    """Signed sums of one component over the eight nodes, by a fast Walsh transform."""
    s01 = u[0] + u[1]
    d01 = u[1] - u[0]
    s32 = u[3] + u[2]
    d32 = u[2] - u[3]
    s45 = u[4] + u[5]
    d45 = u[5] - u[4]
    s76 = u[7] + u[6]
    d76 = u[6] - u[7]
    ss_low = s32 + s01
    sd_low = s32 - s01
    ds_low = d32 + d01
    dd_low = d32 - d01
    ss_top = s76 + s45
    sd_top = s76 - s45
    ds_top = d76 + d45
    dd_top = d76 - d45
    return (
        ds_top + ds_low,  # xi
        sd_top + sd_low,  # eta
        ss_top - ss_low,  # zeta
        sd_top - sd_low,  # eta zeta
        ds_top - ds_low,  # zeta xi
        dd_top + dd_low,  # xi eta
        dd_top - dd_low,  # xi eta zeta
    )


@device
def nodes_of_component(a1, a2, a3, b1, b2, b3, b4):
    """Transpose of `modes_of_component`: seven modal forces to eight nodal ones."""
    sd_top = a2 + b1
    sd_low = a2 - b1
    ds_top = a1 + b2
    ds_low = a1 - b2
    dd_top = b3 + b4
    dd_low = b3 - b4
    s76 = a3 + sd_top
    s45 = a3 - sd_top
    d76 = ds_top + dd_top
    d45 = ds_top - dd_top
    s32 = sd_low - a3
    s01 = -a3 - sd_low
    d32 = ds_low + dd_low
    d01 = ds_low - dd_low
    return (s01 - d01, s01 + d01, s32 + d32, s32 - d32, s45 - d45, s45 + d45, s76 + d76, s76 - d76)


@device
def modes(x, y, z):
    """Seven modal vectors of a nodal vector field given by its components (8-tuples)."""
    p = modes_of_component(x)
    q = modes_of_component(y)
    r = modes_of_component(z)
    return (
        (p[0], q[0], r[0]),
        (p[1], q[1], r[1]),
        (p[2], q[2], r[2]),
        (p[3], q[3], r[3]),
        (p[4], q[4], r[4]),
        (p[5], q[5], r[5]),
        (p[6], q[6], r[6]),
    )


@device
def shift(m, s, w):
    """Modal field ``m + s w``: the geometry a little earlier or later."""
    return (
        add_scaled(m[0], s, w[0]),
        add_scaled(m[1], s, w[1]),
        add_scaled(m[2], s, w[2]),
        add_scaled(m[3], s, w[3]),
        add_scaled(m[4], s, w[4]),
        add_scaled(m[5], s, w[5]),
        add_scaled(m[6], s, w[6]),
    )


@device
def mean_gradient(m):
    """Gradient of the volume with respect to the modal coordinates, and the volume.

    Parameters
    ----------
    m
        Modal coordinates [m].

    Returns
    -------
    tuple
        Six vectors G_c [m^2] and V [m^3]. The seventh mode does not enter the volume.
    """
    a1, a2, a3, b1, b2, b3 = m[0], m[1], m[2], m[3], m[4], m[5]
    t = 1.0 / 3.0
    s = 1.0 / 64.0
    g1 = add_scaled(cross(a2, a3), t, cross(b3, b2))
    g2 = add_scaled(cross(a3, a1), t, cross(b1, b3))
    g3 = add_scaled(cross(a1, a2), t, cross(b2, b1))
    h1 = scale(s * t, add(cross(b3, a2), cross(a3, b2)))
    h2 = scale(s * t, add(cross(a1, b3), cross(b1, a3)))
    h3 = scale(s * t, add(cross(b2, a1), cross(a2, b1)))
    volume = (s * t) * (dot(a1, g1) + dot(a2, g2) + dot(a3, g3)) + t * (dot(b1, h1) + dot(b2, h2) + dot(b3, h3))
    return (scale(s, g1), scale(s, g2), scale(s, g3), h1, h2, h3), volume


@device
def _row(w, i, g):
    return (
        w[0][i] * g[0][0]
        + w[1][i] * g[1][0]
        + w[2][i] * g[2][0]
        + w[3][i] * g[3][0]
        + w[4][i] * g[4][0]
        + w[5][i] * g[5][0],
        w[0][i] * g[0][1]
        + w[1][i] * g[1][1]
        + w[2][i] * g[2][1]
        + w[3][i] * g[3][1]
        + w[4][i] * g[4][1]
        + w[5][i] * g[5][1],
        w[0][i] * g[0][2]
        + w[1][i] * g[1][2]
        + w[2][i] * g[2][2]
        + w[3][i] * g[3][2]
        + w[4][i] * g[4][2]
        + w[5][i] * g[5][2],
    )


@device
def gradient(w, g):
    """Matrix ``sum_c w_c (x) g_c``: V times the mean gradient of the field `w` if ``g = G``."""
    return (_row(w, 0, g), _row(w, 1, g), _row(w, 2, g))


@device
def hourglass_rates(m, w, velocity_gradient):
    """Four vectors ``q_a = gamma_a . v``: what the modal velocities hold beyond a linear field."""
    return (
        subtract(w[3], apply(velocity_gradient, m[3])),
        subtract(w[4], apply(velocity_gradient, m[4])),
        subtract(w[5], apply(velocity_gradient, m[5])),
        subtract(w[6], apply(velocity_gradient, m[6])),
    )


@device
def _projection(m, q, i, inverse_volume):
    a = inverse_volume * q[0][i]
    b = inverse_volume * q[1][i]
    c = inverse_volume * q[2][i]
    d = inverse_volume * q[3][i]
    return (
        a * m[3][0] + b * m[4][0] + c * m[5][0] + d * m[6][0],
        a * m[3][1] + b * m[4][1] + c * m[5][1] + d * m[6][1],
        a * m[3][2] + b * m[4][2] + c * m[5][2] + d * m[6][2],
    )


@device
def _component_forces(t, g, q, i):
    return nodes_of_component(
        dot(t, g[0]),
        dot(t, g[1]),
        dot(t, g[2]),
        dot(t, g[3]) + q[0][i],
        dot(t, g[4]) + q[1][i],
        dot(t, g[5]) + q[2][i],
        q[3][i],
    )


@device
def nodal_forces(stress, q, m, g, volume):
    """Nodal forces of the mean stress and of the hourglass forces.

    ``f_I = sum_c W_cI (sigma G_c) + sum_a gamma_aI Q_a``; the part of gamma that removes linear
    fields acts like a stress ``-(1/V) sum_a Q_a (x) m_a`` and is added to it.

    Parameters
    ----------
    stress
        Mean Cauchy stress, bulk viscosity included [Pa].
    q
        Four hourglass forces [N].
    m, g, volume
        Modal coordinates [m], their mean gradient [m^2], volume [m^3].

    Returns
    -------
    tuple
        Three 8-tuples: x, y and z forces that the stress exerts against motion [N].
    """
    iv = 1.0 / volume
    t0 = subtract((stress[0], stress[3], stress[5]), _projection(m, q, 0, iv))
    t1 = subtract((stress[3], stress[1], stress[4]), _projection(m, q, 1, iv))
    t2 = subtract((stress[5], stress[4], stress[2]), _projection(m, q, 2, iv))
    return _component_forces(t0, g, q, 0), _component_forces(t1, g, q, 1), _component_forces(t2, g, q, 2)


@device
def _product(g, i, j):
    return (
        g[0][i] * g[0][j]
        + g[1][i] * g[1][j]
        + g[2][i] * g[2][j]
        + g[3][i] * g[3][j]
        + g[4][i] * g[4][j]
        + g[5][i] * g[5][j]
    )


@device
def gradient_norms(g):
    """Sum of squares ``B:B`` over all nodes, and a bound of the largest eigenvalue of ``B^T B`` [m^4].

    The patterns are orthogonal, each of squared length 8.
    """
    xx = _product(g, 0, 0)
    yy = _product(g, 1, 1)
    zz = _product(g, 2, 2)
    xy = _product(g, 0, 1)
    yz = _product(g, 1, 2)
    zx = _product(g, 2, 0)
    return 8.0 * (xx + yy + zz), 8.0 * largest_eigenvalue_bound((xx, yy, zz, xy, yz, zx))


@device
def largest_frequency(lame, shear, hourglass_stiffness, norms, volume, mass):
    """Upper bound of the largest natural frequency of one element [rad/s].

    The stiffness of the element is ``V (lambda tr D tr D + 2 mu D:D)``; for unit nodal velocities
    ``(V tr D)^2 <= B:B`` and ``V^2 D:D <= alpha``, the largest eigenvalue of ``B^T B``. The bound
    is attained by a cube for every Poisson ratio, where V / (c sqrt(2 B:B)) of the same
    paper is sqrt(3) too small at nu = 0. Hourglass stiffness is added, with |gamma|^2 = 8.

    Parameters
    ----------
    lame, shear
        Tangent moduli lambda and mu [Pa].
    hourglass_stiffness
        Force per hourglass rate and time [N/m].
    norms
        From `gradient_norms` [m^4].
    volume, mass
        Of the element [m^3], [kg].
    """
    stiffness = (max(lame, 0.0) * norms[0] + 2.0 * shear * norms[1]) / volume + 8.0 * hourglass_stiffness
    return math.sqrt(8.0 * stiffness / mass)


@device
def stable_step(frequency, damping):
    """Stable time step of central differences [s]: ``2/omega (sqrt(1 + xi^2) - xi)``."""
    return 2.0 / frequency * (math.sqrt(1.0 + damping * damping) - damping)
