"""The article's card, ``velodyne.card``: section 3 of the protocol, keyword by keyword, and a reader for it.

The solver's manual is not public; the card holds what the article prints, in its words and order. A setting is
``Keyword: values``, text after ``!`` is a comment, a line that starts with a blank continues the definition above.
Meshes are keyword files beside the card, which ``ls2vel+`` converts (step 1.5).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from replay.decks.deck import DeckInput, FrictionPair, FrictionType, InitialVelocity, PartSet
from replay.decks.lsdyna import mesh_text
from replay.decks.slurm import write_submit
from replay.errors import InputError
from replay.files import read_text, write_text

CARD = "velodyne.card"
_MESH_FILES = {"helmet": "helmet_H1.k", "head": "head_1.k"}
_ALL_PARTS = (99, 1, 899_999_999, "All_parts_in_range")


def write_velodyne(folder: str | Path, deck: DeckInput) -> list[Path]:
    """Write the card, its meshes and ``submit.slurm.sh`` into a folder.

    Parameters
    ----------
    folder
        Where; made if it is not there.
    deck
        What.

    Returns
    -------
    list of Path
        The files.
    """
    folder = Path(folder)
    written = []
    assemblies = [a for a in _MESH_FILES if any(part.assembly == a for part in deck.parts)]
    for assembly in assemblies:
        path = folder / _MESH_FILES[assembly]
        write_text(path, mesh_text(deck, assembly))
        written.append(path)
    write_text(folder / CARD, card_text(deck, [_MESH_FILES[a] for a in assemblies]))
    written.append(folder / CARD)
    written.append(write_submit(folder, "replay-velodyne", f'srun "${{VELODYNE:-velodyne}}" {CARD}'))
    return written


def card_text(deck: DeckInput, includes: list[str]) -> str:
    """Text of the card."""
    c = deck.controls
    lines = [
        f"! {deck.title}",
        "! units: m, kg, s, N, Pa, J (SI)",
        *(f"! {note}" for note in deck.notes),
        "! global simulation controls (3.3)",
        "Solution type: 0 ! explicit structural",
        f"Global memory size: {c.memory_gbyte} ! Gbyte",
        f"Termination time: {_real(c.termination_time_s)} ! s",
        f"Time step scale factor: {_real(c.time_step_factor)}",
        f"Plot state frequency: {_real(c.plot_interval_s)} 0 ! s",
        f"Time history frequency: {_real(c.history_interval_s)} 0 ! s",
        "! hourglass: stiffness form for all parts, no overrides",
        f"Hourglass stabilization method: {c.hourglass_method}",
        f"Hourglass stabilization coefficient: {_real(c.hourglass_coefficient)}",
        "Bulk viscosity: 1",
        f"Quadratic bulk viscosity: {_real(c.bulk_viscosity_quadratic)}",
        f"Linear bulk viscosity: {_real(c.bulk_viscosity_linear)}",
        "! mass scaling of all parts",
        "Part set definition: " + " ".join(str(v) for v in _ALL_PARTS),
        f"Mass scaling timestep: {_real(c.mass_scaling_time_step_s)} ! s",
        f"Mass scaling restart option: {c.mass_scaling_restart}",
        f"Mass scaling part definition: {_ALL_PARTS[0]} 1",
        "! meshes, before anything that refers to their parts (1.6)",
        *(f"Include: {name}" for name in includes),
        "! part sets (3.2)",
    ]
    lines += [_set_line(part_set, deck) for part_set in deck.part_sets if part_set.sid != _ALL_PARTS[0]]
    lines.append("! contact (3.3)")
    lines += [
        f"Contact scheme: {c.contact_scheme} ! Lagrange multiplier",
        f"Curvature based adaptive contact option: {c.contact_adaptive} ! center + corners",
        f"Contact constraint type: {c.contact_constraint} ! velocity constraint",
        f"Max number of contact iterations: {c.contact_iterations}",
        f"Contact convergence tolerance: {_real(c.contact_tolerance)}",
        "! friction (3.2): number, type; static and dynamic coefficient",
    ]
    for friction in deck.friction_types:
        lines += [
            f"Friction type definition: {friction.number} {friction.kind}",
            f" {_real(friction.static)} {_real(friction.dynamic)}",
        ]
    lines += [
        f"Friction pair definition: {pair.first} {pair.second} {pair.friction_type} exteriorfric ! {pair.name}"
        for pair in deck.friction_pairs
    ]
    if deck.initial_velocities:
        lines.append(
            "! initial velocities (3.6): set, 1 = part set, vx vy vz omega; axis P Q, omega right-handed P to Q"
        )
    for velocity in deck.initial_velocities:
        values = " ".join(_real(v) for v in (*velocity.velocity_m_per_s, velocity.omega_rad_per_s))
        lines += [
            f"Initial velocity definition: {velocity.set_id} 1 {values}",
            " " + " ".join(_real(v) for v in (*velocity.p_m, *velocity.q_m)),
        ]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class VelodyneCard:
    """A card as read.

    Parameters
    ----------
    settings
        Keyword, as written, to its values.
    part_sets
        Set number to (first, last, name): the parts in that range of numbers.
    friction_types, friction_pairs, initial_velocities, includes
        The definitions.
    """

    settings: dict[str, tuple[float, ...]]
    part_sets: dict[int, tuple[int, int, str]]
    friction_types: tuple[FrictionType, ...]
    friction_pairs: tuple[FrictionPair, ...]
    initial_velocities: tuple[InitialVelocity, ...]
    includes: tuple[str, ...]


def read_velodyne(path: str | Path) -> VelodyneCard:
    """Read a card.

    Raises
    ------
    InputError
        For a line that is no setting, with its number.
    """
    settings: dict[str, tuple[float, ...]] = {}
    sets: dict[int, tuple[int, int, str]] = {}
    types, pairs, velocities, includes = [], [], [], []
    lines = read_text(path).split("\n")
    number = 0
    while number < len(lines):
        line, note = _split(lines[number])
        number += 1
        if not line.strip():
            continue
        try:
            keyword, rest = line.split(":", 1)
            keyword, values = keyword.strip(), rest.split()
            if keyword == "Include":
                includes.append(values[0])
            elif keyword == "Part set definition":
                sets[int(values[0])] = (int(values[1]), int(values[2]), values[3])
            elif keyword == "Friction type definition":
                static, dynamic = (float(v) for v in _split(lines[number])[0].split())
                types.append(FrictionType(int(values[0]), int(values[1]), static, dynamic))
                number += 1
            elif keyword == "Friction pair definition":
                pairs.append(FrictionPair(int(values[0]), int(values[1]), int(values[2]), note))
            elif keyword == "Initial velocity definition":
                vx, vy, vz, omega = (float(v) for v in values[2:6])
                px, py, pz, qx, qy, qz = (float(v) for v in _split(lines[number])[0].split())
                velocities.append(InitialVelocity(int(values[0]), (vx, vy, vz), omega, (px, py, pz), (qx, qy, qz)))
                number += 1
            else:
                settings[keyword] = tuple(float(v) for v in values)
        except (ValueError, IndexError) as error:
            raise InputError(
                path,
                f"{line.strip()!r} cannot be read ({error})",
                line=number,
                expected="Keyword: values ! comment",
                mend="correct the line, or write the deck again",
            ) from None
    return VelodyneCard(settings, sets, tuple(types), tuple(pairs), tuple(velocities), tuple(includes))


def _split(line: str) -> tuple[str, str]:
    text, _, note = line.partition("!")
    return text.rstrip(), note.strip()


def _set_line(part_set: PartSet, deck: DeckInput) -> str:
    """Write a set as a range of part numbers; refuse it where the range would take in other parts."""
    first, last = min(part_set.pids), max(part_set.pids)
    inside = {part.pid for part in deck.parts if first <= part.pid <= last}
    if inside != set(part_set.pids):
        message = f"part set {part_set.name}: {first} to {last} would also hold {sorted(inside - set(part_set.pids))}"
        raise ValueError(message)
    return f"Part set definition: {part_set.sid} {first} {last} {part_set.name}"


def _real(value: float) -> str:
    return repr(float(value))
