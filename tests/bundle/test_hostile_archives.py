"""Hostile archives: each is refused with one message that says what it holds, and nothing is written or run."""

from __future__ import annotations

import io
import stat
import struct
import subprocess
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest

from replay.bundle import archive as canonical
from replay.bundle import verify
from replay.bundle.archive import Member, write_archive
from replay.bundle.names import find_collision, why_unsafe
from replay.cli import main
from replay.errors import BundleError


def pack(*names: str, method: int = zipfile.ZIP_STORED, mode: int = 0o100644, data: bytes = b"x", **fields) -> bytes:
    """Write an archive with the standard library, which asks no questions."""
    out = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w") as archive:
        warnings.simplefilter("ignore")
        for name in names:
            info = zipfile.ZipInfo("placeholder")
            info.filename, info.external_attr, info.compress_type = name, mode << 16, method
            for field, value in fields.items():
                setattr(info, field, value)
            archive.writestr(info, data)
    return out.getvalue()


def seal_names(*names: str, hidden: bytes = b"") -> bytes:
    """Write the canonical form without the writer's own check of names."""
    entries, out = [], b""
    for name in names:
        entry = canonical.Entry(name, 1, zlib.crc32(b"x"), len(out))
        out += entry.local_header() + b"x"
        entries.append(entry)
    out += hidden
    records = b"".join(entry.central_record() for entry in entries)
    return out + records + canonical._tail(len(entries), len(records), len(out))


def patch(data: bytes, at: int, layout: str, *values: int) -> bytes:
    put = struct.pack(layout, *values)
    return data[:at] + put + data[at + len(put) :]


TWO = seal_names("demo/a", "demo/b")
FIRST_RECORD, LAST_RECORD, END = TWO.index(b"PK\1\2"), TWO.rindex(b"PK\1\2"), TWO.index(b"PK\5\6")


def in_record(offset: int, layout: str, *values: int, record: int = FIRST_RECORD) -> bytes:
    return patch(TWO, record + offset, layout, *values)


