"""Forces and moments of joints between rigid bodies."""

from __future__ import annotations

import math

from replay.solver.kernels.bodies import rotation_matrix
from replay.solver.kernels.device import compiled, device
from replay.solver.kernels.mathx import angle
from replay.solver.kernels.tensors import add, add_scaled, apply, cross, dot, scale, subtract

#: Columns of a joint's row: rotation vector in joint axes, moment of springs and of dampers in space, force of the
#: spring and of the damper at the centre, distance of the centres, place where the force acts, moment in joint axes.
ANGLE, SPRING_MOMENT, DAMPER_MOMENT, SPRING_FORCE, DAMPER_FORCE, GAP, PLACE, OWN_MOMENT = 0, 3, 6, 9, 12, 15, 16, 19
JOINT_COLUMNS = 22


@device
def _vector(array, i, j):
    return (array[i, j, 0], array[i, j, 1], array[i, j, 2])


@device
def _matrix(array, i, j):
    return (
        (array[i, j, 0, 0], array[i, j, 0, 1], array[i, j, 0, 2]),
        (array[i, j, 1, 0], array[i, j, 1, 1], array[i, j, 1, 2]),
        (array[i, j, 2, 0], array[i, j, 2, 1], array[i, j, 2, 2]),
    )


@device
def _product(a, b):
    """Rows of ``a b^T``, both given as rows."""
    return (apply(b, a[0]), apply(b, a[1]), apply(b, a[2]))


@device
def _transposed(m):
    return ((m[0][0], m[1][0], m[2][0]), (m[0][1], m[1][1], m[2][1]), (m[0][2], m[1][2], m[2][2]))


@device
def rotation_vector(m):
    """Rotation vector of a rotation matrix, up to half a turn, and sine and cosine of half its angle."""
    w = (0.5 * (m[2][1] - m[1][2]), 0.5 * (m[0][2] - m[2][0]), 0.5 * (m[1][0] - m[0][1]))
    sine = math.sqrt(dot(w, w))
    cosine = 0.5 * (m[0][0] + m[1][1] + m[2][2] - 1.0)
    size = math.sqrt(sine * sine + cosine * cosine)
    # the larger of the two halves first: no difference of near numbers
    large = math.sqrt(0.5 * (1.0 + abs(cosine) / size))
    small = 0.5 * sine / (size * large)
    half_sine, half_cosine = (small, large) if cosine >= 0.0 else (large, small)
    turn = 2.0 * angle(half_sine, half_cosine)
    return scale(turn / sine if sine > 1e-30 else 1.0, w), half_sine, half_cosine


@device
def conjugate_moment(theta, half_sine, half_cosine, slope):
    """Moment whose power is the rate of a potential: ``J_l(theta)^-T dU/dtheta``.

    The rotation vector of a turn obeys ``theta' = J_l^-1 omega`` with
    ``J_l^-1 = I - theta^/2 + (1 - (t/2) cot(t/2)) theta^ theta^ / t^2``, t = |theta|.
    """
    square = dot(theta, theta)
    half = 0.5 * math.sqrt(square)
    share = (1.0 - half * half_cosine / half_sine) / square if square > 1e-4 else 1.0 / 12.0 + square / 720.0
    turned = cross(theta, slope)
    return add_scaled(add_scaled(slope, 0.5, turned), share, cross(theta, turned))


@device
def _frame(body, side, joint, quaternion, axes):
    """Joint axes of one side in space, as columns."""
    own = _matrix(axes, joint, side)
    if body < 0:
        return own
    pose = rotation_matrix(quaternion[body, 0], quaternion[body, 1], quaternion[body, 2], quaternion[body, 3])
    return _product(pose, _transposed(own))


@device
def _point(body, side, joint, centre, quaternion, arm):
    """Joint centre of one side in space."""
    own = _vector(arm, joint, side)
    if body < 0:
        return own
    pose = rotation_matrix(quaternion[body, 0], quaternion[body, 1], quaternion[body, 2], quaternion[body, 3])
    return add((centre[body, 0], centre[body, 1], centre[body, 2]), apply(pose, own))


@device
def _rates(body, place, centre, twist):
    """Velocity of the point of a body at `place`, and its angular velocity."""
    if body < 0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    omega = (twist[body, 3], twist[body, 4], twist[body, 5])
    r = subtract(place, (centre[body, 0], centre[body, 1], centre[body, 2]))
    return add((twist[body, 0], twist[body, 1], twist[body, 2]), cross(omega, r)), omega


