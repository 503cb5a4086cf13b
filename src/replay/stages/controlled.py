"""From ``controls.yaml`` and a model to what the solver is asked: numbers and names become rows and bodies."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.controls import InitialVelocity, JointSettings, Nodes, SolveControls
from replay.errors import InputError, InputErrors
from replay.solver import (
    Controls,
    Joint,
    Material,
    Problem,
    Recorder,
    RigidSet,
    SolverPart,
    Strap,
    Tie,
    element_recorder,
    initial_velocity_about_axis,
    node_recorder,
    outer_faces,
    read_motion,
    tie_surfaces,
)
from replay.stages.solver_model import SolverModel


class _Lookup:
    """Rows by number, with every name that is not there noted rather than raised."""

    def __init__(self, model: SolverModel, file: Path) -> None:
        self.model, self.file = model, file
        self.errors: list[InputError] = []
        self._node = {int(n): k for k, n in enumerate(model.node_ids)}
        self._element = {int(n): k for k, n in enumerate(model.element_ids)}
        self._pids = [part.pid for part in model.parts]

    def miss(self, column: str, found: str, expected: str = "", mend: str = "correct the number or the name") -> None:
        self.errors.append(InputError(self.file, found, column=column, expected=expected, mend=mend))

    def _rows(self, table: dict[int, int], ids: Iterable[int], column: str, what: str) -> NDArray[np.int64]:
        rows = []
        for number in ids:
            if number in table:
                rows.append(table[number])
            else:
                self.miss(column, f"the model has no {what} {number}")
        return np.array(rows, np.int64)

    def node_rows(self, ids: Iterable[int], column: str) -> NDArray[np.int64]:
        return self._rows(self._node, ids, column, "node")

    def path(self, places: Iterable[int | str], column: str) -> NDArray[np.int64]:
        """Rows of nodes in order, each by its number or by the name of a set that holds it alone."""
        rows = []
        for place in places:
            found = self.model.node_sets.get(place) if isinstance(place, str) else self.node_rows([place], column)
            if found is None or len(found) > 1:
                self.miss(
                    column, f"the model has no set {place!r} of one node",
                    ", ".join(name for name, members in self.model.node_sets.items() if len(members) == 1),
                )  # fmt: skip
            else:
                rows += [int(row) for row in found]
        return np.array(rows, np.int64)

    def element_rows(self, ids: Iterable[int], column: str) -> NDArray[np.int64]:
        return self._rows(self._element, ids, column, "element")

    def pids(self, pids: Iterable[int], column: str) -> list[int]:
        found = []
        for pid in pids:
            if pid in self._pids:
                found.append(pid)
            else:
                self.miss(column, f"the model has no part {pid}", ", ".join(map(str, self._pids)))
        return found

    def part_nodes(self, pids: Iterable[int]) -> NDArray[np.int64]:
        chosen = [k for k, pid in enumerate(self._pids) if pid in set(pids)]
        return np.unique(self.model.hexes[np.isin(self.model.element_part, chosen)])

    def nodes(self, chosen: Nodes, column: str) -> NDArray[np.int64]:
        if chosen.node_set is not None:
            if chosen.node_set in self.model.node_sets:
                return np.asarray(self.model.node_sets[chosen.node_set], np.int64)
            self.miss(
                f"{column}.node_set", f"the model has no node set {chosen.node_set!r}",
                ", ".join(self.model.node_sets) or "this model has none",
            )  # fmt: skip
            return np.empty(0, np.int64)
        if chosen.parts:
            return self.part_nodes(self.pids(chosen.parts, f"{column}.parts"))
        return np.unique(self.node_rows(chosen.nodes, f"{column}.nodes"))


@dataclasses.dataclass(frozen=True)
class SolveTask:
    """What `replay solve` does.

    Parameters
    ----------
    problem
        For the solver.
    recorders
        Histories of nodes and elements that were asked for.
    notes
        What a user should know of how the problem was made.
    """

    problem: Problem
    recorders: list[Recorder]
    notes: list[str]


def build_task(model: SolverModel, controls: SolveControls, file: Path) -> SolveTask:
    """Bring a model and its controls together.

    Parameters
    ----------
    model
        As read.
    controls
        As read from `file`.
    file
        For messages, and the folder of the motions.

    Raises
    ------
    InputError, InputErrors
        Every number and name that the model does not have, at once; then what the solver refuses.
    """
    look = _Lookup(model, file)
    notes: list[str] = []
    nodes = np.array(model.nodes, float)
    parts = _parts(look, controls)
    rigid_sets = [RigidSet(s.name, look.nodes(s, f"rigid_sets[{k}]")) for k, s in enumerate(controls.rigid_sets)]
    pieces = [_faces(look, t, f"ties[{k}]") for k, t in enumerate(controls.ties)]
    straps = [
        Strap(
            s.name, look.path(s.nodes, f"straps[{k}].nodes"), s.stiffness_n_per_m, s.damping_n_s_per_m, s.slack_m,
            s.pay_in_m, s.pay_in_time_s,
        )
        for k, s in enumerate(controls.straps)
    ]  # fmt: skip
    fixed, loads = np.zeros(nodes.shape, bool), np.zeros(nodes.shape)
    for k, support in enumerate(controls.supports):
        rows = look.nodes(support, f"supports[{k}]")
        for axis in support.axes:
            fixed[rows, "xyz".index(axis)] = True
    for k, load in enumerate(controls.loads):
        rows = look.nodes(load, f"loads[{k}]")
        loads[rows] += np.array(load.force_n) / max(len(rows), 1)
    chosen = [_moved(look, v, f"initial_velocities[{k}]") for k, v in enumerate(controls.initial_velocities)]
    for k, motion in enumerate(controls.prescribed_motions):
        look.pids(motion.parts, f"prescribed_motions[{k}].parts")
    written = (
        look.node_rows(controls.output.nodes, "output.nodes"),
        look.element_rows(controls.output.elements, "output.elements"),
    )
    if look.errors:
        raise look.errors[0] if len(look.errors) == 1 else InputErrors(look.errors)
    ties: list[Tie] = []
    for settings, (tied, masters) in zip(controls.ties, pieces):
        found = tie_surfaces(settings.name, nodes, tied, masters, settings.tolerance_m)
        nodes = found.nodes
        ties.append(found.tie)
        notes.append(
            f"tie {settings.name}: {len(found.tie.nodes)} nodes tied, moved by up to {1e3 * found.moved_m:.3g} mm"
            + (f", {len(found.loose)} too far and free" if len(found.loose) else "")
        )
    velocity = np.zeros(nodes.shape)
    for rows, v in zip(chosen, controls.initial_velocities):
        p = v.p_m or (0.0, 0.0, 0.0)
        q = v.q_m or (p[0], p[1], p[2] + 1.0)
        velocity[rows] += initial_velocity_about_axis(nodes[rows], v.velocity_m_per_s, v.omega_rad_per_s, p, q)
    problem = Problem(
        nodes=nodes, hexes=model.hexes, element_part=model.element_part, parts=parts, controls=_numbers(controls),
        initial_velocity=velocity,
        prescribed=tuple(read_motion(file.parent / m.file, m.parts, m.rigid_sets) for m in controls.prescribed_motions),
        node_ids=model.node_ids, element_ids=model.element_ids, fixed=fixed, nodal_forces=loads,
        rigid_sets=(*model.rigid_sets, *rigid_sets), joints=(*model.joints, *map(_joint, controls.joints)),
        straps=tuple(straps), ties=tuple(ties),
    )  # fmt: skip
    recorders: list[Recorder] = []
    if len(written[0]):
        recorders.append(node_recorder(problem, written[0]))
    if len(written[1]):
        recorders.append(element_recorder(problem, written[1]))
    return SolveTask(problem, recorders, notes)


def _numbers(c: SolveControls) -> Controls:
    return Controls(
        termination_time_s=c.termination_time_s,
        time_step_factor=c.time_step_factor,
        hourglass_method="viscous" if c.hourglass.method == "viscous" else "stiffness",
        hourglass_coefficient=c.hourglass.coefficient,
        bulk_viscosity_quadratic=c.bulk_viscosity.quadratic,
        bulk_viscosity_linear=c.bulk_viscosity.linear,
        mass_scaling_time_step_s=c.mass_scaling_time_step_s,
        gravity_m_per_s2=c.gravity_m_per_s2,
        plot_interval_s=min(c.output.plot_interval_s, c.termination_time_s),
        history_interval_s=min(c.output.history_interval_s, c.termination_time_s),
        checkpoint_period_s=c.checkpoint_period_s,
        time_step_floor_s=c.time_step_floor_s,
        speed_limit_m_per_s=c.speed_limit_m_per_s,
    )


def _parts(look: _Lookup, controls: SolveControls) -> tuple[SolverPart, ...]:
    own: dict[int, Material] = {}
    for k, m in enumerate(controls.materials):
        values: dict[str, Any] = dict(m.parameters)
        material = Material(f"materials[{k}]", m.law, m.density_kg_per_m3, values)
        own |= dict.fromkeys(look.pids(m.parts, f"materials[{k}].parts"), material)
    for pid, keyword in look.model.unknown.items():
        if pid not in own:
            look.miss(
                "materials", f"part {pid} has {keyword}, which is not read", "a law of docs/physics.md",
                "name the part under materials with a law of its own",
            )  # fmt: skip
    return tuple(dataclasses.replace(p, material=own.get(p.pid, p.material)) for p in look.model.parts)


def _faces(look: _Lookup, settings: Any, column: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Outer faces of the tied and of the leading parts."""
    found = []
    for key in ("tied_parts", "master_parts"):
        pids = look.pids(getattr(settings, key), f"{column}.{key}")
        index = [k for k, part in enumerate(look.model.parts) if part.pid in pids]
        found.append(outer_faces(look.model.hexes[np.isin(look.model.element_part, index)]))
    return found[0], found[1]


