"""Verify a bundle: every byte, nothing missing, nothing extra, and a description that fits.

Nothing is extracted and nothing is run; content is streamed, so that a bundle of any size is
verified in bounded memory. The first thing that is wrong is named.
"""

from __future__ import annotations

import csv
import io
import json
import re
import zlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from replay.bundle import bag
from replay.bundle.contents import ARTIFACTS, results_hash
from replay.bundle.crate import NAME as CRATE
from replay.bundle.members import Members, open_members
from replay.bundle.names import shown
from replay.errors import BundleError
from replay.files import sha256

_MOST_TEXT_BYTES = 64 << 20
_AGAIN = "fetch the bundle again from where it was sealed"
_LISTING = "artifacts.csv"
_FACTS = "bundle.json"


@dataclass(frozen=True)
class VerifyReport:
    """A bundle that verified.

    Parameters
    ----------
    path
        The archive or folder.
    play, verdict, line
        As sealed; the verdict is ``ACCEPTED``, ``ACCEPTED WITH WARNINGS``, ``REJECTED``, ``INTERRUPTED`` or
        ``NOT JUDGED``.
    files, bytes
        Number and size of the payload's files.
    results_sha256
        Of what the run gave (`replay.bundle.contents.results_hash`): two equal runs share it.
    sha256
        Of the archive; "" for a folder.
    digest_checked
        Whether the ``.sha256`` beside the archive was there (and agrees).
    minimum_package
        Item to whether it is present and hashed.
    """

    path: Path
    play: str
    verdict: str
    line: str
    files: int
    bytes: int
    results_sha256: str
    sha256: str
    digest_checked: bool
    minimum_package: dict[str, bool]

    def text(self) -> str:
        """Say it in a few lines."""
        beside = "the .sha256 beside it agrees" if self.digest_checked else "no .sha256 beside it"
        lines = [
            f"{self.path}: verified, {self.files} files, {self.bytes} bytes",
            f"play {self.play}: {self.verdict}",
        ]
        lines.append(f"results {self.results_sha256} (equal runs share it)")
        if self.sha256:
            lines.append(f"sha256 {self.sha256} ({beside})")
        if missing := [item for item, whole in self.minimum_package.items() if not whole]:
            lines.append(f"not in the package: {', '.join(missing)}")
        return "\n".join(lines)


def verify(path: str | Path) -> VerifyReport:
    """Verify an archive or the folder it was unpacked to.

    Parameters
    ----------
    path
        ``<play>.zip`` or an unpacked bag.

    Raises
    ------
    BundleError
        Naming the first file that is missing, extra, changed, unsafe, or not as described.
    """
    path = Path(path)
    with open_members(path) as members:
        tags = _read_tags(members)
        payload = _check_bytes(members, tags)
        facts = _check_description(members, payload)
        of_results = _check_results_hash(members)
    digest, checked = ("", False) if path.is_dir() else _check_digest(path)
    package = facts.get("minimum_package", {})
    return VerifyReport(
        path=path,
        play=shown(str(facts.get("play", ""))),
        verdict=shown(str(facts.get("verdict", ""))),
        line=shown(str(facts.get("line", ""))),
        files=len(payload),
        bytes=sum(d.size for d in payload.values()),
        results_sha256=of_results,
        sha256=digest,
        digest_checked=checked,
        minimum_package={shown(name): bool(item["present"] and item["hashed"]) for name, item in package.items()},
    )


def _refuse(members: Members, name: str, what: str) -> BundleError:
    return BundleError(f"{members.label}: {shown(name)}: {what}\n    mend: {_AGAIN}")


def _text(members: Members, name: str) -> str:
    """Read a small text member whole."""
    if name not in members.sizes:
        raise _refuse(members, name, "is missing")
    if members.sizes[name] > _MOST_TEXT_BYTES:
        raise _refuse(members, name, f"has {members.sizes[name]} bytes, too many for what it is")
    with members.open(name) as stream:
        data = stream.read()
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        raise _refuse(members, name, "is not UTF-8") from None


