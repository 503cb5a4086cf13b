"""What a run says while it works: an estimate before the first step, then at most a line every five seconds."""

from __future__ import annotations

import time
from typing import TextIO

from replay.solver.integrator import Integrator
from replay.solver.time_step import StepBound

_PERIOD_S = 5.0
#: A step costs more than its element forces: nodes, ledger, outputs.
_OVERHEAD = 1.35


class Progress:
    """Lines about a run on a text stream; silent without one."""

    def __init__(self, stream: TextIO | None, end_s: float) -> None:
        self._stream = stream
        self._end = end_s
        self._began = self._last = time.monotonic()
        self._first_time = 0.0

    def _say(self, text: str) -> None:
        if self._stream is not None:
            print(f"solver: {text}", file=self._stream, flush=True)

    def estimate(self, integrator: Integrator, bound: StepBound) -> None:
        """Say before the first step how large the run is and how long it should take."""
        self._first_time = integrator.time_s
        size = sum(a.nbytes for a in integrator.arrays().values()) + 24 * 8 * 16 * integrator.layout.n_blocks
        step = integrator.problem.controls.time_step_factor * bound.step_s
        steps = max((self._end - integrator.time_s) / step, 1.0) if step > 0 else 0.0
        forces_s = 0.0
        if integrator.step == 0:
            # before the first step the elements stand still in time: a second look at them changes nothing
            before = time.perf_counter()
            for group in integrator.groups:
                group.forces(integrator.nodal, 0.0)
            forces_s = time.perf_counter() - before
        elements = sum(int(group.group.fill.sum()) for group in integrator.groups)
        problem = integrator.problem
        counts = {"joints": len(problem.joints), "straps": len(problem.straps), "tied nodes": integrator.tied.count}
        linked = "".join(f", {count} {name}" for name, count in counts.items() if count)
        self._say(
            f"{elements} elements that deform, {len(integrator.nodal)} nodes, {integrator.bodies.count} rigid bodies"
            f"{linked}; "
            f"about {steps:.0f} steps of {step:.3g} s, {size / 2**20:.1f} MiB of state"
            + (f", {_duration(steps * forces_s * _OVERHEAD)}" if forces_s else "")
        )
        if integrator.added_mass.total_kg > 0:
            added = integrator.added_mass
            share = added.total_kg / integrator.element_mass.sum()
            self._say(
                f"mass scaling adds {added.total_kg:.3g} kg ({100 * share:.3g} %) to {added.elements.sum()} elements"
            )
        self._began = self._last = time.monotonic()

    def step(self, integrator: Integrator, bound: StepBound) -> None:
        """Say how far the run is, if the last line is old enough."""
        if self._stream is None or integrator.step % 16:
            return
        now = time.monotonic()
        if now - self._last < _PERIOD_S:
            return
        self._last = now
        done = (integrator.time_s - self._first_time) / (self._end - self._first_time)
        left = (now - self._began) * (1 - done) / done if done > 0 else 0.0
        problem = integrator.problem
        holder = ""
        if bound.element >= 0:
            holder = f" by element {problem.element_ids[bound.element]} ({problem.part_of(bound.element).name})"
        self._say(
            f"{100 * integrator.time_s / self._end:5.1f} %  t {1e3 * integrator.time_s:.3f} ms  "
            f"dt {integrator.dt_s:.3g} s{holder}  energy ratio {integrator.energies().ratio:.5f}  "
            f"{_duration(left)} left"
        )

    def note(self, text: str) -> None:
        """Say one thing."""
        self._say(text)


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