def _moved(look: _Lookup, velocity: InitialVelocity, column: str) -> NDArray[np.int64]:
    """Rows of the nodes that an initial velocity is given to."""
    if velocity.part_set is not None:
        if velocity.part_set not in look.model.part_sets:
            look.miss(
                f"{column}.part_set", f"the model has no part set {velocity.part_set!r}",
                ", ".join(look.model.part_sets) or "this model has none",
            )  # fmt: skip
            return np.empty(0, np.int64)
        return look.part_nodes(look.model.part_sets[velocity.part_set])
    if velocity.parts:
        return look.part_nodes(look.pids(velocity.parts, f"{column}.parts"))
    return np.arange(len(look.model.nodes))


def _joint(j: JointSettings) -> Joint:
    x = np.array(j.x_axis) / np.linalg.norm(j.x_axis)
    y = np.cross(j.z_axis, x)
    y /= np.linalg.norm(y)
    extension = j.flexion_n_m_per_rad if j.extension_n_m_per_rad is None else j.extension_n_m_per_rad
    stiffness = [
        [j.lateral_n_m_per_rad, j.lateral_n_m_per_rad],
        [j.flexion_n_m_per_rad, extension],
        [j.torsion_n_m_per_rad, j.torsion_n_m_per_rad],
    ]
    return Joint(
        j.name, j.first, j.second, np.array(j.centre_m), np.array(stiffness), j.damping_ratio,
        j.centre_stiffness_n_per_m, j.centre_damping_ratio, np.stack([x, y, np.cross(x, y)]),
    )  # fmt: skip
