"""A zip archive in one canonical form, so that equal contents give equal bytes.

Entries are sorted by name, stored without compression (compressors differ between
machines; the fields inside are compressed already), dated 1980-01-01, with mode 0644 and
nothing optional: no extra field but zip64 where a size needs it, no comment, no gap. Any
program that reads zip reads it.

Because the form is canonical, a reader can compute every byte that is not content. It
compares all of them before it reads any content, and so notices a change in a header as
surely as the checksums notice one in a file.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, NoReturn

from replay.bundle.names import find_collision, shown, why_unsafe
from replay.errors import BundleError, ReplayError

MOST_ENTRIES = 200_000
_MOST_DIRECTORY_BYTES = 128 << 20
_BLOCK = 1 << 20
_MAX16, _MAX32 = 0xFFFF, 0xFFFFFFFF
_ZIP64_FROM = _MAX32
_FLAGS = 0x0800  # names are UTF-8
_DATE = 0x0021  # 1980-01-01
_MODE = 0o100644 << 16
_LOCAL = struct.Struct("<4s5H3I2H")
_CENTRAL = struct.Struct("<4s6H3I5H2I")
_END = struct.Struct("<4s4H2IH")
_END64 = struct.Struct("<4sQ2H2I4Q")
_LOCATOR = struct.Struct("<4sIQI")
_REPACKED = "fetch the bundle again; a repacked one can be unpacked and its folder verified"


@dataclass(frozen=True)
class Entry:
    """One member: where its bytes are and what they must be."""

    name: str
    size: int
    crc32: int
    offset: int

    def local_header(self) -> bytes:
        """Return the header before the content."""
        big = self.size >= _ZIP64_FROM
        extra = struct.pack("<2H2Q", 1, 16, self.size, self.size) if big else b""
        size = _MAX32 if big else self.size
        name = self.name.encode()
        fields = (45 if big else 20, _FLAGS, 0, 0, _DATE, self.crc32, size, size, len(name), len(extra))
        return _LOCAL.pack(b"PK\3\4", *fields) + name + extra

    def central_record(self) -> bytes:
        """Return the record in the central directory."""
        big, far = self.size >= _ZIP64_FROM, self.offset >= _ZIP64_FROM
        wide = ([self.size, self.size] if big else []) + ([self.offset] if far else [])
        extra = struct.pack(f"<2H{len(wide)}Q", 1, 8 * len(wide), *wide) if wide else b""
        size, offset = _MAX32 if big else self.size, _MAX32 if far else self.offset
        name, version = self.name.encode(), 45 if wide else 20
        fields = (0x300 | 45, version, _FLAGS, 0, 0, _DATE, self.crc32, size, size, len(name), len(extra), 0, 0, 0)
        return _CENTRAL.pack(b"PK\1\2", *fields, _MODE, offset) + name + extra


def _tail(count: int, size: int, offset: int) -> bytes:
    """Return everything after the central directory."""
    out = b""
    if count >= _MAX16 or size >= _ZIP64_FROM or offset >= _ZIP64_FROM:
        at = offset + size
        out = _END64.pack(b"PK\6\6", 44, 0x300 | 45, 45, 0, 0, count, count, size, offset)
        out += _LOCATOR.pack(b"PK\6\7", 0, at, 1)
        count, size, offset = _MAX16, _MAX32, _MAX32
    return out + _END.pack(b"PK\5\6", 0, 0, count, count, size, offset, 0)


@dataclass(frozen=True)
class Member:
    """A file to be written: its name, what its bytes are known to be, and how to open it."""

    name: str
    size: int
    crc32: int
    open: Callable[[], BinaryIO]


def write_archive(path: Path, members: Sequence[Member]) -> None:
    """Write the canonical archive of `members`; content is streamed.

    Parameters
    ----------
    path
        File to write (in place; the caller makes it atomic).
    members
        In any order.

    Raises
    ------
    ReplayError
        When a file changed since it was measured, or a name may not be in a bundle.
    """
    _refuse_names([m.name for m in members], ReplayError, path.name)
    entries = []
    with path.open("wb") as out:
        for member in sorted(members, key=lambda m: m.name.encode()):
            entry = Entry(member.name, member.size, member.crc32, out.tell())
            out.write(entry.local_header())
            crc = 0
            with member.open() as stream:
                while block := stream.read(_BLOCK):
                    crc = zlib.crc32(block, crc)
                    out.write(block)
            if crc != member.crc32 or out.tell() - entry.offset - len(entry.local_header()) != member.size:
                message = (
                    f"{member.name}: changed while it was being sealed\n    mend: let the run end, then seal again"
                )
                raise ReplayError(message)
            entries.append(entry)
        start = out.tell()
        for entry in entries:
            out.write(entry.central_record())
        out.write(_tail(len(entries), out.tell() - start, start))


def _refuse_names(names: Iterable[str], kind: type[ReplayError], where: str) -> None:
    names = list(names)
    for name in names:
        if reason := why_unsafe(name):
            message = f"{where}: {shown(name)!r} {reason}\n    mend: rename it"
            raise kind(message)
    if collision := find_collision(names):
        name, other, reason = collision
        message = f"{where}: {shown(name)!r} {reason} ({shown(other)!r})\n    mend: rename one of them"
        raise kind(message)


class Archive:
    """A canonical archive, checked to the last byte that is not content, open for reading.

    Parameters
    ----------
    path
        The archive.

    Raises
    ------
    BundleError
        Naming the first entry that is unsafe, or whose headers are not what they must be.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._stream: BinaryIO = path.open("rb")
        except OSError as error:
            message = f"{path}: cannot be read ({error.strerror})"
            raise BundleError(message) from None
        try:
            self.entries = self._check()
        except BaseException:
            self._stream.close()
            raise

    def _refuse(self, what: str) -> NoReturn:
        message = f"{self.path.name}: {what}\n    mend: {_REPACKED}"
        raise BundleError(message)

    def _read(self, offset: int, size: int) -> bytes:
        self._stream.seek(offset)
        return self._stream.read(size)

    def _check(self) -> dict[str, Entry]:
        count, start, size, tail = self._find_directory()
        if count > MOST_ENTRIES or size > _MOST_DIRECTORY_BYTES:
            self._refuse(f"declares {count} entries, more than the {MOST_ENTRIES} a bundle may hold")
        directory = self._read(start, size)
        entries: list[Entry] = []
        at = position = 0
        for index in range(count):
            if at >= len(directory):
                self._refuse(f"the end-of-archive record counts {count} entries, the directory has {index}")
            entry, at, position = self._check_entry(index, directory, at, position, start)
            entries.append(entry)
        if at != len(directory):
            self._refuse(f"the end-of-archive record counts {count} entries, the directory has more")
        if position != start:
            last = shown(entries[-1].name) if entries else "the beginning"
            self._refuse(f"{start - position} foreign bytes after {last}")
        if tail != _tail(count, size, start):
            self._refuse("the end-of-archive record is not as it was sealed")
        names = [entry.name for entry in entries]
        if collision := find_collision(names):
            self._refuse(f"{shown(collision[0])!r} {collision[2]} ({shown(collision[1])!r})")
        for before, name in pairwise(names):
            if before.encode() > name.encode():
                self._refuse(f"{shown(name)!r} is not in its sorted place")
        return {entry.name: entry for entry in entries}

    def _find_directory(self) -> tuple[int, int, int, bytes]:
        length = self.path.stat().st_size
        end = self._read(max(0, length - _END.size), _END.size)
        if len(end) < _END.size or end[:4] != b"PK\5\6":
            self._refuse("has no end-of-archive record in its last bytes: cut short, or bytes were added")
        _, _, _, _, count, size, start, _ = _END.unpack(end)
        tail_size = _END.size
        if count == _MAX16 or _MAX32 in (size, start):
            tail_size += _END64.size + _LOCATOR.size
            wide = self._read(max(0, length - tail_size), _END64.size)
            if len(wide) == _END64.size and wide[:4] == b"PK\6\6":
                _, _, _, _, _, _, _, count, size, start = _END64.unpack(wide)
        if start + size + tail_size != length:
            self._refuse("the end-of-archive record does not fit the length of the file")
        return count, start, size, self._read(length - tail_size, tail_size)

    def _check_entry(self, index: int, directory: bytes, at: int, position: int, end: int) -> tuple[Entry, int, int]:
        """Check one record and the local header it belongs to; return both ends."""
        local_name = self._local_name(position)
        if len(directory) - at < _CENTRAL.size or directory[at : at + 4] != b"PK\1\2":
            self._refuse(f"{shown(local_name)!r}: its record in the central directory is damaged")
        fields = _CENTRAL.unpack_from(directory, at)
        flags, method, crc, packed, size = fields[3], fields[4], fields[7], fields[8], fields[9]
        n_name, n_extra, n_comment, mode, offset = fields[10], fields[11], fields[12], fields[15], fields[16]
        after = at + _CENTRAL.size
        raw_name = directory[after : after + n_name]
        name = raw_name.decode("utf-8", "replace")
        if name.encode() != raw_name:
            self._refuse(f"entry {index} ({shown(local_name)!r}): a name is not UTF-8: {raw_name!r}")
        label = repr(shown(name))
        if reason := why_unsafe(name):
            self._refuse(f"{label} {reason}" + (f" (locally {shown(local_name)!r})" if local_name != name else ""))
        if flags & 1:
            self._refuse(f"{label} is encrypted")
        if (mode >> 16) & 0o170000 not in (0, 0o100000):
            self._refuse(f"{label} is a link or a special file, not a plain one")
        if method:
            self._refuse(f"{label} is compressed; a sealed bundle stores, so that nothing can swell")
        extra = directory[after + n_name : after + n_name + n_extra]
        size, offset = _widen(extra, size, offset)
        if packed not in (_MAX32, size):
            self._refuse(f"{label} declares {size} bytes and stores {packed}")
        entry = Entry(name, size, crc, position)
        header = entry.local_header()
        if position + len(header) + size > end:
            self._refuse(f"{label} declares {size} bytes, more than the archive holds")
        if offset != position:
            self._refuse(f"{label} overlaps another entry or leaves a gap before it")
        record_end = after + n_name + n_extra + n_comment
        if directory[at:record_end] != entry.central_record():
            self._refuse(f"{label}: its record in the central directory is not as it was sealed")
        if self._read(position, len(header)) != header:
            self._refuse(f"{label}: its local header (there {shown(local_name)!r}) is not as it was sealed")
        return entry, record_end, position + len(header) + size

    def _local_name(self, position: int) -> str:
        """Name in the local header at `position`, as far as there is one, for messages."""
        header = self._read(position, _LOCAL.size)
        if len(header) < _LOCAL.size:
            return ""
        return self._read(position + _LOCAL.size, min(_LOCAL.unpack(header)[9], 1024)).decode("utf-8", "replace")

    def open(self, name: str) -> BinaryIO:
        """Open a member for reading; the stream can seek and shares the archive's file."""
        entry = self.entries[name]
        return io.BufferedReader(_Window(self._stream, entry.offset + len(entry.local_header()), entry.size), _BLOCK)

    def close(self) -> None:
        """Close the archive."""
        self._stream.close()

    def __enter__(self) -> Archive:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _widen(extra: bytes, size: int, offset: int) -> tuple[int, int]:
    """Take the 64-bit values of a zip64 field in place of those that do not fit."""
    if len(extra) < 4 or extra[:2] != b"\1\0":
        return size, offset
    wide = list(struct.unpack_from(f"<{(len(extra) - 4) // 8}Q", extra, 4))
    if size == _MAX32 and len(wide) >= 2:
        size, wide = wide[0], wide[2:]
    if offset == _MAX32 and wide:
        offset = wide[0]
    return size, offset


class _Window(io.RawIOBase):
    """A part of an open file as a file of its own."""

    def __init__(self, stream: BinaryIO, start: int, size: int) -> None:
        super().__init__()
        self._stream, self._start, self._size, self._at = stream, start, size, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at = max(0, base + offset)
        return self._at

    def readinto(self, buffer) -> int:
        count = max(0, min(len(buffer), self._size - self._at))
        if not count:
            return 0
        self._stream.seek(self._start + self._at)
        block = self._stream.read(count)
        buffer[: len(block)] = block
        self._at += len(block)
        return len(block)
