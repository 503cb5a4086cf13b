"""Verifying: one changed byte anywhere is caught, and the file it belongs to is named."""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from replay.bundle import bag, verify
from replay.bundle.archive import Archive, Member, write_archive
from replay.errors import BundleError


def owners(path: Path) -> tuple[list[tuple[int, str]], int]:
    """Where each file's bytes begin, headers first, then the records of the directory; and where those end."""
    with Archive(path) as archive:
        entries = list(archive.entries.values())
    starts = [(entry.offset, entry.name) for entry in entries]
    last = entries[-1]
    position = last.offset + len(last.local_header()) + last.size
    for entry in entries:
        starts.append((position, entry.name))
        position += len(entry.central_record())
    return starts, position


def flip(path: Path, copy: Path, offset: int, mask: int) -> None:
    data = bytearray(path.read_bytes())
    data[offset] ^= mask
    copy.write_bytes(data)


def complaint(path: Path) -> str:
    with pytest.raises(BundleError) as error:
        verify(path)
    return str(error.value)


def test_a_sealed_bundle_verifies(sealed):
    report = verify(sealed())
    assert (report.play, report.verdict, report.digest_checked) == ("demo", "ACCEPTED", True)
    assert report.sha256 == hashlib.sha256(sealed().read_bytes()).hexdigest()
    with zipfile.ZipFile(sealed()) as archive:
        sizes = [i.file_size for i in archive.infolist() if "/data/" in i.filename]
    assert (report.files, report.bytes) == (len(sizes), sum(sizes))
    assert all(report.minimum_package.values())
    assert "play demo: ACCEPTED" in report.text()


