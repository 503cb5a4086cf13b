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
elastic_plastic    *MAT_PIECEWISE_LINEAR_PLASTICITY     nothing (024)
=================  ===================================  ======================================================
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from replay.decks.deck import DeckControls, DeckInput, DeckPart
from replay.decks.keyword.columns import card, curve_lines, facts_lines, field_names, node_lines, set_lines, solid_lines
from replay.decks.slurm import write_submit
from replay.files import write_text
from replay.solver.kernels.materials import crushable_foam

_RIGID_DOF = {0: 1, 1: 2, 2: 3, 3: 5, 4: 6, 5: 7}
_CURVE_BASE = 900
_CABLE_BASE = 950
_CABLE_REACH_M = 1.0
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
    command = 'srun "${LSDYNA:-ls-dyna}" i=main.k memory=2000m'
    return _write(Path(folder), deck, write_submit(Path(folder), "replay-lsdyna", command))


def write_openradioss(folder: str | Path, deck: DeckInput) -> list[Path]:
    """Write the deck for OpenRadioss, which reads the same cards: its starter makes the engine's file of ``main.k``.

    Parameters
    ----------
    folder, deck
        As for `write_lsdyna`.

    Returns
    -------
    list of Path
        The files, with a ``submit.slurm.sh`` that runs starter and engine.
    """
    starter = '"${RADIOSS_STARTER:-starter_linux64_gf}" -i main.k -np "$SLURM_NTASKS"'
    engine = 'srun "${RADIOSS_ENGINE:-engine_linux64_gf_ompi}" -i main_0001.rad'
    submit = write_submit(Path(folder), "replay-openradioss", f"{starter}\n{engine}")
    return _write(Path(folder), deck, submit)


def _write(folder: Path, deck: DeckInput, submit: Path) -> list[Path]:
    written = []
    assemblies = [a for a in _MESH_FILES if any(part.assembly == a for part in deck.parts)]
    for assembly in assemblies:
        path = folder / _MESH_FILES[assembly]
        write_text(path, mesh_text(deck, assembly))
        written.append(path)
    main = folder / "main.k"
    write_text(main, main_text(deck, [_MESH_FILES[a] for a in assemblies]))
    return [*written, main, submit]


def main_text(deck: DeckInput, includes: Sequence[str]) -> str:
    """``main.k``: controls, outputs, meshes, sets, contacts, loads."""
    lines = [
        "*KEYWORD",
        f"$ {deck.title}",
        "$ units: m, kg, s, N, Pa, J (SI)",
        *([] if deck.contact else ["$ no *CONTACT: parts that touch share nodes"]),
        *(f"$ {note}" for note in deck.notes),
        *(facts_lines(deck.facts) if deck.facts else []),
        "*TITLE",
        deck.title[:80],
        *_control_lines(deck.controls),
    ]
    for include in includes:
        lines += ["*INCLUDE", include]
    for part_set in deck.part_sets:
        lines += set_lines("SET_PART_LIST", part_set.sid, part_set.name, part_set.pids)
    for keyword, sets, numbers in (
        ("SET_NODE_LIST", deck.node_sets, deck.node_ids),
        ("SET_SOLID", deck.element_sets, deck.element_ids),
    ):
        for numbered in sets:
            lines += set_lines(keyword, numbered.sid, numbered.name, numbers[numbered.rows].tolist())
    lines += contact_lines(deck) + cable_lines(deck)
    for velocity in deck.initial_velocities:
        p, q = np.array(velocity.p_m), np.array(velocity.q_m)
        direction = (q - p) / np.sqrt(np.sum((q - p) ** 2))
        lines += [
            "*INITIAL_VELOCITY_GENERATION",
            "$ styp 1: part set; the axis passes through P (xc, yc, zc) along Q - P (nx, ny, nz)",
            field_names("id", "styp", "omega", "vx", "vy", "vz"),
            card(velocity.set_id, 1, velocity.omega_rad_per_s, *velocity.velocity_m_per_s),
            field_names("xc", "yc", "zc", "nx", "ny", "nz", "phase"),
            card(*p, *direction, 0),
        ]
    lines += _driver_lines(deck)
    for lead, follower in tied_rigid_parts(deck):
        lines += ["*CONSTRAINED_RIGID_BODIES", "$ rigid parts that share nodes are one body", card(lead, follower)]
    return "\n".join([*lines, "*END"]) + "\n"


