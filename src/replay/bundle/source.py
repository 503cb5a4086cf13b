"""The source a run was made with: a snapshot that unpacks to what was there, and its commit."""

from __future__ import annotations

import os
import subprocess
import tarfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from replay.errors import InputError, ReplayError
from replay.files import sha256

# Of what git does not know yet, that which a run depends on.
_CODE = ("src", "workflow", "profiles", "container")
# Without git: everything but what is made, installed or cached.
_MADE = {"results", "dist", "build", "__pycache__", "shared"}


@dataclass(frozen=True)
class Source:
    """A source tree.

    Parameters
    ----------
    root
        Its folder.
    files
        Relative paths, sorted.
    commit
        Hash of the commit, or None where there is no git checkout.
    committed
        Date of the commit (ISO 8601), or None.
    diff
        Difference of the files to the commit, empty when there is none.
    untracked
        Files of the code that git does not know.
    withheld
        Files that were left out because their bytes may not be shared.
    """

    root: Path
    files: tuple[str, ...]
    commit: str | None
    committed: str | None
    diff: bytes
    untracked: tuple[str, ...]
    withheld: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``source.json``."""
        left = {"withheld": list(self.withheld)} if self.withheld else {}
        if self.commit is None:
            return {"commit": None, "note": "not a git checkout: the snapshot is all that is known", **left}
        dirty = bool(self.diff or self.untracked)
        return {"commit": self.commit, "dirty": dirty, "untracked": list(self.untracked), **left}


def read_source(root: str | Path, *, without: frozenset[str] = frozenset()) -> Source:
    """List the source tree at `root`, with the help of git where it is a checkout.

    Parameters
    ----------
    root
        Its folder.
    without
        Hashes (sha256) of files whose bytes may not be shared: wherever such a file lies, it is left out.

    Raises
    ------
    InputError
        When `root` is not the root of the project's source.
    """
    root = Path(root)
    for needed in ("Snakefile", "environment.lock"):
        if not (root / needed).is_file():
            raise InputError(
                root / needed,
                "the file does not exist, so the run could not be repeated from the bundle",
                mend="seal in the project's own folder",
            )
    # A checkout of its own, not a folder somewhere inside another one.
    if (root / ".git").exists() and _git(root, "rev-parse", "--verify", "-q", "HEAD") is not None:
        return _from_git(root, without)
    files, withheld = _split(root, sorted(_walk(root)), without)
    return Source(root, files, None, None, b"", (), withheld)


def _split(root: Path, names: Iterable[str], without: frozenset[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Files to keep, and files to leave out."""
    names = list(names)
    left = [name for name in names if without and sha256(root / name) in without]
    return tuple(name for name in names if name not in left), tuple(left)


def _walk(root: Path) -> Iterator[str]:
    """Files of a tree without git: all that is neither made, installed nor cached."""
    for folder, inner, names in os.walk(root):
        inner[:] = [n for n in inner if n not in _MADE and not n.endswith(".egg-info") and (n[0] != "." or n == ".ci")]
        for name in names:
            path = Path(folder) / name
            if path.is_file() and not path.is_symlink() and path.suffix != ".pyc":
                yield path.relative_to(root).as_posix()


def _from_git(root: Path, without: frozenset[str]) -> Source:
    tracked = _names(_must(root, "ls-files", "-z"))
    unknown = _names(_must(root, "ls-files", "-z", "--others", "--exclude-standard", "--", *_CODE))
    files = [n for n in {*tracked, *unknown} if (root / n).is_file() and not (root / n).is_symlink()]
    kept, withheld = _split(root, sorted(files), without)
    options = ("--binary", "--no-ext-diff", "--no-textconv", "--no-color", "--no-renames", "HEAD", "--", ".")
    diff = _must(root, "diff", *options, *(f":(exclude,literal){name}" for name in withheld))
    commit, _, date = _must(root, "show", "-s", "--format=%H %cI", "HEAD").decode().strip().partition(" ")
    untracked = tuple(sorted(set(unknown) - set(withheld)))
    return Source(root, kept, commit, date, diff, untracked, withheld)


def _names(listing: bytes) -> list[str]:
    return [name.decode() for name in listing.split(b"\0") if name]


def _git(root: Path, *arguments: str) -> bytes | None:
    try:
        command = ["git", "--no-optional-locks", "-c", "core.quotepath=off", "-C", str(root), *arguments]
        done = subprocess.run(command, capture_output=True, check=False)
    except OSError:
        return None
    return done.stdout if done.returncode == 0 else None


def _must(root: Path, *arguments: str) -> bytes:
    out = _git(root, *arguments)
    if out is None:
        message = f"{root}: `git {arguments[0]}` failed\n    mend: repair the checkout (`git status` says more)"
        raise ReplayError(message)
    return out


def write_snapshot(source: Source, stream: BinaryIO) -> None:
    """Write the tree as a tar whose bytes depend on names and contents alone."""
    with tarfile.open(fileobj=stream, mode="w", format=tarfile.PAX_FORMAT) as tar:
        for name in source.files:
            path = source.root / name
            info = tarfile.TarInfo(name)
            info.size = path.stat().st_size
            info.mode = 0o755 if path.stat().st_mode & 0o100 else 0o644
            with path.open("rb") as content:
                tar.addfile(info, content)