def test_every_single_byte_change_is_caught_and_its_file_named(tmp_path, sealed):
    path = sealed()
    starts, end = owners(path)
    length = path.stat().st_size
    draw = np.random.default_rng(20)
    # Contents outweigh headers: half of the places are drawn among headers and records alone.
    structure = []
    with Archive(path) as archive:
        for entry in archive.entries.values():
            structure += range(entry.offset, entry.offset + len(entry.local_header()))
    structure += range(next(at for at, _ in starts[len(starts) // 2 :]), length)
    places = [*draw.integers(0, length, 500), *draw.choice(structure, 500), length - 1, 0]
    copy = tmp_path / "demo.zip"
    for place in places:
        flip(path, copy, int(place), int(draw.integers(1, 256)))
        message = complaint(copy)
        owner = next((name for at, name in reversed(starts) if at <= place), "")
        wanted = owner.removeprefix("demo/") if place < end else "end-of-archive record"
        assert wanted in message, f"byte {place} belongs to {wanted}:\n{message}"


@pytest.mark.parametrize(
    "change", [lambda d: d[:-1], lambda d: d + b"\0", lambda d: b"\0" + d, lambda d: d[:5000], lambda d: b""]
)
def test_bytes_cut_off_or_added_are_caught(tmp_path, sealed, change):
    (tmp_path / "demo.zip").write_bytes(change(sealed().read_bytes()))
    assert "demo.zip: " in complaint(tmp_path / "demo.zip")


def test_the_digest_beside_the_archive_counts_when_it_is_there(tmp_path, sealed):
    copy = tmp_path / "demo.zip"
    shutil.copy(sealed(), copy)
    assert not verify(copy).digest_checked
    for text in ("0" * 64 + "  demo.zip\n", "", "not a hash"):
        (tmp_path / "demo.zip.sha256").write_text(text)
        assert complaint(copy).startswith("demo.zip.sha256: does not hold the hash")


def resealed(path: Path, target: Path, change: Callable[[dict[str, bytes]], None], *, rehash: bool = True) -> Path:
    """Change members of a bundle and write it in canonical form again, with right checksums where `rehash`."""
    with zipfile.ZipFile(path) as archive:
        files = {name.removeprefix("demo/"): archive.read(name) for name in archive.namelist()}
    change(files)
    if rehash:
        payload = {n: bag.digest(io.BytesIO(d)) for n, d in files.items() if n.startswith("data/")}
        files |= {f"manifest-{a}.txt": bag.manifest_text(payload, a).encode() for a in bag.ALGORITHMS}
        info = bag.parse_info(files["bag-info.txt"].decode()) | {"Payload-Oxum": bag.oxum(payload)}
        files["bag-info.txt"] = bag.info_text(info).encode()
        tags = {
            n: bag.digest(io.BytesIO(files[n]))
            for n in ("bagit.txt", "bag-info.txt", *(f"manifest-{a}.txt" for a in bag.ALGORITHMS))
        }
        files |= {f"tagmanifest-{a}.txt": bag.manifest_text(tags, a).encode() for a in bag.ALGORITHMS}
    members = []
    for name, data in files.items():
        known = bag.digest(io.BytesIO(data))
        members.append(Member(f"demo/{name}", known.size, known.crc32, lambda data=data: io.BytesIO(data)))
    write_archive(target, members)
    return target


def edit(name: str, old: bytes, new: bytes) -> Callable[[dict[str, bytes]], None]:
    def change(files: dict[str, bytes]) -> None:
        assert old in files[name]
        files[name] = files[name].replace(old, new, 1)

    return change


def test_resealing_without_a_change_still_verifies(tmp_path, sealed):
    copy = resealed(sealed(), tmp_path / "demo.zip", lambda files: None)
    assert copy.read_bytes() == sealed().read_bytes()


DRIVER = "data/results/driver/driver_6dof.csv"


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (lambda f: f.pop(DRIVER), f"{DRIVER}: is missing, but manifest-sha256.txt lists it"),
        (lambda f: f.update({"data/extra.txt": b"x"}), "data/extra.txt: was not sealed here"),
        (lambda f: f.update({"extra.txt": b"x"}), "extra.txt: was not sealed here: no manifest lists it"),
        (lambda f: f.update({"fetch.txt": b"http://example.org/x - data/x\n"}), "fetch.txt: was not sealed here"),
        (edit("manifest-sha256.txt", b"data/README.md", b"../../etc/passwd"), "changed since|does not list"),
        (lambda f: f.update({DRIVER: b"another"}), f"{DRIVER}: changed since it was sealed: its sha256"),
        (lambda f: f.pop("bagit.txt"), "bagit.txt: is missing"),
        (lambda f: f.pop("manifest-sha512.txt"), "manifest-sha512.txt: is missing"),
        (edit("bag-info.txt", b"demo", b"Demo"), "bag-info.txt: changed since it was sealed: its sha256"),
        (lambda f: f.update({"tagmanifest-sha256.txt": b""}), "is not that of|does not list"),
        (lambda f: f.update({"manifest-sha256.txt": b"hello\n"}), "manifest-sha256.txt:1: is not a line"),
        (lambda f: f.update({"manifest-sha256.txt": f["manifest-sha256.txt"][:-1]}), "cut short|changed"),
        (lambda f: f.update({"manifest-sha256.txt": b"\xff"}), "manifest-sha256.txt: is not UTF-8"),
    ],
)
def test_the_frame_must_fit_the_files(tmp_path, sealed, change, wanted):
    message = complaint(resealed(sealed(), tmp_path / "demo.zip", change, rehash=False))
    assert any(part in message for part in wanted.split("|")), message


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (lambda f: f.pop(DRIVER), f"{DRIVER}: is missing, but ro-crate-metadata.json describes it"),
        (lambda f: f.update({"data/extra.txt": b"x"}), "data/extra.txt: is not described by ro-crate"),
        (lambda f: f.update({DRIVER: b"another"}), f"{DRIVER}: is not as ro-crate-metadata.json describes it"),
        (lambda f: f.update({"data/ro-crate-metadata.json": b"{"}), "is not JSON"),
        (lambda f: f.update({"data/ro-crate-metadata.json": b"[" * 200_000}), "is not JSON"),
        (lambda f: f.update({"data/ro-crate-metadata.json": b"[]"}), "is not an RO-Crate"),
        (lambda f: f.pop("data/ro-crate-metadata.json"), "data/ro-crate-metadata.json: is missing"),
    ],
)
def test_a_bundle_sealed_with_false_papers_is_caught(tmp_path, sealed, change, wanted):
    assert wanted in complaint(resealed(sealed(), tmp_path / "demo.zip", change))


