"""Initial penetration: found, and taken out by moving nodes, or refused with the parts and places.

The article's step 3.1 eliminates initial penetrations by "element projection". Here every slave point that lies inside
another piece of mesh is brought to the surface of the face it is behind. Both sides give way, each node by its inverse
mass, a rigid part not at all; the moves are small or the model is not seated at all, and then it is refused.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.errors import InputError
from replay.solver.contact.contact import slave_points
from replay.solver.contact.rooms import mesh_of, room_for_hits, room_for_slots
from replay.solver.contact.search import Search
from replay.solver.contact.settings import WHERE, ContactControls, pair_table
from replay.solver.contact.surface import Surface, extract_surface
from replay.solver.kernels.contact_detect import penetrations
from replay.solver.kernels.lanes import NODE_COLUMNS
from replay.solver.problem import Problem, gradients
from replay.tables import Column, TableFormat

#: A node may move this share of its shortest edge; an element may keep no less than this share of its volume.
MOST_MOVE = 0.3
LEAST_VOLUME = 0.1
#: A point this share of the typical edge inside a face is not inside.
TOUCHING = 1e-6
# a point this share of a face's size inside it is not taken for one that touches
_STARTS_INSIDE = 1e-3
_MOST_ROUNDS = 400
_MOST_PLACES = 6

PENETRATION_TABLE = TableFormat(
    "initial penetrations",
    (
        Column("part", "part of the node that was inside, or gave way", "text"),
        Column("pid", "its number", "int"),
        Column("other_part", "part that it touched first", "text"),
        Column("other_pid", "its number", "int"),
        Column("node_id", "number of the node", "int"),
        Column("x_m", "where it was"),
        Column("y_m", "the same"),
        Column("z_m", "the same"),
        Column("depth_m", "how deep it was inside; 0 where it only gave way"),
        Column("moved_m", "how far it was moved"),
        Column("moved_over_edge", "the same over its shortest edge"),
    ),
)


@dataclass(frozen=True)
class Seating:
    """What was found and done about initial penetration.

    Parameters
    ----------
    nodes : (n, 3) float64
        Coordinates without penetration [m].
    rows : (k,) int64
        Nodes that moved, or were inside.
    depth_m, moved_m, moved_over_edge : (k,) float64
        Depth before, distance moved [m], and over the node's shortest edge.
    part, other : (k,) int64
        Part indices of the node and of what it met.
    deepest_before_m, deepest_m
        Deepest penetration before and after [m].
    volume_ratio
        Least volume of an element over its volume before.
    """

    nodes: NDArray[np.float64]
    rows: NDArray[np.int64]
    depth_m: NDArray[np.float64]
    moved_m: NDArray[np.float64]
    moved_over_edge: NDArray[np.float64]
    part: NDArray[np.int64]
    other: NDArray[np.int64]
    deepest_before_m: float
    deepest_m: float
    volume_ratio: float

    @property
    def share_moved(self) -> float:
        """Farthest move over the node's shortest edge."""
        return float(self.moved_over_edge.max(initial=0.0))

    @property
    def sound(self) -> bool:
        """Whether nothing is left inside, no node moved too far, and no element is crushed."""
        seated = self.deepest_m <= 0.0 and self.share_moved <= MOST_MOVE
        return seated and self.volume_ratio >= LEAST_VOLUME

    def places(self, names: Mapping[int, str] | list[str], before: NDArray[np.float64]) -> list[str]:
        """Where the worst of each pair of parts is: a clause each, deepest first.

        Parameters
        ----------
        names
            Of the parts by index.
        before : (n, 3) float64
            Coordinates before [m].
        """
        clauses, seen = [], set()
        for k in np.lexsort((self.rows, -self.depth_m)):
            pair = frozenset((int(self.part[k]), int(self.other[k])))
            if self.depth_m[k] <= 0 or pair in seen:
                continue
            seen.add(pair)
            x, y, z = before[self.rows[k]]
            clauses.append(
                f"{names[int(self.part[k])]} {1e3 * self.depth_m[k]:.2f} mm inside {names[int(self.other[k])]} at "
                f"({x:.4f}, {y:.4f}, {z:.4f}) m"
            )
        return clauses