UNSAFE_NAMES = {
    "a path that climbs out": ("../evil", "leads out of the bundle"),
    "a path that climbs out from inside": ("demo/../../evil", "leads out of the bundle"),
    "an absolute path": ("/etc/evil", "has an absolute path"),
    "a drive letter": ("C:/evil", "has an absolute path"),
    "a drive letter without a slash": ("C:evil", "has an absolute path"),
    "a network share": ("//server/share/evil", "has an absolute path"),
    "backslashes that climb out": ("demo\\..\\evil", "has a backslash"),
    "an empty part of a path": ("demo//evil", "not in normal form"),
    "a dot as part of a path": ("demo/./evil", "not in normal form"),
    "an entry for a folder": ("demo/", "is a folder entry"),
    "a name that is written right to left": ("demo/ev\u202eil", "control or invisible characters"),
    "a name with a space of no width": ("demo/ev\u200bil", "control or invisible characters"),
    "a name with a line break": ("demo/ev\nil", "control or invisible characters"),
    "a name that moves the cursor": ("demo/ev\x1b[2Jil", "control or invisible characters"),
    "a name in decomposed Unicode": ("demo/e\u0301vil", "another Unicode form than NFC"),
    "a name beyond what file systems take": ("demo/" + "x" * 300, "too long"),
    "a path beyond what systems take": ("demo/" + "x/" * 600 + "x", "too long"),
    "a device of Windows": ("demo/con.txt", "some systems cannot store"),
    "a numbered port of Windows": ("demo/data/LPT1", "some systems cannot store"),
    "a name that ends in a point": ("demo/evil.", "some systems cannot store"),
    "a name that ends in a space": ("demo/evil ", "some systems cannot store"),
    "a hidden stream of NTFS": ("demo/evil:stream", "some systems cannot store"),
    "a wildcard": ("demo/evil*", "some systems cannot store"),
}
COLLISIONS = {
    "one name twice": (("demo/a", "demo/a"), "occurs twice"),
    "names that differ in case alone": (("demo/A", "demo/a"), "differs in case alone"),
    "folders that differ in case alone": (("Demo/a", "demo/b"), "folder that differs in case alone"),
    "a file where a folder is": (("demo/a", "demo/a/b"), "is a file where another entry needs a folder"),
    "names that one file system folds together": (("demo/stra\u00dfe", "demo/strasse"), "differs in case alone"),
    "entries out of order": (("demo/b", "demo/a"), "not in its sorted place"),
    "two bags": (("demo/a", "other/b"), "at its top"),
    "a file at the top": (("a",), "at its top"),
}
OTHERS: dict[str, tuple[bytes, str]] = {
    "a symbolic link": (pack("demo/link", mode=stat.S_IFLNK | 0o777, data=b"/etc/passwd"), "'demo/link' is a link"),
    "a device": (pack("demo/null", mode=stat.S_IFCHR | 0o666), "special file"),
    "a named pipe": (pack("demo/pipe", mode=stat.S_IFIFO | 0o666), "special file"),
    "a bomb": (pack("demo/bomb", method=zipfile.ZIP_DEFLATED, data=b"\0" * (5 << 20)), "'demo/bomb' is compressed"),
    "a bomb of another method": (pack("demo/bomb", method=zipfile.ZIP_LZMA, data=b"\0" * 999), "is compressed"),
    "an encrypted entry": (in_record(8, "<H", 0x0801), "'demo/a' is encrypted"),
    "sizes that come after the content": (in_record(8, "<H", 0x0808), "not as it was sealed"),
    "a size beyond the archive": (in_record(20, "<2I", 1 << 30, 1 << 30), "more than the archive holds"),
    "two sizes for one entry": (in_record(20, "<2I", 1, 1 << 30), "'demo/a' declares 1073741824 bytes and stores 1"),
    "entries that share bytes": (in_record(42, "<I", 0, record=LAST_RECORD), "'demo/b' overlaps another entry"),
    "an entry on another disk": (in_record(34, "<H", 1), "not as it was sealed"),
    "a wrong checksum of its content": (in_record(16, "<I", 1), "not as it was sealed"),
    "two names for one entry": (TWO.replace(b"demo/a", b"demo/x", 1), "its local header (there 'demo/x')"),
    "a name that is not UTF-8": (patch(TWO, FIRST_RECORD + 46 + 5, "<B", 0xFF), "a name is not UTF-8"),
    "a date, by another program": (pack("demo/a"), "'demo/a'"),
    "an extra field with another name": (
        pack("demo/a", extra=struct.pack("<2HBI", 0x7075, 11, 1, 0) + b"../evil"[:6]),
        "'demo/a'",
    ),
    "a comment of an entry": (pack("demo/a", comment=b"hello"), "'demo/a'"),
    "a comment of the archive": (patch(TWO, END + 20, "<H", 5) + b"hello", "no end-of-archive record in its last"),
    "bytes before": (b"MZ" + TWO, "does not fit the length"),
    "bytes after": (TWO + b"\0", "no end-of-archive record in its last bytes"),
    "bytes between": (seal_names("demo/a", "demo/b", hidden=b"hidden"), "6 foreign bytes after demo/b"),
    "a second archive behind the first": (TWO + seal_names("demo/c"), "does not fit the length"),
    "a count beyond reason": (canonical._tail(10_000_000, 0, 0), "declares 10000000 entries"),
    "a count that is too large": (patch(TWO, END + 8, "<2H", 3, 3), "counts 3 entries, the directory has 2"),
    "a count that is too small": (patch(TWO, END + 8, "<2H", 1, 1), "counts 1 entries, the directory has more"),
    "a directory that lies elsewhere": (patch(TWO, END + 16, "<I", 0), "does not fit the length"),
    "no entry at all": (canonical._tail(0, 0, 0), "holds 0 folders"),
    "something that is no archive": (b"#!/bin/sh\necho hello\n", "no end-of-archive record"),
    "nothing": (b"", "no end-of-archive record"),
}
HOSTILE: dict[str, tuple[bytes, str]] = {
    **{what: (pack(name), reason) for what, (name, reason) in UNSAFE_NAMES.items()},
    **{what: (seal_names(*names), reason) for what, (names, reason) in COLLISIONS.items()},
    **OTHERS,
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_archive_is_refused_with_one_message_and_nothing_is_written(tmp_path, what, monkeypatch):
    data, reason = HOSTILE[what]
    path = tmp_path / "h.zip"
    path.write_bytes(data)
    monkeypatch.setattr(subprocess, "Popen", _never)
    with pytest.raises(BundleError) as error:
        verify(path)
    message = str(error.value)
    assert reason in message
    assert message.startswith("h.zip: ")
    assert message.isprintable() or "\n" in message
    assert not set(message) - {"\n"} & set(map(chr, range(32)))
    assert [p.name for p in tmp_path.iterdir()] == ["h.zip"]


def _never(*arguments: object, **options: object) -> None:
    message = f"a program was started: {arguments}"
    raise AssertionError(message)


def test_the_collection_is_of_thirty_different_kinds_and_more():
    assert len(HOSTILE) >= 60
    assert len({data for data, _ in HOSTILE.values()}) == len(HOSTILE)


COMMANDS: dict[str, Callable[[str, Path], list[str]]] = {
    "verify": lambda bundle, _: ["verify", bundle],
    "show": lambda bundle, _: ["show", bundle],
    "compare": lambda bundle, _: ["compare", bundle, bundle],
    "agree": lambda bundle, _: ["agree", bundle, bundle],
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("what", ["a path that climbs out", "a symbolic link", "a bomb", "one name twice"])
def test_no_command_opens_what_verify_refuses(tmp_path, command, what, capsys):
    path = tmp_path / "h.zip"
    path.write_bytes(HOSTILE[what][0])
    assert main(COMMANDS[command](str(path), tmp_path / "into")) == BundleError.exit_code
    said = capsys.readouterr()
    assert HOSTILE[what][1] in said.err
    assert said.out == ""
    assert [p.name for p in tmp_path.iterdir()] == ["h.zip"]


def test_names_that_go_together_are_left_alone():
    assert find_collision(["demo/a", "demo/b/a", "demo/b/c", "demo/a.b"]) is None
    assert all(why_unsafe(name) is None for name in ("demo/a", "demo/.hidden", "demo/größe 1 (a).csv", "demo/console"))


def test_the_writer_refuses_unsafe_names_as_the_reader_does(tmp_path):
    for name, _ in UNSAFE_NAMES.values():
        with pytest.raises(Exception, match="mend: rename"):
            write_archive(tmp_path / "a.zip", [Member(name, 1, 0, lambda: io.BytesIO(b"x"))])