def with_crate(change: Callable[[dict[str, bytes]], None]) -> Callable[[dict[str, bytes]], None]:
    """Make a change, and let the crate describe it rightly: the list of artifacts is next to notice."""

    def both(files: dict[str, bytes]) -> None:
        change(files)
        value = json.loads(files["data/ro-crate-metadata.json"])
        for entity in value["@graph"]:
            if f"data/{entity['@id']}" in files and "sha256" in entity:
                data = files[f"data/{entity['@id']}"]
                entity |= {"sha256": hashlib.sha256(data).hexdigest(), "contentSize": str(len(data))}
        files["data/ro-crate-metadata.json"] = json.dumps(value).encode()

    return both


LIST = "data/artifacts.csv"


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (edit(DRIVER, b"1.0", b"2.0"), f"{DRIVER}: is not as artifacts.csv lists it"),
        (edit(LIST, b",exact,", b",roughly,"), "is not as artifacts.csv lists it"),
        (edit(LIST, b"path,bytes", b"file,bytes"), f"{LIST}: has other columns"),
        (edit(LIST, b"\n", b"\nx,y\n"), f"{LIST}: line 2 has 2 cells"),
        (lambda f: f.update({LIST: f[LIST] + b"x" * 200_000}), f"{LIST}: is not a table"),
        (lambda f: f.update({LIST: f[LIST] + f[LIST].split(b"\n")[1] + b"\n"}), "is not both there and listed once"),
        (lambda f: f.update({"data/bundle.json": b"{}"}), "artifacts.csv lists it"),
    ],
)
def test_the_list_of_artifacts_must_fit_the_files(tmp_path, sealed, change, wanted):
    assert wanted in complaint(resealed(sealed(), tmp_path / "demo.zip", with_crate(change)))


def test_an_unpacked_bundle_verifies_and_is_checked_as_strictly(tmp_path, sealed):
    with zipfile.ZipFile(sealed()) as archive:
        archive.extractall(tmp_path)
    folder = tmp_path / "demo"
    report = verify(folder)
    assert (report.play, report.sha256) == ("demo", "")
    original = (folder / DRIVER).read_bytes()
    (folder / DRIVER).write_bytes(b"another")
    assert f"{DRIVER}: changed since it was sealed" in complaint(folder)
    (folder / DRIVER).unlink()
    assert f"{DRIVER}: is missing" in complaint(folder)
    (folder / DRIVER).symlink_to("/etc/hostname")
    assert f"{DRIVER!r} is a link or a special file" in complaint(folder)
    (folder / DRIVER).unlink()
    (folder / DRIVER).write_bytes(original)
    verify(folder)
    (folder / "data/stray.txt").write_text("x")
    assert "data/stray.txt: was not sealed here" in complaint(folder)


def test_what_a_bundle_says_of_itself_is_printed_without_control_characters(tmp_path, sealed):
    change = edit("data/bundle.json", b'"verdict": "ACCEPTED"', b'"verdict": "\\u001b[2JACCEPTED"')

    def both(files: dict[str, bytes]) -> None:
        old = files["data/bundle.json"]
        change(files)
        new = files["data/bundle.json"]
        for before, after in (
            (hashlib.sha256(old).hexdigest().encode(), hashlib.sha256(new).hexdigest().encode()),
            (f"bundle.json,{len(old)},".encode(), f"bundle.json,{len(new)},".encode()),
        ):
            edit(LIST, before, after)(files)

    assert verify(resealed(sealed(), tmp_path / "demo.zip", with_crate(both))).verdict == "\\x1b[2JACCEPTED"


def test_what_is_no_bundle_is_refused(tmp_path):
    assert "does not exist" in complaint(tmp_path / "none.zip")
    assert "is no unpacked bundle" in complaint(tmp_path)
    (tmp_path / "text.zip").write_text("hello")
    assert "no end-of-archive record" in complaint(tmp_path / "text.zip")
