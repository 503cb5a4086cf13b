"""From a model, a driver and a play's settings to what the solver is asked."""

from __future__ import annotations

import numpy as np

from replay.models import Model, select_assembly
from replay.motion import Kinematics
from replay.play import Play
from replay.solver import Controls, Material, PrescribedMotion, Problem, SolverPart


def controls_of(play: Play, duration_s: float, *, checkpoint_every_s: float, hourglass_factor: float = 1.0) -> Controls:
    """Numerical settings of a run.

    Parameters
    ----------
    play
        Its ``solver`` block.
    duration_s
        Length of the run [s].
    checkpoint_every_s
        Wall-clock time between checkpoints [s]; changes no result.
    hourglass_factor
        Multiplies the hourglass coefficient (a half, for the sensitivity run).
    """
    settings = play.solver
    return Controls(
        termination_time_s=duration_s,
        time_step_factor=settings.time_step_factor,
        hourglass_method=settings.hourglass.method,
        hourglass_coefficient=settings.hourglass.coefficient * hourglass_factor,
        bulk_viscosity_quadratic=settings.bulk_viscosity.quadratic,
        bulk_viscosity_linear=settings.bulk_viscosity.linear,
        mass_scaling_time_step_s=settings.mass_scaling_time_step_s,
        plot_interval_s=min(settings.plot_interval_s, duration_s),
        history_interval_s=min(settings.history_interval_s, duration_s / 10.0),
        checkpoint_period_s=checkpoint_every_s,
    )


def driven_problem(model: Model, driver: Kinematics, controls: Controls) -> Problem:
    """Head and helmet with the skull driven along the play's motion.

    The model stands at the driver's first pose and moves as one rigid body with its first velocity, so that
    nothing is strained before the impact.

    Parameters
    ----------
    model
        In head axes, origin at the head's centre of gravity.
    driver
        ``driver_6dof.csv``: the motion of that centre, global axes.
    controls
        Numerical settings.
    """
    arms = driver.rotation[0].apply(model.nodes)
    parts = solver_parts(model)
    return Problem(
        nodes=driver.position_m[0] + arms,
        hexes=model.hexes,
        element_part=model.element_part,
        parts=parts,
        controls=controls,
        initial_velocity=driver.velocity_m_per_s[0] + np.cross(driver.omega_rad_per_s[0], arms),
        prescribed=(
            PrescribedMotion(
                pids=tuple(part.pid for part in model.parts if part.role == "skull"),
                times=driver.time_s,
                positions=driver.position_m,
                quaternions=driver.rotation.as_quat(),
                velocities=driver.velocity_m_per_s,
                angular_velocities=driver.omega_rad_per_s,
            ),
        ),
        node_ids=model.node_ids,
        element_ids=model.element_ids,
    )


def helmet_problem(model: Model, speed_m_per_s: float, controls: Controls) -> Problem:
    """The helmet alone in free flight along x (protocol 1.6); nodes it shared with the head are free.

    Parameters
    ----------
    model
        Head and helmet.
    speed_m_per_s
        Initial speed of the whole helmet.
    controls
        Those of the replay, for a shorter time.
    """
    helmet = select_assembly(model, "helmet")
    return Problem(
        nodes=helmet.nodes,
        hexes=helmet.hexes,
        element_part=helmet.element_part,
        parts=solver_parts(helmet),
        controls=controls,
        initial_velocity=np.tile([speed_m_per_s, 0.0, 0.0], (len(helmet.nodes), 1)),
        node_ids=helmet.node_ids,
        element_ids=helmet.element_ids,
    )


def solver_parts(model: Model) -> tuple[SolverPart, ...]:
    """Parts of a head and helmet model with their materials."""
    parts = []
    for part in model.parts:
        facts = model.materials[part.material]
        material = Material(part.material, facts["law"], facts["density_kg_per_m3"], facts["parameters"])
        parts.append(SolverPart(part.pid, part.name, material))
    return tuple(parts)
