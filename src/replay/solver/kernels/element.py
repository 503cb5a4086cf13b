"""One element over one step: from nodal motion to nodal forces, state and stable time step.

`element` is a template: the names `update`, `deformation` and `hold` are bound to one material law by
`lanes.specialise`, so that each law compiles into its own straight line of arithmetic.
"""

# ruff: noqa: F821 - some names are bound for each law by `compile_law`
from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from replay.solver.kernels.device import device
from replay.solver.kernels.hexahedron import (
    gradient,
    gradient_norms,
    hourglass_rates,
    largest_frequency,
    mean_gradient,
    modes,
    nodal_forces,
    shift,
    stable_step,
)
from replay.solver.kernels.tensors import (
    add_scaled,
    add_sym,
    add_trace,
    apply,
    axial_vector,
    cayley,
    contract,
    dot,
    scale,
    scale_sym,
    symmetric_part,
    trace,
)


class Motion(NamedTuple):
    """What a material law sees of the step.

    Parameters
    ----------
    strain
        Increment ``D dt`` from the mid-step velocity gradient (6-tuple).
    rotation
        Rotation of the step, exactly orthogonal (three rows).
    deformation
        Mean deformation gradient F at the end of the step (three rows); identity for laws in rate form.
    volume_ratio
        V / V0 at the end of the step. Forces are exact derivatives of V, so a pressure that depends
        on this ratio stores energy exactly.
    """

    strain: tuple
    rotation: tuple
    deformation: tuple
    volume_ratio: float


class Moduli(NamedTuple):
    """Tangent moduli that bound the element's frequency and scale its hourglass control.

    Parameters
    ----------
    lame, shear
        lambda and mu of the isotropic bound [Pa].
    hourglass
        Shear modulus of the hourglass stiffness [Pa]: always a shear modulus, never the wave
        modulus, which would lock soft tissue in bending and torsion.
    """

    lame: float
    shear: float
    hourglass: float


class YieldingModuli(NamedTuple):
    """`Moduli` of a law that says ``HOURGLASS_YIELDS``.

    Parameters
    ----------
    lame, shear, hourglass
        As in `Moduli`.
    flow_stress
        Yield stress in tension [Pa]; limits the hourglass forces.
    """

    lame: float
    shear: float
    hourglass: float
    flow_stress: float


class Control(NamedTuple):
    """Numerical controls, the same for all elements of a run.

    Parameters
    ----------
    hourglass_stiffness, hourglass_viscosity
        Coefficients; one of them is zero.
    hourglass_twist
        Share of the stiffness that twisting patterns get; 1 treats all patterns alike.
    viscosity_quadratic, viscosity_linear
        Bulk viscosity coefficients.
    """

    hourglass_stiffness: float
    hourglass_viscosity: float
    hourglass_twist: float
    viscosity_quadratic: float
    viscosity_linear: float


# bound for each law by `lanes.compile_law`
update: Callable[..., Any]
deformation: Callable[..., Any]
hold: Callable[..., Any]

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@device
def no_deformation(reference, m):
    """Identity: a law in rate form does not look at F."""
    return IDENTITY


@device
def total_deformation(reference, m):
    """Mean deformation gradient from the reference modal gradient ``G0 / V0`` (`reference` from its second value)."""
    r = reference
    g0 = (
        (r[1], r[2], r[3]),
        (r[4], r[5], r[6]),
        (r[7], r[8], r[9]),
        (r[10], r[11], r[12]),
        (r[13], r[14], r[15]),
        (r[16], r[17], r[18]),
    )
    return gradient(m, g0)


@device
def without_twist(rate, axis, less):
    """Hourglass rate less a share of its component along the axis that its pattern does not vary along."""
    return add_scaled(rate, -less * dot(axis, rate) / dot(axis, axis), axis)


@device
def turn_and_grow(rotation, q, k, rate):
    """Hourglass force after the step: grown by stiffness times rate, half of it before the turn as in `elastic`."""
    half = 0.5 * k
    return add_scaled(apply(rotation, add_scaled(q, half, rate)), half, rate)


@device
def elastic_hourglass(q, moduli, area):
    """Hourglass force of a law that does not yield."""
    return q


@device
def yielding_hourglass(q, moduli, area):
    """Hourglass force returned to what the material can hold: ``|q| <= sigma_y A / 12``.

    In a cube of face A bent by one mode, this force is that of a linear stress which reaches sigma_y at the face.
    The return is radial, so it never gives energy.
    """
    most = moduli.flow_stress * area * (1.0 / 12.0)
    return scale(most / max(most, math.sqrt(dot(q, q))), q)


