"""What the solver is asked to do: arrays and settings, checked once at the door."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.errors import InputError
from replay.solver.arrays import WHERE, checked_array, checked_integers, checked_rows
from replay.solver.contact.settings import ContactControls
from replay.solver.joints import Joint
from replay.solver.kernels.geometry import element_gradients
from replay.solver.materials import LAWS, Material, law_parameters
from replay.solver.prescribed import PrescribedMotion, RigidSet
from replay.solver.straps import Strap
from replay.solver.ties import Tie, check_ties


@dataclass(frozen=True)
class SolverPart:
    """A part: elements of one material that are listed together.

    Parameters
    ----------
    pid
        Number of the part.
    name
        For outputs and messages.
    material
        Of all its elements.
    """

    pid: int
    name: str
    material: Material


@dataclass(frozen=True)
class Controls:
    """Numerical settings, the article's section 3 first.

    Parameters
    ----------
    termination_time_s
        End of the run [s].
    time_step_factor
        Share of the stable step that is used.
    hourglass_method
        ``stiffness`` (the article's method 4), ``selective`` (with 1.9 of the stiffness against bending patterns and
        0.6 of it against twisting ones) or ``viscous``.
    hourglass_coefficient
        kappa in ``k = kappa 2 mu (B:B) / (16 V)`` for the stiffness form, or the usual coefficient of the
        viscous form with the shear wave speed.
    bulk_viscosity_quadratic, bulk_viscosity_linear
        Bulk viscosity, in compression only.
    mass_scaling_time_step_s
        Elements whose step (times the factor) is below this get mass [s]; 0 turns it off.
    gravity_m_per_s2
        Acceleration of free fall.
    plot_interval_s, history_interval_s
        Times between states, and between rows of the histories [s].
    checkpoint_period_s
        Wall-clock time between checkpoints [s]; 0 leaves them to signals.
    time_step_floor_s
        A stable step below this stops the run [s].
    speed_limit_m_per_s
        A faster node stops the run [m/s]; 0 means ten times the fastest prescribed or initial
        speed, or a tenth of the fastest wave where nothing moves at first.
    """

    termination_time_s: float
    time_step_factor: float = 0.9
    hourglass_method: str = "stiffness"
    hourglass_coefficient: float = 0.10
    bulk_viscosity_quadratic: float = 1.2
    bulk_viscosity_linear: float = 0.06
    mass_scaling_time_step_s: float = 1.92e-7
    gravity_m_per_s2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    plot_interval_s: float = 1e-3
    history_interval_s: float = 1e-4
    checkpoint_period_s: float = 60.0
    time_step_floor_s: float = 1e-7
    speed_limit_m_per_s: float = 0.0

    def check(self) -> None:
        """Refuse settings that make no sense.

        Raises
        ------
        InputError
            Naming the setting.
        """
        if self.hourglass_method not in ("stiffness", "selective", "viscous"):
            raise InputError(
                WHERE,
                f"{self.hourglass_method!r} is no hourglass method",
                column="controls.hourglass_method",
                expected="stiffness, selective or viscous",
            )
        for name in ("termination_time_s", "plot_interval_s", "history_interval_s"):
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(WHERE, f"it is {getattr(self, name)!r}", column=f"controls.{name}", expected="> 0")
        if not 0 < self.time_step_factor <= 1:
            raise InputError(
                WHERE,
                f"it is {self.time_step_factor!r}",
                column="controls.time_step_factor",
                expected="above 0, at most 1 (the stability limit)",
            )
        for name in (
            "hourglass_coefficient", "bulk_viscosity_quadratic", "bulk_viscosity_linear", "mass_scaling_time_step_s",
            "checkpoint_period_s", "time_step_floor_s", "speed_limit_m_per_s",
        ):  # fmt: skip
            if not 0 <= getattr(self, name) < math.inf:
                raise InputError(WHERE, f"it is {getattr(self, name)!r}", column=f"controls.{name}", expected=">= 0")
        if len(self.gravity_m_per_s2) != 3 or not np.isfinite(self.gravity_m_per_s2).all():
            raise InputError(
                WHERE, f"it is {self.gravity_m_per_s2!r}", column="controls.gravity_m_per_s2", expected="three numbers"
            )


def _absent() -> NDArray[Any]:
    """Stand in for an array that is not given."""
    return np.empty(0)


def _is_absent(value: Any) -> bool:
    return value is None or np.shape(value) == (0,)


@dataclass(frozen=True)
class Problem:
    """One run of the solver.

    Parameters
    ----------
    nodes : (n, 3) float64
        Coordinates [m].
    hexes : (m, 8) int
        Rows of `nodes`, order (-,-,-) (+,-,-) (+,+,-) (-,+,-) (-,-,+) (+,-,+) (+,+,+) (-,+,+).
    element_part : (m,) int
        Index into `parts`.
    parts
        Parts and their materials.
    controls
        Numerical settings.
    initial_velocity : (n, 3) float64, optional
        At time 0 [m/s]; rigid bodies take the momentum of their nodes. A driven body starts with its driver.
    prescribed
        Motions of driven bodies, one a body; a single one may stand by itself.
    node_ids, element_ids : (n,), (m,) int64, optional
        Numbers in outputs and messages; 1, 2, ... by default.
    fixed : (n, 3) bool, optional
        Degrees of freedom that keep their initial velocity (zero: supports).
    nodal_forces : (n, 3) float64, optional
        Loads from time 0 on [N].
    initial_stress : (m, 6) float64, optional
        Cauchy stress xx, yy, zz, xy, yz, zx at time 0 [Pa]; only for laws that say ``INITIAL_STRESS``.
    rigid_sets
        Nodes that move as bodies.
    joints, straps, ties
        Force elements between bodies, cables through nodes, tied interfaces.
    contact
        Contact of all parts; None lets them pass through each other.

    Raises
    ------
    InputError
        With the node, element or part that cannot be used.
    """

    nodes: NDArray[np.float64]
    hexes: NDArray[np.int64]
    element_part: NDArray[np.int64]
    parts: tuple[SolverPart, ...]
    controls: Controls
    initial_velocity: NDArray[np.float64] = field(default_factory=_absent)
    prescribed: tuple[PrescribedMotion, ...] = ()
    node_ids: NDArray[np.int64] = field(default_factory=_absent)
    element_ids: NDArray[np.int64] = field(default_factory=_absent)
    fixed: NDArray[np.bool_] = field(default_factory=_absent)
    nodal_forces: NDArray[np.float64] = field(default_factory=_absent)
    initial_stress: NDArray[np.float64] = field(default_factory=_absent)
    rigid_sets: tuple[RigidSet, ...] = ()
    joints: tuple[Joint, ...] = ()
    straps: tuple[Strap, ...] = ()
    ties: tuple[Tie, ...] = ()
    contact: ContactControls | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        nodes = checked_array(self.nodes, "nodes", (None, 3))
        n = len(nodes)
        put(self, "nodes", nodes)
        put(self, "hexes", checked_integers(self.hexes, "hexes", (None, 8)))
        m = len(self.hexes)
        put(self, "element_part", checked_integers(self.element_part, "element_part", (m,)))
        put(self, "parts", tuple(self.parts))
        numbers = np.arange(1, n + 1) if _is_absent(self.node_ids) else self.node_ids
        put(self, "node_ids", checked_integers(numbers, "node_ids", (n,)))
        numbers = np.arange(1, m + 1) if _is_absent(self.element_ids) else self.element_ids
        put(self, "element_ids", checked_integers(numbers, "element_ids", (m,)))
        for name, shape in (("initial_velocity", (n, 3)), ("nodal_forces", (n, 3)), ("initial_stress", (m, 6))):
            value = getattr(self, name)
            put(self, name, np.zeros(shape) if _is_absent(value) else checked_array(value, name, shape))
        fixed = np.zeros((n, 3), bool) if _is_absent(self.fixed) else np.array(self.fixed, dtype=bool)
        if fixed.shape != (n, 3):
            raise InputError(WHERE, f"its shape is {fixed.shape}", column="fixed", expected=f"({n}, 3)")
        put(self, "fixed", fixed)
        alone = isinstance(self.prescribed, PrescribedMotion)
        put(self, "prescribed", (self.prescribed,) if alone else tuple(self.prescribed or ()))
        for name in ("rigid_sets", "joints", "straps", "ties"):
            put(self, name, tuple(getattr(self, name)))
        self._check()

    def _check(self) -> None:
        self.controls.check()
        n = len(self.nodes)
        if not len(self.hexes):
            raise InputError(WHERE, "there is no element", column="hexes")
        if self.hexes.min() < 0 or self.hexes.max() >= n:
            row = int(np.argmax(((self.hexes < 0) | (self.hexes >= n)).any(axis=1)))
            raise InputError(
                WHERE,
                f"element {self.element_ids[row]} names a node row that does not exist",
                column="hexes",
                expected=f"rows 0 to {n - 1}",
            )
        if self.element_part.min() < 0 or self.element_part.max() >= len(self.parts):
            raise InputError(
                WHERE,
                "an element belongs to a part that does not exist",
                column="element_part",
                expected=f"indices 0 to {len(self.parts) - 1}",
            )
        for name in ("node_ids", "element_ids"):
            values, counts = np.unique(getattr(self, name), return_counts=True)
            if (counts > 1).any():
                raise InputError(WHERE, f"{values[np.argmax(counts)]} occurs twice", column=name)
        pids = [part.pid for part in self.parts]
        if len(set(pids)) < len(pids):
            raise InputError(WHERE, f"a part number occurs twice in {pids}", column="parts")
        lonely = np.ones(n, bool)
        lonely[self.hexes] = False
        if lonely.any():
            raise InputError(
                WHERE,
                f"node {self.node_ids[np.argmax(lonely)]} belongs to no element and has no mass",
                column="nodes",
                mend="remove it",
            )
        _, volume = gradients(self.nodes, self.hexes)
        if not (volume > 0).all():
            row = int(np.argmax(~(volume > 0)))
            raise InputError(
                WHERE,
                f"element {self.element_ids[row]} of part {self.part_of(row).name!r} has volume {volume[row]:.3g} m^3",
                column="hexes",
                expected="positive volumes",
                mend="its nodes are out of order, or the element is collapsed",
            )
        for part in self.parts:
            law_parameters(part.material)
        if self.contact is not None:
            self.contact.check(pids, [part.pid for part in self.parts if part.material.is_rigid])
        self._check_motion()

    def _check_motion(self) -> None:
        stressed = {self.parts[k].pid for k in self.element_part[(self.initial_stress != 0).any(axis=1)].tolist()}
        for part in self.parts:
            if part.pid in stressed and not LAWS[part.material.law].INITIAL_STRESS:
                raise InputError(
                    WHERE, f"part {part.name!r} of the law {part.material.law!r} has an initial stress",
                    column="initial_stress", expected="only laws whose stress is not a function of the deformation",
                )  # fmt: skip
        self._check_names()
        rigid = self.rigid_names()
        deforming = {part.pid: part.name for part in self.parts if not part.material.is_rigid}
        for rigid_set in self.rigid_sets:
            checked_rows(rigid_set.nodes, f"rigid_sets.{rigid_set.name}.nodes", len(self.nodes))
        for motion in self.prescribed:
            motion.check(rigid, deforming, self.controls.termination_time_s)
        for joint in self.joints:
            joint.check(rigid)
        for strap in self.straps:
            strap.check(self.nodes)
        check_ties(self.ties, self.nodes, self.node_ids, self.fixed)

    def _check_names(self) -> None:
        for kind in ("rigid_sets", "joints", "straps", "ties"):
            names = [item.name for item in getattr(self, kind)]
            for name in names:
                if not name or names.count(name) > 1:
                    raise InputError(
                        WHERE, f"the name {name!r} is empty or occurs twice", column=kind, expected="a name of its own"
                    )

    def rigid_names(self) -> dict[int | str, str]:
        """Rigid parts by number and rigid sets by name: everything that a joint or a motion may name."""
        parts: dict[int | str, str] = {part.pid: part.name for part in self.parts if part.material.is_rigid}
        return parts | {s.name: s.name for s in self.rigid_sets}

    def part_of(self, row: int) -> SolverPart:
        """Part of the element in one row."""
        return self.parts[int(self.element_part[row])]

    def digest(self) -> str:
        """SHA-256 of everything that the result depends on."""
        total = hashlib.sha256()

        def feed(value: Any) -> None:
            if isinstance(value, np.ndarray):
                total.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
            elif isinstance(value, Material):
                feed((value.name, value.law, value.density_kg_per_m3, sorted(dict(value.parameters).items())))
            elif dataclasses.is_dataclass(value):
                for f in dataclasses.fields(value):
                    if f.name != "checkpoint_period_s":  # when a checkpoint is written changes no result
                        total.update(f.name.encode())
                        feed(getattr(value, f.name))
            elif isinstance(value, list | tuple):
                total.update(f"[{len(value)}".encode())
                for item in value:
                    feed(item)
            elif isinstance(value, float | np.floating):
                total.update(float(value).hex().encode() + b";")
            else:
                total.update(repr(value).encode() + b";")

        feed(self)
        return total.hexdigest()


def gradients(coordinates: NDArray[np.float64], hexes: NDArray[np.int64]) -> tuple[NDArray, NDArray]:
    """Modal gradients (m, 18) [m^2] and volumes (m,) [m^3] of elements."""
    result, volume = np.empty((len(hexes), 18)), np.empty(len(hexes))
    element_gradients(np.ascontiguousarray(coordinates), np.ascontiguousarray(hexes), result, volume)
    return result, volume


def initial_velocity_about_axis(
    nodes: ArrayLike, translation: ArrayLike, omega: float, p: ArrayLike, q: ArrayLike
) -> NDArray[np.float64]:
    """Velocities of nodes that move together and turn about the axis from P to Q.

    Parameters
    ----------
    nodes : (n, 3)
        [m].
    translation : (3,)
        Velocity of the axis [m/s].
    omega : float
        Angular velocity, right-handed about P to Q [rad/s].
    p, q : (3,)
        Two points of the axis [m].

    Raises
    ------
    InputError
        When P and Q coincide and there is no axis.
    """
    p, q = np.asarray(p, float), np.asarray(q, float)
    length = np.linalg.norm(q - p)
    if not length > 1e-9:
        raise InputError(
            WHERE,
            f"P and Q are one point {tuple(p.tolist())}",
            column="initial_velocity",
            expected="two points that span the axis",
            mend="move Q along the angular velocity",
        )
    return np.asarray(translation, float) + np.cross(omega * (q - p) / length, np.asarray(nodes, float) - p)
