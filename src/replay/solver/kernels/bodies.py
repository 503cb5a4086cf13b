"""Rigid bodies: a step that keeps momentum and energy exactly, and the motion a driver prescribes.

Between two kicks a free body turns by itself. In its own frame the angular momentum obeys
``m' = m x I^-1 m``; the implicit midpoint rule keeps both quadratic invariants, |m| and
``m I^-1 m / 2``, and the Cayley map of its mean angular velocity carries the frame so that the
momentum in space stays put (Austin, Krishnaprasad and Wang 1993).

Quaternions are (x, y, z, w), body to space.
"""

from __future__ import annotations

import math

from replay.solver.kernels.device import compiled, device
from replay.solver.kernels.lanes import POSITION, VELOCITY
from replay.solver.kernels.tensors import add, add_scaled, apply, cross, dot, scale

#: Sums over a body: kinetic energy, work absorbed by elements, work from outside, work of the rigid tie [J], nodes that
#: are too fast.
BODY_SUMS = 5
_MOST_ITERATIONS = 60


@device
def rotation_matrix(x, y, z, w):
    """Three rows of the rotation of a unit quaternion."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


@device
def _vector(array, i):
    return (array[i, 0], array[i, 1], array[i, 2])


@device
def _matrix(array, i):
    return (
        (array[i, 0, 0], array[i, 0, 1], array[i, 0, 2]),
        (array[i, 1, 0], array[i, 1, 1], array[i, 1, 2]),
        (array[i, 2, 0], array[i, 2, 1], array[i, 2, 2]),
    )


@device
def _transposed(m, a):
    return (
        m[0][0] * a[0] + m[1][0] * a[1] + m[2][0] * a[2],
        m[0][1] * a[0] + m[1][1] * a[1] + m[2][1] * a[2],
        m[0][2] * a[0] + m[1][2] * a[1] + m[2][2] * a[2],
    )


def _turn(spin, inverse_inertia, dt):
    """Free turn of a body over `dt`: new angular momentum and mean angular velocity, both in its frame."""
    mean = spin
    for _ in range(_MOST_ITERATIONS):
        omega = apply(inverse_inertia, mean)
        following = add_scaled(spin, 0.5 * dt, cross(mean, omega))
        change = abs(following[0] - mean[0]) + abs(following[1] - mean[1]) + abs(following[2] - mean[2])
        size = abs(following[0]) + abs(following[1]) + abs(following[2])
        mean = following
        if not change > 1e-16 * size:
            break
    omega = apply(inverse_inertia, mean)
    return add_scaled(spin, dt, cross(mean, omega)), omega


turn = compiled(_turn)


def _advance_bodies(
    nodal, first_tied, begin, end, inner, impulse, external, lever, node_mass, wrench, driven, mass, inverse_inertia,
    gravity, centre, quaternion, velocity, spin, next_centre, next_quaternion, spin_before, twist, dt_kick, dt_drift,
    speed_limit, sums,
):  # fmt: skip
    """Kick every body, find its pose at the end of the step, and give its nodes the velocity that leads there.

    Parameters
    ----------
    nodal : (n, 8) float64
        Positions (unchanged) and velocities (updated) of all nodes.
    first_tied : int
        Row of the first tied node.
    begin, end : (n_bodies,) int64
        Tied nodes of each body, counted from `first_tied`.
    inner, impulse, external, lever, node_mass : (n_tied, 3) or (n_tied,) float64
        Element forces [N], impulses of contact [N s], loads [N], offset from the centre in the body frame [m],
        lumped mass [kg].
    wrench : (n_bodies, 6) float64
        Force [N] and torque about the centre [N m] of joints and straps, in space.
    driven : (n_bodies,) bool
        Whether `next_centre` and `next_quaternion` are prescribed rather than found.
    mass, inverse_inertia, gravity
        [kg], (n_bodies, 3, 3) in the body frame [1/(kg m^2)], (3,) [m/s^2].
    centre, quaternion, velocity, spin
        Pose at the start of the step; velocity of the centre [m/s] and angular momentum in the
        body frame [N m s], updated.
    next_centre, next_quaternion
        Pose at the end of the step (output for free bodies).
    spin_before
        Angular momentum at this orientation before the kick (kept for output).
    twist : (n_bodies, 6) float64
        Velocity of the centre [m/s] and angular velocity in space [rad/s]: of a free body the mean over the kick
        (output), of a driven one as it is told.
    dt_kick, dt_drift : float
        Mean of the steps before and after, step after [s].
    speed_limit : float
        Faster nodes, and velocities that are not numbers, are counted [m/s].
    sums : (n_bodies, BODY_SUMS) float64
        See `BODY_SUMS` (output): kinetic energy after the kick, works of the kick.
    """
    for body in range(begin.shape[0]):
        pose = rotation_matrix(quaternion[body, 0], quaternion[body, 1], quaternion[body, 2], quaternion[body, 3])
        c = _vector(centre, body)
        kinetic_before = 0.0
        kinetic = 0.0
        weight_work = 0.0
        force = (wrench[body, 0], wrench[body, 1], wrench[body, 2])
        moment = (wrench[body, 3], wrench[body, 4], wrench[body, 5])
        if not driven[body]:
            total = force
            torque = moment
            for k in range(begin[body], end[body]):
                f = add_scaled(_vector(external, k), -1.0, _vector(inner, k))
                f = add_scaled(f, 1.0 / dt_kick, _vector(impulse, k))
                total = add(total, f)
                torque = add(torque, cross(apply(pose, _vector(lever, k)), f))
            old = _vector(velocity, body)
            g = (gravity[0], gravity[1], gravity[2])
            new = add_scaled(add_scaled(old, dt_kick / mass[body], total), dt_kick, g)
            tensor = _matrix(inverse_inertia, body)
            spin_old = _vector(spin, body)
            spin_new = add_scaled(spin_old, dt_kick, _transposed(pose, torque))
            kinetic_before = 0.5 * mass[body] * dot(old, old) + 0.5 * dot(spin_old, apply(tensor, spin_old))
            kinetic = 0.5 * mass[body] * dot(new, new) + 0.5 * dot(spin_new, apply(tensor, spin_new))
            weight_work = 0.5 * dt_kick * mass[body] * dot(g, add(old, new))
            mean = scale(0.5, add(old, new))
            mean_turn = apply(pose, apply(tensor, scale(0.5, add(spin_old, spin_new))))
            for axis in range(3):
                twist[body, axis] = mean[axis]
                twist[body, 3 + axis] = mean_turn[axis]
            spin_end, omega = turn(spin_new, tensor, dt_drift)
            # quaternion of the Cayley map: (dt omega / 2, 1), normalised, on the body's side
            hx, hy, hz = scale(0.5 * dt_drift, omega)
            x, y, z, w = quaternion[body, 0], quaternion[body, 1], quaternion[body, 2], quaternion[body, 3]
            qx = x + w * hx + y * hz - z * hy
            qy = y + w * hy + z * hx - x * hz
            qz = z + w * hz + x * hy - y * hx
            qw = w - x * hx - y * hy - z * hz
            size = math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
            next_quaternion[body, 0] = qx / size
            next_quaternion[body, 1] = qy / size
            next_quaternion[body, 2] = qz / size
            next_quaternion[body, 3] = qw / size
            for axis in range(3):
                next_centre[body, axis] = c[axis] + dt_drift * new[axis]
                velocity[body, axis] = new[axis]
                spin_before[body, axis] = spin_old[axis]
                spin[body, axis] = spin_end[axis]
        pose = rotation_matrix(
            next_quaternion[body, 0], next_quaternion[body, 1], next_quaternion[body, 2], next_quaternion[body, 3]
        )
        c = _vector(next_centre, body)
        linked = dt_kick * (
            dot(force, (twist[body, 0], twist[body, 1], twist[body, 2]))
            + dot(moment, (twist[body, 3], twist[body, 4], twist[body, 5]))
        )
        absorbed = 0.0
        loaded = 0.0
        contact = 0.0
        square_before = 0.0
        square = 0.0
        runaways = 0.0
        for k in range(begin[body], end[body]):
            fast = 0.0
            node = first_tied + k
            place = add(c, apply(pose, _vector(lever, k)))
            for axis in range(3):
                before = nodal[node, VELOCITY + axis]
                after = (place[axis] - nodal[node, POSITION + axis]) / dt_drift
                mean = 0.5 * dt_kick * (before + after)
                absorbed += inner[k, axis] * mean
                loaded += external[k, axis] * mean
                contact += 0.5 * impulse[k, axis] * (before + after)
                square_before += node_mass[k] * before * before
                square += node_mass[k] * after * after
                fast += after * after
                nodal[node, VELOCITY + axis] = after
            runaways += 0.0 if fast <= speed_limit * speed_limit else 1.0
        sums[body, 4] = runaways
        if driven[body]:
            # whoever drives the body pays for its kinetic energy and for what elements, joints, straps and contact take
            sums[body, 0] = 0.5 * square
            sums[body, 1] = absorbed
            sums[body, 2] = 0.5 * (square - square_before) + absorbed - linked - contact
            sums[body, 3] = 0.0
        else:
            sums[body, 0] = kinetic
            sums[body, 1] = absorbed
            sums[body, 2] = loaded + weight_work
            sums[body, 3] = kinetic - kinetic_before + absorbed - loaded - weight_work - linked - contact


def _present_twists(driven, told, quaternion, velocity, spin, inverse_inertia, twist):
    """Velocity of the centre and angular velocity in space of every body, half a step before the present time.

    Parameters
    ----------
    driven, told
        Whether a body is driven, and its pose and rates at the present time (n_bodies, 13) then.
    quaternion, velocity, spin, inverse_inertia
        See `advance_bodies`.
    twist : (n_bodies, 6) float64
        [m/s], [rad/s] (output).
    """
    for body in range(driven.shape[0]):
        pose = rotation_matrix(quaternion[body, 0], quaternion[body, 1], quaternion[body, 2], quaternion[body, 3])
        omega = apply(pose, apply(_matrix(inverse_inertia, body), _vector(spin, body)))
        for axis in range(3):
            twist[body, axis] = told[body, 7 + axis] if driven[body] else velocity[body, axis]
            twist[body, 3 + axis] = told[body, 10 + axis] if driven[body] else omega[axis]


@device
def _quaternion_rate(omegas, quaternions, i):
    """Rate ``omega q / 2`` of a quaternion turning with `omega` in space."""
    a, b, c = 0.5 * omegas[i, 0], 0.5 * omegas[i, 1], 0.5 * omegas[i, 2]
    x, y, z, w = quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3]
    return (
        w * a + b * z - c * y,
        w * b + c * x - a * z,
        w * c + a * y - b * x,
        -a * x - b * y - c * z,
    )


def _prescribed_pose(times, positions, quaternions, velocities, omegas, t, result):
    """Pose, velocity and angular velocity of a prescribed motion at one time.

    Cubic Hermite in the position; cubic Hermite in the quaternion with ``q' = omega q / 2``,
    then normalised. Before the first and after the last time the motion goes on uniformly.

    Parameters
    ----------
    times, positions, quaternions, velocities, omegas
        Samples: (k,) [s], (k, 3) [m], (k, 4), (k, 3) [m/s], (k, 3) in space [rad/s].
    t : float
        [s].
    result : (13,) float64
        x, y, z, qx, qy, qz, qw, vx, vy, vz, omega_x, omega_y, omega_z (output).
    """
    last = times.shape[0] - 1
    low = 0
    high = last
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= t:
            low = middle
        else:
            high = middle
    inside = min(max(t, times[0]), times[last])
    width = times[high] - times[low] if last > 0 else 1.0
    s = (inside - times[low]) / width
    h00 = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s)
    h10 = s * (1.0 - s) * (1.0 - s) * width
    h01 = s * s * (3.0 - 2.0 * s)
    h11 = s * s * (s - 1.0) * width
    d00 = 6.0 * s * (s - 1.0) / width
    d10 = (3.0 * s - 1.0) * (s - 1.0)
    d11 = s * (3.0 * s - 2.0)
    for axis in range(3):
        p0 = positions[low, axis]
        p1 = positions[high, axis]
        v0 = velocities[low, axis]
        v1 = velocities[high, axis]
        speed = d00 * (p0 - p1) + d10 * v0 + d11 * v1
        # the difference form keeps a body at rest at rest to the last bit
        result[axis] = p0 + h01 * (p1 - p0) + h10 * v0 + h11 * v1 + (t - inside) * speed
        result[7 + axis] = speed
    r0 = _quaternion_rate(omegas, quaternions, low)
    r1 = _quaternion_rate(omegas, quaternions, high)
    for k in range(4):
        q0 = quaternions[low, k]
        q1 = quaternions[high, k]
        result[3 + k] = h00 * q0 + h01 * q1 + h10 * r0[k] + h11 * r1[k]
    x, y, z, w = result[3], result[4], result[5], result[6]
    rx = d00 * (quaternions[low, 0] - quaternions[high, 0]) + d10 * r0[0] + d11 * r1[0]
    ry = d00 * (quaternions[low, 1] - quaternions[high, 1]) + d10 * r0[1] + d11 * r1[1]
    rz = d00 * (quaternions[low, 2] - quaternions[high, 2]) + d10 * r0[2] + d11 * r1[2]
    rw = d00 * (quaternions[low, 3] - quaternions[high, 3]) + d10 * r0[3] + d11 * r1[3]
    square = x * x + y * y + z * z + w * w
    # omega = 2 q' q^-1; normalising q changes only the scalar part
    result[10] = 2.0 * (w * rx - x * rw + y * rz - z * ry) / square
    result[11] = 2.0 * (w * ry - y * rw + z * rx - x * rz) / square
    result[12] = 2.0 * (w * rz - z * rw + x * ry - y * rx) / square
    size = math.sqrt(square)
    for k in range(4):
        result[3 + k] /= size
    beyond = t - inside
    if beyond != 0.0:
        hx, hy, hz = 0.5 * beyond * result[10], 0.5 * beyond * result[11], 0.5 * beyond * result[12]
        x, y, z, w = result[3], result[4], result[5], result[6]
        result[3] = x + w * hx - y * hz + z * hy
        result[4] = y + w * hy - z * hx + x * hz
        result[5] = z + w * hz - x * hy + y * hx
        result[6] = w - x * hx - y * hy - z * hz
        size = math.sqrt(result[3] ** 2 + result[4] ** 2 + result[5] ** 2 + result[6] ** 2)
        for k in range(4):
            result[3 + k] /= size


advance_bodies = compiled(_advance_bodies)
present_twists = compiled(_present_twists)
prescribed_pose = compiled(_prescribed_pose)
