"""How two players start: from the play's description or its reconstruction, through ``starts.json``, to velocities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from replay.models import Model, Part, load_apparatus
from replay.motion import Kinematics, steady_before
from replay.play import Collision, GivenStart
from replay.solver import initial_velocity_about_axis

ROLES = {"struck": 1, "impactor": 2}
"""The two players of a collision, and the number of each."""
PLAYER_SETS = {"struck": ("head_1", "helmet_1", "body_1"), "impactor": ("head_2", "helmet_2", "body_2", "apparatus")}
"""Sets that together hold all parts of a player: a deck's set is a range of numbers, and no range holds a player."""


@dataclass(frozen=True)
class PlayerStart:
    """Posture and velocities of a player at first contact.

    Parameters
    ----------
    rotation
        Head axes to global.
    velocity_m_per_s
        Of the axis P-Q, global axes, (3,).
    omega_rad_per_s
        Right-handed about P to Q.
    p_m, q_m
        Two points of the axis, from the head CG in head axes, (3,) [m].
    """

    rotation: Rotation
    velocity_m_per_s: np.ndarray
    omega_rad_per_s: float
    p_m: np.ndarray
    q_m: np.ndarray

    def velocities(self, nodes: np.ndarray, head_cg_m: np.ndarray) -> np.ndarray:
        """Velocities (n, 3) of nodes of this player, whose head CG is at `head_cg_m` [m/s]."""
        p, q = (head_cg_m + self.rotation.apply(point) for point in (self.p_m, self.q_m))
        return initial_velocity_about_axis(nodes, self.velocity_m_per_s, self.omega_rad_per_s, p, q)

    def head_velocity(self) -> np.ndarray:
        """Velocity of the head CG (3,) [m/s]."""
        return self.velocities(np.zeros((1, 3)), np.zeros(3))[0]

    def to_json(self) -> dict[str, Any]:
        """Entry of ``starts.json``."""
        return {
            "quaternion_xyzw": self.rotation.as_quat().tolist(),
            "velocity_m_per_s": self.velocity_m_per_s.tolist(),
            "omega_rad_per_s": self.omega_rad_per_s,
            "P_m": self.p_m.tolist(),
            "Q_m": self.q_m.tolist(),
        }

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> PlayerStart:
        """Read an entry of ``starts.json``."""
        return cls(
            Rotation.from_quat(entry["quaternion_xyzw"]),
            np.array(entry["velocity_m_per_s"], float),
            float(entry["omega_rad_per_s"]),
            np.array(entry["P_m"], float),
            np.array(entry["Q_m"], float),
        )


def start_of(collision: Collision, role: str, kinematics: Kinematics | None, window_start_s: float) -> PlayerStart:
    """Start of one player.

    Parameters
    ----------
    collision
        The play's block.
    role
        One of `ROLES`.
    kinematics
        Reconstruction of the tracked head; None where nothing was recorded.
    window_start_s
        Time of first contact on its clock [s].
    """
    player = collision.player(role)
    if player is None:
        return _apparatus_start(collision)
    start = player.start
    if isinstance(start, GivenStart):
        told = PlayerStart(
            Rotation.from_quat(start.orientation),
            np.array(start.velocity_m_per_s, float),
            float(start.omega_rad_per_s),
            np.array(start.p_m, float),
            np.array(start.q_m, float),
        )
        falls = collision.apparatus is not None and load_apparatus(collision.apparatus.name).held == "fixed"
        return replace(told, velocity_m_per_s=-_approach(collision)) if falls else told
    assert kinematics is not None
    before = steady_before(kinematics, window_start_s, start.fit_s)
    rotation, velocity, omega = before.rotation[0], before.velocity_m_per_s[0], before.omega_rad_per_s[0]
    speed = float(np.sqrt(omega @ omega))
    axis = rotation.inv().apply(omega / speed) if speed > 0 else np.array([0.0, 0.0, 1.0])
    return PlayerStart(rotation, velocity, speed, np.zeros(3), axis)


def _apparatus_start(collision: Collision) -> PlayerStart:
    """Start of an apparatus, whose tip and axis x stand for a player's head: it moves unless it is held."""
    assert collision.apparatus is not None
    design = load_apparatus(collision.apparatus.name)
    velocity = np.zeros(3) if design.held == "fixed" else _approach(collision)
    return PlayerStart(_apparatus_rotation(collision), velocity, 0.0, np.zeros(3), np.array([1.0, 0.0, 0.0]))


def _apparatus_rotation(collision: Collision) -> Rotation:
    """Axes of the apparatus to global ones: its place is said in the axes of the struck head."""
    assert collision.apparatus is not None
    place = load_apparatus(collision.apparatus.name).place(collision.apparatus.place)
    start = collision.struck.start
    assert isinstance(start, GivenStart)
    return Rotation.from_quat(start.orientation) * place.rotation


def _approach(collision: Collision) -> np.ndarray:
    """Velocity of the apparatus as seen from the struck head, (3,) [m/s]."""
    assert collision.apparatus is not None
    return collision.apparatus.speed_m_per_s * _apparatus_rotation(collision).apply([1.0, 0.0, 0.0])


def aim_of(collision: Collision) -> np.ndarray:
    """Point through which what strikes would pass, from the struck head's CG in its axes, (3,) [m]."""
    aim = np.array(collision.aim_m, float)
    if collision.apparatus is None:
        return aim
    return aim + np.array(load_apparatus(collision.apparatus.name).place(collision.apparatus.place).aim_m)


def held_part(scene: Model) -> Part | None:
    """The rigid part by which an apparatus is held in place; None where everything is free."""
    facts = scene.info.get("players", [{}])[-1].get("apparatus")
    if facts is None or facts["held"] != "fixed":
        return None
    return next(part for part in scene.parts if part.role == "mount")


def scene_velocities(
    scene: Model, starts: Mapping[str, PlayerStart], head_cg_m: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Initial velocities (n, 3) of both players' nodes [m/s]."""
    velocities = np.zeros_like(scene.nodes)
    for role, number in ROLES.items():
        rows = np.unique(scene.hexes[scene.elements_of(player=number)])
        velocities[rows] = starts[role].velocities(scene.nodes[rows], head_cg_m[role])
    return velocities