def _control_lines(c: DeckControls) -> list[str]:
    """Controls and outputs (the article's section 3.3)."""
    return [
        "*CONTROL_UNITS",
        field_names("length", "time", "mass", "temp"),
        card("m", "sec", "kg", "k"),
        "*CONTROL_TERMINATION",
        field_names("endtim"),
        card(c.termination_time_s),
        "*CONTROL_TIMESTEP",
        "$ dt2ms < 0: mass is added to elements below this step; tssfac is the article's time step scale factor",
        field_names("dtinit", "tssfac", "isdo", "tslimt", "dt2ms"),
        card(0.0, c.time_step_factor, 0, 0.0, -c.mass_scaling_time_step_s),
        "*CONTROL_HOURGLASS",
        "$ ihq 4: stiffness form, for all parts",
        field_names("ihq", "qh"),
        card(c.hourglass_method, c.hourglass_coefficient),
        "*CONTROL_BULK_VISCOSITY",
        field_names("q1", "q2", "type"),
        card(c.bulk_viscosity_quadratic, c.bulk_viscosity_linear, 1),
        "*CONTROL_ENERGY",
        field_names("hgen", "rwen", "slnten", "rylen"),
        card(2, 2, 2, 2),
        "*DATABASE_GLSTAT",
        card(c.history_interval_s),
        "*DATABASE_MATSUM",
        card(c.history_interval_s),
        "*DATABASE_RBDOUT",
        card(c.history_interval_s),
        "*DATABASE_RCFORC",
        card(c.history_interval_s),
        "*DATABASE_SLEOUT",
        card(c.history_interval_s),
        "*DATABASE_BINARY_D3PLOT",
        card(c.plot_interval_s),
    ]


def contact_lines(deck: DeckInput) -> list[str]:
    """One contact a friction pair, and one of everything with itself; none where parts share nodes instead."""
    if not deck.contact:
        return []
    sets = {part_set.sid for part_set in deck.part_sets}
    of_type = {friction.number: friction for friction in deck.friction_types}
    lines = []
    for number, pair in enumerate(deck.friction_pairs, 1):
        friction = of_type[pair.friction_type]
        sides = [(2 if side in sets else 3) for side in (pair.first, pair.second)]
        lines += ["*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_ID", f"{number:10d}{pair.name[:70]}"]
        lines += [field_names("ssid", "msid", "sstyp", "mstyp"), card(pair.first, pair.second, *sides)]
        lines += [field_names("fs", "fd"), card(friction.static, friction.dynamic), card(1.0, 1.0)]
    lines += ["*CONTACT_AUTOMATIC_SINGLE_SURFACE_ID", f"{len(deck.friction_pairs) + 1:10d}everything"]
    return [*lines, field_names("ssid", "msid", "sstyp", "mstyp"), card(0, 0, 5, 0), card(0.0, 0.0), card(1.0, 1.0)]


def cable_lines(deck: DeckInput) -> list[str]:
    """Straps as discrete elements whose force grows with elongation beyond the slack, and is zero in compression."""
    lines: list[str] = []
    for k, cable in enumerate(deck.cables):
        number, (a, b) = _CABLE_BASE + k, deck.node_ids[[cable.first, cable.second]].tolist()
        reach = cable.slack_m + _CABLE_REACH_M
        lines += ["*PART", cable.name[:80], field_names("pid", "secid", "mid"), card(number, number, number)]
        lines += ["*SECTION_DISCRETE", field_names("secid", "dro"), card(number, 0), card(0.0, 0.0)]
        lines += ["*MAT_SPRING_NONLINEAR_ELASTIC", field_names("mid", "lcd"), card(number, number)]
        points = (-_CABLE_REACH_M, cable.slack_m, reach)
        lines += curve_lines(number, points, (0.0, 0.0, cable.stiffness_n_per_m * _CABLE_REACH_M))
        lines += ["*ELEMENT_DISCRETE", f"{number:8d}{number:8d}{a:8d}{b:8d}"]
    return lines


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
    lines = ["*KEYWORD", f"$ {assembly}: {int(mine.sum())} solid elements; units: m, kg, s, N, Pa, J (SI)"]
    lines += node_lines(deck.node_ids[used], deck.nodes[used])
    pids = np.array([part.pid for part in deck.parts])[deck.element_part[mine]]
    lines += solid_lines(deck.element_ids[mine], pids, deck.node_ids[deck.hexes[mine]])
    for k in chosen:
        part = deck.parts[k]
        lines += ["*PART", part.name[:80], field_names("pid", "secid", "mid"), card(part.pid, part.pid, part.pid)]
        lines += ["*SECTION_SOLID", "$ elform 1: one integration point", card(part.pid, 1)]
        lines += material_lines(part)
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


