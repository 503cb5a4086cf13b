"""The canonical zip: any program reads it, and beyond 4 GB it is still one."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path

import pytest

from replay.bundle import archive as canonical
from replay.bundle.archive import Archive, Member, write_archive
from replay.errors import ReplayError

FILES = {"demo/b.txt": b"bee", "demo/a.txt": b"", "demo/größe.bin": bytes(range(256)) * 3}


def members(files: dict[str, bytes]) -> list[Member]:
    return [Member(n, len(d), zlib.crc32(d), lambda d=d: io.BytesIO(d)) for n, d in files.items()]


def read_back(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        for info in archive.infolist():
            assert info.date_time == (1980, 1, 1, 0, 0, 0)
            assert info.external_attr >> 16 == 0o100644
        return {name: archive.read(name) for name in archive.namelist()}


def test_any_program_reads_it_sorted_and_dated_alike(tmp_path):
    write_archive(tmp_path / "a.zip", members(FILES))
    assert read_back(tmp_path / "a.zip") == FILES
    assert list(read_back(tmp_path / "a.zip")) == sorted(FILES)
    write_archive(tmp_path / "b.zip", members(dict(reversed(FILES.items()))))
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()


@pytest.mark.parametrize("limit", [0, 2, 100, 400])
def test_sizes_and_offsets_beyond_32_bits_take_64(tmp_path, monkeypatch, limit):
    """The limit is lowered, so that small files take the fields of those beyond 4 GB."""
    monkeypatch.setattr(canonical, "_ZIP64_FROM", limit)
    write_archive(tmp_path / "a.zip", members(FILES))
    assert read_back(tmp_path / "a.zip") == FILES
    with Archive(tmp_path / "a.zip") as archive:
        assert {name: archive.open(name).read() for name in archive.entries} == FILES


def test_members_can_be_read_at_any_place(tmp_path):
    write_archive(tmp_path / "a.zip", members(FILES))
    with Archive(tmp_path / "a.zip") as archive, archive.open("demo/größe.bin") as stream:
        stream.seek(-2, io.SEEK_END)
        assert stream.read() == b"\xfe\xff"
        stream.seek(10)
        assert stream.read(3) == bytes([10, 11, 12])
        assert stream.seek(5000) == 5000
        assert stream.read() == b""


def test_a_file_that_grows_while_it_is_sealed_is_refused(tmp_path):
    grown = Member("demo/a.txt", 3, zlib.crc32(b"abc"), lambda: io.BytesIO(b"abcd"))
    with pytest.raises(ReplayError, match=r"demo/a.txt: changed while it was being sealed"):
        write_archive(tmp_path / "a.zip", [grown])


def test_names_no_bundle_may_hold_are_refused_on_writing_too(tmp_path):
    for files in ({"../a": b""}, {"demo/a": b"", "demo/A": b""}):
        with pytest.raises(ReplayError, match="mend: rename"):
            write_archive(tmp_path / "a.zip", members(files))
