"""From somebody's keyword files to a helmet in SI and head axes, and to the model that the solver reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from replay.decks.keyword import Elements, KeywordDeck, read_keyword
from replay.decks.keyword.materials import Mapped, map_material
from replay.decks.keyword.units import SYSTEMS, Units, plausible_units
from replay.documents import load_yaml
from replay.errors import InputError, InputErrors
from replay.models import Model, Part, census, surrogate
from replay.models.model import GRID_DECIMALS
from replay.models.surrogate import Surrogate, SurrogatePart
from replay.models.surrogate_settings import HelmetSettings
from replay.solver import LAWS, Material, law_parameters
from replay.stages.own_deck import model_of_own_deck

WEDGE = census.KINDS.index("wedge")


@dataclass(frozen=True)
class ForeignDeck:
    """A deck that was read, with all that was decided about it.

    Parameters
    ----------
    deck
        As read.
    units
        Its units.
    units_from
        Who said so.
    settings, settings_file
        What the user says beside it, and where.
    materials
        Number of a ``*MAT`` card to what it becomes.
    helmet
        Mesh and parts in SI.
    """

    deck: KeywordDeck
    units: Units
    units_from: str
    settings: HelmetSettings
    settings_file: Path | None
    materials: dict[int, Mapped]
    helmet: Surrogate


def open_deck(
    files: Sequence[Path], *, units: str | None = None, settings_file: Path | None = None, otherwise: str | None = None
) -> ForeignDeck:
    """Read keyword files as one deck.

    Parameters
    ----------
    files
        The files, as though one included them all.
    units
        Name of the unit system; what the settings say, or else what the deck's numbers say, where None.
    settings_file
        ``helmet.yaml``.
    otherwise
        Units of a deck whose numbers do not say them; None refuses it.

    Raises
    ------
    InputError, InputErrors
        For everything that cannot be used.
    """
    settings = load_yaml(settings_file, HelmetSettings) if settings_file else HelmetSettings()
    deck = read_keyword(*files)
    if not len(deck.solids.ids) and not len(deck.shells.ids):
        raise InputError(files[0], "the deck has no solid and no shell", expected="*ELEMENT_SOLID", line=1,
                         column="ELEMENT_SOLID", mend="name the files with the mesh")  # fmt: skip
    system, said = _units(files[0], deck, units, settings, otherwise)
    materials = {mid: map_material(entry, deck, system) for mid, entry in deck.of_kind("material").items()}
    _put_own_materials(settings, settings_file, materials)
    helmet = _surrogate(deck, system, settings, settings_file, materials)
    return ForeignDeck(deck, system, said, settings, settings_file, materials, helmet)


def _units(
    file: Path, deck: KeywordDeck, asked: str | None, settings: HelmetSettings, otherwise: str | None
) -> tuple[Units, str]:
    if asked or settings.units:
        return SYSTEMS[str(asked or settings.units)], "the command line" if asked else "the settings"
    used = np.isin(deck.node_ids, np.concatenate([deck.solids.nodes.ravel(), deck.shells.nodes.ravel()]))
    extent = float((deck.nodes[used].max(axis=0) - deck.nodes[used].min(axis=0)).max())
    densities = [entry.number("ro") for entry in deck.of_kind("material").values()]
    fit = plausible_units([d for d in densities if d > 0], extent)
    if len(fit) == 1:
        return fit[0], f"its numbers: densities and a size of {extent * fit[0].length_m:.3g} m fit no other system"
    if otherwise:
        return SYSTEMS[otherwise], "nobody: assumed"
    why = "several systems fit" if fit else "no system makes a helmet of it"
    shown = f"{why}: {', '.join(u.name for u in fit)}" if fit else why
    raise InputError(
        file,
        f"its units are not known: the mesh is {extent:.6g} long, densities are "
        f"{', '.join(f'{d:.4g}' for d in densities[:4]) or 'not given'}; {shown}",
        line=1, column="units", expected=", ".join(SYSTEMS), mend="give --units, or units: in the settings file",
    )  # fmt: skip


def _put_own_materials(settings: HelmetSettings, file: Path | None, materials: dict[int, Mapped]) -> None:
    """Let the settings' laws stand for cards, all mistakes at once."""
    errors = []
    for mid, own in settings.materials.items():
        try:
            law_parameters(Material(f"{mid}", own.law, own.density_kg_per_m3, own.parameters))
        except InputError as error:
            errors.append(
                InputError(file or "settings", error.found, column=f"materials.{mid}.{error.column}",
                           expected=error.expected, mend=error.mend)
            )  # fmt: skip
            continue
        keyword = materials[mid].keyword if mid in materials else "no card"
        materials[mid] = Mapped(keyword, mid, own.law, own.density_kg_per_m3, dict(own.parameters))
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(errors)


