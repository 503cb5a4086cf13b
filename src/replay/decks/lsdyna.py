"""LS-DYNA keyword decks: ``main.k`` with controls and loads, ``head_1.k`` and ``helmet_H1.k`` with the meshes.

Fixed columns throughout, so that any reader of the format takes them: *NODE is I8, 3E16, I8, I8; *ELEMENT_SOLID is two
lines of I8 (the layout of the format since 1997); all other cards are ten-column fields. Our laws are mapped thus:

=================  ===================================  ======================================================
law                keyword                              what is lost
=================  ===================================  ======================================================
elastic            *MAT_ELASTIC (001)                   nothing at small strain
rigid              *MAT_RIGID (020)                     nothing
viscohyperelastic  *MAT_VISCOELASTIC (006)              two decay times become one (see `one_decay`)
fluid              *MAT_VISCOELASTIC (006), constant G  nothing at small strain
crushable_foam     *MAT_CRUSHABLE_FOAM (063)            rate effect and hysteresis law differ
=================  ===================================  ======================================================
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from replay.decks.deck import DeckInput, DeckPart
from replay.decks.slurm import write_submit
from replay.files import write_text
from replay.solver.kernels.materials import crushable_foam

_RIGID_DOF = {0: 1, 1: 2, 2: 3, 3: 5, 4: 6, 5: 7}
_CURVE_BASE = 900
_MESH_FILES = {"head": "head_1.k", "helmet": "helmet_H1.k"}


def write_lsdyna(folder: str | Path, deck: DeckInput) -> list[Path]:
    """Write the deck into a folder.

    Parameters
    ----------
    folder
        Where; made if it is not there.
    deck
        What.

    Returns
    -------
    list of Path
        The files: ``main.k``, a mesh file an assembly, ``submit.slurm.sh``.
    """
    folder = Path(folder)
    written = []
    assemblies = [a for a in _MESH_FILES if any(part.assembly == a for part in deck.parts)]
    for assembly in assemblies:
        path = folder / _MESH_FILES[assembly]
        write_text(path, mesh_text(deck, assembly))
        written.append(path)
    main = folder / "main.k"
    write_text(main, main_text(deck, [_MESH_FILES[a] for a in assemblies]))
    written.append(main)
    written.append(write_submit(folder, "replay-lsdyna", 'srun "${LSDYNA:-ls-dyna}" i=main.k memory=2000m'))
    return written


def main_text(deck: DeckInput, includes: Sequence[str]) -> str:
    """``main.k``: controls, outputs, sets, loads, includes."""
    c = deck.controls
    lines = [
        "*KEYWORD",
        f"$ {deck.title}",
        "$ units: m, kg, s, N, Pa, J (SI)",
        "$ no *CONTACT: parts that touch share nodes",
        *(f"$ {note}" for note in deck.notes),
        "*TITLE",
        deck.title[:80],
        "*CONTROL_TERMINATION",
        _fields("endtim"),
        _card(c.termination_time_s),
        "*CONTROL_TIMESTEP",
        "$ dt2ms < 0: mass is added to elements below this step; tssfac is the article's time step scale factor",
        _fields("dtinit", "tssfac", "isdo", "tslimt", "dt2ms"),
        _card(0.0, c.time_step_factor, 0, 0.0, -c.mass_scaling_time_step_s),
        "*CONTROL_HOURGLASS",
        "$ ihq 4: stiffness form, for all parts",
        _fields("ihq", "qh"),
        _card(c.hourglass_method, c.hourglass_coefficient),
        "*CONTROL_BULK_VISCOSITY",
        _fields("q1", "q2", "type"),
        _card(c.bulk_viscosity_quadratic, c.bulk_viscosity_linear, 1),
        "*CONTROL_ENERGY",
        _fields("hgen", "rwen", "slnten", "rylen"),
        _card(2, 2, 2, 2),
        "*DATABASE_GLSTAT",
        _card(c.history_interval_s),
        "*DATABASE_MATSUM",
        _card(c.history_interval_s),
        "*DATABASE_RBDOUT",
        _card(c.history_interval_s),
        "*DATABASE_BINARY_D3PLOT",
        _card(c.plot_interval_s),
    ]
    for part_set in deck.part_sets:
        lines += ["*SET_PART_LIST_TITLE", part_set.name[:80], _card(part_set.sid)]
        lines += [_card(*part_set.pids[k : k + 8]) for k in range(0, len(part_set.pids), 8)]
    for velocity in deck.initial_velocities:
        p, q = np.array(velocity.p_m), np.array(velocity.q_m)
        direction = (q - p) / np.sqrt(np.sum((q - p) ** 2))
        lines += [
            "*INITIAL_VELOCITY_GENERATION",
            "$ styp 1: part set; the axis passes through P (xc, yc, zc) along Q - P (nx, ny, nz)",
            _fields("id", "styp", "omega", "vx", "vy", "vz"),
            _card(velocity.set_id, 1, velocity.omega_rad_per_s, *velocity.velocity_m_per_s),
            _fields("xc", "yc", "zc", "nx", "ny", "nz", "phase"),
            _card(*p, *direction, 0),
        ]
    lines += _driver_lines(deck)
    for lead, follower in tied_rigid_parts(deck):
        lines += ["*CONSTRAINED_RIGID_BODIES", "$ rigid parts that share nodes are one body", _card(lead, follower)]
    for include in includes:
        lines += ["*INCLUDE", include]
    return "\n".join([*lines, "*END"]) + "\n"


def mesh_text(deck: DeckInput, assembly: str) -> str:
    """One assembly's file: nodes, elements, parts, sections, materials.

    Nodes that two assemblies share stand in the head's file; the helmet's elements refer to them.
    """
    chosen = [k for k, part in enumerate(deck.parts) if part.assembly == assembly]
    mine = np.isin(deck.element_part, chosen)
    used = np.zeros(len(deck.nodes), dtype=bool)
    used[deck.hexes[mine]] = True
    if assembly != "head":
        head = [k for k, part in enumerate(deck.parts) if part.assembly == "head"]
        used[deck.hexes[np.isin(deck.element_part, head)]] = False
    lines = ["*KEYWORD", f"$ {assembly}: {int(mine.sum())} solid elements; units: m, kg, s, N, Pa, J (SI)", "*NODE"]
    lines += [
        f"{i:8d}{_number(x, 16)}{_number(y, 16)}{_number(z, 16)}{0:8d}{0:8d}"
        for i, (x, y, z) in zip(deck.node_ids[used].tolist(), deck.nodes[used].tolist())
    ]
    lines.append("*ELEMENT_SOLID")
    numbers = deck.node_ids[deck.hexes[mine]]
    pids = np.array([part.pid for part in deck.parts])[deck.element_part[mine]]
    lines += [
        f"{e:8d}{p:8d}\n" + "".join(f"{n:8d}" for n in row)
        for e, p, row in zip(deck.element_ids[mine].tolist(), pids.tolist(), numbers.tolist())
    ]
    for k in chosen:
        part = deck.parts[k]
        lines += ["*PART", part.name[:80], _fields("pid", "secid", "mid"), _card(part.pid, part.pid, part.pid)]
        lines += ["*SECTION_SOLID", "$ elform 1: one integration point", _card(part.pid, 1)]
        lines += _material_lines(part)
    return "\n".join([*lines, "*END"]) + "\n"


def tied_rigid_parts(deck: DeckInput) -> list[tuple[int, int]]:
    """Pairs of part numbers (lead, follower) of rigid parts that share nodes and therefore are one body.

    Every follower is named once, and a lead follows nobody.
    """
    rigid = [k for k, part in enumerate(deck.parts) if part.law == "rigid"]
    nodes = {k: np.unique(deck.hexes[deck.element_part == k]) for k in rigid}
    lead = {k: k for k in rigid}
    for position, k in enumerate(rigid):
        for other in rigid[:position]:
            if lead[k] != lead[other] and len(np.intersect1d(nodes[k], nodes[other])):
                old, new = sorted((lead[k], lead[other]), reverse=True)
                lead = {a: new if b == old else b for a, b in lead.items()}
    return [(deck.parts[lead[k]].pid, deck.parts[k].pid) for k in rigid if lead[k] != k]


def one_decay(shear_pa: float, ratios: Sequence[float], times_s: Sequence[float]) -> tuple[float, float, float]:
    """Short- and long-term shear modulus and decay rate of a one-term law in place of a Prony series.

    The instantaneous and the long-term modulus are kept; the decay rate is the one whose relaxation has the same
    area over time: ``tau = sum(g_i tau_i) / sum(g_i)``.

    Returns
    -------
    tuple
        G0 [Pa], G_infinity [Pa], beta [1/s].
    """
    total = sum(ratios)
    if total <= 0:
        return shear_pa, shear_pa, 0.0
    time = sum(g * t for g, t in zip(ratios, times_s)) / total
    return shear_pa, shear_pa * (1 - total), 1 / time


def foam_curve(parameters: Mapping[str, Any]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Compressive strain against stress [Pa] of a crushable foam: the curve that our own law follows.

    Without lateral strain the nominal strain is the volumetric one, and the nominal stress is the true one.
    """
    known = {f.name for f in dataclasses.fields(crushable_foam.Parameters)}
    law = crushable_foam.Parameters(**{name: value for name, value in parameters.items() if name in known})
    return law.loading_curve()