def _read_tags(members: Members) -> dict[str, dict[str, str]]:
    """Check the tag files against their manifests, and return all four manifests."""
    for name, stored in members.checksums.items():
        # Nothing hashes the tag manifests but the zip itself; and a manifest that changed must not accuse a file.
        if not name.startswith(bag.PAYLOAD) and zlib.crc32(_text(members, name).encode()) != stored:
            raise _refuse(members, name, "changed since it was sealed: its zip checksum is another")
    if _text(members, "bagit.txt").encode() != bag.DECLARATION:
        raise _refuse(members, "bagit.txt", "does not declare BagIt 1.0 in UTF-8")
    manifests = {}
    for kind in ("tagmanifest", "manifest"):
        for algorithm in bag.ALGORITHMS:
            manifests[f"{kind}-{algorithm}.txt"] = read_manifest_of(members, algorithm, kind)
    expected = {"bagit.txt", "bag-info.txt", *(f"manifest-{a}.txt" for a in bag.ALGORITHMS)}
    for algorithm in bag.ALGORITHMS:
        name = f"tagmanifest-{algorithm}.txt"
        _same_names(members, set(manifests[name]), expected, name)
        for tag, listed in manifests[name].items():
            with_digest = bag.digest(io.BytesIO(_text(members, tag).encode()))
            if with_digest.of(algorithm) != listed:
                raise _refuse(members, tag, f"changed since it was sealed: its {algorithm} is not that of {name}")
    tag_files = {name for name in members.sizes if not name.startswith(bag.PAYLOAD)}
    if extra := sorted(tag_files - expected - set(manifests)):
        raise _refuse(members, extra[0], "was not sealed here: no manifest lists it")
    return manifests


def _same_names(members: Members, listed: set[str], expected: set[str], manifest: str) -> None:
    if missing := sorted(expected - listed):
        raise _refuse(members, missing[0], f"was not sealed here: {manifest} does not list it")
    if extra := sorted(listed - expected):
        raise _refuse(members, extra[0], f"is missing, but {manifest} lists it")


def _check_bytes(members: Members, manifests: Mapping[str, dict[str, str]]) -> dict[str, bag.Digest]:
    """Stream every payload file once; return what was read, by path in the payload."""
    there = {name for name in members.sizes if name.startswith(bag.PAYLOAD)}
    for algorithm in bag.ALGORITHMS:
        name = f"manifest-{algorithm}.txt"
        _same_names(members, set(manifests[name]), there, name)
    payload = {}
    for name in sorted(there, key=str.encode):
        with members.open(name) as stream:
            digest = bag.digest(stream)
        if digest.size != members.sizes[name]:
            raise _refuse(members, name, f"ends after {digest.size} of {members.sizes[name]} bytes")
        if members.checksums.get(name, digest.crc32) != digest.crc32:
            raise _refuse(members, name, "changed since it was sealed: its zip checksum is another")
        for algorithm in bag.ALGORITHMS:
            if digest.of(algorithm) != manifests[f"manifest-{algorithm}.txt"][name]:
                raise _refuse(members, name, f"changed since it was sealed: its {algorithm} is another")
        payload[name] = digest
    info = bag.parse_info(_text(members, "bag-info.txt"))
    if info.get("Payload-Oxum") != bag.oxum(payload):
        raise _refuse(members, "bag-info.txt", f"counts {info.get('Payload-Oxum')}, there is {bag.oxum(payload)}")
    return {name.removeprefix(bag.PAYLOAD): digest for name, digest in payload.items()}


def _check_description(members: Members, payload: Mapping[str, bag.Digest]) -> dict[str, Any]:
    _check_crate(members, payload)
    _check_listing(members, payload)
    facts = _json(members, _FACTS)
    package = facts.get("minimum_package") if isinstance(facts, dict) else None
    whole = isinstance(package, dict) and all(
        isinstance(i, dict) and {"present", "hashed"} <= set(i) for i in package.values()
    )
    if not whole or facts.get("format") != "replay bundle 1":
        raise _refuse(members, bag.PAYLOAD + _FACTS, "is not the description of a bundle of this kind")
    return facts


def _json(members: Members, name: str) -> Any:
    try:
        return json.loads(_text(members, bag.PAYLOAD + name))
    except (ValueError, RecursionError):
        raise _refuse(members, bag.PAYLOAD + name, "is not JSON that can be read") from None


