"""Take the source and the play out of a bundle, to run it again: all checked before anything is written."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from replay.bundle.members import MOST_ENTRIES
from replay.bundle.names import find_collision, shown, why_unsafe
from replay.bundle.sealed import SealedRun
from replay.errors import BundleError, InputError
from replay.files import sha256

_SNAPSHOT = "source/source.tar"
_BLOCK = 1 << 20


def unpack_source(run: SealedRun, folder: Path) -> int:
    """Write the source snapshot of a bundle into a folder; plain files alone, never through a link.

    Parameters
    ----------
    run
        The bundle.
    folder
        Must not exist yet.

    Returns
    -------
    int
        Number of files.

    Raises
    ------
    BundleError
        When the snapshot holds anything but plain files with plain names; nothing was written then.
    """
    with _snapshot(run) as tar:
        members = list(_checked(run, tar))
        folder.mkdir(parents=True)
        for member in members:
            path = folder / member.name
            path.parent.mkdir(parents=True, exist_ok=True)
            content = tar.extractfile(member)
            assert content is not None
            with content, path.open("xb") as target:
                while block := content.read(_BLOCK):
                    target.write(block)
            path.chmod(0o755 if member.mode & 0o100 else 0o644)
    return len(members)


def source_files(run: SealedRun) -> tuple[str, ...]:
    """Names in the source snapshot, checked.

    Raises
    ------
    BundleError
        As `unpack_source`.
    """
    with _snapshot(run) as tar:
        return tuple(member.name for member in _checked(run, tar))


@contextmanager
def _snapshot(run: SealedRun) -> Iterator[tarfile.TarFile]:
    try:
        with tarfile.open(run.file(_SNAPSHOT), mode="r:", errorlevel=2) as tar:
            yield tar
    except (tarfile.TarError, ValueError, OverflowError) as error:
        raise _refuse(run, f"is no tar archive that can be read ({error})") from None


def _refuse(run: SealedRun, what: str) -> BundleError:
    return BundleError(f"{run.path.name}: {_SNAPSHOT}: {what}\n    mend: ask for the bundle again; nothing was written")


def _checked(run: SealedRun, tar: tarfile.TarFile) -> Iterator[tarfile.TarInfo]:
    members: list[tarfile.TarInfo] = []
    for member in tar:
        reason = why_unsafe(member.name)
        if not member.isreg() or member.issparse():
            reason = "is a link, a folder or a special file, not a plain one"
        if len(members) >= MOST_ENTRIES:
            reason = f"is one of more than {MOST_ENTRIES} files"
        if reason:
            raise _refuse(run, f"{shown(member.name)!r} {reason}")
        members.append(member)
    if collision := find_collision(member.name for member in members):
        raise _refuse(run, f"{shown(collision[0])!r} {collision[2]} ({shown(collision[1])!r})")
    yield from members


def unpack_play(run: SealedRun, play: str, folder: Path, withheld: Mapping[str, Path]) -> None:
    """Write the play as it was described into ``<folder>/<play>``.

    Parameters
    ----------
    run, play
        The bundle and the name of its play.
    folder
        Where the folder of the play goes.
    withheld
        From `find_withheld`.
    """
    prefix = f"plays/{play}/"
    for name in run.files:
        if name.startswith(prefix):
            _copy(run.file(name), folder / name.removeprefix("plays/"))
    for name, path in withheld.items():
        _copy(path, folder / name.removeprefix("plays/"))


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    with source.open("rb") as stream, target.open("xb") as out:
        while block := stream.read(_BLOCK):
            out.write(block)


def find_withheld(run: SealedRun, play: str, folder: Path | None) -> dict[str, Path]:
    """Find the files that the bundle names by hash alone, in a folder of whoever has them.

    Returns
    -------
    dict
        Payload path to file.

    Raises
    ------
    InputError
        When one is not there, naming hash and reason.
    """
    left = (run.json("bundle.json") or {}).get("left_out", [])
    needed = {e["path"]: e for e in left if e["sha256"] and e["path"].startswith(f"plays/{play}/")}
    found: dict[str, Path] = {}
    for name, entry in needed.items():
        if reason := why_unsafe(name):
            message = f"{run.path.name}: {shown(name)!r} {reason}"
            raise BundleError(message)
        path = None if folder is None else folder / name.rpartition("/")[2]
        if path is None or not path.is_file() or sha256(path) != entry["sha256"]:
            raise InputError(
                path or run.path,
                f"{shown(name)} was withheld ({shown(entry['reason'])})" + ("" if path is None else "; this is not it"),
                expected=f"a file {name.rpartition('/')[2]} with sha256 {entry['sha256']}",
                mend="ask its owner for it, and name its folder with --withheld",
            )
        found[name] = path
    return found