class _Prober:
    """Finds the slave points of a mesh that lie inside another piece of it."""

    def __init__(self, problem: Problem, controls: ContactControls) -> None:
        self._problem = problem
        n = len(problem.nodes)
        tied = np.concatenate([np.empty(0, np.int64), *(tie.nodes for tie in problem.ties)])
        self.surface: Surface = extract_surface(problem.hexes, problem.element_part, n, tied)
        surface = self.surface
        self._mesh = mesh_of(surface)
        table = pair_table(controls, [part.pid for part in problem.parts])
        awake = slave_points(surface, problem.nodes, controls)
        loose = np.full(n, -1, np.int64)
        self._search = Search(surface, self._mesh, table.active, loose, awake, problem.nodes)
        self.edge = self._search.edge
        # anything deeper than this is refused for its neighbours, which are not as deep
        self._reach = 2.0 * self._search.longest_edge
        self.slots = room_for_slots(surface.n_points)
        self._nodal = np.zeros((n, NODE_COLUMNS))

    def probe(self, nodes: NDArray[np.float64]) -> NDArray[np.int64]:
        """Slave points inside something, with their face, gap, normal and shares in slot 0 of `slots`."""
        self._nodal[:, :3] = nodes
        self._search.update(self._nodal, 0.0, self._reach)
        hits = room_for_hits(len(self._search.candidates))
        penetrations(
            self._nodal, self._mesh, self._search.points, self._search.first, self._search.candidates, self._reach,
            hits, self.slots,
        )  # fmt: skip
        return np.flatnonzero(self.slots.active[:, 0] & (self.slots.gap[:, 0] < -TOUCHING * self.edge))

    def incidence(self, points: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Node rows and shares (k, 8) of the constraints of these points: 1 or 4 of the point, 4 of the face."""
        surface, n = self.surface, len(self.surface.nodes)
        own = np.zeros((len(points), 4), np.int64)
        share = np.zeros((len(points), 4))
        is_node = points < n
        own[is_node, 0], share[is_node, 0] = surface.nodes[points[is_node]], 1.0
        own[~is_node], share[~is_node] = surface.faces[points[~is_node] - n], 0.25
        face = surface.faces[self.slots.face[points, 0]]
        return np.hstack([own, face]), np.hstack([share, -self.slots.shape[points, 0]])


def seat(problem: Problem) -> Seating:
    """Find initial penetration and move nodes until there is none.

    Parameters
    ----------
    problem
        With contact.

    Returns
    -------
    Seating
        Whether the result may be used is `Seating.sound`.
    """
    controls = problem.contact or ContactControls()
    prober = _Prober(problem, controls)
    mobility = _mobility(problem)
    nodes = problem.nodes.copy()
    inside = prober.probe(nodes)
    surface = prober.surface
    first_depth = np.zeros(surface.n_points)
    first_depth[inside] = -prober.slots.gap[inside, 0]
    met = np.full(len(nodes), -1)
    part_of = np.full(len(nodes), -1)
    part_of[surface.nodes] = surface.node_part
    depth = np.zeros(len(nodes))
    deepest_before = deepest = float(first_depth.max(initial=0.0))
    for _ in range(_MOST_ROUNDS):
        if not len(inside):
            deepest = 0.0
            break
        rows, share = prober.incidence(inside)
        gap, normal = prober.slots.gap[inside, 0], prober.slots.normal[inside, 0]
        other = surface.part[prober.slots.face[inside, 0]]
        own = surface.point_parts()[inside]
        for k in range(8):
            touched = share[:, k] != 0
            fresh = touched & (met[rows[:, k]] < 0)
            met[rows[fresh, k]] = (other if k < 4 else own)[fresh]
        # the multipliers' own iteration, on lengths: one over the row sum never overshoots
        load = np.bincount(rows.ravel(), np.abs(share).ravel(), len(nodes))
        weight = (np.abs(share) * (mobility * load)[rows]).sum(axis=1)
        push = np.divide(-gap + TOUCHING * prober.edge, weight, out=np.zeros(len(gap)), where=weight > 0)
        for k in range(8):
            np.add.at(nodes, rows[:, k], (mobility[rows[:, k]] * share[:, k] * push)[:, None] * normal)
        inside = prober.probe(nodes)
        deepest = float(-prober.slots.gap[inside, 0].min(initial=0.0))
    count = len(surface.nodes)
    depth[surface.nodes] = first_depth[:count]
    moved = np.sqrt(((nodes - problem.nodes) ** 2).sum(axis=1))
    chosen = np.flatnonzero((moved > 0) | (depth > 0))
    _, before = gradients(problem.nodes, problem.hexes)
    _, after = gradients(nodes, problem.hexes)
    return Seating(
        nodes=nodes, rows=chosen, depth_m=depth[chosen], moved_m=moved[chosen],
        moved_over_edge=(moved / _shortest_edges(problem))[chosen], part=part_of[chosen], other=met[chosen],
        deepest_before_m=deepest_before, deepest_m=deepest, volume_ratio=float((after / before).min()),
    )  # fmt: skip


def seated(problem: Problem) -> tuple[Problem, Seating]:
    """Take initial penetration out of a problem.

    Returns
    -------
    tuple of Problem and Seating
        The problem with the moved nodes, and what was moved.

    Raises
    ------
    InputError
        Where a node would move more than 0.3 of its shortest edge, an element keep less than a tenth of its volume, or
        something stay inside: with the parts and places.
    """
    found = seat(problem)
    if not found.sound:
        raise InputError(
            WHERE, _sentence(found, problem),
            expected=f"moves of at most {MOST_MOVE:g} of a node's shortest edge (this takes {found.share_moved:.2g}), "
            f"volumes of at least {LEAST_VOLUME:g} of what they were (this leaves {found.volume_ratio:.2g})",
            mend="seat the parts apart in the mesh; projection is for small overlaps",
        )  # fmt: skip
    return (problem if not len(found.rows) else dataclasses.replace(problem, nodes=found.nodes)), found


def refuse_penetration(problem: Problem) -> None:
    """Refuse a problem whose parts lie inside each other at time 0.

    Raises
    ------
    InputError
        With the parts and places.
    """
    if problem.contact is None:
        return
    prober = _Prober(problem, problem.contact)
    inside = prober.probe(problem.nodes)
    deep = -prober.slots.gap[inside, 0] > _STARTS_INSIDE * prober.slots.size[inside, 0]
    if deep.any():
        raise InputError(
            WHERE, _sentence(seat(problem), problem), expected="parts that touch or stand apart at the start",
            mend="take small overlaps out with replay.solver.contact.projection.seated, or seat the parts apart",
        )  # fmt: skip


def _sentence(found: Seating, problem: Problem) -> str:
    places = found.places([part.name for part in problem.parts], problem.nodes)
    more = f"; {len(places) - _MOST_PLACES} more" if len(places) > _MOST_PLACES else ""
    return "parts lie inside each other: " + "; ".join(places[:_MOST_PLACES]) + more


def penetration_table(found: Seating, problem: Problem) -> dict[str, list]:
    """Columns of `PENETRATION_TABLE`."""
    own = [problem.parts[int(k)] for k in found.part]
    other = [problem.parts[int(k)] if k >= 0 else None for k in found.other]
    place = problem.nodes[found.rows]
    return {
        "part": [part.name for part in own],
        "pid": [part.pid for part in own],
        "other_part": [part.name if part else "" for part in other],
        "other_pid": [part.pid if part else 0 for part in other],
        "node_id": problem.node_ids[found.rows].tolist(),
        "x_m": place[:, 0].tolist(),
        "y_m": place[:, 1].tolist(),
        "z_m": place[:, 2].tolist(),
        "depth_m": found.depth_m.tolist(),
        "moved_m": found.moved_m.tolist(),
        "moved_over_edge": found.moved_over_edge.tolist(),
    }


def _mobility(problem: Problem) -> NDArray[np.float64]:
    """Inverse lumped mass of each node [1/kg]; zero in rigid parts and where a support holds it."""
    _, volume = gradients(problem.nodes, problem.hexes)
    density = np.array([part.material.density_kg_per_m3 for part in problem.parts])[problem.element_part]
    mass = np.bincount(problem.hexes.ravel(), np.repeat(volume * density / 8, 8), len(problem.nodes))
    rigid = np.array([part.material.is_rigid for part in problem.parts])[problem.element_part]
    held = np.array(problem.fixed.any(axis=1))
    held[problem.hexes[rigid]] = True
    return np.where(held, 0.0, 1.0 / mass)


def _shortest_edges(problem: Problem) -> NDArray[np.float64]:
    """Shortest element edge at each node [m]."""
    result = np.full(len(problem.nodes), np.inf)
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)):
        first, second = problem.hexes[:, a], problem.hexes[:, b]
        length = np.sqrt(((problem.nodes[first] - problem.nodes[second]) ** 2).sum(axis=1))
        np.minimum.at(result, first, length)
        np.minimum.at(result, second, length)
    return result
