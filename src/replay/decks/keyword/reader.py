"""Reading LS-DYNA keyword files: everything in them is understood, or kept as it stands and listed, or refused by line.

Own code rather than a library: `docs/decks.md` has the comparison.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from replay.decks.keyword.blocks import STANDARD, Block, read_blocks
from replay.decks.keyword.columns import FACTS_MARK
from replay.decks.keyword.deck import Collision, Elements, Kept, KeywordDeck, Remark, meaning_of
from replay.decks.keyword.entries import read_entries
from replay.decks.keyword.fields import Line, Value, mistake
from replay.decks.keyword.forms import canonical, form_of, is_complete
from replay.decks.keyword.mesh import ElementRows, NodeRows, read_elements, read_nodes
from replay.decks.keyword.parameters import read_parameters
from replay.decks.keyword.transform import Transform, read_transform, transformation
from replay.errors import InputError, InputErrors

_DEEPEST = 40
_MOST_ERRORS = 50
_SOLIDS, _SHELLS = ("ELEMENT_SOLID",), ("ELEMENT_SHELL",)
# Keywords that a model takes over.
_USED = ("PART", "SECTION_SOLID", "SECTION_SHELL", "DEFINE_CURVE")


@dataclass
class _Reading:
    """What grows while files are read."""

    deck: KeywordDeck = field(default_factory=KeywordDeck)
    parameters: dict[str, Value] = field(default_factory=dict)
    folders: list[Path] = field(default_factory=list)
    errors: list[InputError] = field(default_factory=list)
    nodes: list[tuple[NodeRows, int]] = field(default_factory=list)
    solids: list[tuple[ElementRows, int]] = field(default_factory=list)
    shells: list[tuple[ElementRows, int]] = field(default_factory=list)


def read_keyword(*paths: str | Path) -> KeywordDeck:
    """Read keyword files and what they include as one deck.

    Parameters
    ----------
    paths
        Files, as though one file included them all.

    Raises
    ------
    InputError, InputErrors
        Every mistake with file, line, field, what was found and what was expected.
    """
    reading = _Reading()
    for path in map(Path, paths):
        reading.folders.append(path.parent)
        _read_file(path, reading, (), STANDARD, Transform())
    _gather(reading)
    if not reading.errors:
        _check_references(reading)
    if reading.errors:
        errors = reading.errors[:_MOST_ERRORS]
        raise errors[0] if len(errors) == 1 else InputErrors(errors)
    return reading.deck


def _read_file(path: Path, reading: _Reading, above: tuple[Path, ...], layout: str, transform: Transform) -> None:
    reading.deck.files.append(path)
    index = len(reading.deck.files) - 1
    try:
        for block in read_blocks(path, layout):
            if len(reading.errors) >= _MOST_ERRORS:
                return
            reading.deck.keywords += 1
            try:
                _take(block, index, reading, (*above, path.resolve()), transform)
            except InputError as error:
                reading.errors.append(error)
            except InputErrors as errors:
                reading.errors += errors.errors
    except InputError as error:
        reading.errors.append(error)


def _take(block: Block, index: int, reading: _Reading, above: tuple[Path, ...], transform: Transform) -> None:
    deck, keyword = reading.deck, canonical(block.keyword)
    if keyword in ("KEYWORD", "TITLE"):
        deck.spent += 1
        if keyword == "TITLE":
            deck.title = deck.title or " ".join(line.text.strip() for line in block.lines)
        else:
            deck.facts += "".join(row[len(FACTS_MARK) :].strip() for row in block.raw if row.startswith(FACTS_MARK))
            _remark_lines(block, deck)
    elif keyword == "NODE" and not block.options:
        reading.nodes.append((transform.nodes(read_nodes(block, reading.parameters)), index))
        _remark_beyond(block, deck, (8, 16, 16, 16, 8, 8), (20,) * 6, (10, 16, 16, 16, 10, 10))
    elif keyword in _SOLIDS + _SHELLS and not block.options:
        rows = transform.elements(read_elements(block, reading.parameters, shell=keyword in _SHELLS))
        (reading.shells if keyword in _SHELLS else reading.solids).append((rows, index))
        _remark_beyond(block, deck, (8,) * 10, (20,) * 10, (10,) * 10)
        if keyword in _SHELLS:
            deck.remarks.append(Remark(f"*{keyword}", block.file, block.number, meaning_of(keyword)))
    elif keyword in ("PARAMETER", "PARAMETER_EXPRESSION", "PARAMETER_LOCAL", "PARAMETER_EXPRESSION_LOCAL"):
        reading.parameters = read_parameters(
            block.lines, reading.parameters, expression="EXPRESSION" in keyword, width=block.width
        )
        deck.spent += 1
    elif keyword in ("INCLUDE_PATH", "INCLUDE_PATH_RELATIVE"):
        for line in block.lines:
            reading.folders.append(block.file.parent / line.text.strip().replace("\\", "/"))
        deck.spent += 1
    elif keyword in ("INCLUDE", "INCLUDE_TRANSFORM"):
        deck.spent += 1
        _include(block, reading, above, transform)
    elif form_of(keyword) is not None:
        for entry in read_entries(block, reading.parameters):
            deck.entries.append(transform.entry(entry))
            if entry.extra:
                what = f"{len(entry.extra)} more cards than are understood are kept and not used"
                deck.remarks.append(Remark(f"*{keyword}", block.file, block.number, what))
        if keyword not in _USED and not keyword.startswith(("MAT_", "SET_")):
            deck.remarks.append(Remark(f"*{keyword}", block.file, block.number, meaning_of(keyword)))
        if is_complete(keyword):
            _remark_beyond(block, deck, (10,) * 8, (20,) * 8, (10,) * 8)
    else:
        name = f"*{block.keyword}" if block.keyword else ""
        deck.kept.append(Kept(name, block.file, block.number, block.text()))
        meaning = meaning_of(keyword) if keyword else "text outside the keywords; no effect"
        deck.remarks.append(Remark(name, block.file, block.number, meaning))


def _remark_lines(block: Block, deck: KeywordDeck) -> None:
    lines = [line for line in block.lines if line.text.strip()]
    if lines:
        what = f"{len(lines)} lines below it belong to no keyword and are not read"
        deck.remarks.append(Remark(f"*{block.keyword}", block.file, lines[0].number, what))


def _remark_beyond(
    block: Block, deck: KeywordDeck, standard: Sequence[int], long: Sequence[int], i10: Sequence[int]
) -> None:
    """Say it where lines go on beyond their last column."""
    total = sum({"standard": standard, "long": long, "i10": i10}[block.layout])
    if block.options:
        total = max(total, 80)
    longer = [
        line.number for line in block.lines if len(line.text) > total and "," not in line.text
        and line.text[total:].strip()
    ]  # fmt: skip
    if longer:
        what = f"text beyond column {total} in {len(longer)} lines is not read"
        deck.remarks.append(Remark(f"*{block.keyword}", block.file, longer[0], what))


def _include(block: Block, reading: _Reading, above: tuple[Path, ...], transform: Transform) -> None:
    names, cards = _file_names(block)
    inner = transform
    if canonical(block.keyword) == "INCLUDE_TRANSFORM":
        known = reading.deck.of_kind("transform")
        own = read_transform(
            cards, block.width, reading.parameters, lambda line, number: transformation(line, number, known)
        )
        inner = own.then(transform)
    elif cards:
        names += [(line, line.text.strip()) for line in cards]
    if not names:
        raise mistake(block, "filename", "no file is named", "the name of a keyword file")
    for line, name in names:
        path = _find(line, name, [block.file.parent, *reading.folders])
        if path.resolve() in above:
            chain = " -> ".join(p.name for p in (*above[above.index(path.resolve()) :], path))
            raise mistake(
                line, "filename", f"the file includes itself: {chain}", "includes without a circle", "remove one"
            )
        if len(above) >= _DEEPEST:
            raise mistake(
                line, "filename", f"includes are nested {len(above)} deep", f"at most {_DEEPEST}", "flatten them"
            )
        _read_file(path, reading, above, block.layout, inner)


def _file_names(block: Block) -> tuple[list[tuple[Line, str]], list[Line]]:
    """First file name, which may go on over lines that end in `` +``, and the lines after it."""
    lines = block.lines
    name = ""
    for k, line in enumerate(lines):
        text = line.text.rstrip()
        name += text[:-2].strip() if text.endswith(" +") else text.strip()
        if not text.endswith(" +"):
            return ([(line, name)] if name else []), lines[k + 1 :]
    return ([(lines[-1], name)] if name else []), []


def _find(line: Line, name: str, folders: list[Path]) -> Path:
    plain = name.strip("\"'").replace("\\", "/")
    if "\0" in plain or len(plain) > 1000:
        raise mistake(line, "filename", "is no name of a file", "a name of at most 1000 characters")
    for folder in folders:
        try:
            if (folder / plain).is_file():
                return folder / plain
        except OSError:
            continue
    looked = ", ".join(dict.fromkeys(str(folder) for folder in folders))
    raise mistake(line, "filename", f"the file {plain[:200]} is not there", f"a file in {looked}",
                     "correct the name, or name its folder with *INCLUDE_PATH")  # fmt: skip


def _gather(reading: _Reading) -> None:
    """Join the blocks' arrays and note the numbers given twice; the first definition holds."""
    deck = reading.deck
    if reading.nodes:
        ids = np.concatenate([rows.ids for rows, _ in reading.nodes])
        points = np.concatenate([rows.coordinates for rows, _ in reading.nodes])
        codes = np.concatenate([rows.constraints for rows, _ in reading.nodes])
        files, lines = _places(reading.nodes)
        first = _first_of(ids, "node", deck, files, lines)
        deck.node_ids, deck.nodes, deck.node_constraints = ids[first], points[first], codes[first]
        held = (deck.node_constraints != 0).any(axis=1)
        if held.any():
            row = int(np.flatnonzero(first)[np.argmax(held)])
            what = f"constraints of {int(held.sum())} nodes (tc, rc) are not applied: they move freely"
            deck.remarks.append(Remark("*NODE", deck.files[files[row]], int(lines[row]), what))
    for name, blocks in (("solids", reading.solids), ("shells", reading.shells)):
        if blocks:
            files, lines = _places(blocks)
            rows = Elements(
                np.concatenate([b.ids for b, _ in blocks]),
                np.concatenate([b.parts for b, _ in blocks]),
                np.concatenate([b.nodes for b, _ in blocks]),
                files,
                lines,
            )
            if name == "solids":  # a tetrahedron may stand there with its four nodes alone
                four = (rows.nodes[:, :4] != 0).all(axis=1) & (rows.nodes[:, 4:] == 0).all(axis=1)
                rows.nodes[four, 4:8] = rows.nodes[four, 3:4]
            setattr(deck, name, rows.only(_first_of(rows.ids, "element", deck, files, lines)))
    shared = np.intersect1d(deck.solids.ids, deck.shells.ids)
    if len(shared) and len(deck.solids.ids):
        what = f"{len(shared)} numbers are used by a solid and by a shell, which LS-DYNA permits"
        deck.remarks.append(Remark("*ELEMENT_SHELL", deck.files[deck.shells.files[0]], int(deck.shells.lines[0]), what))
    _collide_entries(deck)


