"""Compare two runs artifact by artifact: bundles, unpacked bundles or results folders."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from replay.bundle.numbers import Apart, worst
from replay.bundle.sealed import Listed, SealedRun, open_run
from replay.bundle.units import unit_of
from replay.manifest import NAME as MANIFEST

Outcome = Literal["same", "within", "differs", "missing", "extra", "not compared"]
_FINE = ("same", "within", "not compared")
_ORDER: dict[Outcome, int] = {"differs": 0, "missing": 1, "extra": 2, "within": 3, "not compared": 4, "same": 5}
# Where a run came from, not what it made: told when it differs, but no reason for runs to disagree.
_PROVENANCE = ("source/", "bundle.json", "README.md")


@dataclass(frozen=True)
class Difference:
    """One artifact in both runs.

    Parameters
    ----------
    path, class_, unit
        The artifact.
    outcome
        ``same`` bytes; ``within`` tolerance; ``differs``; ``missing`` in the new run; ``extra`` there;
        ``not compared`` for a volatile one, and for provenance that differs.
    worst
        Its worst entry, where the file holds numbers that differ.
    """

    path: str
    class_: str
    unit: str
    outcome: Outcome
    worst: Apart | None = None

    @property
    def kind(self) -> str:
        """Class of the artifact, or provenance: where a run came from, told when it differs but not compared."""
        return "provenance" if self.outcome == "not compared" and self.class_ != "volatile" else self.class_

    def sentence(self) -> str:
        """Say it in one line."""
        text = f"{self.path} ({self.class_}): {self.outcome}"
        if self.worst is None:
            return text
        unit = "" if math.isnan(self.worst.absolute) else self.unit or unit_of(self.worst.where)
        unit = f" {unit}" if unit else ""
        text += f", worst at {self.worst.where}: {self.worst.old}{unit} -> {self.worst.new}{unit}"
        if not math.isnan(self.worst.absolute):
            text += f" (by {self.worst.absolute:.3g}{unit}, relative {self.worst.relative:.2g})"
        return text


@dataclass(frozen=True)
class Comparison:
    """Two runs side by side.

    Parameters
    ----------
    old, new
        The runs.
    differences
        Every artifact: those that differ first, each outcome in the order of the workflow.
    """

    old: Path
    new: Path
    differences: tuple[Difference, ...]

    @property
    def first(self) -> Difference | None:
        """The first artifact in the order of the workflow that differs: there the runs parted."""
        return next((d for d in self.differences if d.outcome == "differs"), None)

    @property
    def agree(self) -> bool:
        """Whether every exact artifact is the same and every other within its tolerance."""
        return all(d.outcome in _FINE for d in self.differences)

    @property
    def identical(self) -> bool:
        """Whether every compared artifact has the same bytes."""
        return all(d.outcome in ("same", "not compared") for d in self.differences)

    def count(self, outcome: Outcome) -> int:
        """Count the artifacts with one outcome."""
        return sum(d.outcome == outcome for d in self.differences)

    def text(self) -> str:
        """Say it in a few lines: the counts by class, where the runs parted, then all that is not the same."""
        counts = []
        for kind in ("exact", "tolerance", "provenance", "volatile"):
            found = Counter(d.outcome for d in self.differences if d.kind == kind)
            counts += [f"{kind} " + ", ".join(f"{found[o]} {o}" for o in _ORDER if found[o])] if found else []
        lines = [f"the runs {'agree' if self.agree else 'differ'}: {'; '.join(counts)}"]
        if self.first:
            lines.append(f"first to differ, in the order of the workflow:\n  {self.first.sentence()}")
        rest = [d for d in self.differences if d.outcome not in ("same", "not compared") and d is not self.first]
        lines += ["also:", *(f"  {d.sentence()}" for d in rest)] if rest else []
        if any(d.outcome == "not compared" and d.path == "source/source.tar" for d in self.differences):
            lines.append("the runs were made with different source (source/source.tar)")
        return "\n".join(lines)


def compare(old: str | Path, new: str | Path) -> Comparison:
    """Compare two runs by the class of each artifact.

    Parameters
    ----------
    old, new
        Sealed archives, unpacked bundles or results folders, in any mixture. Where one is a
        results folder, what a bundle adds to it (source, lock, papers) is not compared.

    Raises
    ------
    BundleError
        When a bundle's frame is broken (its bytes are for `verify`).
    InputError
        When a results folder changed since its stages wrote it.
    """
    old, new = Path(old), Path(new)
    with open_run(old) as before, open_run(new) as after:
        both = before.sealed and after.sealed
        names = sorted(name for name in {*before.files, *after.files} if both or name.startswith("results/"))
        found = [_compare_one(name, before, after) for name in names]
        stages = [*before.stages(), *after.stages()]
    found.sort(key=lambda d: (_ORDER[d.outcome], _place(d.path, stages)))
    return Comparison(old, new, tuple(found))


def _place(path: str, stages: list[str]) -> tuple[int, bool, str]:
    """Where in the workflow a file comes: what is no result first, then by stage, its manifest after its files."""
    parts = path.split("/")
    stage = stages.index(parts[1]) if parts[0] == "results" and parts[1] in stages else -1
    return stage, parts[-1] == MANIFEST, path


def _compare_one(name: str, before: SealedRun, after: SealedRun) -> Difference:
    old, new = before.files.get(name), after.files.get(name)
    either = old or new
    assert either is not None
    if either.class_ == "volatile":
        return Difference(name, "volatile", "", "not compared")
    if old is None or new is None:
        return Difference(name, either.class_, either.unit, "extra" if old is None else "missing")
    if _same_bytes(old, new):
        return Difference(name, old.class_, old.unit, "same")
    if name.startswith(_PROVENANCE):
        return Difference(name, old.class_, "", "not compared")
    if name.endswith(f"/{MANIFEST}"):
        same = _essence(old, before, after) == _essence(new, before, after)
        return Difference(name, old.class_, "", "within" if same else "differs")
    with old.open() as a, new.open() as b:
        apart = worst(name, a, b, old.rtol, old.atol)
    # Equal numbers in other bytes are good enough for a tolerance, never for class exact.
    within = old.class_ == "tolerance" and (apart.within if apart else _is_numeric(name))
    return Difference(name, old.class_, old.unit, "within" if within else "differs", apart)


def _is_numeric(name: str) -> bool:
    return name.endswith((".csv", ".json", ".h5", ".hdf5", ".vtkhdf", ".npy", ".npz"))


def _same_bytes(old: Listed, new: Listed) -> bool:
    with old.open() as a, new.open() as b:
        while True:
            one, other = a.read(1 << 20), b.read(1 << 20)
            if one != other:
                return False
            if not one:
                return True


def _essence(artifact: Listed, *sides: SealedRun) -> Any:
    """Read a stage's manifest without the sizes and hashes of files that may differ within tolerance."""
    loose = {name for side in sides for name, a in side.files.items() if a.class_ == "tolerance"}
    with artifact.open() as stream:
        value = json.load(stream)
    for entry in value["artifacts"]:
        if entry["class"] == "tolerance":
            entry["bytes"] = entry["sha256"] = None
    for entry in value["inputs"]:
        if f"results/{entry['path']}" in loose:
            entry["sha256"] = None
    return value
