"""Compare two runs artifact by artifact: bundles, unpacked bundles or results folders."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal

from replay.bundle import bag
from replay.bundle.contents import gather
from replay.bundle.members import Members, open_members
from replay.bundle.numbers import Apart, worst
from replay.bundle.verify import read_listing
from replay.errors import BundleError
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

    def sentence(self) -> str:
        """Say it in one line."""
        text = f"{self.path} ({self.class_}): {self.outcome}"
        if self.worst is None:
            return text
        unit = f" {self.unit}" if self.unit else ""
        text += f", worst at {self.worst.where}: {self.worst.old}{unit} -> {self.worst.new}{unit}"
        if not math.isnan(self.worst.absolute):
            text += f" (by {self.worst.absolute:.3g}{unit}, relative {self.worst.relative:.2g})"
        return text


@dataclass(frozen=True)
class Comparison:
    """Two runs side by side; the worst artifacts first."""

    old: Path
    new: Path
    differences: tuple[Difference, ...]

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
        """Say it in a few lines: the counts, then what is not the same, worst first."""
        head = "the runs agree" if self.agree else "the runs differ"
        counts = ", ".join(f"{self.count(o)} {o}" for o in _ORDER if self.count(o))
        rows = [d.sentence() for d in self.differences if d.outcome not in ("same", "not compared")]
        if any(d.outcome == "not compared" and d.path == "source/source.tar" for d in self.differences):
            rows.append("the runs were made with different source (source/source.tar)")
        return "\n".join([f"{head}: {counts}", *rows])


@dataclass(frozen=True)
class _Artifact:
    class_: str
    rtol: float
    atol: float
    unit: str
    open: Callable[[], BinaryIO]


@dataclass(frozen=True)
class _Side:
    sealed: bool
    artifacts: dict[str, _Artifact]


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
    with _open(old) as before, _open(new) as after:
        both = before.sealed and after.sealed
        names = sorted(name for name in {*before.artifacts, *after.artifacts} if both or name.startswith("results/"))
        found = [_compare_one(name, before, after) for name in names]
    found.sort(key=lambda d: (_ORDER[d.outcome], -_beyond(d), d.path))
    return Comparison(old, new, tuple(found))


def _beyond(difference: Difference) -> float:
    relative = difference.worst.relative if difference.worst else math.nan
    return math.inf if math.isnan(relative) else relative


@contextmanager
def _open(path: Path) -> Iterator[_Side]:
    if path.is_dir() and not (path / "bagit.txt").is_file():
        run = gather(path)
        yield _Side(
            False,
            {i.path: _Artifact(i.class_, i.rtol or 0.0, i.atol or 0.0, i.unit, i.open) for i in run.items},
        )
        return
    with open_members(path) as members:
        yield _Side(True, {row["path"]: _listed(members, row) for row in read_listing(members)})


def _listed(members: Members, row: dict[str, str]) -> _Artifact:
    name = bag.PAYLOAD + row["path"]
    if name not in members.sizes:
        message = (
            f"{members.label}: {name}: is missing, but artifacts.csv lists it\n    mend: `replay verify` says more"
        )
        raise BundleError(message)
    try:
        rtol, atol = (float(row[key] or 0.0) for key in ("rtol", "atol"))
    except ValueError:
        message = f"{members.label}: artifacts.csv: the tolerances of {row['path']} are no numbers"
        raise BundleError(message) from None
    return _Artifact(row["class"], rtol, atol, row["unit"], lambda: members.open(name))


def _compare_one(name: str, before: _Side, after: _Side) -> Difference:
    old, new = before.artifacts.get(name), after.artifacts.get(name)
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


def _same_bytes(old: _Artifact, new: _Artifact) -> bool:
    with old.open() as a, new.open() as b:
        while True:
            one, other = a.read(1 << 20), b.read(1 << 20)
            if one != other:
                return False
            if not one:
                return True


def _essence(artifact: _Artifact, *sides: _Side) -> Any:
    """Read a stage's manifest without the sizes and hashes of files that may differ within tolerance."""
    loose = {name for side in sides for name, a in side.artifacts.items() if a.class_ == "tolerance"}
    with artifact.open() as stream:
        value = json.load(stream)
    for entry in value["artifacts"]:
        if entry["class"] == "tolerance":
            entry["bytes"] = entry["sha256"] = None
    for entry in value["inputs"]:
        if f"results/{entry['path']}" in loose:
            entry["sha256"] = None
    return value
