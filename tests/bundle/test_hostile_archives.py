"""Hostile archives: each is refused with one message that names the entry, and nothing is written."""

from __future__ import annotations

import stat
import struct
import warnings
import zipfile
from pathlib import Path

import pytest

from replay.bundle import archive as canonical
from replay.bundle import verify
from replay.bundle.names import find_collision, why_unsafe
from replay.errors import BundleError


def pack(path: Path, *names: str, method: int = zipfile.ZIP_STORED, mode: int = 0o100644, data: bytes = b"x") -> Path:
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w") as out:
        warnings.simplefilter("ignore")
        for name in names:
            info = zipfile.ZipInfo("placeholder")
            info.filename, info.external_attr, info.compress_type = name, mode << 16, method
            out.writestr(info, data)
    return path


def patch(path: Path, find: bytes, put: bytes, *, last: bool = False) -> Path:
    data = path.read_bytes()
    at = data.rindex(find) if last else data.index(find)
    path.write_bytes(data[:at] + put + data[at + len(put) :])
    return path


UNSAFE = {
    "../evil": "leads out of the bundle",
    "demo/../../evil": "leads out of the bundle",
    "/etc/evil": "has an absolute path",
    "C:/evil": "has an absolute path",
    "demo\\..\\evil": "has a backslash",
    "demo//evil": "not in normal form",
    "demo/./evil": "not in normal form",
    "demo/": "is a folder entry",
    "demo/ev\u202eil": "control or invisible characters",
    "demo/ev\u200bil": "control or invisible characters",
    "demo/ev\nil": "control or invisible characters",
    "demo/e\u0301vil": "another Unicode form than NFC",
    "demo/" + "x" * 300: "too long",
    "demo/" + "x/" * 600 + "x": "too long",
    "demo/con.txt": "some systems cannot store",
    "demo/evil.": "some systems cannot store",
    "demo/evil:stream": "some systems cannot store",
}


@pytest.mark.parametrize(("name", "reason"), UNSAFE.items(), ids=range(len(UNSAFE)))
def test_an_unsafe_name_is_refused(tmp_path, name, reason):
    assert reason in (why_unsafe(name) or "")
    refused(pack(tmp_path / "h.zip", name), reason)


def refused(path: Path, *wanted: str) -> None:
    before = sorted(path.parent.iterdir())
    with pytest.raises(BundleError) as error:
        verify(path)
    for part in wanted:
        assert part in str(error.value)
    assert str(error.value).startswith(f"{path.name}: ")
    assert sorted(path.parent.iterdir()) == before


def test_a_link_is_refused(tmp_path):
    refused(
        pack(tmp_path / "h.zip", "demo/link", mode=stat.S_IFLNK | 0o777, data=b"/etc/passwd"), "demo/link", "is a link"
    )


def test_a_device_is_refused(tmp_path):
    refused(pack(tmp_path / "h.zip", "demo/null", mode=stat.S_IFCHR | 0o666), "demo/null", "special file")


def test_a_bomb_is_refused_unread(tmp_path):
    path = pack(tmp_path / "h.zip", "demo/bomb", method=zipfile.ZIP_DEFLATED, data=b"\0" * (50 << 20))
    assert path.stat().st_size < 100_000
    refused(path, "demo/bomb", "is compressed")


def seal_names(path: Path, *names: str) -> Path:
    """Write the canonical form without the writer's own check of names."""
    entries, out = [], b""
    for name in names:
        entry = canonical.Entry(name, 1, 0x8CDC1683, len(out))  # CRC-32 of b"x"
        out += entry.local_header() + b"x"
        entries.append(entry)
    records = b"".join(entry.central_record() for entry in entries)
    path.write_bytes(out + records + canonical._tail(len(entries), len(records), len(out)))
    return path


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        (("demo/a", "demo/a"), "occurs twice"),
        (("demo/A", "demo/a"), "differs in case alone"),
        (("Demo/a", "demo/b"), "folder that differs in case alone"),
        (("demo/a", "demo/a/b"), "is a file where another entry needs a folder"),
        (("demo/stra\u00dfe", "demo/strasse"), "differs in case alone"),
        (("demo/b", "demo/a"), "not in its sorted place"),
        (("demo/a", "other/b"), "at its top"),
        (("a",), "at its top"),
    ],
)
def test_names_that_do_not_go_together_are_refused(tmp_path, names, reason):
    refused(seal_names(tmp_path / "h.zip", *names), reason)


def test_names_that_go_together_are_left_alone():
    assert find_collision(["demo/a", "demo/b/a", "demo/b/c", "demo/a.b"]) is None
    assert all(why_unsafe(name) is None for name in ("demo/a", "demo/.hidden", "demo/größe 1 (a).csv"))


def test_a_size_beyond_the_archive_is_refused(tmp_path):
    path = seal_names(tmp_path / "h.zip", "demo/a", "demo/b")
    data = path.read_bytes()
    at = data.index(b"PK\1\2") + 20
    path.write_bytes(data[:at] + struct.pack("<2I", 1 << 30, 1 << 30) + data[at + 8 :])
    refused(path, "'demo/a' declares 1073741824 bytes, more than the archive holds")
    path.write_bytes(data[:at] + struct.pack("<2I", 1, 1 << 30) + data[at + 8 :])
    refused(path, "'demo/a' declares 1073741824 bytes and stores 1")


def test_entries_that_share_bytes_are_refused(tmp_path):
    path = seal_names(tmp_path / "h.zip", "demo/a", "demo/b")
    data = path.read_bytes()
    at = data.rindex(b"PK\1\2") + 42
    path.write_bytes(data[:at] + struct.pack("<I", 0) + data[at + 4 :])
    refused(path, "'demo/b' overlaps another entry")


def test_an_encrypted_entry_is_refused(tmp_path):
    path = seal_names(tmp_path / "h.zip", "demo/a")
    data = path.read_bytes()
    at = data.index(b"PK\1\2") + 8
    path.write_bytes(data[:at] + struct.pack("<H", 0x0801) + data[at + 2 :])
    refused(path, "'demo/a' is encrypted")


def test_a_count_beyond_reason_is_refused_unread(tmp_path):
    (tmp_path / "h.zip").write_bytes(canonical._tail(10_000_000, 0, 0))
    refused(tmp_path / "h.zip", "declares 10000000 entries")


def test_a_comment_extra_field_or_hidden_bytes_are_refused(tmp_path):
    path = pack(tmp_path / "h.zip", "demo/a")
    refused(path, "'demo/a'")  # dated, and by another program
    with zipfile.ZipFile(path, "a") as out:
        out.comment = b"hello"
    refused(path, "no end-of-archive record in its last bytes")
    plain = seal_names(tmp_path / "g.zip", "demo/a", "demo/b").read_bytes()
    start = plain.index(b"PK\1\2")
    tail = plain.index(b"PK\5\6")
    hidden = plain[:start] + b"hidden" + plain[start:tail] + canonical._tail(2, tail - start, start + 6)
    path.write_bytes(hidden)
    refused(path, "6 foreign bytes after demo/b")


def test_two_names_for_one_entry_are_refused(tmp_path):
    path = patch(seal_names(tmp_path / "h.zip", "demo/a", "demo/b"), b"demo/a", b"demo/x")
    refused(path, "'demo/a': its local header (there 'demo/x')")


def test_a_name_that_is_not_utf8_is_refused(tmp_path):
    path = patch(seal_names(tmp_path / "h.zip", "demo/a"), b"demo/a", b"demo/\xff", last=True)
    refused(path, "a name is not UTF-8")
