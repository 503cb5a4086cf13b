"""What one play asks of a machine, before anything has run: threads, memory, time, from resolution and window.

Measured on the shipped head and helmet, one core of 2.5 GHz: 0.38 us an element and step, the same from tiny to coarse;
the stable step is that of the smallest brain or fluid element. A cluster ends what outlasts its request, so that time
is asked for with a margin; a solver that meets its limit all the same goes on from its checkpoint in the next job.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_S_PER_ELEMENT_STEP = 0.38e-6
_MARGIN = 4.0
_START_MINUTES = 10
_ELEMENTS_PER_THREAD = 2500
_MOST_THREADS = 16
_BASE_MB, _MB_PER_ELEMENT = 700, 0.025


@dataclass(frozen=True)
class _Mesh:
    elements: int
    step_s: float


# Elements that deform, and the time step of the replay, of the shipped head and helmet.
_MESHES = {
    "tiny": _Mesh(1628, 1.97e-6),
    "coarse": _Mesh(6154, 1.82e-6),
    "medium": _Mesh(39200, 0.82e-6),
    "fine": _Mesh(202092, 0.44e-6),
}


@dataclass(frozen=True)
class Estimate:
    """What the solver of one play asks for.

    Parameters
    ----------
    threads
        Beyond these it gains little.
    memory_mb
        Megabytes of one process.
    minutes
        Wall clock of one replay on so many threads, margin included.
    core_hours
        Processor time of one replay, without margin.
    """

    threads: int
    memory_mb: int
    minutes: int
    core_hours: float


def estimate(resolution: str, duration_s: float, *, most_threads: int = _MOST_THREADS) -> Estimate:
    """Estimate one replay.

    Parameters
    ----------
    resolution
        ``model.resolution``; of one that is not known (the settings stage will say so) the least is asked.
    duration_s
        ``window.duration_s`` [s].
    most_threads
        The machine has no more.
    """
    mesh = _MESHES.get(resolution, _MESHES["tiny"])
    threads = max(1, min(math.ceil(mesh.elements / _ELEMENTS_PER_THREAD), most_threads))
    seconds = mesh.elements * duration_s / mesh.step_s * _S_PER_ELEMENT_STEP
    return Estimate(
        threads=threads,
        memory_mb=round(_BASE_MB + _MB_PER_ELEMENT * mesh.elements),
        minutes=_START_MINUTES + math.ceil(_MARGIN * seconds / threads / 60.0),
        core_hours=seconds / 3600.0,
    )
