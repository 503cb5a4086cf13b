"""The run: steps, outputs at their times, checkpoints, and the summary."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numba
import numpy as np
from numpy.typing import NDArray

import replay
from replay.errors import InstabilityError
from replay.files import write_json
from replay.solver.checkpoint import Checkpoints, Signals, code_hash, identity
from replay.solver.contact.recorder import ContactRecorder
from replay.solver.integrator import Integrator
from replay.solver.link_histories import link_recorders
from replay.solver.outputs import ENERGY_TABLE, Histories, States
from replay.solver.problem import Controls, Problem
from replay.solver.progress import Progress
from replay.solver.threads import ThreadChoice
from replay.solver.time_step import StepBound, fitted_step
from replay.solver.view import Recorder, ReferenceGradients, StateView
from replay.solver.watchdog import check_speed, check_step, speed_limit

#: Steps a history interval is cut into where nothing deforms and no element bounds the step.
_RIGID_STEPS = 20


@dataclass(frozen=True)
class RunSummary:
    """How a run went; the contents of run.json, which hold no clock and no host.

    Parameters
    ----------
    ran_to_end
        Whether the termination time was reached.
    stopped
        The watch-dog's sentence where it was not.
    time_s, steps
        Reached time [s] and steps done.
    smallest_time_step_s
        Over all history times [s].
    min_volume_ratio
        Smallest V / V0 of a deformable element at history times.
    flow_residual
        The most that a step left of the flow equation that a law solves, over its stress; None where no law does.
    added_mass_kg, added_mass_by_part_kg
        Mass scaling, in all and by part name [kg].
    mass_kg
        Of everything, added mass included [kg].
    mass_by_part_kg
        By part name, added mass included [kg].
    energies
        Last row of the ledger [J].
    energy_ratio_range
        Least and greatest energy ratio at history times.
    contact
        Steps with contact, share of them that did not converge, mean iterations, deepest penetration over the
        face's size; empty without contact.
    state_hash
        SHA-256 of every array of the final state: equal for equal runs, whatever the number of threads.
    model_hash, code_hash, version
        What ran.
    """

    ran_to_end: bool
    stopped: str
    time_s: float
    steps: int
    smallest_time_step_s: float
    min_volume_ratio: float
    flow_residual: float | None
    added_mass_kg: float
    added_mass_by_part_kg: dict[str, float]
    mass_kg: float
    mass_by_part_kg: dict[str, float]
    energies: dict[str, float]
    energy_ratio_range: tuple[float, float]
    contact: dict[str, float]
    state_hash: str
    model_hash: str
    code_hash: str
    version: str


class _Clock:
    """The times at which something is due: histories, states, the end."""

    def __init__(self, controls: Controls) -> None:
        self._interval = (controls.history_interval_s, controls.plot_interval_s)
        self._end = controls.termination_time_s
        self.count = [0, 0]

    def _next(self, kind: int) -> float:
        return min(self.count[kind] * self._interval[kind], self._end)

    def due(self, t: float) -> tuple[bool, bool]:
        """Whether a history row and a state are due at `t`; counts them."""
        # 30 * 1e-4 and 3 * 1e-3 are one time, but not one double
        late = t + 1e-9 * min(self._interval)
        answer = [self._next(kind) <= late for kind in (0, 1)]
        for kind in (0, 1):
            if answer[kind]:
                self.count[kind] = math.floor(late / self._interval[kind]) + 1
        return answer[0] or answer[1], answer[1]

    def target(self) -> float:
        """Next time at which something is due [s]."""
        return min(self._next(0), self._next(1))

    def over(self, t: float) -> bool:
        """Whether the run has reached its end."""
        return t >= self._end


class _Run:
    def __init__(
        self, problem: Problem, folder: Path, recorders: Sequence[Recorder], resume: bool, stream: TextIO | None
    ) -> None:
        self.problem, self.folder, self.recorders = problem, folder, [*link_recorders(problem), *recorders]
        if problem.contact is not None:
            self.recorders.append(ContactRecorder(problem))
        self.controls = problem.controls
        self.progress = Progress(stream, self.controls.termination_time_s)
        self.integrator = Integrator(problem, speed_limit(problem))
        self.reference = ReferenceGradients(problem)
        self.clock = _Clock(self.controls)
        self.histories = Histories(problem)
        self.checkpoints = Checkpoints(folder / "checkpoint", identity(problem))
        self.smallest = np.array([math.inf, math.inf])  # time step, volume ratio
        self._last_state_s = -1.0
        self._soft = np.array([not p.material.is_rigid for p in problem.parts])[problem.element_part]
        saved = self.checkpoints.read() if resume else None
        for path in self.checkpoints.damaged:
            self.progress.note(f"{path.name} is damaged; going back to the checkpoint before it")
        if saved is None:
            self.checkpoints.clear()
        else:
            self._restore(saved)
        written = None if saved is None else int(saved["counts"][2])
        self.states = States(problem, folder, self.reference.volume, resume_at=written)
        self._good = {name: a.copy() for name, a in self.integrator.arrays().items()}

    def _arrays(self) -> dict[str, NDArray[Any]]:
        result: dict[str, NDArray[Any]] = {f"run.{k}": v for k, v in self.integrator.arrays().items()}
        result |= {f"histories.{k}": v for k, v in self.histories.state().items()}
        for number, recorder in enumerate(self.recorders):
            result |= {f"recorder{number}.{k}": np.asarray(v) for k, v in recorder.state().items()}
        result["counts"] = np.array([*self.clock.count, self.states.count], np.int64)
        result["smallest"] = self.smallest
        result["last_state_s"] = np.array([self._last_state_s])
        return result

    def _restore(self, saved: dict[str, NDArray[Any]]) -> None:
        def below(prefix: str) -> dict[str, NDArray[Any]]:
            return {name[len(prefix) :]: a for name, a in saved.items() if name.startswith(prefix)}

        self.integrator.restore(below("run."))
        self.histories.restore(below("histories."))
        for number, recorder in enumerate(self.recorders):
            recorder.restore(below(f"recorder{number}."))
        self.clock.count = saved["counts"][:2].tolist()
        self.smallest = saved["smallest"].copy()
        self._last_state_s = float(saved["last_state_s"][0])
        self.progress.note(f"goes on from {self.integrator.time_s:.6g} s, step {self.integrator.step}")

    def save(self) -> Path:
        """Write a checkpoint of the present state, at the head of a step."""
        self.states.sync()
        return self.checkpoints.write(self.integrator.step, self._arrays())

    def _stable(self, bound: StepBound) -> float:
        if math.isfinite(bound.step_s):
            return self.controls.time_step_factor * bound.step_s
        return self.controls.history_interval_s / _RIGID_STEPS

    def go(self, signals: Signals, threads: ThreadChoice) -> None:
        """Step until the end, a signal, or the watch-dog's veto."""
        integrator, clock = self.integrator, self.clock
        last_save = time.monotonic()
        first = True
        while True:
            t = integrator.time_s
            bound = integrator.forces()
            check_step(integrator, bound)
            if first:
                self.progress.estimate(integrator, bound)
                first = False
            row, state = clock.due(t)
            over = clock.over(t)
            if over:
                dt, lands, target = self._stable(bound), False, t
            else:
                target = clock.target()
                dt, lands = fitted_step(self._stable(bound), t, target)
            before = integrator.velocities() if row else None
            integrator.kick(dt, drift=not row)
            check_speed(integrator)
            if before is not None:
                self._sample(bound, integrator.present_velocities(before, dt), state)
            if over:
                return
            integrator.drift(dt, target if lands else t + dt)
            threads.step()
            self.progress.step(integrator, bound)
            received = signals.take()
            period = self.controls.checkpoint_period_s
            now = time.monotonic()
            if received is not None or (period > 0 and now - last_save >= period):
                path = self.save()
                last_save = now
                if received in (signal.SIGTERM, signal.SIGINT):
                    self.states.abandon()
                    self.progress.note(f"{received.name}: state saved to {path.name}; the same command goes on")
                    raise KeyboardInterrupt if received == signal.SIGINT else SystemExit(128 + received)

    def _sample(self, bound: StepBound, velocities: NDArray[np.float64], state: bool) -> None:
        integrator = self.integrator
        view = StateView(integrator, velocities, self.reference)
        self._good = {name: a.copy() for name, a in integrator.arrays().items()}
        self.histories.sample(view, bound, integrator.added_mass.total_kg)
        for recorder in self.recorders:
            recorder.sample(view)
        if state:
            self.states.append(view)
            self._last_state_s = view.time_s
        if self._soft.any():
            ratio = (view.volumes / self.reference.volume)[self._soft].min()
            step = view.time_step_s if view.step else math.inf
            self.smallest = np.minimum(self.smallest, [step, ratio])

    def finish(self, stopped: str = "") -> RunSummary:
        """Write all tables and the summary."""
        integrator = self.integrator
        self.histories.write(self.folder)
        for recorder in self.recorders:
            recorder.write(self.folder)
        self.states.close()
        names = [part.name for part in self.problem.parts]
        mass = np.bincount(self.problem.element_part, integrator.element_mass, len(names))
        table = self.histories.state()["energy"]
        ratio = table[:, ENERGY_TABLE.names.index("ratio")]
        energies = integrator.energies(integrator.velocities())
        summary = RunSummary(
            ran_to_end=not stopped,
            stopped=stopped,
            time_s=integrator.time_s,
            steps=integrator.step,
            smallest_time_step_s=float(self.smallest[0]),
            min_volume_ratio=float(self.smallest[1]),
            flow_residual=_flow_residual(integrator),
            added_mass_kg=integrator.added_mass.total_kg,
            added_mass_by_part_kg=dict(zip(names, integrator.added_mass.by_part_kg.tolist())),
            mass_kg=float(mass.sum()),
            mass_by_part_kg=dict(zip(names, mass.tolist())),
            energies={f"{k}_J": v for k, v in dataclasses.asdict(energies).items()},
            energy_ratio_range=(float(ratio.min()), float(ratio.max())) if len(ratio) else (1.0, 1.0),
            contact={} if integrator.contact is None else integrator.contact.summary(),
            state_hash=state_hash(integrator),
            model_hash=self.problem.digest(),
            code_hash=code_hash(),
            version=replay.__version__,
        )
        write_json(self.folder / "run.json", dataclasses.asdict(summary))
        return summary

    def stop(self, error: InstabilityError) -> None:
        """Leave the last good state where the user can look at it, and the tables as far as they go."""
        self.integrator.restore(self._good)
        view = StateView(self.integrator, self.integrator.velocities(), self.reference)
        if view.time_s > self._last_state_s:
            self.states.append(view)
        self.finish(str(error))