def _places(blocks: Sequence[tuple[NodeRows | ElementRows, int]]) -> tuple[np.ndarray, np.ndarray]:
    files = np.concatenate([np.full(len(rows.ids), index) for rows, index in blocks])
    return files, np.concatenate([rows.lines for rows, _ in blocks])


def _first_of(ids: np.ndarray, kind: str, deck: KeywordDeck, files: np.ndarray, lines: np.ndarray) -> np.ndarray:
    _, first, back = np.unique(ids, return_index=True, return_inverse=True)
    keep = np.zeros(len(ids), dtype=bool)
    keep[first] = True
    for row in np.flatnonzero(~keep).tolist():
        before = int(first[back[row]])
        deck.collisions.append(
            Collision(
                kind,
                int(ids[row]),
                f"{deck.files[files[before]]}:{lines[before]}",
                f"{deck.files[files[row]]}:{lines[row]}",
            )
        )
    return keep


def _collide_entries(deck: KeywordDeck) -> None:
    seen: dict[tuple[str, int], str] = {}
    for entry in deck.entries:
        if entry.kind and entry.id:
            key, place = (entry.kind, entry.id), f"{entry.file}:{entry.line}"
            if key in seen:
                deck.collisions.append(Collision(entry.kind, entry.id, seen[key], place))
            seen.setdefault(key, place)


