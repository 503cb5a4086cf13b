"""What contact does to the step: velocities, the ledger's entries, impulses by pair of parts, small corrections."""

from __future__ import annotations

from replay.solver.kernels.contact_detect import SLOTS
from replay.solver.kernels.contact_system import CORNERS
from replay.solver.kernels.device import compiled
from replay.solver.kernels.lanes import VELOCITY

#: Entries of the ledger: changes of kinetic energy, of what elements absorb, of what comes from outside; lost in normal
#: contact and in friction [J].
SUMS = 5
#: Sums over a pair of parts: impulse on the first part (3) [N s], lost in normal contact, in friction [J].
PAIR_SUMS = 5
# share of a penetration that one step takes back, most that one step moves a node over the face's size
_TAKEN_BACK = 0.1
_MOST_SHIFT = 0.002
# what is left: this share of a face's size
_LEFT = 1e-4


def _inner(force, first_slot, slot, row, axis):
    """Sum of the element forces on a node along an axis."""
    total = 0.0
    for k in range(first_slot[row], first_slot[row + 1]):
        total += force[slot[k], axis]
    return total


_inner = compiled(_inner)


def _survey(slots):
    """Active slots, and the deepest penetration over the face's size."""
    count = 0
    deepest = 0.0
    for point in range(slots.face.shape[0]):
        for slot in range(SLOTS):
            if slots.face[point, slot] < 0:
                break
            if slots.active[point, slot]:
                count += 1
            deepest = max(deepest, -slots.gap[point, slot] / slots.size[point, slot])
    return count, deepest


def _look_back(
    nodal, used, nodes, force, first_slot, slot, inverse_mass, external, dt_kick, was, before
):  # fmt: skip
    """Velocities of the problem's nodes before the kick.

    Parameters
    ----------
    nodal, used, nodes
        Of the problem.
    force, first_slot, slot, inverse_mass, external
        As in `assembly.advance_nodes`.
    dt_kick
        Mean of the steps before and after [s].
    was : (n_tied, 3) float64
        Velocities of the bodies' nodes before the kick [m/s].
    before : (n_nodes, 3) float64
        Output [m/s].
    """
    free = nodal.shape[0] - was.shape[0]
    for k in range(used):
        row = nodes.row[k]
        for axis in range(3):
            if row >= free:
                before[k, axis] = was[row - free, axis]
            else:
                pull = external[row, axis] - _inner(force, first_slot, slot, row, axis)
                before[k, axis] = nodes.start[k, axis] - dt_kick * inverse_mass[row, axis] * pull


def _temper(n, used, constraints, nodes, before):
    """Shorten all multipliers by one factor where, not converged, they would make energy; return the factor.

    Contact's work in a kick is ``P (v_before + v_after) / 2``, a square in the factor; momentum does not mind it.
    """
    without = 0.0
    with_it = 0.0
    for k in range(used):
        for axis in range(3):
            push = nodes.impulse[k, axis]
            without += push * (before[k, axis] + nodes.start[k, axis])
            with_it += push * (nodes.now[k, axis] - nodes.start[k, axis])
    if not without + with_it > 0.0 or not with_it > 0.0:
        return 1.0
    factor = max(-without / with_it, 0.0)
    for c in range(n):
        constraints.impulse[c] *= factor
        for axis in range(3):
            constraints.drag[c, axis] *= factor
    for k in range(used):
        for axis in range(3):
            nodes.impulse[k, axis] *= factor
            nodes.now[k, axis] = nodes.start[k, axis] + factor * (nodes.now[k, axis] - nodes.start[k, axis])
    return factor


def _push(
    nodal, used, nodes, force, first_slot, slot, mass, inverse_mass, external, dt_kick, n_tied, body_impulse, sums
):  # fmt: skip
    """Give free nodes their impulses and enter the kick's change of kinetic energy and of the works in it.

    The work of a kick is that of forces with the mean of the velocities before and after; contact changes
    the velocity after.

    Parameters
    ----------
    nodal, used, nodes
        Of the problem.
    force, first_slot, slot, mass, inverse_mass, external
        As in `assembly.advance_nodes`.
    dt_kick
        Mean of the steps before and after [s].
    n_tied
        Nodes of bodies.
    body_impulse : (n_tied, 3) float64
        Impulses on the bodies' nodes (output; zero before) [N s].
    sums : (SUMS,) float64
        Added to [J].

    Returns
    -------
    bool
        Whether a body gets an impulse.
    """
    free = nodal.shape[0] - n_tied
    pushed = False
    for k in range(used):
        row = nodes.row[k]
        for axis in range(3):
            push = nodes.impulse[k, axis]
            if row >= free:
                body_impulse[row - free, axis] = push
                pushed = pushed or push != 0.0
                continue
            inner = _inner(force, first_slot, slot, row, axis)
            mobility = inverse_mass[row, axis]
            load = external[row, axis]
            old = nodal[row, VELOCITY + axis]
            change = mobility * push
            nodal[row, VELOCITY + axis] = old + change
            sums[0] += mass[row] * change * (old + 0.5 * change)
            sums[1] += 0.5 * dt_kick * inner * change
            sums[2] += 0.5 * dt_kick * load * change
            if mobility == 0.0:
                sums[2] -= push * old
    return pushed


