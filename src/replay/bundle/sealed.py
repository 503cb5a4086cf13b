"""One run as others read it: a sealed archive, the folder it was unpacked to, or a results folder.

Whatever is read of a bundle is first compared with the bundle's own manifest, so that a table over a
hundred bundles shows nothing that was changed, without reading the rest of them.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from replay.bundle import bag
from replay.bundle.contents import gather, workflow_order
from replay.bundle.members import Members, open_members
from replay.bundle.verify import read_listing, read_manifest_of
from replay.errors import BundleError, InputError
from replay.files import read_json
from replay.manifest import NAME as MANIFEST

_BLOCK = 1 << 20
_MOST_BYTES = 256 << 20


@dataclass(frozen=True)
class Listed:
    """One file of a run: its class, and how it is opened.

    Parameters
    ----------
    class_, rtol, atol, unit, stage
        As in ``artifacts.csv``.
    open
        Opens the content, unchecked.
    """

    class_: str
    rtol: float
    atol: float
    unit: str
    stage: str
    open: Callable[[], BinaryIO]


class SealedRun:
    """The files of one run by their payload path (``results/driver/driver_6dof.csv``).

    Parameters
    ----------
    path
        Archive or folder.
    sealed
        Whether it is a bundle; a results folder lacks the source, the lock and the papers.
    files
        Every artifact by path.
    fetch
        Returns a path from which an artifact can be read, its bytes checked.
    """

    def __init__(self, path: Path, *, sealed: bool, files: Mapping[str, Listed], fetch: Callable[[str], Path]) -> None:
        self.path, self.sealed, self.files, self._fetch = path, sealed, dict(files), fetch

    def __contains__(self, name: str) -> bool:
        return name in self.files

    def file(self, name: str) -> Path:
        """Path of a checked copy of one file; it lives as long as the run is open.

        Raises
        ------
        BundleError
            When its bytes are not those that were sealed.
        InputError
            When the run has no such file.
        """
        if name not in self.files:
            raise InputError(self.path, f"has no {name}", mend="the play did not come that far, or it was withheld")
        return self._fetch(name)

    def json(self, name: str) -> Any:
        """Content of a JSON file, or None where the run has none of that name."""
        return read_json(self.file(name)) if name in self.files else None

    def stages(self) -> list[str]:
        """Names of the stages with a manifest, in the order in which they built on one another."""
        read = {}
        for name in self.files:
            parts = name.split("/")
            if len(parts) == 3 and parts[0] == "results" and parts[2] == MANIFEST:
                read[parts[1]] = [entry["path"] for entry in self.json(name)["inputs"]]
        return workflow_order(read)


@contextmanager
def open_run(path: str | Path) -> Iterator[SealedRun]:
    """Open a bundle, an unpacked bundle or a results folder for reading.

    Raises
    ------
    BundleError
        When it is a bundle whose frame is broken; nothing was written then.
    InputError
        When it is a results folder that changed since its stages wrote it.
    """
    path = Path(path)
    if path.is_dir() and not (path / "bagit.txt").is_file():
        run = gather(path)
        files = {i.path: Listed(i.class_, i.rtol or 0.0, i.atol or 0.0, i.unit, i.stage, i.open) for i in run.items}
        yield SealedRun(path, sealed=False, files=files, fetch=lambda name: path / name.removeprefix("results/"))
        return
    with open_members(path) as members, tempfile.TemporaryDirectory(prefix="replay-bundle-") as folder:
        hashes = read_manifest_of(members, "sha256")
        files = {row["path"]: _listed(members, row) for row in read_listing(members)}

        def fetch(name: str) -> Path:
            return _checked_copy(members, name, hashes.get(bag.PAYLOAD + name, ""), Path(folder))

        yield SealedRun(path, sealed=True, files=files, fetch=fetch)


@contextmanager
def foreign_content(path: Path) -> Iterator[None]:
    """Turn what goes wrong on reading files of another's making into one message: whoever sealed may write anything.

    Raises
    ------
    BundleError
        Where a file holds other things than a run of this kind.
    """
    try:
        yield
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        message = f"{path.name}: its files are not those of a run of this kind ({type(error).__name__}: {error})"
        raise BundleError(message) from None


def _listed(members: Members, row: dict[str, str]) -> Listed:
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
    return Listed(row["class"], rtol, atol, row["unit"], row["stage"], lambda: members.open(name))


def _checked_copy(members: Members, name: str, promised: str, folder: Path) -> Path:
    """Copy one member out of the bundle, unless it is another than was sealed or beyond what a reader needs."""
    copy = folder / name
    if copy.is_file():
        return copy
    if members.sizes[bag.PAYLOAD + name] > _MOST_BYTES:
        message = f"{members.label}: {name}: has {members.sizes[bag.PAYLOAD + name]} bytes, too many for what it is"
        raise BundleError(message)
    copy.parent.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256()
    with members.open(bag.PAYLOAD + name) as source, copy.open("wb") as target:
        while block := source.read(_BLOCK):
            digest.update(block)
            target.write(block)
    if digest.hexdigest() != promised:
        copy.unlink()
        message = f"{members.label}: {name}: changed since it was sealed\n    mend: `replay verify` says more"
        raise BundleError(message)
    return copy
