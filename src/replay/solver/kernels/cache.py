"""Compiled kernels on disk, shared by any number of jobs that start at the same moment.

Numba keeps a function's versions in numbered files behind one index: two processes that begin with an empty folder
both write number 1, and whichever index is last then names the other's code, of another signature or another CPU.
Here a version's file is named by what it was compiled for, holds that key, and takes its name in one rename; nothing
is ever shared but whole files. Numba's stamp looks only at the file of the outermost function and would keep serving
code compiled from an older `materials/elastic.py`; here the folder carries `source_hash`, so that any edit of any
kernel file recompiles. A folder that cannot be written is read, and what it lacks is compiled in memory.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.serialize import dumps


@cache
def source_hash() -> str:
    """Hex digest of every kernel source and of the compiler's version."""
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    folder = Path(__file__).parent
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


@cache
def cache_folder() -> Path:
    """Folder of the compiled kernels, named by `source_hash`.

    Below ``NUMBA_CACHE_DIR`` where that is set (a workflow shares one between its jobs),
    else below ``XDG_CACHE_HOME`` or ``~/.cache``, else below the temporary folder.
    """
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(named) / f"kernels-{source_hash()[:16]}"
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "replay"
    return (home if _writable(home) else _own_temporary()) / f"kernels-{source_hash()[:16]}"


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _own_temporary() -> Path:
    """A folder below the temporary one that nobody else can have put code into."""
    folder = Path(tempfile.gettempdir()) / f"replay-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if folder.is_dir() and found.st_uid == os.getuid() and not found.st_mode & 0o022 and not folder.is_symlink():
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="replay-"))


class KernelFiles:
    """The compiled versions of one function: a file each.

    Parameters
    ----------
    folder
        Where they are kept.
    stem
        Beginning of their names: the function's.
    """

    def __init__(self, folder: Path, stem: str) -> None:
        self._folder, self._stem = folder, stem

    def _path(self, key: Any) -> Path:
        """Name by the signature, the machine's kind (triple, CPU, features) and the code: the parts of numba's key."""
        return self._folder / f"{self._stem}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"

    def load(self, key: Any) -> Any:
        """Return what was saved under `key`, or None; a file that cannot be read is as good as none."""
        try:
            held, data = pickle.loads(self._path(key).read_bytes())
        except Exception:  # a spoilt pickle raises anything; the kernel is then compiled anew and written over it
            return None
        return data if held == key else None

    def save(self, key: Any, data: Any) -> None:
        """Write `data` under `key` in one rename; a full or read-only disk costs only the next start."""
        with contextlib.suppress(OSError):
            handle, name = tempfile.mkstemp(dir=self._folder, prefix=f".{self._stem}.")
            os.close(handle)
            temporary = Path(name)
            try:
                temporary.write_bytes(dumps((key, data)))
                temporary.chmod(0o644)
                temporary.replace(self._path(key))
            finally:
                temporary.unlink(missing_ok=True)

    def flush(self) -> None:
        """Forget nothing: a file serves exactly the sources and the key it was made of."""


class _KernelLocator(_CacheLocator):
    """Tell numba where a kernel is kept and when it is out of date."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._line = function.__code__.co_firstlineno

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        return source_hash()

    def get_disambiguator(self) -> str:
        return str(self._line)

    def ensure_cache_path(self) -> None:
        """Make the folder where that is possible; `KernelFiles.save` does without it."""
        if not cache_folder().is_dir():
            _writable(cache_folder())

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _KernelLocator:
        return cls(py_func)


class _KernelCacheImpl(CompileResultCacheImpl):
    _locator_classes: ClassVar[list[Any]] = [_KernelLocator]  # type: ignore[misc]


class KernelCache(FunctionCache):
    """Numba's cache of one function, in files of our own."""

    _impl_class = _KernelCacheImpl

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file: Any = KernelFiles(cache_folder(), self._impl.filename_base)
