"""The BagIt 1.0 frame of a bundle (RFC 8493): tag files, and manifests of every file's hashes."""

from __future__ import annotations

import hashlib
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import BinaryIO

from replay.errors import BundleError

ALGORITHMS = ("sha256", "sha512")
DECLARATION = b"BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n"
PAYLOAD = "data/"
RESULTS = "Replay-Results-SHA256"  # field of bag-info.txt
_BLOCK = 1 << 20
_LINE = re.compile(r"([0-9a-f]+)  (.+)")
_ESCAPES = {"%": "%25", "\r": "%0D", "\n": "%0A"}


@dataclass(frozen=True)
class Digest:
    """What one reading of a file gives."""

    size: int
    crc32: int
    sha256: str
    sha512: str

    def of(self, algorithm: str) -> str:
        """Hex digest by name of the algorithm."""
        return {"sha256": self.sha256, "sha512": self.sha512}[algorithm]


def digest(stream: BinaryIO) -> Digest:
    """Read a stream to its end, in blocks, and return its size and checksums."""
    size = crc = 0
    hashes = [hashlib.new(name) for name in ALGORITHMS]
    while block := stream.read(_BLOCK):
        size += len(block)
        crc = zlib.crc32(block, crc)
        for each in hashes:
            each.update(block)
    return Digest(size, crc, hashes[0].hexdigest(), hashes[1].hexdigest())


def manifest_text(digests: Mapping[str, Digest], algorithm: str) -> str:
    """Text of a manifest: one line per file, sorted, as ``sha256sum -c`` reads it."""
    lines = []
    for name in sorted(digests, key=str.encode):
        written = "".join(_ESCAPES.get(c, c) for c in name)
        lines.append(f"{digests[name].of(algorithm)}  {written}\n")
    return "".join(lines)


def parse_manifest(text: str, name: str, algorithm: str) -> dict[str, str]:
    """Read a manifest back.

    Parameters
    ----------
    text, name
        Content and name of the manifest.
    algorithm
        ``sha256`` or ``sha512``.

    Returns
    -------
    dict
        File to hex digest.

    Raises
    ------
    BundleError
        When a line is not hash, two spaces and a name, or a name occurs twice.
    """
    width = hashlib.new(algorithm).digest_size * 2
    out: dict[str, str] = {}
    for number, line in enumerate(text.split("\n")[:-1], 1):
        match = _LINE.fullmatch(line)
        if not match or len(match[1]) != width:
            message = f"{name}:{number}: is not a line of a {algorithm} manifest"
            raise BundleError(message)
        file = match[2].replace("%0D", "\r").replace("%0A", "\n").replace("%25", "%")
        if file in out:
            message = f"{name}:{number}: names {file!r} a second time"
            raise BundleError(message)
        out[file] = match[1]
    if text and not text.endswith("\n"):
        message = f"{name}: its last line is cut short"
        raise BundleError(message)
    return out


def info_text(fields: Mapping[str, str]) -> str:
    """Text of ``bag-info.txt``, one field a line, in the order given."""
    return "".join(f"{key}: {' '.join(value.split())}\n" for key, value in fields.items())


def parse_info(text: str) -> dict[str, str]:
    """Read ``bag-info.txt`` back (fields without folded lines, as `info_text` writes them)."""
    pairs = (line.partition(": ") for line in text.splitlines() if ": " in line)
    return {key: value for key, _, value in pairs}


def oxum(digests: Mapping[str, Digest]) -> str:
    """Return ``Payload-Oxum``: bytes and number of the payload's files."""
    return f"{sum(d.size for d in digests.values())}.{len(digests)}"
