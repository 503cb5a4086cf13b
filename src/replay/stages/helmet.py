"""``replay helmet``: protocol section 1 on a foreign deck, ``inspect`` to look and ``prepare`` to make it ready."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from replay import gates, models
from replay.decks.deck import DeckPart
from replay.decks.keyword import read_keyword
from replay.decks.keyword.renumber import Renumbered, dangling, renumbered
from replay.decks.lsdyna import material_lines
from replay.files import sha256, write_json, write_text
from replay.gates.helmet import CHECKS
from replay.models import census
from replay.models.model import GRID_DECIMALS
from replay.models.readiness import surrogate_inspection
from replay.models.surrogate import SurrogatePart
from replay.stages.foreign_deck import WEDGE, ForeignDeck, as_model, open_deck, set_numbers
from replay.stages.limits import told
from replay.tables import Column, TableFormat

RENUMBERING = TableFormat(
    "renumbering of a helmet",
    (
        Column("kind", "node, element, part, section, material, hourglass, a set, curve or contact", "text"),
        Column("old", "number in the deck", "int"),
        Column("new", "number in the include file and the model", "int"),
    ),
)
_MOST_LISTED = 12
# Places of the article's step 3.2.3 in the block, and where parts go when there are more of them.
_PLACES = {"comfort_pad": (174, 180, 1001), "energy_pad": (184, 194, 2001), "chin_cup": (181, 181, 3001)}
_RESERVED = range(99, 201)
_FILES = ("model.h5", "left_out.k", "renumbering.csv", "prepared.json", "inspection.json", "gate_helmet.json")


def inspect(
    files: Sequence[Path], *, units: str | None = None, settings_file: Path | None = None, out: Path | None = None
) -> int:
    """Print what a helmet deck holds and whether it is ready; write it as JSON where asked.

    Returns
    -------
    int
        0, or 3 when the helmet gate refuses it.
    """
    source = open_deck(files, units=units, settings_file=settings_file)
    report = {**_facts(source), **surrogate_inspection(source.helmet, source.settings)}
    gate = _judge(source, report)
    print(_text(source, report))
    _print_gate(gate)
    if out is not None:
        write_json(out, {**report, "gate": gate.to_json()})
    return 3 if gate.verdict == "fail" else 0


def prepare(
    files: Sequence[Path], *, helmet: int, out: Path, units: str | None = None, settings_file: Path | None = None
) -> int:
    """Make a helmet ready for coupling: the model, the include file, and a manifest of every change.

    Wedges are taken out, nothing else; numbers move to the helmet's block, values to SI. A helmet that the gate refuses
    leaves its inspection and the gate's verdict, and no model.

    Returns
    -------
    int
        0, or 3 when the helmet gate refuses it.

    Raises
    ------
    InputErrors
        For parts whose law is refused.
    """
    source = open_deck(files, units=units, settings_file=settings_file)
    kinds = census.element_kinds(source.helmet.solids)
    removed = kinds == WEDGE
    ready = _without(source, removed)
    report = {**_facts(source), **surrogate_inspection(ready.helmet, source.settings, removed=kinds[removed])}
    gate = _judge(source, report)
    base = helmet * 10_000_000
    include = f"helmet_H{helmet}.k"
    usable = gate.verdict != "fail"
    new = _renumbered(ready, base, helmet) if usable else None
    model = as_model(source, {k: dict(v) for k, v in new.numbers.items()}, removed, helmet=helmet) if new else None
    for name in (*_FILES, include):
        (out / name).unlink(missing_ok=True)
    write_json(out / "inspection.json", report)
    gate.write(out / "gate_helmet.json")
    if new is not None and model is not None:
        write_text(out / include, new.text)
        _check_include(out / include, base)
        write_text(out / "left_out.k", new.left_out)
        RENUMBERING.write(out / "renumbering.csv", _table(new))
        models.write_model(out / "model.h5", model)
        write_json(out / "prepared.json", _manifest(source, removed, new, helmet, include))
    print(_text(source, report))
    _print_gate(gate)
    done = f"model.h5, {include} and prepared.json are in {out}" if usable else f"nothing was prepared; see {out}"
    print(f"helmet {helmet}: {int(removed.sum())} wedges removed; {done}")
    return 0 if usable else 3


def _without(source: ForeignDeck, removed: np.ndarray) -> ForeignDeck:
    """The helmet as it will be simulated: without wedges, and without shells, which no law of ours carries."""
    mesh = source.helmet
    helmet = replace(
        mesh,
        solids=mesh.solids[~removed],
        solid_ids=mesh.solid_ids[~removed],
        solid_part=mesh.solid_part[~removed],
        shells=mesh.shells[:0],
        shell_ids=mesh.shell_ids[:0],
        shell_part=mesh.shell_part[:0],
        shell_thickness_m=mesh.shell_thickness_m[:0],
    )
    deck = replace(source.deck, solids=source.deck.solids.only(~removed))
    return replace(source, helmet=helmet, deck=deck)


def _renumbered(source: ForeignDeck, base: int, helmet: int) -> Renumbered:
    deck = source.deck
    numbers = part_numbers(source.helmet.parts, base)
    pads = {f"H{helmet}_pads_set{k}": set(pids) for k, pids in enumerate(source.helmet.pad_sets, 1)}
    fixed = set_numbers(helmet)
    sets = {
        sid: fixed[name]
        for name, pids in pads.items()
        for sid, entry in deck.of_kind("part_set").items()
        if pids and set(entry.members()) == pids
    }
    own = {
        mid: partial(_own_card, law.law, law.density_kg_per_m3, law.parameters)
        for mid, law in source.settings.materials.items()
    }
    title = f"helmet {helmet}, prepared from {', '.join(f.name for f in deck.files)}"
    return renumbered(
        deck,
        source.units,
        base,
        points_m=np.round(source.helmet.nodes, GRID_DECIMALS) + 0.0,
        solids=deck.solids,
        parts=numbers,
        sets=sets,
        own_materials=own,
        title=title,
    )


def _own_card(law: str, density: float, parameters: dict[str, Any], mid: int) -> list[str]:
    return material_lines(DeckPart(mid, f"material {mid}", law, density, parameters, "helmet"))


def part_numbers(parts: Iterable[SurrogatePart], base: int) -> dict[int, int]:
    """Numbers of a helmet's parts: pads and cup at the article's places, the others in order from the first on.

    Pads that do not fit their places go together to a range of their own, so that a set stays a range of numbers.
    """
    parts = list(parts)
    numbers: dict[int, int] = {}
    for role, (first, last, instead) in _PLACES.items():
        pids = [part.pid for part in parts if part.role == role]
        start = first if len(pids) <= last - first + 1 else instead
        numbers |= {pid: base + start + k for k, pid in enumerate(pids)}
    free = (base + k for k in range(1, 1_000_000) if k not in _RESERVED)
    taken = set(numbers.values())
    for part in parts:
        if part.pid not in numbers:
            numbers[part.pid] = next(n for n in free if n not in taken)
    return numbers


def _check_include(path: Path, base: int) -> None:
    """Read the include file back: everything is in the block, and nothing dangles."""
    deck = read_keyword(path)
    ids = np.concatenate([deck.node_ids, deck.solids.ids, deck.shells.ids, [e.id for e in deck.entries if e.kind]])
    outside = ids[(ids <= base) | (ids > base + 9_999_999)]
    loose = dangling(deck)
    if len(outside) or loose or deck.collisions:
        message = f"{path.name}: {len(outside)} numbers outside the block, {len(loose)} dangling, {deck.collisions[:1]}"
        raise AssertionError(message)


def _facts(source: ForeignDeck) -> dict[str, Any]:
    """What is known of the deck itself."""
    deck = source.deck
    return {
        "files": {str(f): sha256(f) for f in deck.files},
        "title": deck.title,
        "units": {"system": source.units.name, "said_by": source.units_from},
        "materials": [
            {"mid": m.mid, "card": m.keyword, "law": m.law or "refused", "lost": list(m.lost), "refused": m.refused}
            for m in source.materials.values()
        ],
        "not_simulated": [
            {"keyword": r.keyword, "file": str(r.file), "line": r.line, "meaning": r.meaning} for r in deck.remarks
        ],
        "colliding_ids": [
            {"kind": c.kind, "number": c.number, "first": c.first, "again": c.second} for c in deck.collisions[:200]
        ],
        "dangling": [
            {"at": d.place, "keyword": d.keyword, "field": d.field, "kind": d.kind, "number": d.number}
            for d in dangling(deck)[:200]
        ],
    }


def _judge(source: ForeignDeck, report: dict[str, Any]) -> gates.Gate:
    collisions = source.deck.collisions
    facts = report.pop("gate")
    facts["colliding_ids"] = len(collisions)
    if collisions:
        c = collisions[0]
        facts["colliding_ids_detail"] = f"the first: {c.kind} {c.number} at {c.first} and {c.second}"
    return gates.helmet_gate(told(facts, CHECKS), gates.Limits.load())


def _print_gate(gate: gates.Gate) -> None:
    print(f"gate helmet: {gate.verdict}")
    for line in gate.cause_lines():
        print(f"    {line}")


def _table(new: Renumbered) -> dict[str, list[Any]]:
    rows = [(kind, old, number) for kind, table in new.numbers.items() for old, number in table.items()]
    return {name: [row[k] for row in rows] for k, name in enumerate(RENUMBERING.names)}


def _manifest(source: ForeignDeck, removed: np.ndarray, new: Renumbered, helmet: int, include: str) -> dict[str, Any]:
    mesh, deck = source.helmet, source.deck
    return {
        "helmet": helmet,
        **_facts(source),
        "removed_wedges": mesh.solid_ids[removed].tolist(),
        "shells_not_simulated": len(mesh.shells),
        "frame": {"forward": source.settings.frame.forward, "up": source.settings.frame.up,
                  "origin_m": list(source.settings.frame.origin_m)},
        "conversion": {
            name: source.units.factor(name)
            for name in ("length", "mass", "time", "density", "pressure", "velocity", "rate")
        },
        "renumbered": {kind: len(table) for kind, table in new.numbers.items() if table},
        "parts": [
            {"old": part.pid, "new": new.numbers["part"].get(part.pid), "name": part.name, "role": part.role}
            for part in mesh.parts
        ],
        "changes": list(new.changes),
        "unreferenced_nodes_removed": len(deck.node_ids) - len(new.numbers["node"]),
        "written": [include, "model.h5", "left_out.k", "renumbering.csv", "inspection.json", "gate_helmet.json"],
    }  # fmt: skip


def _text(source: ForeignDeck, report: dict[str, Any]) -> str:
    """The report for a terminal."""
    c, q, t, mass = report["census"], report["quality"], report["topology"], report["mass"]
    kinds = ", ".join(f"{n} {name}" for name, n in c["kinds"].items() if n) or "none"
    size, double, unused = report["dimensions_m"], t["duplicate_node_pairs"], len(t["unreferenced_nodes"])
    least, most = _shown(q["min_scaled_jacobian"]), _shown(q["max_aspect_ratio"])
    lines = [f"{', '.join(f.name for f in source.deck.files)}: units {source.units.name} (from {source.units_from})"]
    lines.append(f"  elements    {c['solids']} solids ({kinds}), {c['shells']} shells, {c['nodes']} nodes")
    lines.append(f"  hex share   {c['hex_share']:.2%}")
    lines += [f"  {name:11} {_ids(ids)}" for name, ids in c["ids"].items()]
    lines.append(
        f"  quality     scaled Jacobian {least} least, aspect {most} most, "
        f"{len(q['not_positive_volumes'])} volumes not positive"
    )
    lines.append(
        f"  topology    {t['skin_faces']} skin faces, {t['folded_skin_edges']} edges where the skin folds, "
        f"{t['free_shell_edges']} free shell edges, {double} pairs of nodes at one place, {unused} nodes unused"
    )
    lines.append(f"  size        {size['length']:.4f} x {size['width']:.4f} x {size['height']:.4f} m")
    if mass["mass_kg"] is not None:
        cg = " ".join(f"{v * 1e3:.2f}" for v in mass["cg_m"])
        lines.append(f"  mass        {mass['mass_kg']:.4f} kg, CG {cg} mm")
    if "datum" in mass:
        cg = " ".join(f"{v * 1e3:.2f}" for v in mass["datum"]["cg_m"])
        inertia = " ".join(f"{mass['datum']['inertia_kg_m2'][k][k]:.5f}" for k in range(3))
        lines.append(
            f"  datum       radius {mass['datum']['radius_m'] * 1e3:.2f} mm; CG {cg} mm, inertia {inertia} kg m2 in it"
        )
    lines.append(f"  padding     set {report['padding']['set']}, size {report['padding']['size']}")
    lines.append(f"  chin strap  {report['chinstrap']['routing']}")
    lines += [f"  {i['interface']:36} {i['status']}{': ' + i['why'] if i['why'] else ''}" for i in report["interfaces"]]
    lines.append(f"  {'pid':>9} {'part':28} {'role':12} {'law':18} {'solids':>7} {'shells':>7} {'mass kg':>9}")
    lines += [
        f"  {p['pid']:>9} {p['name'][:28]:28} {p['role']:12} {p['law']:18} {p['solids']:>7} {p['shells']:>7}"
        f" {p['mass_kg']:>9.4f}{'  ' + p['problem'] if p['problem'] else ''}"
        for p in report["parts"]
    ]
    lost: dict[str, list[str]] = {}
    for entry in report["materials"]:
        for what in entry["lost"]:
            lost.setdefault(f"{entry['card']}: {what}", []).append(str(entry["mid"]))
    lines += [f"  {what} (material {', '.join(mids)})" for what, mids in lost.items()]
    lines.append(f"  not simulated: {len(report['not_simulated'])} keywords")
    lines += [f"    {r['keyword']} {Path(r['file']).name}:{r['line']}: {r['meaning']}" for r in report["not_simulated"]]
    return "\n".join(lines)


def _ids(ids: list[int]) -> str:
    return ", ".join(map(str, ids[:_MOST_LISTED])) + (f" ... {len(ids)} in all" if len(ids) > _MOST_LISTED else "")


def _shown(value: float | None) -> str:
    return "none" if value is None else f"{value:.3f}"
