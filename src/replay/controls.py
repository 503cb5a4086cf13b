"""The validated description of a run of the solver by itself: ``controls.yaml`` of ``replay solve``.

Names and defaults of the numerical settings are the article's (section 3.3): hourglass method 4 with 0.10, bulk
viscosity 1.2 and 0.06, factor 0.9, mass scaling 1.92e-7 s, 30 ms. docs/solver.md has an example with every block.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from replay.documents import Number, Setting, load_yaml, refuse
from replay.play import BulkViscosity, ContactSettings, InputFile, NotNegative, Positive, Vector3

Name = Annotated[str, Field(min_length=1)]
NumberOrName = int | Name
"""A thing of the model by its number, or a set by its name."""


class HourglassControl(Setting):
    """Hourglass stabilisation, protocol 3.3.2."""

    method: Literal[4, "stiffness", "viscous"] = Field(
        default=4, description="4 and stiffness are one form, viscous is the other."
    )
    coefficient: Annotated[Number, Field(ge=0, le=0.3)] = Field(default=0.10, description="Coefficient.")


class Nodes(Setting):
    """Some nodes: by number, by a set of the model, or all of some parts."""

    nodes: tuple[int, ...] = Field(default=(), description="Numbers of nodes.")
    node_set: Name | None = Field(default=None, description="Name of a node set of the model.")
    parts: tuple[int, ...] = Field(default=(), description="Numbers of parts: all of their nodes.")

    @model_validator(mode="after")
    def _one_way(self) -> Nodes:
        if (bool(self.nodes) + bool(self.node_set) + bool(self.parts)) != 1:
            refuse("names its nodes in no way or in several", "one of nodes, node_set, parts", "keep one of them")
        return self


class PartMaterial(Setting):
    """Material of some parts, in place of the model's."""

    parts: tuple[int, ...] = Field(min_length=1, description="Numbers of parts.")
    law: Name = Field(description="Name of a material law (docs/physics.md).")
    density_kg_per_m3: Positive = Field(description="Mass density [kg/m^3].")
    parameters: dict[str, Number | list[Number]] = Field(default_factory=dict, description="Constants of the law, SI.")


class RigidNodes(Nodes):
    """Nodes that move as one body."""

    name: Name = Field(description="Name for joints, motions and outputs.")


class InitialVelocity(Setting):
    """Velocity at time 0: translation, and rotation about the axis from P to Q."""

    parts: tuple[int, ...] = Field(default=(), description="Numbers of parts; none means all.")
    part_set: Name | None = Field(default=None, description="Name of a part set of the model.")
    velocity_m_per_s: Vector3 = Field(default=(0.0, 0.0, 0.0), description="Velocity of the axis [m/s].")
    omega_rad_per_s: Number = Field(default=0.0, description="Angular velocity, right-handed about P to Q [rad/s].")
    p_m: Vector3 | None = Field(default=None, description="P [m].")
    q_m: Vector3 | None = Field(default=None, description="Q [m].")

    @model_validator(mode="after")
    def _an_axis_for_a_turn(self) -> InitialVelocity:
        if self.omega_rad_per_s != 0.0 and (self.p_m is None or self.q_m is None):
            refuse("turns about no axis", "p_m and q_m", "give two points of the axis")
        if self.p_m is not None and self.p_m == self.q_m:
            refuse("has P = Q", "two points that span the axis", "move Q along the angular velocity")
        if self.parts and self.part_set:
            refuse("names parts and a part set", "one of them", "keep one of them")
        return self


class Support(Nodes):
    """Nodes that are held."""

    axes: tuple[Literal["x", "y", "z"], ...] = Field(
        default=("x", "y", "z"), min_length=1, description="Directions that keep their initial velocity."
    )


class Load(Nodes):
    """A constant force from time 0 on, shared evenly by the nodes."""

    force_n: Vector3 = Field(description="Total force [N].")


class Motion(Setting):
    """Rigid parts and sets driven along a file of 6-DOF motion."""

    parts: tuple[int, ...] = Field(default=(), description="Numbers of rigid parts.")
    rigid_sets: tuple[Name, ...] = Field(default=(), description="Names of rigid sets.")
    file: InputFile = Field(
        description="CSV with time_s, x_m.., qx..qw, vx_m_per_s.., omega_x_rad_per_s..: a driver_6dof.csv will do."
    )


