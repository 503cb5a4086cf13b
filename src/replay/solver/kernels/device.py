"""How the kernels are compiled: one decorator for the physics, one for what the solver calls.

The physics (`tensors`, `hexahedron`, `materials`) is pure scalar functions, each decorated by
`device`: inlined wherever it is called, so that the lane loop of `lanes` becomes one long
basic block that LLVM vectorises. The same dispatchers are accepted inside a ``numba.cuda``
kernel, which recompiles their source as device functions; nothing in them is CPU-specific.

What the solver calls is decorated by `compiled` and kept on disk (`cache`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import config

from replay.solver.kernels.cache import KernelCache

#: Inlined scalar function; `error_model` spares a branch per division, `fastmath` stays off
#: so that one kind of machine gives one result.
device = njit(forceinline=True, error_model="numpy")


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
        dispatcher._cache = KernelCache(function)
    return dispatcher
