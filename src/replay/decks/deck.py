"""What a deck says, independent of the format it is written in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class DeckPart:
    """A part with its material.

    Parameters
    ----------
    pid
        Part number, at most eight digits.
    name
        Name.
    law
        ``elastic``, ``rigid``, ``viscohyperelastic``, ``fluid`` or ``crushable_foam``.
    density_kg_per_m3
        Density.
    parameters
        Constants of the law, units in their names.
    assembly
        ``head`` or ``helmet``: the helmet goes to an include of its own.
    """

    pid: int
    name: str
    law: str
    density_kg_per_m3: float
    parameters: Mapping[str, Any]
    assembly: str


@dataclass(frozen=True)
class PartSet:
    """A set of parts, by list or by range of numbers."""

    sid: int
    name: str
    pids: tuple[int, ...]


@dataclass(frozen=True)
class NumberedSet:
    """A set of nodes or elements.

    Parameters
    ----------
    sid, name
        Number and title.
    rows
        Of the deck's nodes or elements, (k,).
    """

    sid: int
    name: str
    rows: np.ndarray


@dataclass(frozen=True)
class Cable:
    """A strap between two nodes that carries tension only.

    Parameters
    ----------
    name
        Title of its part.
    first, second
        Rows of the deck's nodes.
    stiffness_n_per_m
        Of the cable as a whole.
    slack_m
        Elongation from which on it pulls.
    """

    name: str
    first: int
    second: int
    stiffness_n_per_m: float
    slack_m: float = 0.0


@dataclass(frozen=True)
class FrictionType:
    """A friction law: static and dynamic coefficient."""

    number: int
    kind: int
    static: float
    dynamic: float


@dataclass(frozen=True)
class FrictionPair:
    """Friction between a part and a part or set, of one type."""

    first: int
    second: int
    friction_type: int
    name: str


@dataclass(frozen=True)
class InitialVelocity:
    """Velocities of a part set: translation, and a rotation about the axis from P to Q.

    Parameters
    ----------
    set_id
        Part set.
    velocity_m_per_s
        Global, (3,).
    omega_rad_per_s
        Angular speed about P-Q, right-handed, >= 0.
    p_m, q_m
        Points of the axis, (3,) [m]; where omega is 0 they only name a direction.
    """

    set_id: int
    velocity_m_per_s: tuple[float, float, float]
    omega_rad_per_s: float
    p_m: tuple[float, float, float]
    q_m: tuple[float, float, float]


@dataclass(frozen=True)
class DeckControls:
    """The article's section 3.3, SI units."""

    termination_time_s: float = 30.0e-3
    time_step_factor: float = 0.9
    plot_interval_s: float = 1.0e-3
    history_interval_s: float = 1.0e-3
    memory_gbyte: int = 32
    hourglass_method: int = 4
    hourglass_coefficient: float = 0.10
    bulk_viscosity_quadratic: float = 1.2
    bulk_viscosity_linear: float = 0.06
    mass_scaling_time_step_s: float = 1.92e-7
    mass_scaling_restart: int = 1
    contact_scheme: int = 3
    contact_adaptive: int = 3
    contact_constraint: int = 0
    contact_iterations: int = 20
    contact_tolerance: float = 1.0e-3


@dataclass(frozen=True)
class Driver:
    """Prescribed motion of a rigid part's centre: velocities against time.

    Parameters
    ----------
    pid
        The rigid part.
    time_s
        (k,).
    velocity_m_per_s, omega_rad_per_s
        Global, (k, 3).
    """

    pid: int
    time_s: np.ndarray
    velocity_m_per_s: np.ndarray
    omega_rad_per_s: np.ndarray


ARTICLE_FRICTION_TYPES = (FrictionType(1, 0, 0.5, 0.5), FrictionType(2, 0, 0.5, 0.5))
ARTICLE_FRICTION_PAIRS = (
    FrictionPair(60009020, 10000099, 1, "H1_pads_set1_to_skin"),
    FrictionPair(60009020, 10000100, 1, "H1_pads_set2_to_skin"),
    FrictionPair(60009020, 10000181, 2, "H1_Chincup_to_skin"),
)


