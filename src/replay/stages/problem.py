"""From a model, a driver and a play's settings to what the solver is asked."""

from __future__ import annotations

import dataclasses

import numpy as np

from replay import models
from replay.models import Model, select_assembly
from replay.motion import Kinematics
from replay.play import Contact, Play
from replay.solver import (
    ContactControls,
    Controls,
    Joint,
    Material,
    PrescribedMotion,
    Problem,
    RigidSet,
    SolverPart,
    Strap,
)
from replay.stages.contact import contact_controls, pairs_without_a_side, part_numbers


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


def unresolved_pairs(model: Model, contact: Contact) -> list[str]:
    """Friction pairs, and names of self-contact, of which the model lacks a side."""
    return pairs_without_a_side(model, contact.pairs) + [
        name for name in contact.self_contact if not part_numbers(model, name)
    ]


def seated_by_contact(model: Model) -> bool:
    """Whether the model's helmet touches the head, and shares no nodes with it."""
    return bool(model.info.get("helmet_seat") == "contact")


def contact_of(model: Model, contact: Contact) -> ContactControls | None:
    """Contact of the parts that a model has, if it is seated by it; pairs of which it lacks a side are left out."""
    if not seated_by_contact(model):
        return None
    return contact_controls(model, contact)


def chin_straps(model: Model, player: int = 1) -> tuple[tuple[RigidSet, ...], tuple[Strap, ...]]:
    """The hard shell of a player's chin cup, and the straps from its corners to the shell, as far as there are any."""
    if not seated_by_contact(model):
        return (), ()
    ending = "" if player == 1 else f"_{player}"
    sets = {name: rows for name, rows in model.node_sets.items() if ending or not name.endswith("_2")}
    sets = {name.removesuffix(ending): rows for name, rows in sets.items() if name.endswith(ending)}
    data = (model.info["players"][player - 1] if "players" in model.info else model.info).get("strap", {})
    straps = []
    for name in sorted(sets):
        place = name.removeprefix("strap_anchor_")
        cup = sets.get(f"chin_cup_strap_{place.rpartition('_')[2]}")
        if place != name and cup is not None:
            rows = np.array([sets[name][0], cup[0]], np.int64)
            straps.append(Strap(f"chin_{place}{ending}", rows, data["stiffness_n_per_m"], data["damping_n_s_per_m"]))
    shell = (RigidSet(f"chin_cup_shell{ending}", sets["chin_cup_shell"].astype(np.int64)),) if straps else ()
    return shell, tuple(straps)


def membrane_cables(model: Model) -> tuple[Strap, ...]:
    """Falx and tentorium of a model that has them, cable by cable."""
    if model.info.get("membranes", "none") == "none":
        return ()
    return tuple(
        Strap(f"{name}_{k}", ends.astype(np.int64), stiffness, recorded=False)
        for name, net in (("falx", models.falx(model)), ("tentorium", models.tentorium(model)))
        for k, (ends, stiffness) in enumerate(zip(net.nodes, net.stiffness_n_per_m.tolist()))
    )


def body_links(model: Model) -> tuple[tuple[RigidSet, ...], tuple[Joint, ...]]:
    """Node sets that move as bodies, and joints, of a model with a body; none of a bare head."""
    sets = tuple(RigidSet(name, model.node_sets[name].astype(np.int64)) for name in model.rigid_node_sets)
    joints = tuple(
        Joint(
            j.name, j.first, j.second, np.array(j.centre_m), np.array(j.stiffness_n_m_per_rad), j.damping_ratio,
            j.centre_stiffness_n_per_m, j.centre_damping_ratio, np.array(j.axes),
        )
        for j in model.joints
    )  # fmt: skip
    return sets, joints


def driven_problem(model: Model, driver: Kinematics, controls: Controls, contact: Contact) -> Problem:
    """Head and helmet with the skull driven along the play's motion.

    The model stands at the driver's first pose and moves as one rigid body with its first velocity, so that
    nothing is strained before the impact. A helmet seated by contact is held by it and by its chin straps alone.

    Parameters
    ----------
    model
        In head axes, origin at the head's centre of gravity.
    driver
        ``driver_6dof.csv``: the motion of that centre, global axes.
    controls
        Numerical settings.
    contact
        The play's ``solver.contact`` block.
    """
    shell, straps = chin_straps(model)
    parts, (bodies, joints) = solver_parts(model), body_links(model)
    arms = driver.rotation[0].apply(model.nodes)
    turn = driver.rotation[0].as_matrix()
    joints = tuple(
        dataclasses.replace(j, centre=driver.position_m[0] + turn @ j.centre, axes=j.axes @ turn.T) for j in joints
    )
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
        rigid_sets=(*shell, *bodies),
        joints=joints,
        straps=(*straps, *membrane_cables(model)),
        contact=contact_of(model, contact),
    )


def resting_problem(model: Model, controls: Controls, contact: Contact) -> Problem:
    """Head and helmet at rest, as assembled: what initial penetration is looked for in."""
    return Problem(
        nodes=model.nodes,
        hexes=model.hexes,
        element_part=model.element_part,
        parts=solver_parts(model),
        controls=controls,
        node_ids=model.node_ids,
        element_ids=model.element_ids,
        contact=contact_of(model, contact),
    )


def helmet_problem(model: Model, speed_m_per_s: float, controls: Controls, contact: Contact) -> Problem:
    """The helmet alone in free flight along x (protocol 1.6).

    Parameters
    ----------
    model
        Head and helmet.
    speed_m_per_s
        Initial speed of the whole helmet.
    controls
        Those of the replay, for a shorter time.
    contact
        That of the replay.
    """
    helmet = select_assembly(model, "helmet")
    shell, straps = chin_straps(helmet)
    return Problem(
        nodes=helmet.nodes,
        hexes=helmet.hexes,
        element_part=helmet.element_part,
        parts=solver_parts(helmet),
        controls=controls,
        initial_velocity=np.tile([speed_m_per_s, 0.0, 0.0], (len(helmet.nodes), 1)),
        node_ids=helmet.node_ids,
        element_ids=helmet.element_ids,
        rigid_sets=shell,
        straps=straps,
        contact=contact_of(helmet, contact),
    )


def solver_parts(model: Model) -> tuple[SolverPart, ...]:
    """Parts of a model with their materials."""
    parts = []
    for part in model.parts:
        facts = model.materials[part.material]
        material = Material(part.material, facts["law"], facts["density_kg_per_m3"], facts["parameters"])
        parts.append(SolverPart(part.pid, part.name, material))
    return tuple(parts)
