"""How every file of the project is written and named: atomically, in one order, with its hash.

A reader of a results folder never meets half a file: the bytes go to a temporary name in
the same folder, are flushed to the disk, and take their name in one rename.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import json
import math
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from replay.errors import InputError, ReplayError

_BLOCK = 1 << 20
#: Name of the file that `hold_folder` locks.
LOCK = ".lock"


@contextlib.contextmanager
def atomic_path(path: str | Path, *, reserve_bytes: int = 0) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on a clean exit it becomes `path`, else it is removed.

    Parameters
    ----------
    path
        The file to write.
    reserve_bytes
        Room that the disk must have before anything is written: for libraries that do not survive a full one (HDF5).

    Raises
    ------
    ReplayError
        When the disk is full or the folder cannot be written.
    """
    path = Path(path)
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=path.suffix)
        temporary = Path(name)
        try:
            if reserve_bytes:
                os.posix_fallocate(handle, 0, reserve_bytes)
                os.ftruncate(handle, 0)
        finally:
            os.close(handle)
        yield temporary
        temporary.chmod(0o644)
        with temporary.open("rb+") as stream:
            os.fsync(stream.fileno())
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EACCES, errno.EROFS, errno.EDQUOT, errno.ENOTDIR):
            message = (
                f"{path}: cannot be written ({error.strerror})\n    mend: free disk space or choose another folder"
            )
            raise ReplayError(message) from error
        raise
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def hold_folder(folder: Path, doing: str) -> IO[str]:
    """Make `folder` and keep every other process from writing there until the returned file is closed.

    The kernel drops the lock of a process that dies.

    Raises
    ------
    ReplayError
        When another process holds it; a killed workflow can leave its solver running.
    """
    folder.mkdir(parents=True, exist_ok=True)
    held = (folder / LOCK).open("w")
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        held.close()
        message = (
            f"{folder}: another process is writing {doing}\n"
            "    mend: wait for it, or end it (a killed workflow can leave its solver running)"
        )
        raise ReplayError(message) from None
    return held


def write_text(path: str | Path, text: str) -> None:
    """Write `text` (UTF-8, newlines as given) atomically."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(text.encode("utf-8"))


def write_json(path: str | Path, value: Any) -> None:
    """Write `value` as JSON, keys in the order given, numbers in shortest exact form.

    NaN and infinity are not JSON and are written as ``null``: a file that claims a number
    must have one.
    """
    write_text(path, json_text(value))


def json_text(value: Any) -> str:
    """Return the text that `write_json` writes."""
    return json.dumps(_plain(value), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def read_json(path: str | Path) -> Any:
    """Read a JSON file; a syntax error names the line.

    Raises
    ------
    InputError
        When the file is missing, not UTF-8 or not JSON.
    """
    text = read_text(path)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(
            path,
            f"is not JSON: {error.msg}",
            line=error.lineno,
            expected="one JSON value",
            mend="correct the syntax at that line",
        ) from None


def read_text(path: str | Path) -> str:
    """Read a UTF-8 text file, with or without a byte-order mark, any newline convention.

    Raises
    ------
    InputError
        When the file is missing, empty or not UTF-8.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "the file does not exist", mend="check the name and the folder")
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            path,
            f"byte {error.start} is not UTF-8",
            expected="UTF-8 text",
            mend="save the file again with UTF-8 encoding",
        ) from None
    if not text.strip():
        raise InputError(path, "the file is empty", mend="export it again from the program that made it")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def sha256(path: str | Path) -> str:
    """Hex SHA-256 of a file, read in blocks."""
    digest = hashlib.sha256()
    with Path(path).open("rb") as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    """Turn numpy scalars, arrays, paths and non-finite numbers into plain JSON values."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return value.as_posix()
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
