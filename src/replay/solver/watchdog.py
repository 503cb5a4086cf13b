"""Stops a run that has gone wrong, within one step, and says where."""

from __future__ import annotations

import math

import numpy as np

from replay.errors import InstabilityError
from replay.solver.integrator import Integrator
from replay.solver.kernels.geometry import element_gradients
from replay.solver.kernels.lanes import POSITION, VELOCITY
from replay.solver.problem import Problem
from replay.solver.time_step import StepBound

_MOST_SPEED = 10.0
_WAVE_SHARE = 0.1


def speed_limit(problem: Problem) -> float:
    """Speed that no node of a sound run reaches [m/s]; see `Controls.speed_limit_m_per_s`."""
    if problem.controls.speed_limit_m_per_s > 0:
        return problem.controls.speed_limit_m_per_s
    fastest = float(np.sqrt((problem.initial_velocity**2).sum(axis=1)).max())
    for motion in problem.prescribed:
        rigid = [k for k, part in enumerate(problem.parts) if part.pid in motion.pids]
        sets = [s.nodes for s in problem.rigid_sets if s.name in motion.rigid_sets]
        rows = np.unique(np.concatenate([problem.hexes[np.isin(problem.element_part, rigid)].ravel(), *sets]))
        reach = np.sqrt(((problem.nodes[rows] - motion.positions[0]) ** 2).sum(axis=1).max()) if len(rows) else 0.0
        linear = np.sqrt((motion.velocities**2).sum(axis=1))
        turning = reach * np.sqrt((motion.angular_velocities**2).sum(axis=1))
        fastest = max(fastest, float((linear + turning).max()))
    if fastest > 0:
        return _MOST_SPEED * fastest
    soft = [part.material for part in problem.parts if not part.material.is_rigid]
    return _WAVE_SHARE * max((material.wave_speed_m_per_s() for material in soft), default=math.inf)


def check_step(integrator: Integrator, bound: StepBound) -> None:
    """Refuse an inverted element, a value that is not a number, and a collapsed time step.

    Raises
    ------
    InstabilityError
        With part, element and time.
    """
    floor = integrator.problem.controls.time_step_floor_s
    if bound.step_s >= floor:
        return
    problem = integrator.problem
    row = bound.element
    if row < 0:
        message = (
            f"joints or straps want a time step of {bound.step_s:.3g} s, below the floor of {floor:.3g} s, at "
            f"{integrator.time_s:.6g} s\n    mend: soften them, or give their bodies more mass"
        )
        raise InstabilityError(message)
    part = problem.part_of(row)
    where = f"element {problem.element_ids[row]} of part {part.pid} ({part.name})"
    at = f"at {integrator.time_s:.6g} s (step {integrator.step})"
    if bound.step_s > 0:
        message = (
            f"the stable time step has collapsed to {bound.step_s:.3g} s, below the floor of {floor:.3g} s, "
            f"in {where} {at}\n    mend: look at the last state there; a squeezed element wants a finer mesh or a "
            "stiffer foam curve, a stiff or tiny one mass scaling"
        )
        raise InstabilityError(message)
    coordinates = integrator.user_order(integrator.nodal[:, POSITION : POSITION + 3])
    gradient, volume = np.empty((1, 18)), np.empty(1)
    element_gradients(np.ascontiguousarray(coordinates), problem.hexes[row : row + 1], gradient, volume)
    if math.isfinite(volume[0]):
        found = f"has turned inside out (volume {volume[0]:.3g} m^3)"
        mend = "look at the last state there; refine the mesh, or soften what squeezes it"
    else:
        found = "holds values that are not numbers"
        mend = "look at the last state there, and at the loads and materials around it"
    message = f"{where} {found} {at}\n    mend: {mend}"
    raise InstabilityError(message)


def check_speed(integrator: Integrator) -> None:
    """Refuse a node that moves faster than the speed limit.

    Raises
    ------
    InstabilityError
        With the node, its speed and the time.
    """
    if not integrator.runaways:
        return
    velocity = integrator.nodal[:, VELOCITY : VELOCITY + 3]
    speed = np.sqrt((velocity**2).sum(axis=1))
    bad = ~(speed <= integrator.speed_limit)
    row = int(np.argmax(np.where(bad, np.where(np.isfinite(speed), speed, np.inf), 0.0)))
    user = int(integrator.layout.node_order[row])
    problem = integrator.problem
    element = int(np.argmax((problem.hexes == user).any(axis=1)))
    part = problem.part_of(element)
    shown = f"{speed[row]:.4g} m/s" if math.isfinite(speed[row]) else "at a speed that is not a number"
    message = (
        f"node {problem.node_ids[user]} of part {part.pid} ({part.name}), element {problem.element_ids[element]}, "
        f"runs away {shown} (limit {integrator.speed_limit:.4g} m/s) at {integrator.time_s:.6g} s "
        f"(step {integrator.step})\n    mend: look at the last state there; if such speeds are meant, raise "
        "controls.speed_limit_m_per_s"
    )
    raise InstabilityError(message)