def _surrogate(
    deck: KeywordDeck, units: Units, settings: HelmetSettings, file: Path | None, materials: dict[int, Mapped]
) -> Surrogate:
    order = np.argsort(deck.node_ids, kind="stable")
    nodes = surrogate.to_head(deck.nodes * units.length_m, settings.frame)
    pids = list(dict.fromkeys([*deck.of_kind("part"), *_seen(deck.solids), *_seen(deck.shells)]))
    used = {*_seen(deck.solids), *_seen(deck.shells)}
    parts = tuple(_part(pid, deck, settings, materials) for pid in pids if pid in used)
    index = {part.pid: k for k, part in enumerate(parts)}
    solids, shells = _rows(deck, deck.solids, order), _rows(deck, deck.shells, order)[:, :4]
    shells = np.where(shells < 0, shells[:, 2:3], shells)
    node_sets, mounts, anchors = _node_sets(deck, settings, file, order)
    shell_rows = np.concatenate(
        [solids[np.isin(deck.solids.parts, [p.pid for p in parts if p.role == "shell"])].ravel(),
         shells[np.isin(deck.shells.parts, [p.pid for p in parts if p.role == "shell"])].ravel()]
    )  # fmt: skip
    try:
        datum = surrogate.datum_of(settings, nodes, deck.node_ids, units.length_m)
    except ValueError as error:
        raise InputError(file or "settings", str(error), column="datum", expected="three points not on a line",
                         mend="correct the points") from None  # fmt: skip
    return Surrogate(
        nodes=nodes,
        node_ids=deck.node_ids,
        solids=solids,
        solid_ids=deck.solids.ids,
        solid_part=_indices(deck.solids.parts, index),
        shells=shells,
        shell_ids=deck.shells.ids,
        shell_part=_indices(deck.shells.parts, index),
        shell_thickness_m=_thickness(deck) * units.length_m,
        parts=parts,
        pad_sets=_pad_sets(deck, settings, parts),
        node_sets=node_sets,
        mounts=mounts,
        anchors=anchors,
        tied=_tied(deck, set(index)),
        datum=datum or surrogate.found_datum(nodes, np.unique(shell_rows[shell_rows >= 0])),
    )


def _seen(elements: Elements) -> list[int]:
    return np.unique(elements.parts).tolist()


def _indices(pids: np.ndarray, index: dict[int, int]) -> np.ndarray:
    return np.array([index[pid] for pid in pids.tolist()], dtype=np.int64)


def _rows(deck: KeywordDeck, elements: Elements, order: np.ndarray) -> np.ndarray:
    """Rows of the nodes that elements name; -1 for none."""
    if not len(elements.ids):
        return np.zeros((0, 10), dtype=np.int64)
    place = np.searchsorted(deck.node_ids, elements.nodes, sorter=order)
    return np.where(elements.nodes > 0, order[np.minimum(place, len(order) - 1)], -1)


def _part(pid: int, deck: KeywordDeck, settings: HelmetSettings, materials: dict[int, Mapped]) -> SurrogatePart:
    entry = deck.of_kind("part").get(pid)
    own = settings.parts.get(pid)
    name = (own.name if own else "") or (entry.title if entry else "") or f"part {pid}"
    role = own.role if own else surrogate.role_of(name)
    mid = entry.whole("mid") if entry else 0
    mapped = materials.get(mid)
    if entry is None:
        return SurrogatePart(pid, name, role, "", np.nan, "its elements name a part without *PART", has_material=False)
    if mapped is None:
        found = f"material {mid} is not defined" if mid else "no material is named"
        return SurrogatePart(pid, name, role, "", np.nan, found, has_material=False)
    return SurrogatePart(pid, name, role, mapped.law, mapped.density_kg_per_m3, mapped.refused)


def _thickness(deck: KeywordDeck) -> np.ndarray:
    """Thickness of each shell in the deck's unit: that of its section's first node, 0 where there is none."""
    parts, sections = deck.of_kind("part"), deck.of_kind("section")
    of = {}
    for pid in _seen(deck.shells):
        section = sections.get(parts[pid].whole("secid")) if pid in parts else None
        of[pid] = section.number("t1") if section else 0.0
    return np.array([of[pid] for pid in deck.shells.parts.tolist()])