def _check_references(reading: _Reading) -> None:
    """Refuse elements whose nodes are not there."""
    deck = reading.deck
    known = np.sort(deck.node_ids)
    for elements, needed in ((deck.solids, 8), (deck.shells, 3)):
        if not len(elements.ids):
            continue
        place = np.minimum(np.searchsorted(known, elements.nodes), max(len(known) - 1, 0))
        there = (elements.nodes == 0) | (known[place] == elements.nodes if len(known) else False)
        blank = elements.nodes == 0
        blank[:, needed:] = False
        if needed == 8:  # a ten-node tetrahedron has both of its last nodes
            blank[:, 8] = (elements.nodes[:, 8] == 0) & (elements.nodes[:, 9] != 0)
            blank[:, 9] = (elements.nodes[:, 9] == 0) & (elements.nodes[:, 8] != 0)
        for row in np.flatnonzero((blank | ~there).any(axis=1))[:_MOST_ERRORS].tolist():
            column = int(np.argmax(blank[row] | ~there[row]))
            found = f"names node {elements.nodes[row, column]}, which is not there"
            reading.errors.append(
                InputError(
                    deck.files[elements.files[row]],
                    f"element {elements.ids[row]} {'has no node there' if blank[row, column] else found}",
                    line=int(elements.lines[row]),
                    column=f"n{column + 1}",
                    expected="the number of a node of the deck",
                    mend="add the node, or correct the number",
                )
            )