def element(x, y, z, u, v, w, mass, reference, stress, hourglass, state, dt, p, control):
    """Advance one element to the end of the step that has just moved its nodes.

    Parameters
    ----------
    x, y, z
        Nodal coordinates at the end of the step (8-tuples) [m].
    u, v, w
        Nodal velocities of the step (8-tuples) [m/s]: coordinates moved by `dt` times these.
    mass
        Mass of the element, added mass included [kg].
    reference
        V0 [m^3], and ``G0 / V0`` [1/m] for laws in total form.
    stress, hourglass, state
        Cauchy stress [Pa], four hourglass forces [N], variables of the law, before the step.
    dt
        Length of the step [s].
    p
        Parameters of the law.
    control
        `Control`.

    Returns
    -------
    tuple
        x, y, z forces, new stress, hourglass, state, stable time step [s] (negative when the
        element is inverted or not a number), and the work of the step in stress, hourglass
        forces and bulk viscosity [J].
    """
    end = modes(x, y, z)
    rate = modes(u, v, w)
    middle = shift(end, -0.5 * dt, rate)

    g_middle, volume_middle = mean_gradient(middle)
    volume_rate_gradient = gradient(rate, g_middle)
    inverse = 1.0 / volume_middle
    velocity_gradient = (
        scale(inverse, volume_rate_gradient[0]),
        scale(inverse, volume_rate_gradient[1]),
        scale(inverse, volume_rate_gradient[2]),
    )
    strain = scale_sym(dt, symmetric_part(velocity_gradient))
    rotation = cayley(scale(dt, axial_vector(velocity_gradient)))

    g, volume = mean_gradient(end)
    motion = Motion(strain, rotation, deformation(reference, end), volume / reference[0])
    new_stress, new_state, moduli = update(motion, stress, state, dt, p)

    # hourglass control
    norms = gradient_norms(g_middle)
    per_modulus = 2.0 * moduli.hourglass * norms[0] * inverse * (1.0 / 16.0)
    stiffness = control.hourglass_stiffness * per_modulus
    density = mass / volume
    soft_impedance = math.sqrt(2.0 * moduli.hourglass * density)
    # the face area of a cube: the V^(2/3) of the usual form without a cube root
    area = math.sqrt(norms[0] * (1.0 / 1.5))
    viscosity = control.hourglass_viscosity * soft_impedance * area * 0.25
    rates = hourglass_rates(middle, rate, velocity_gradient)
    k = stiffness * dt
    less = 1.0 - control.hourglass_twist
    h0 = hold(turn_and_grow(rotation, hourglass[0], k, without_twist(rates[0], middle[0], less)), moduli, area)
    h1 = hold(turn_and_grow(rotation, hourglass[1], k, without_twist(rates[1], middle[1], less)), moduli, area)
    h2 = hold(turn_and_grow(rotation, hourglass[2], k, without_twist(rates[2], middle[2], less)), moduli, area)
    h3 = hold(turn_and_grow(rotation, hourglass[3], k, rates[3]), moduli, area)
    hourglass_forces = (
        add_scaled(h0, viscosity, rates[0]),
        add_scaled(h1, viscosity, rates[1]),
        add_scaled(h2, viscosity, rates[2]),
        add_scaled(h3, viscosity, rates[3]),
    )
    squares = dot(rates[0], rates[0]) + dot(rates[1], rates[1]) + dot(rates[2], rates[2]) + dot(rates[3], rates[3])
    elastic = (
        dot(add_scaled(h0, 1.0, hourglass[0]), rates[0])
        + dot(add_scaled(h1, 1.0, hourglass[1]), rates[1])
        + dot(add_scaled(h2, 1.0, hourglass[2]), rates[2])
        + dot(add_scaled(h3, 1.0, hourglass[3]), rates[3])
    )
    hourglass_work = dt * (0.5 * elastic + viscosity * squares)

    # bulk viscosity in compression, and the stable step with it
    frequency = largest_frequency(moduli.lame, moduli.shear, stiffness, norms, volume, mass)
    wave_speed = math.sqrt((max(moduli.lame, 0.0) + 2.0 * moduli.shear) / density)
    length = 2.0 * wave_speed / frequency
    volume_rate = trace(symmetric_part(volume_rate_gradient))
    closing = max(-volume_rate * inverse, 0.0)
    quadratic = control.viscosity_quadratic * control.viscosity_quadratic * length * closing
    viscous = density * length * (quadratic + control.viscosity_linear * wave_speed)
    pressure = viscous * closing
    viscosity_work = -dt * pressure * volume_rate
    damping = 4.0 * viscous * norms[0] / (mass * volume * frequency)
    step = stable_step(frequency, damping)
    # a comparison with a value that is not a number is false
    sound = (volume > 0.0) & (volume_middle > 0.0) & (step > 0.0)
    step = step if sound else -1.0

    stress_work = 0.5 * dt * contract(add_sym(stress, new_stress), symmetric_part(volume_rate_gradient))
    fx, fy, fz = nodal_forces(add_trace(new_stress, -pressure), hourglass_forces, end, g, volume)
    return fx, fy, fz, new_stress, (h0, h1, h2, h3), new_state, step, (stress_work, hourglass_work, viscosity_work)