def _material_lines(part: DeckPart) -> list[str]:
    p, mid, density = part.parameters, part.pid, part.density_kg_per_m3
    if part.law == "elastic":
        young, nu = p["youngs_modulus_pa"], p["poisson_ratio"]
        return ["*MAT_ELASTIC", _fields("mid", "ro", "e", "pr"), _card(mid, density, young, nu)]
    if part.law == "rigid":
        return [
            "*MAT_RIGID",
            _fields("mid", "ro", "e", "pr"),
            _card(mid, density, p["youngs_modulus_pa"], p["poisson_ratio"]),
            _card(0.0, 0, 0),
            _card(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ]
    if part.law in ("viscohyperelastic", "fluid"):
        ratios, times = p.get("prony_ratios", ()), p.get("prony_times_s", ())
        short, long, rate = one_decay(float(p["shear_modulus_pa"]), ratios, times)
        head = _fields("mid", "ro", "bulk", "g0", "gi", "beta")
        return ["*MAT_VISCOELASTIC", head, _card(mid, density, p["bulk_modulus_pa"], short, long, rate)]
    if part.law == "brain_isv":
        # no keyword has this law: its Maxwell element at small strain, beside the network's modulus
        flow, share = float(p["reference_rate_per_s"]) / float(p["yield_stress_pa"]), float(p["locking_stretch"]) ** -2
        short, network = float(p["shear_modulus_pa"]), float(p["network_modulus_pa"]) * (3 - share) / (1 - share) / 3
        head = _fields("mid", "ro", "bulk", "g0", "gi", "beta")
        note = f"$ {part.name}: stands for the law brain_isv, linearised at rest; no damage"
        values = (p["bulk_modulus_pa"], short + network, network, short * flow)
        return [note, "*MAT_VISCOELASTIC", head, _card(mid, density, *values)]
    if part.law == "crushable_foam":
        strain, stress = foam_curve(p)
        tension = float(p.get("tension_cutoff_pa", p["plateau_stress_pa"]))
        return [
            "*MAT_CRUSHABLE_FOAM",
            _fields("mid", "ro", "e", "pr", "lcid", "tsc", "damp"),
            _card(mid, density, p["youngs_modulus_pa"], 0.0, mid, tension, 0.1),
            *_curve_lines(mid, strain, stress),
        ]
    message = f"part {part.name}: the law {part.law!r} has no keyword"
    raise ValueError(message)


def _driver_lines(deck: DeckInput) -> list[str]:
    if deck.driver is None:
        return []
    driver, lines = deck.driver, []
    values = np.hstack([driver.velocity_m_per_s, driver.omega_rad_per_s])
    for k, dof in _RIGID_DOF.items():
        lines += [
            "*BOUNDARY_PRESCRIBED_MOTION_RIGID",
            "$ vad 0: velocity; dof 1-3 translation, 5-7 rotation about x, y, z",
            _fields("pid", "dof", "vad", "lcid", "sf"),
            _card(driver.pid, dof, 0, _CURVE_BASE + k, 1.0),
            *_curve_lines(_CURVE_BASE + k, driver.time_s.tolist(), values[:, k].tolist()),
        ]
    return lines


def _curve_lines(number: int, abscissa: Sequence[float], ordinate: Sequence[float]) -> list[str]:
    points = [f"{_number(a, 20)}{_number(o, 20)}" for a, o in zip(abscissa, ordinate)]
    return ["*DEFINE_CURVE", _fields("lcid"), _card(number), *points]


def _fields(*names: str) -> str:
    return ("$#" + "".join(f"{name:>10}" for name in names)[2:]).rstrip()


def _card(*values: float) -> str:
    """Ten-column fields."""
    return "".join(f"{v:10d}" if isinstance(v, int | np.integer) else _number(float(v), 10) for v in values)


def _number(value: float, width: int) -> str:
    """As many digits as fit a field with one blank before it."""
    if not math.isfinite(value):
        message = f"{value} cannot stand in a deck"
        raise ValueError(message)
    for digits in range(17, 0, -1):
        text = f"{value:.{digits}g}"
        if "." not in text and "e" not in text:
            text += "."
        if "e" in text:
            mantissa, exponent = text.split("e")
            text = f"{mantissa}e{int(exponent)}"
        if len(text) < width:
            return text.rjust(width)
    message = f"{value} does not fit {width} columns"
    raise ValueError(message)