@device
def _load(body, sign, place, force, moment, centre, wrench):
    if body >= 0:
        r = subtract(place, (centre[body, 0], centre[body, 1], centre[body, 2]))
        torque = add(moment, cross(r, force))
        for axis in range(3):
            wrench[body, axis] += sign * force[axis]
            wrench[body, 3 + axis] += sign * torque[axis]


def _joint_forces(body, arm, axes, stiffness, damping, hold, centre, quaternion, twist, wrench, row):
    """Add the wrenches of all joints to their bodies.

    Both forces of a joint act at one place, midway between the two centres, and the moments are opposite: momentum
    and angular momentum are kept to rounding.

    Parameters
    ----------
    body : (n, 2) int64
        First and second body; -1 is ground.
    arm : (n, 2, 3) float64
        Joint centre in the frame of each body [m].
    axes : (n, 2, 3, 3) float64
        Joint axes in the frame of each body, as columns.
    stiffness, damping : (n, 3, 2), (n, 3) float64
        [N m/rad], [N m s/rad].
    hold : (n, 2) float64
        Stiffness and damping of the centre [N/m], [N s/m].
    centre, quaternion, twist
        Of the bodies; see `kernels.bodies`.
    wrench : (n_bodies, 6) float64
        Updated in place.
    row : (n, JOINT_COLUMNS) float64
        What the second body feels (output); see `ANGLE` and its neighbours.
    """
    for k in range(body.shape[0]):
        a, b = body[k, 0], body[k, 1]
        p = _point(a, 0, k, centre, quaternion, arm)
        q = _point(b, 1, k, centre, quaternion, arm)
        place = scale(0.5, add(p, q))
        va, wa = _rates(a, place, centre, twist)
        vb, wb = _rates(b, place, centre, twist)
        gap = subtract(q, p)
        spring = scale(-hold[k, 0], gap)
        damper = scale(-hold[k, 1], subtract(vb, va))
        frame = _frame(a, 0, k, quaternion, axes)
        back = _transposed(frame)
        theta, half_sine, half_cosine = rotation_vector(_product(back, _transposed(_frame(b, 1, k, quaternion, axes))))
        rate = apply(back, subtract(wb, wa))
        slope = (
            stiffness[k, 0, 0 if theta[0] >= 0.0 else 1] * theta[0],
            stiffness[k, 1, 0 if theta[1] >= 0.0 else 1] * theta[1],
            stiffness[k, 2, 0 if theta[2] >= 0.0 else 1] * theta[2],
        )
        resist = (damping[k, 0] * rate[0], damping[k, 1] * rate[1], damping[k, 2] * rate[2])
        turning = apply(frame, scale(-1.0, conjugate_moment(theta, half_sine, half_cosine, slope)))
        slowing = apply(frame, scale(-1.0, resist))
        force = add(spring, damper)
        moment = add(turning, slowing)
        own = apply(back, moment)
        _load(a, -1.0, place, force, moment, centre, wrench)
        _load(b, 1.0, place, force, moment, centre, wrench)
        for axis in range(3):
            row[k, ANGLE + axis] = theta[axis]
            row[k, SPRING_MOMENT + axis] = turning[axis]
            row[k, DAMPER_MOMENT + axis] = slowing[axis]
            row[k, SPRING_FORCE + axis] = spring[axis]
            row[k, DAMPER_FORCE + axis] = damper[axis]
            row[k, PLACE + axis] = place[axis]
            row[k, OWN_MOMENT + axis] = own[axis]
        row[k, GAP] = math.sqrt(dot(gap, gap))


def _joint_work(body, centre, twist, row, dt, work):
    """Add what springs and dampers of all joints take over a kick to `work` (2,) [J].

    Parameters
    ----------
    body, centre, row
        See `_joint_forces`.
    twist : (n_bodies, 6) float64
        Mean over the kick.
    dt : float
        [s].
    work : (2,) float64
        Springs, dampers; updated in place.
    """
    for k in range(body.shape[0]):
        place = (row[k, PLACE], row[k, PLACE + 1], row[k, PLACE + 2])
        va, wa = _rates(body[k, 0], place, centre, twist)
        vb, wb = _rates(body[k, 1], place, centre, twist)
        v, w = subtract(vb, va), subtract(wb, wa)
        for axis in range(3):
            work[0] -= dt * (row[k, SPRING_FORCE + axis] * v[axis] + row[k, SPRING_MOMENT + axis] * w[axis])
            work[1] -= dt * (row[k, DAMPER_FORCE + axis] * v[axis] + row[k, DAMPER_MOMENT + axis] * w[axis])


joint_forces = compiled(_joint_forces)
joint_work = compiled(_joint_work)