def _account(nodal, n, used, constraints, nodes, before, old_impulse, old_drag, pair_sums, sums):
    """Enter what each constraint lost, add its impulse to its pair, and keep its multipliers for the next step.

    The loss of a constraint is its impulse times the mean of the speeds before and after the kick.
    """
    for k in range(used):
        for axis in range(3):
            nodes.now[k, axis] = nodal[nodes.row[k], VELOCITY + axis]
    old_impulse[:] = 0.0
    old_drag[:] = 0.0
    for c in range(n):
        point = constraints.point[c]
        slot = constraints.slot[c]
        p = constraints.impulse[c]
        old_impulse[point, slot] = p
        normal_work = 0.0
        friction_work = 0.0
        pair = constraints.pair[c]
        sign = constraints.sign[c]
        for axis in range(3):
            drag = constraints.drag[c, axis]
            old_drag[point, slot, axis] = drag
            mean = 0.0
            for corner in range(CORNERS):
                k = constraints.node[c, corner]
                if k >= 0:
                    mean += 0.5 * constraints.share[c, corner] * (before[k, axis] + nodes.now[k, axis])
            normal_work += p * constraints.normal[c, axis] * mean
            friction_work += drag * mean
            pair_sums[pair, axis] += sign * (p * constraints.normal[c, axis] + drag)
        pair_sums[pair, 3] -= normal_work
        pair_sums[pair, 4] -= friction_work
        sums[3] -= normal_work
        sums[4] -= friction_work


def _correct(n, used, constraints, nodes, slots, dt, want, shift):
    """Displacement of a step that takes back a little of what is left of penetrations (n_nodes, 3) [m].

    One step of the multipliers' own iteration, which never overshoots. Bodies stay where they are.
    """
    any_shift = False
    for c in range(n):
        w = 0.0
        for corner in range(CORNERS):
            k = constraints.node[c, corner]
            if k >= 0:
                for axis in range(3):
                    w += constraints.share[c, corner] * constraints.normal[c, axis] * nodes.now[k, axis]
        size = slots.size[constraints.point[c], constraints.slot[c]]
        deep = -(slots.gap[constraints.point[c], constraints.slot[c]] + dt * w) - _LEFT * size
        want[c] = 0.0
        if deep > 0.0 and constraints.weight[c] > 0.0:
            want[c] = min(_TAKEN_BACK * deep, _MOST_SHIFT * size) / constraints.weight[c]
            any_shift = True
    if not any_shift:
        return False
    for k in range(used):
        for axis in range(3):
            total = 0.0
            for m in range(nodes.first[k], nodes.first[k + 1]):
                c = nodes.constraint[m]
                total += constraints.share[c, nodes.corner[m]] * want[c] * constraints.normal[c, axis]
            shift[k, axis] = nodes.mobility[k, axis] * total
    return True


def _start_shift(nodal, used, nodes, shift, dt, index, kept, force, first_slot, slot, sums):
    """Let the corrections ride on the velocities of the coming step; enter the first half of their work."""
    for k in range(used):
        row = nodes.row[k]
        for axis in range(3):
            if shift[k, axis] != 0.0:
                kept[index[row], axis] = shift[k, axis] / dt
                nodal[row, VELOCITY + axis] += kept[index[row], axis]
                work = 0.5 * _inner(force, first_slot, slot, row, axis) * shift[k, axis]
                sums[1] += work
                sums[3] -= work


def _end_shift(nodal, surface_nodes, kept, dt, force, first_slot, slot, sums):
    """Take the corrections off the velocities again; enter the second half of their work."""
    for k in range(surface_nodes.shape[0]):
        row = surface_nodes[k]
        for axis in range(3):
            if kept[k, axis] != 0.0:
                nodal[row, VELOCITY + axis] -= kept[k, axis]
                work = 0.5 * _inner(force, first_slot, slot, row, axis) * kept[k, axis] * dt
                sums[1] += work
                sums[3] -= work
                kept[k, axis] = 0.0


survey = compiled(_survey)
look_back = compiled(_look_back)
temper = compiled(_temper)
push = compiled(_push)
account = compiled(_account)
correct = compiled(_correct)
start_shift = compiled(_start_shift)
end_shift = compiled(_end_shift)