def material_lines(part: DeckPart) -> list[str]:
    """The ``*MAT`` card of a part, and the curve it needs, numbered as the part.

    Raises
    ------
    ValueError
        For a law without a keyword.
    """
    p, mid, density = part.parameters, part.pid, part.density_kg_per_m3
    if part.law == "elastic":
        young, nu = p["youngs_modulus_pa"], p["poisson_ratio"]
        return ["*MAT_ELASTIC", field_names("mid", "ro", "e", "pr"), card(mid, density, young, nu)]
    if part.law == "rigid":
        return [
            "*MAT_RIGID",
            field_names("mid", "ro", "e", "pr"),
            card(mid, density, p["youngs_modulus_pa"], p["poisson_ratio"]),
            card(0.0, 0, 0),
            card(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ]
    if part.law in ("viscohyperelastic", "fluid"):
        ratios, times = p.get("prony_ratios", ()), p.get("prony_times_s", ())
        short, long, rate = one_decay(float(p["shear_modulus_pa"]), ratios, times)
        head = field_names("mid", "ro", "bulk", "g0", "gi", "beta")
        return ["*MAT_VISCOELASTIC", head, card(mid, density, p["bulk_modulus_pa"], short, long, rate)]
    if part.law == "brain_isv":
        # no keyword has this law: its Maxwell element at small strain, beside the network's modulus
        flow, share = float(p["reference_rate_per_s"]) / float(p["yield_stress_pa"]), float(p["locking_stretch"]) ** -2
        short, network = float(p["shear_modulus_pa"]), float(p["network_modulus_pa"]) * (3 - share) / (1 - share) / 3
        head = field_names("mid", "ro", "bulk", "g0", "gi", "beta")
        note = f"$ {part.name}: stands for the law brain_isv, linearised at rest; no damage"
        values = (p["bulk_modulus_pa"], short + network, network, short * flow)
        return ["*MAT_VISCOELASTIC", note, head, card(mid, density, *values)]
    if part.law == "crushable_foam":
        strain, stress = foam_curve(p)
        tension = float(p.get("tension_cutoff_pa", p["plateau_stress_pa"]))
        return [
            "*MAT_CRUSHABLE_FOAM",
            field_names("mid", "ro", "e", "pr", "lcid", "tsc", "damp"),
            card(mid, density, p["youngs_modulus_pa"], 0.0, mid, tension, 0.1),
            *curve_lines(mid, strain, stress),
        ]
    if part.law == "elastic_plastic":
        return _plastic_lines(part)
    message = f"part {part.name}: the law {part.law!r} has no keyword"
    raise ValueError(message)


def _plastic_lines(part: DeckPart) -> list[str]:
    """*MAT_024: a tangent modulus, or the points of the hardening curve."""
    p, mid = part.parameters, part.pid
    young, hardening = float(p["youngs_modulus_pa"]), float(p.get("hardening_modulus_pa", 0.0))
    tangent = young * hardening / (young + hardening)
    strains, stresses = list(p.get("curve_strains", ())), list(p.get("curve_stresses_pa", ()))
    lines = ["*MAT_PIECEWISE_LINEAR_PLASTICITY", field_names("mid", "ro", "e", "pr", "sigy", "etan")]
    lines.append(card(mid, part.density_kg_per_m3, young, p["poisson_ratio"], p["yield_stress_pa"], tangent))
    lines.append(card(0.0, 0.0, mid if strains else 0, 0, 0.0))
    lines += [card(*[0.0] * 8), card(*[0.0] * 8)]
    if strains:
        lines += curve_lines(mid, (0.0, *strains), (p["yield_stress_pa"], *stresses))
    return lines


def _driver_lines(deck: DeckInput) -> list[str]:
    if deck.driver is None:
        return []
    driver, lines = deck.driver, []
    values = np.hstack([driver.velocity_m_per_s, driver.omega_rad_per_s])
    for k, dof in _RIGID_DOF.items():
        lines += [
            "*BOUNDARY_PRESCRIBED_MOTION_RIGID",
            "$ vad 0: velocity; dof 1-3 translation, 5-7 rotation about x, y, z",
            field_names("pid", "dof", "vad", "lcid", "sf"),
            card(driver.pid, dof, 0, _CURVE_BASE + k, 1.0),
            *curve_lines(_CURVE_BASE + k, driver.time_s.tolist(), values[:, k].tolist()),
        ]
    return lines
