"""How the kernels are compiled: one decorator for the physics, one for what the solver calls.

The physics (`tensors`, `hexahedron`, `materials`) is pure scalar functions, each decorated by
`device`: inlined wherever it is called, so that the lane loop of `lanes` becomes one long
basic block that LLVM vectorises. The same dispatchers are accepted inside a ``numba.cuda``
kernel, which recompiles their source as device functions; nothing in them is CPU-specific.

What the solver calls is decorated by `compiled` and cached on disk. Numba's own cache looks
only at the file of the outermost function and would keep serving code compiled from an older
`materials/elastic.py`; here both the folder and the index carry `source_hash`, so that any
edit of any kernel file recompiles.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba import njit
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

#: Inlined scalar function; `error_model` spares a branch per division, `fastmath` stays off
#: so that one kind of machine gives one result.
device = njit(forceinline=True, error_model="numpy")


@cache
def source_hash() -> str:
    """Hex digest of every kernel source and of the compiler's version."""
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    folder = Path(__file__).parent
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def cache_folder() -> Path:
    """Folder of the compiled kernels, named by `source_hash`.

    Below ``NUMBA_CACHE_DIR`` where that is set (a workflow shares one between its jobs),
    else below ``XDG_CACHE_HOME`` or ``~/.cache``, else below the temporary folder.
    """
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(named) / f"kernels-{source_hash()[:16]}"
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "replay"
    try:
        home.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=home).close()
    except OSError:
        home = Path(tempfile.gettempdir()) / f"replay-{os.getuid()}"
    return home / f"kernels-{source_hash()[:16]}"


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

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _KernelLocator:
        return cls(py_func)


class _KernelCacheImpl(CompileResultCacheImpl):
    _locator_classes: ClassVar[list[Any]] = [_KernelLocator]  # type: ignore[misc]


class _KernelCache(FunctionCache):
    _impl_class = _KernelCacheImpl


def compiled(function: Callable[..., Any], *, parallel: bool = False) -> Any:
    """Compile a function that the solver calls, and keep it on disk.

    Parameters
    ----------
    function
        Works on arrays; releases the interpreter lock.
    parallel
        Whether its ``prange`` loops run on several threads. No loop of the project reduces
        a float across iterations, so the result does not depend on their number.
    """
    dispatcher: Any = njit(parallel=parallel, nogil=True, error_model="numpy")(function)
    if not config.DISABLE_JIT:  # type: ignore[attr-defined]
        dispatcher._cache = _KernelCache(function)
    return dispatcher
