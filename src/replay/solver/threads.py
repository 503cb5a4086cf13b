"""How many threads are worth having, found out while a run goes on.

Results do not depend on the number of threads, so a run may change it at any step. On an idle machine
two threads halve the time of a large model; on a small model, or where other work holds the second
core, each step waits for the slower one and a single thread wins by far. A few steps of each tell.
"""

from __future__ import annotations

import time

import numba

#: Fewer blocks of elements are never worth another thread.
_BLOCKS_PER_THREAD = 48
_TRIAL_STEPS = 12
_PERIOD_STEPS = 1000


class ThreadChoice:
    """Switches between one thread and all that are allowed, to whichever is faster.

    Parameters
    ----------
    allowed
        Most threads.
    n_blocks
        Blocks of elements of the model.
    """

    def __init__(self, allowed: int, n_blocks: int) -> None:
        self._many = min(allowed, max(n_blocks // _BLOCKS_PER_THREAD, 1))
        self._count = 0
        self._began = 0.0
        self._cost: dict[int, float] = {}
        numba.set_num_threads(self._many)

    def step(self) -> None:
        """Count a step; look at the clock where a trial begins or ends."""
        if self._many == 1:
            return
        place = self._count % _PERIOD_STEPS
        self._count += 1
        if place == 0:
            self._switch(self._many)
        elif place == _TRIAL_STEPS:
            self._cost[self._many] = time.perf_counter() - self._began
            self._switch(1)
        elif place == 2 * _TRIAL_STEPS:
            self._cost[1] = time.perf_counter() - self._began
            self._switch(min(self._cost, key=lambda n: (self._cost[n], n)))

    def _switch(self, threads: int) -> None:
        numba.set_num_threads(threads)
        self._began = time.perf_counter()