class JointSettings(Setting):
    """A joint between two rigid bodies, or a body and ground."""

    name: Name = Field(description="Name for outputs.")
    first: NumberOrName | None = Field(default=None, description="Rigid part or set below the joint; none is ground.")
    second: NumberOrName = Field(description="Rigid part or set above it.")
    centre_m: Vector3 = Field(description="Centre of the joint at time 0 [m].")
    flexion_n_m_per_rad: NotNegative = Field(description="Stiffness of turning forward, positive about y [N m/rad].")
    extension_n_m_per_rad: NotNegative | None = Field(
        default=None, description="Stiffness of turning back; that of flexion where none is given [N m/rad]."
    )
    lateral_n_m_per_rad: NotNegative = Field(description="Stiffness of turning sideways, about x [N m/rad].")
    torsion_n_m_per_rad: NotNegative = Field(description="Stiffness of turning about z [N m/rad].")
    damping_ratio: NotNegative = Field(default=0.0, description="Damping ratio of every axis.")
    centre_stiffness_n_per_m: NotNegative = Field(
        default=1e8, description="Stiffness that holds the two bodies' centres together; 0 lets them part [N/m]."
    )
    centre_damping_ratio: NotNegative = Field(default=0.1, description="Damping ratio of that.")
    x_axis: Vector3 = Field(default=(1.0, 0.0, 0.0), description="Forward, of any length.")
    z_axis: Vector3 = Field(default=(0.0, 0.0, 1.0), description="Upward, of any length; made square to x_axis.")

    @model_validator(mode="after")
    def _two_directions(self) -> JointSettings:
        (a, b, c), (u, v, w) = self.x_axis, self.z_axis
        square = (b * w - c * v) ** 2 + (c * u - a * w) ** 2 + (a * v - b * u) ** 2
        if not square > 1e-12 * (a * a + b * b + c * c) * (u * u + v * v + w * w):
            refuse("x_axis and z_axis are parallel", "two directions", "turn one of them")
        return self


class StrapSettings(Setting):
    """A cable through nodes that pulls and never pushes."""

    name: Name = Field(description="Name for outputs.")
    nodes: tuple[NumberOrName, ...] = Field(
        min_length=2, description="Its nodes in order: numbers, or names of one-node sets."
    )
    stiffness_n_per_m: Positive = Field(description="Tension per stretch of the whole strap [N/m].")
    damping_n_s_per_m: NotNegative = Field(default=0.0, description="Tension per rate of its length [N s/m].")
    slack_m: NotNegative = Field(default=0.0, description="Length to spare at time 0 [m].")
    pay_in_m: NotNegative = Field(default=0.0, description="Length that a buckle takes in [m].")
    pay_in_time_s: NotNegative = Field(default=0.0, description="Time it takes for that [s].")


class TieSettings(Setting):
    """The outside of some parts tied to the outside of others."""

    name: Name = Field(description="Name for outputs.")
    tied_parts: tuple[int, ...] = Field(min_length=1, description="Parts whose surface follows: the finer or softer.")
    master_parts: tuple[int, ...] = Field(min_length=1, description="Parts whose surface leads.")
    tolerance_m: Positive = Field(description="Nodes farther from the masters' surface than this stay free [m].")


class Outputs(Setting):
    """What is written, and when."""

    plot_interval_s: Positive = Field(default=1.0e-3, description="Time between states [s].")
    history_interval_s: Positive = Field(default=1.0e-4, description="Time between rows of histories [s].")
    nodes: tuple[int, ...] = Field(default=(), description="Nodes with a history of their own.")
    elements: tuple[int, ...] = Field(default=(), description="Elements with a history of their own.")


class SolveControls(Setting):
    """A run of the solver by itself."""

    termination_time_s: Positive = Field(default=0.030, description="End of the run [s].")
    time_step_factor: Annotated[Number, Field(gt=0, le=1)] = Field(
        default=0.9, description="Factor on the stable time step."
    )
    time_step_floor_s: NotNegative = Field(default=1e-7, description="A stable step below this stops the run [s].")
    mass_scaling_time_step_s: NotNegative = Field(
        default=1.92e-7, description="Time step that mass scaling holds; 0 turns it off [s]."
    )
    hourglass: HourglassControl = Field(default_factory=lambda: HourglassControl(), description="Hourglass control.")
    bulk_viscosity: BulkViscosity = Field(default_factory=lambda: BulkViscosity(), description="Bulk viscosity.")
    gravity_m_per_s2: Vector3 = Field(default=(0.0, 0.0, 0.0), description="Acceleration of free fall [m/s^2].")
    speed_limit_m_per_s: NotNegative = Field(
        default=0.0, description="A faster node stops the run; 0 is ten times the fastest given speed [m/s]."
    )
    checkpoint_period_s: NotNegative = Field(default=10.0, description="Wall-clock time between checkpoints [s].")
    output: Outputs = Field(default_factory=lambda: Outputs(), description="What is written, and when.")
    materials: tuple[PartMaterial, ...] = Field(default=(), description="Materials in place of the model's.")
    rigid_sets: tuple[RigidNodes, ...] = Field(default=(), description="Nodes that move as bodies.")
    initial_velocities: tuple[InitialVelocity, ...] = Field(default=(), description="Added up where they overlap.")
    supports: tuple[Support, ...] = Field(default=(), description="Nodes that are held.")
    loads: tuple[Load, ...] = Field(default=(), description="Constant forces.")
    prescribed_motions: tuple[Motion, ...] = Field(default=(), description="Driven bodies, one motion each.")
    joints: tuple[JointSettings, ...] = Field(default=(), description="Joints between bodies.")
    straps: tuple[StrapSettings, ...] = Field(default=(), description="Straps.")
    ties: tuple[TieSettings, ...] = Field(default=(), description="Tied interfaces.")
    contact: ContactSettings | None = Field(default=None, description="Contact of all parts; none without this block.")


def load_controls(path: Path) -> SolveControls:
    """Read ``controls.yaml``; files it names lie beside it.

    Raises
    ------
    InputError, InputErrors
        Every problem of the file at once, each with its line.
    """
    context: dict[str, Any] = {"folder": path.parent}
    return load_yaml(path, SolveControls, context=context)
