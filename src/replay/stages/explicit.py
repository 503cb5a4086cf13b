"""``replay solve``: the solver as a tool of its own, for who has a model and wants a run."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from replay.controls import load_controls
from replay.errors import InputError
from replay.files import hold_folder, write_json
from replay.solver import solve
from replay.solver.arrays import WHERE
from replay.stages.controlled import build_task
from replay.stages.solver_model import open_model


def solve_model(model: Path, controls: Path, out: Path, *, threads: int | None = None, anew: bool = False) -> int:
    """Run a model under its controls; go on from a checkpoint where there is one.

    Parameters
    ----------
    model
        ``model.h5``, or a keyword deck.
    controls
        ``controls.yaml``.
    out
        Folder of the results.
    threads
        Most threads.
    anew
        Start from time 0 even where a checkpoint lies.

    Returns
    -------
    int
        0.

    Raises
    ------
    InputError, InputErrors
        For a model or controls that cannot be used.
    InstabilityError, ResumeError
        See `replay.solver.solve`.
    """
    settings = load_controls(controls)
    with _told_of(controls):
        task = build_task(open_model(model), settings, controls)
        for note in task.notes:
            print(note)
        with hold_folder(out, "this run"):
            write_json(out / "controls.json", settings.model_dump(mode="json"))
            summary = solve(task.problem, out, recorders=task.recorders, threads=threads, resume=not anew)
    low, high = summary.energy_ratio_range
    energies = summary.energies
    flow = "" if summary.flow_residual is None else f", flow residual {summary.flow_residual:.1e}"
    print(
        f"{model}: {1e3 * summary.time_s:.6g} ms in {summary.steps} steps, energy ratio {low:.5f} to {high:.5f}\n"
        f"    kinetic {energies['kinetic_J']:.6g} J, internal {energies['internal_J']:.6g} J, "
        f"hourglass {energies['hourglass_J']:.6g} J, added mass {summary.added_mass_kg:.3g} kg{flow}\n"
        f"    results: {out}"
    )
    return 0


@contextlib.contextmanager
def _told_of(controls: Path) -> Iterator[None]:
    """Name the user's file where the solver, which knows none, refuses a problem."""
    try:
        yield
    except InputError as error:
        if error.file != WHERE:
            raise
        raise InputError(controls, error.found, expected=error.expected, mend=error.mend, column=error.column) from None