def _pad_sets(
    deck: KeywordDeck, settings: HelmetSettings, parts: Sequence[SurrogatePart]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The settings' pad sets, or sets whose titles say pads and 1 or 2, or the parts of those roles."""
    found: list[tuple[int, ...]] = [settings.padding.set1, settings.padding.set2]
    for entry in deck.of_kind("part_set").values():
        title = surrogate.plain_name(entry.title)
        for k, digit in enumerate("12"):
            if "pad" in title and title.endswith(digit) and not found[k]:
                found[k] = entry.members()
    for k, role in enumerate(("comfort_pad", "energy_pad")):
        found[k] = found[k] or tuple(part.pid for part in parts if part.role == role)
    return found[0], found[1]


def _node_sets(
    deck: KeywordDeck, settings: HelmetSettings, file: Path | None, order: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray]]:
    sets = deck.of_kind("node_set")

    def rows(number: int) -> np.ndarray:
        ids = np.array(sets[number].members(), dtype=np.int64)
        ids = ids[np.isin(ids, deck.node_ids)]
        return order[np.searchsorted(deck.node_ids, ids, sorter=order)] if len(ids) else ids

    found: dict[str, dict[str, np.ndarray]] = {"mount": {}, "anchor": {}}
    everything = {}
    for number, entry in sets.items():
        name = surrogate.plain_name(entry.title) or f"set_{number}"
        everything[name if name not in everything else f"{name}_{number}"] = rows(number)
        kind, place = surrogate.interface_of(entry.title)
        if kind:
            found[kind][place or str(number)] = rows(number)
    errors = []
    for kind, key in (("mount", "facemask_mounts"), ("anchor", "strap_anchors")):
        for place, number in getattr(settings, key).items():
            if number not in sets:
                errors.append(
                    InputError(file or "settings", f"node set {number} is not in the deck", column=f"{key}.{place}",
                               expected=f"one of {', '.join(map(str, list(sets)[:12])) or 'none'}",
                               mend="correct the number")
                )  # fmt: skip
            else:
                found[kind][place] = rows(number)
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(errors)
    return everything, found["mount"], found["anchor"]


def _tied(deck: KeywordDeck, pids: set[int]) -> tuple[frozenset[int], ...]:
    """Parts that one contact names on either side; a single surface without sides names all."""
    part_sets = deck.of_kind("part_set")
    groups = []
    for entry in deck.entries:
        if not entry.keyword.startswith("CONTACT_"):
            continue
        group: set[int] = set()
        for side, kind in (("ssid", "sstyp"), ("msid", "mstyp")):
            number = entry.whole(side)
            if entry.whole(kind) == 3:
                group.add(number)
            elif entry.whole(kind) == 2 and number in part_sets:
                group |= set(part_sets[number].members())
            elif side == "ssid" and (entry.whole(kind) == 5 or not number):
                group |= pids
        groups.append(frozenset(group & pids))
    return tuple(group for group in groups if len(group) > 1)