def _check_crate(members: Members, payload: Mapping[str, bag.Digest]) -> None:
    """Check that the crate describes every file of the payload, and no other."""
    name = bag.PAYLOAD + CRATE
    value = _json(members, CRATE)
    graph = value.get("@graph") if isinstance(value, dict) else None
    if not isinstance(graph, list) or not all(isinstance(e, dict) and isinstance(e.get("@id"), str) for e in graph):
        raise _refuse(members, name, "is not an RO-Crate: it has no graph of entities")
    described = set()
    for entity in graph:
        kinds = entity.get("@type")
        if "File" not in (kinds if isinstance(kinds, list) else [kinds]) or re.match(r"[a-z]+://|#", entity["@id"]):
            continue
        file = unquote(entity["@id"])
        if file not in payload:
            raise _refuse(members, bag.PAYLOAD + file, f"is missing, but {CRATE} describes it")
        known = payload[file]
        if entity.get("sha256") != known.sha256 or entity.get("contentSize") != str(known.size):
            raise _refuse(members, bag.PAYLOAD + file, f"is not as {CRATE} describes it")
        described.add(file)
    if missing := sorted(set(payload) - described - {CRATE}):
        raise _refuse(members, bag.PAYLOAD + missing[0], f"is not described by {CRATE}")


def read_manifest_of(members: Members, algorithm: str, kind: str = "manifest") -> dict[str, str]:
    """Read a manifest of a bundle: file to hex digest.

    Raises
    ------
    BundleError
        When it is missing or malformed.
    """
    name = f"{kind}-{algorithm}.txt"
    return bag.parse_manifest(_text(members, name), f"{members.label}: {name}", algorithm)


def read_listing(members: Members) -> list[dict[str, str]]:
    """Read ``artifacts.csv`` of a bundle, one dict a row.

    Raises
    ------
    BundleError
        When it is not the table it should be.
    """
    name = bag.PAYLOAD + _LISTING
    try:
        rows = list(csv.reader(io.StringIO(_text(members, name))))
    except csv.Error as error:
        raise _refuse(members, name, f"is not a table ({error})") from None
    if not rows or rows[0] != ARTIFACTS.names:
        raise _refuse(members, name, "has other columns than a list of artifacts")
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(rows[0]):
            raise _refuse(members, name, f"line {number} has {len(row)} cells")
    return [dict(zip(rows[0], row)) for row in rows[1:]]


def _check_listing(members: Members, payload: Mapping[str, bag.Digest]) -> None:
    """Check that the list of artifacts names every file but itself and the crate, with its true hash."""
    rows = read_listing(members)
    names = Counter(row["path"] for row in rows)
    expected = set(payload) - {CRATE, _LISTING}
    if odd := sorted((expected ^ set(names)) | {name for name, times in names.items() if times > 1}):
        raise _refuse(members, bag.PAYLOAD + odd[0], f"is not both there and listed once by {_LISTING}")
    for row in rows:
        digest = payload[row["path"]]
        known = ("", "") if row["class"] == "volatile" else (str(digest.size), digest.sha256)
        if (row["bytes"], row["sha256"]) != known or row["class"] not in ("exact", "tolerance", "volatile"):
            raise _refuse(members, bag.PAYLOAD + row["path"], f"is not as {_LISTING} lists it")


def _check_results_hash(members: Members) -> str:
    """Compare the hash of the results with what the listing, already checked, gives."""
    digest = results_hash(_text(members, bag.PAYLOAD + _LISTING).encode())
    said = bag.parse_info(_text(members, "bag-info.txt")).get(bag.RESULTS, digest)  # bundles of before have none
    if said != digest:
        raise _refuse(members, "bag-info.txt", f"says {said[:12]} of the results; {_LISTING} gives {digest[:12]}")
    return digest


def _check_digest(path: Path) -> tuple[str, bool]:
    """Compare the whole archive with the ``.sha256`` beside it, where there is one."""
    digest = sha256(path)
    beside = path.with_name(path.name + ".sha256")
    if not beside.is_file():
        return digest, False
    match = re.fullmatch(rb"([0-9a-f]{64})  ([^\n]+)\n", beside.read_bytes()[:4096])
    if not match or match[1].decode() != digest:
        message = (
            f"{beside.name}: does not hold the hash of {path.name}, which is whole in itself ({digest})\n"
            f"    mend: it belongs to another bundle; {_AGAIN}, with its .sha256"
        )
        raise BundleError(message)
    return digest, True
