"""A sealed archive, or the folder it was unpacked to, as one set of named files."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Protocol

from replay.bundle.archive import MOST_ENTRIES, Archive
from replay.bundle.names import find_collision, shown, why_unsafe
from replay.errors import BundleError


class Members(Protocol):
    """Files of a bag by their path in it.

    Attributes
    ----------
    label
        Name of the archive or folder, for messages.
    sizes
        Path to bytes, in the order of the paths.
    checksums
        Path to the CRC-32 that the archive stores; empty for a folder.
    """

    label: str
    sizes: dict[str, int]
    checksums: dict[str, int]

    def open(self, name: str) -> BinaryIO:
        """Open a file for reading; the stream can seek."""
        ...


class _ZipMembers:
    def __init__(self, archive: Archive) -> None:
        self._archive = archive
        self.label = archive.path.name
        tops = {name.partition("/")[0] for name in archive.entries}
        if len(tops) != 1 or any("/" not in name for name in archive.entries):
            message = f"{self.label}: holds {len(tops)} folders or files at its top\n    expected: one bag"
            raise BundleError(message)
        self._top = f"{tops.pop()}/"
        self.sizes = {name[len(self._top) :]: entry.size for name, entry in archive.entries.items()}
        self.checksums = {name[len(self._top) :]: entry.crc32 for name, entry in archive.entries.items()}

    def open(self, name: str) -> BinaryIO:
        return self._archive.open(self._top + name)


class _FolderMembers:
    def __init__(self, folder: Path) -> None:
        self._folder, self.label = folder, folder.name
        self.sizes: dict[str, int] = {}
        self.checksums: dict[str, int] = {}
        self._walk(folder, "")
        if collision := find_collision(self.sizes):
            message = f"{self.label}: {shown(collision[0])!r} {collision[2]} ({shown(collision[1])!r})"
            raise BundleError(message)

    def _walk(self, folder: Path, prefix: str) -> None:
        for path in sorted(folder.iterdir(), key=lambda p: p.name.encode("utf-8", "surrogateescape")):
            name = prefix + path.name
            mode = path.lstat().st_mode
            reason = why_unsafe(name)
            if not stat.S_ISDIR(mode) and not stat.S_ISREG(mode):
                reason = "is a link or a special file, not a plain one"
            if len(self.sizes) >= MOST_ENTRIES:
                reason = f"is one of more than {MOST_ENTRIES} files"
            if reason:
                message = f"{self.label}: {shown(name)!r} {reason}\n    mend: unpack the bundle again"
                raise BundleError(message)
            if stat.S_ISDIR(mode):
                self._walk(path, f"{name}/")
            else:
                self.sizes[name] = path.lstat().st_size

    def open(self, name: str) -> BinaryIO:
        return (self._folder / name).open("rb")


@contextmanager
def open_members(path: str | Path) -> Iterator[Members]:
    """Open an archive or an unpacked bag; nothing is ever written.

    Parameters
    ----------
    path
        ``<play>.zip``, or a folder that holds ``bagit.txt``.

    Raises
    ------
    BundleError
        When it is neither, or holds something that is refused by its name.
    """
    path = Path(path)
    if path.is_dir():
        if not (path / "bagit.txt").is_file():
            message = f"{path}: is no unpacked bundle, bagit.txt is missing\n    mend: name the folder that holds it"
            raise BundleError(message)
        yield _FolderMembers(path)
        return
    if not path.is_file():
        message = f"{path}: does not exist\n    mend: check the name and the folder"
        raise BundleError(message)
    with Archive(path) as archive:
        yield _ZipMembers(archive)