def as_model(source: ForeignDeck, numbers: dict[str, dict[int, int]], removed: np.ndarray, *, helmet: int) -> Model:
    """The model that the solver reads.

    Parameters
    ----------
    source
        A deck whose parts can all be used.
    numbers
        Old to new numbers of nodes, elements and parts.
    removed
        Mask of solids that are taken out.
    helmet
        1 or 2.

    Raises
    ------
    InputErrors
        Naming every part that cannot be used, and why.
    """
    mesh, files = source.helmet, source.deck.files
    bad = [p for k, p in enumerate(mesh.parts) if p.problem and (mesh.solid_part[~removed] == k).any()]
    if bad:
        raise InputErrors(
            [InputError(files[0], f"part {p.pid} ({p.name}): {p.problem}", line=_line_of(source.deck, p.pid),
                        column="mid", expected=f"a material of the laws {', '.join(sorted(LAWS))}",
                        mend="give it one under materials: in the settings file") for p in bad]
        )  # fmt: skip
    hexes = census.as_hexes(mesh.solids, census.element_kinds(mesh.solids))[~removed]
    used = np.unique(hexes)
    row = np.full(len(mesh.nodes), -1)
    row[used] = np.arange(len(used))
    kept = [k for k in range(len(mesh.parts)) if (mesh.solid_part[~removed] == k).any()]
    index = np.full(len(mesh.parts), -1)
    index[kept] = np.arange(len(kept))
    parts, materials = _model_parts(source, kept, numbers["part"])
    sets = {f"H{helmet}_pads_set{n}": pids for n, pids in enumerate(mesh.pad_sets, 1)}
    part_sets = {
        name: tuple(sorted(numbers["part"][pid] for pid in pids if pid in numbers["part"]))
        for name, pids in {**sets, "all_parts": tuple(mesh.parts[k].pid for k in kept)}.items()
    }
    node_sets = {f"facemask_mount_{n}": r for n, r in mesh.mounts.items()}
    for place, rows in mesh.anchors.items():
        node_sets[f"chin_cup_strap{place.removeprefix('cup')}" if place[:3] == "cup" else f"strap_anchor_{place}"] = (
            rows
        )
    return Model(
        nodes=np.round(mesh.nodes[used], GRID_DECIMALS) + 0.0,
        node_ids=np.array([numbers["node"][v] for v in mesh.node_ids[used].tolist()], dtype=np.int64),
        hexes=row[hexes].astype(np.int32),
        element_ids=np.array([numbers["element"][v] for v in mesh.solid_ids[~removed].tolist()], dtype=np.int64),
        element_part=index[mesh.solid_part[~removed]].astype(np.int32),
        element_region=np.zeros(len(hexes), dtype=np.int32),
        parts=parts,
        region_names=("none",),
        part_sets={name: pids for name, pids in part_sets.items() if pids},
        part_set_ids={
            name: number for name, number in set_numbers(helmet).items() if part_sets.get(name)
        },
        node_sets={n: row[r][row[r] >= 0].astype(np.int32) for n, r in node_sets.items() if (row[r] >= 0).any()},
        materials=materials,
        info={
            "preset": "foreign deck",
            "resolution": "as it came",
            "title": source.deck.title,
            "files": [f.name for f in files],
            "units_of_the_deck": source.units.name,
            "notes": [f"prepared as helmet {helmet} from a keyword deck in {source.units.name}"],
        },
    )  # fmt: skip


def _line_of(deck: KeywordDeck, pid: int) -> int:
    entry = deck.of_kind("part").get(pid)
    if entry is not None:
        return entry.line
    rows = np.flatnonzero(deck.solids.parts == pid)
    return int(deck.solids.lines[rows[0]]) if len(rows) else 1


def _model_parts(
    source: ForeignDeck, kept: list[int], numbers: dict[int, int]
) -> tuple[tuple[Part, ...], dict[str, dict[str, Any]]]:
    parts: list[Part] = []
    materials: dict[str, dict[str, Any]] = {}
    entries = source.deck.of_kind("part")
    for k in kept:
        part = source.helmet.parts[k]
        mid = entries[part.pid].whole("mid")
        mapped = source.materials[mid]
        name = f"mat_{mid}"
        own = source.settings.materials.get(mid)
        materials[name] = {
            "law": mapped.law,
            "density_kg_per_m3": mapped.density_kg_per_m3,
            "parameters": {n: list(v) if isinstance(v, tuple) else v for n, v in mapped.parameters.items()},
            "certainty": dict.fromkeys(("density_kg_per_m3", *mapped.parameters), "given"),
            "source": (own.source or "the settings file") if own else f"{mapped.keyword} {mid} of the deck",
        }
        plain = surrogate.plain_name(part.name) or f"part_{part.pid}"
        if plain in {p.name for p in parts}:
            plain = f"{plain}_{part.pid}"
        parts.append(Part(numbers[part.pid], plain, part.role, "helmet", name))
    return tuple(parts), materials


def set_numbers(helmet: int) -> dict[str, int]:
    """Numbers of a helmet's part sets, which friction pairs name (article, 3.2.3)."""
    base = helmet * 10_000_000
    return {f"H{helmet}_pads_set1": base + 99, f"H{helmet}_pads_set2": base + 100, "all_parts": 99}


def read_deck_as_model(files: Sequence[Path], *, units: str | None = None, settings_file: Path | None = None) -> Model:
    """A keyword deck as a model with its own numbers, for a run of it by itself; one of ours as it was before.

    Raises
    ------
    InputError, InputErrors
        For what cannot be read, and for parts that cannot be simulated.
    """
    ours = model_of_own_deck(read_keyword(*files)) if settings_file is None else None
    if ours is not None:
        return ours
    source = open_deck(files, units=units, settings_file=settings_file)
    same = {
        "node": {n: n for n in source.deck.node_ids.tolist()},
        "element": {n: n for n in source.deck.solids.ids.tolist()},
        "part": {part.pid: part.pid for part in source.helmet.parts},
    }
    return as_model(source, same, np.zeros(len(source.deck.solids.ids), dtype=bool), helmet=1)
