"""Growth of the pore volume fraction phi: Cocks and Ashby under tension, and a shear term that knows the Lode angle.

    phi'_CA    = [(1 - phi)^-m - (1 - phi)] sinh(X) sqrt(2/3) |Dp|,  X = min(2 (2m - 1)/(2m + 1) <s_H>/s_vm, cap)
    phi'_shear = K_pore omega <sigma':D>/s_vm,                   omega = 1 - (27 J3 / (2 s_vm^3))^2

(s_H mean stress, s_vm von Mises stress; Cocks and Ashby 1980; the article's equations 1 to 4). The stress does not
see phi. In ``w = 1 - (1 - phi)^(m + 1)`` the first part is ``w' = (m + 1) sinh(X) eps_p' w`` and the exponential of
its integral is exact for any step; w is the state.

The cap is ours. Where a soft, nearly incompressible solid is pulled, sigma_H/sigma_vm reaches hundreds and the
hyperbolic sine leaves every physical meaning; the magnitude of phi depends on the cap and a report must say so.
"""

from __future__ import annotations

import math

from replay.solver.kernels.device import compiled, device
from replay.solver.kernels.mathx import exp, expm1, log1p, sinh
from replay.solver.kernels.tensors import add_trace, contract, trace

#: ``1 - w`` never falls below this, so that phi stays below one.
SOLID = 1e-9


@device
def lode_function(deviator, per_mises):
    """omega: 0 in uniaxial tension and compression, 1 in pure shear."""
    d = deviator
    minor = d[1] * d[2] - d[4] * d[4]
    third = d[0] * minor + d[3] * (d[4] * d[5] - d[3] * d[2]) + d[5] * (d[3] * d[4] - d[1] * d[5])
    cosine = 13.5 * third * per_mises * per_mises * per_mises
    return max(1.0 - cosine * cosine, 0.0)


@device
def grow_pores(w, phi, stress, strain, plastic_strain, exponent, shear_sensitivity, cap):
    """Advance w and phi by a step.

    Parameters
    ----------
    w, phi
        At its start.
    stress
        Cauchy stress at its end [Pa].
    strain
        Increment of strain D dt.
    plastic_strain
        Increment ``sqrt(2/3) |Dp| dt``.
    exponent, shear_sensitivity, cap
        m_CA, K_pore, largest argument of the hyperbolic sine.

    Returns
    -------
    w, phi, holds
        The third is true: steps of any size are right.
    """
    mean = trace(stress) * (1.0 / 3.0)
    deviator = add_trace(stress, -mean)
    per_mises = 1.0 / math.sqrt(1.5 * contract(deviator, deviator) + 1e-60)
    power = exponent + 1.0
    argument = 2.0 * (2.0 * exponent - 1.0) / (2.0 * exponent + 1.0) * max(mean, 0.0) * per_mises
    pulled = exp(power * sinh(min(argument, cap)) * plastic_strain)
    work = max(contract(deviator, strain), 0.0) * per_mises
    sheared = shear_sensitivity * lode_function(deviator, per_mises) * work
    # dw/dphi = (m + 1) (1 - phi)^m
    opened = power * (1.0 - w) * sheared / (1.0 - phi)
    w = min(w * pulled + opened, 1.0 - SOLID)
    return w, max(-expm1(log1p(-w) / power), phi), True


def _advance_pores(w, phi, stress, strain, plastic_strain, exponent, shear_sensitivity, cap):
    """Advance `grow_pores` for many points in place: w, phi (m,), stress, strain (m, 6), plastic_strain (m,)."""
    for k in range(w.shape[0]):
        s = (stress[k, 0], stress[k, 1], stress[k, 2], stress[k, 3], stress[k, 4], stress[k, 5])
        e = (strain[k, 0], strain[k, 1], strain[k, 2], strain[k, 3], strain[k, 4], strain[k, 5])
        w[k], phi[k], _ = grow_pores(w[k], phi[k], s, e, plastic_strain[k], exponent, shear_sensitivity, cap)


advance_pores = compiled(_advance_pores)