def _flow_residual(integrator: Integrator) -> float | None:
    kept = [values for group in integrator.groups if (values := group.variable("flow_residual")) is not None]
    return max((float(values.max()) for values in kept), default=None)


def state_hash(integrator: Integrator) -> str:
    """SHA-256 of every array that a step changes."""
    digest = hashlib.sha256()
    for name, array in sorted(integrator.arrays().items()):
        digest.update(name.encode() + np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def solve(
    problem: Problem,
    folder: str | Path,
    *,
    recorders: Sequence[Recorder] = (),
    threads: int | None = None,
    resume: bool = True,
    progress: TextIO | None = sys.stderr,
) -> RunSummary:
    """Run a problem to its end.

    Parameters
    ----------
    problem
        Arrays and settings.
    folder
        Gets timestep.csv, energy.csv, part_energy.csv, histories.csv, states.vtkhdf, run.json; joints.csv,
        straps.csv, ties.csv, contact.csv and rigid_sets.csv where the problem has any; what the recorders write; and
        while the run lasts a folder ``checkpoint``.
    recorders
        See `Recorder`; called at every history time.
    threads
        Most threads of the element and node loops, all by default. The run takes one where more do not
        pay; results do not depend on it.
    resume
        Whether to go on from a checkpoint in `folder`.
    progress
        Stream for progress lines; None for silence.

    Returns
    -------
    RunSummary
        Also written to run.json.

    Raises
    ------
    InstabilityError
        When the watch-dog stops the run; tables and the last good state are written.
    ResumeError
        When the checkpoint belongs to another model, code or version.
    KeyboardInterrupt, SystemExit
        On SIGINT or SIGTERM, after a checkpoint.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    before = numba.get_num_threads()
    try:
        with Signals() as signals:
            run = _Run(problem, folder, recorders, resume, progress)
            choice = ThreadChoice(min(threads or before, before), run.integrator.layout.n_blocks)
            try:
                run.go(signals, choice)
            except InstabilityError as error:
                run.stop(error)
                raise
            summary = run.finish()
            run.checkpoints.clear()
            return summary
    finally:
        numba.set_num_threads(before)