@dataclass(frozen=True)
class DeckInput:
    """Everything a deck writer needs, as arrays.

    Parameters
    ----------
    title
        One line.
    nodes
        (n, 3) [m], in the global frame at the start of the run.
    node_ids
        (n,), at most eight digits.
    hexes
        Rows of `nodes`, (m, 8).
    element_ids
        (m,), at most eight digits.
    element_part
        Index into `parts`, (m,).
    parts, part_sets
        Parts and sets.
    controls
        Numerical controls.
    initial_velocities
        Where one is empty the deck starts from rest.
    driver
        Prescribed motion, or None.
    friction_types, friction_pairs
        The article's unless given.
    contact
        Whether parts touch: then there is a contact of everything, and one a friction pair; otherwise parts that touch
        share nodes.
    node_sets, element_sets
        Sets of nodes and of elements.
    cables
        Straps.
    facts
        What no card can say; see `replay.decks.facts`.
    """

    title: str
    nodes: np.ndarray
    node_ids: np.ndarray
    hexes: np.ndarray
    element_ids: np.ndarray
    element_part: np.ndarray
    parts: tuple[DeckPart, ...]
    part_sets: tuple[PartSet, ...]
    controls: DeckControls = DeckControls()
    initial_velocities: tuple[InitialVelocity, ...] = ()
    driver: Driver | None = None
    friction_types: tuple[FrictionType, ...] = ARTICLE_FRICTION_TYPES
    friction_pairs: tuple[FrictionPair, ...] = ARTICLE_FRICTION_PAIRS
    notes: tuple[str, ...] = field(default_factory=tuple)
    contact: bool = False
    node_sets: tuple[NumberedSet, ...] = ()
    element_sets: tuple[NumberedSet, ...] = ()
    cables: tuple[Cable, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for what, numbers in (
            ("node", self.node_ids),
            ("element", self.element_ids),
            ("part", np.array([part.pid for part in self.parts])),
        ):
            if len(numbers) and (int(np.min(numbers)) < 1 or int(np.max(numbers)) > 99_999_999):
                message = f"a {what} number outside 1 to 99,999,999 does not fit an eight-column field"
                raise ValueError(message)
            if len(np.unique(numbers)) != len(numbers):
                message = f"{what} numbers occur twice"
                raise ValueError(message)


def deck_parts(parts: Sequence[Any], materials: Mapping[str, Mapping[str, Any]]) -> tuple[DeckPart, ...]:
    """Deck parts from a model's parts (``pid``, ``name``, ``material``, ``assembly``) and its materials."""
    return tuple(
        DeckPart(
            pid=int(part.pid),
            name=str(part.name),
            law=str(materials[part.material]["law"]),
            density_kg_per_m3=float(materials[part.material]["density_kg_per_m3"]),
            parameters=materials[part.material]["parameters"],
            assembly=str(part.assembly),
        )
        for part in parts
    )


def axis_through(
    point_m: np.ndarray, omega_rad_per_s: np.ndarray
) -> tuple[float, tuple[float, float, float], tuple[float, float, float]]:
    """Angular speed and two points P, Q one metre apart on the axis of a rotation through a point.

    Parameters
    ----------
    point_m
        A point of the axis, (3,) [m]: the body's centre of gravity, whose velocity is then the translation.
    omega_rad_per_s
        Angular velocity, (3,); at rest the axis is z.

    Returns
    -------
    tuple
        ``|omega|``, P, Q, with ``omega = |omega| (Q - P)``.
    """
    omega = np.asarray(omega_rad_per_s, dtype=float)
    speed = float(np.sqrt(np.sum(omega**2)))
    axis = omega / speed if speed > 0 else np.array([0.0, 0.0, 1.0])
    p = np.asarray(point_m, dtype=float)
    q = p + axis
    return speed, (float(p[0]), float(p[1]), float(p[2])), (float(q[0]), float(q[1]), float(q[2]))
