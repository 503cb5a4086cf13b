"""Checkpoints: everything that a step changes, in one file that proves itself whole.

A file is a line of JSON (identity, names, kinds, shapes), the raw arrays, and the SHA-256 of
all that. It takes its name in one rename, and the one before it is kept, so that a machine
that dies while writing loses nothing. A checkpoint continues only the run it belongs to: the same
model and settings, the same solver code, the same version.
"""

from __future__ import annotations

import hashlib
import json
import signal
import threading
import types
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import replay
from replay.errors import ResumeError
from replay.files import atomic_path
from replay.solver.problem import Problem

_MAGIC = b"replay checkpoint 1\n"
_KEPT = 2
_PATTERN = "step-*.checkpoint"


@cache
def code_hash() -> str:
    """Hex digest of every source of the solver, kernels included."""
    digest = hashlib.sha256()
    folder = Path(__file__).parent
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def identity(problem: Problem) -> dict[str, str]:
    """What a checkpoint must agree with to be continued."""
    return {"version": replay.__version__, "code": code_hash(), "model": problem.digest()}


class Checkpoints:
    """The checkpoints of one run.

    Parameters
    ----------
    folder
        Where they are kept.
    run
        `identity` of the run.
    """

    def __init__(self, folder: Path, run: Mapping[str, str]) -> None:
        self.folder = folder
        self._run = dict(run)
        self.damaged: list[Path] = []

    def write(self, step: int, arrays: Mapping[str, NDArray[Any]]) -> Path:
        """Write a checkpoint and drop all but the last two."""
        path = self.folder / f"step-{step:012d}.checkpoint"
        contents = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        header = {
            "run": self._run,
            "arrays": [[name, a.dtype.str, list(a.shape)] for name, a in contents.items()],
        }
        digest = hashlib.sha256()
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            for piece in (_MAGIC, json.dumps(header).encode() + b"\n", *(a.tobytes() for a in contents.values())):
                digest.update(piece)
                stream.write(piece)
            stream.write(digest.digest())
        for old in (*self._files()[:-_KEPT], *self._debris()):
            old.unlink()
        return path

    def _files(self) -> list[Path]:
        return sorted(self.folder.glob(_PATTERN))

    def _debris(self) -> list[Path]:
        """What a writer that was killed has left without its name; the only writer of the folder may remove it."""
        return sorted(self.folder.glob(f".{_PATTERN}"))

    def read(self) -> dict[str, NDArray[Any]] | None:
        """Arrays of the last whole checkpoint, or None where there is no file; `damaged` lists those passed over.

        Raises
        ------
        ResumeError
            When the checkpoint belongs to another model, code or version, or none is whole.
        """
        files = self._files()
        for path in reversed(files):
            found = _read_whole(path)
            if found is None:
                self.damaged.append(path)
                continue
            header, arrays = found
            self._refuse_stranger(path, header["run"])
            return arrays
        if files:
            message = f"{self.folder}: no checkpoint is whole\n    mend: remove the folder and start the run anew"
            raise ResumeError(message)
        return None

    def _refuse_stranger(self, path: Path, run: Mapping[str, str]) -> None:
        told = {
            "version": "another version of replay",
            "code": "another state of the solver's code",
            "model": "another model or other settings",
        }
        for key, sentence in told.items():
            if run.get(key) != self._run[key]:
                then, now = run.get(key, "unknown")[:12], self._run[key][:12]
                message = (
                    f"{path}: was written by {sentence} ({key} {then}, now {now})\n"
                    "    mend: remove the checkpoint folder and start the run anew, or go back to what it began with"
                )
                raise ResumeError(message)

    def clear(self) -> None:
        """Remove all checkpoints: the run has ended."""
        for path in (*self._files(), *self._debris()):
            path.unlink()
        if self.folder.is_dir() and not any(self.folder.iterdir()):
            self.folder.rmdir()


def _read_whole(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]] | None:
    raw = path.read_bytes()
    body, footer = raw[:-32], raw[-32:]
    if not body.startswith(_MAGIC) or hashlib.sha256(body).digest() != footer:
        return None
    end = body.index(b"\n", len(_MAGIC))
    header = json.loads(body[len(_MAGIC) : end])
    arrays, place = {}, end + 1
    for name, kind, shape in header["arrays"]:
        dtype = np.dtype(kind)
        count = int(np.prod(shape, dtype=int))
        arrays[name] = np.frombuffer(body, dtype, count, place).reshape(shape).copy()
        place += count * dtype.itemsize
    return header, arrays


class Signals:
    """Notes SIGTERM, SIGINT and SIGUSR1 while a run goes on; use as a context manager.

    The run looks at `received` once a step: SIGUSR1 (a cluster's warning) asks for a checkpoint,
    the other two for a checkpoint and the end. Outside the main thread nothing is installed.
    """

    _NOTED = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)

    def __init__(self) -> None:
        self.received: signal.Signals | None = None
        self._old: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Signals:
        if threading.current_thread() is threading.main_thread():
            for number in self._NOTED:
                self._old[number] = signal.signal(number, self._note)
        return self

    def _note(self, number: int, frame: types.FrameType | None) -> None:
        got = signal.Signals(number)
        # a request to end is not forgotten for a later request to save
        if self.received in (None, signal.SIGUSR1):
            self.received = got

    def __exit__(self, *_: object) -> None:
        for number, handler in self._old.items():
            signal.signal(number, handler)
        self._old.clear()

    def take(self) -> signal.Signals | None:
        """Return what has been received and forget it."""
        got, self.received = self.received, None
        return got
