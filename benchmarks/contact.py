"""What contact costs: the search from ten thousand to a million faces, and its share of a step of two helmets.

    python benchmarks/contact.py            # both tables
    python benchmarks/contact.py search 10 100 1000      # thousand faces
    python benchmarks/contact.py helmets coarse

The search is compared with itself on the smallest mesh: time a face that stays the same is linear growth. The share
of a step is contact's time over that of the whole step, in one run.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from replay.models import build_model, select_assembly
from replay.solver import ContactControls, Controls, Material, Problem, SolverPart
from replay.solver.blocks import structured_block
from replay.solver.integrator import Integrator
from replay.solver.kernels.contact_detect import detect

SOFT = Material("soft", "elastic", 1000.0, {"youngs_modulus_pa": 1e7, "poisson_ratio": 0.3})
STEPS = 200


def plates(thousand_faces: int) -> Integrator:
    """Two plates, one element thick, that touch over their whole face; one mesh is shifted by half an element."""
    side = int(np.sqrt(thousand_faces * 1000 / 4))
    h = 0.01
    nodes, hexes = structured_block((side, side, 1), (side * h, side * h, h))
    upper = nodes + np.array([0.5 * h, 0.5 * h, h * 1.0001])
    part = np.repeat([0, 1], len(hexes))
    problem = Problem(
        np.vstack([nodes, upper]), np.vstack([hexes, hexes + len(nodes)]), part,
        (SolverPart(1, "lower", SOFT), SolverPart(2, "upper", SOFT)), Controls(1.0, mass_scaling_time_step_s=0.0),
        contact=ContactControls(),
    )  # fmt: skip
    return Integrator(problem, 1e9)


def search_table(sizes: list[int]) -> None:
    """Print time a face of the list and of the closest points, against the smallest mesh."""
    print("| faces | list, us a face | over the first | closest points, us a face | over the first |")
    print("|---:|---:|---:|---:|---:|")
    plates(1)
    first: tuple[float, float] | None = None
    for size in sizes:
        run = plates(size)
        contact = run.contact
        assert contact is not None
        faces = len(contact.surface.faces)
        run.forces()
        dt = 1e-6
        run.kick(dt, drift=False)
        search, best = contact._search, [np.inf, np.inf]
        for _ in range(3):
            search.forget()
            begin = time.perf_counter()
            search.update(run.nodal, dt, 1e-5)
            middle = time.perf_counter()
            detect(
                run.nodal, contact._mesh, search.points, search.first, search.candidates, 1e-5, dt, 1e-3,
                contact._old_face, contact._depth, contact._hits, contact._slots,
            )  # fmt: skip
            best = [min(best[0], middle - begin), min(best[1], time.perf_counter() - middle)]
        cost = (1e6 * best[0] / faces, 1e6 * best[1] / faces)
        first = first or cost
        print(
            f"| {faces:,} | {cost[0]:.3f} | {cost[0] / first[0]:.2f} | {cost[1]:.3f} | {cost[1] / first[1]:.2f} |",
            flush=True,
        )


def helmets_row(resolution: str) -> None:
    """Print contact's share of a step of two helmets that strike each other."""
    helmet = select_assembly(build_model("nfl", resolution), "helmet")
    n, m = len(helmet.nodes), len(helmet.hexes)
    turned = helmet.nodes * [-1.0, -1.0, 1.0]
    turned[:, 0] += helmet.nodes[:, 0].max() - turned[:, 0].min() + 1e-3
    parts = []
    for offset in (0, 10_000_000):
        for part in helmet.parts:
            facts = helmet.materials[part.material]
            material = Material(part.material, facts["law"], facts["density_kg_per_m3"], facts["parameters"])
            parts.append(SolverPart(part.pid + offset, f"{part.name} {1 + bool(offset)}", material))
    velocity = np.zeros((2 * n, 3))
    velocity[:n, 0], velocity[n:, 0] = 3.0, -3.0
    problem = Problem(
        np.vstack([helmet.nodes, turned]), np.vstack([helmet.hexes, helmet.hexes + n]),
        np.concatenate([helmet.element_part, helmet.element_part + len(helmet.parts)]), tuple(parts),
        Controls(1.0), initial_velocity=velocity, contact=ContactControls(),
    )  # fmt: skip
    run = Integrator(problem, 1e9)
    contact = run.contact
    assert contact is not None
    spent = 0.0
    apply, finish, settle = contact.apply, contact.finish, contact.settle

    def timed(function):
        def call(*arguments):
            nonlocal spent
            begin = time.perf_counter()
            result = function(*arguments)
            spent += time.perf_counter() - begin
            return result

        return call

    contact.apply, contact.finish, contact.settle = timed(apply), timed(finish), timed(settle)  # type: ignore[method-assign]
    while not contact.counts[0]:
        _step(run)
    spent, begin = 0.0, time.perf_counter()
    for _ in range(STEPS):
        _step(run)
    whole = time.perf_counter() - begin
    print("| model | hexes | surface faces | steps with constraints | mean iterations | contact, share of a step |")
    print("|---|---:|---:|---:|---:|---:|")
    told = contact.summary()
    print(
        f"| two helmets, {resolution} | {2 * m:,} | {len(contact.surface.faces):,} | {told['steps']} of {STEPS} | "
        f"{told['mean_iterations']:.1f} | {100 * spent / whole:.0f} % |"
    )


def _step(run: Integrator) -> None:
    dt = 0.9 * run.forces().step_s
    run.kick(dt, drift=True)
    run.drift(dt, run.time_s + dt)


if __name__ == "__main__":
    what = sys.argv[1:] or ["both"]
    if what[0] in ("search", "both"):
        search_table([int(v) for v in what[1:]] or [10, 30, 100, 300, 1000])
    if what[0] in ("helmets", "both"):
        helmets_row(what[1] if len(what) > 1 else "coarse")
