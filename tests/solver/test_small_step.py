"""The brain's small step: the whole step wherever it holds, and where it does not the lane loop takes the whole one."""

from __future__ import annotations

import platform
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from dumb_brain import dev
from material_point import Point
from numba import types
from numba.core import config
from test_brain_isv import BRAIN, LAW, SHEAR, value

from replay.solver import Controls, Material, Problem, SolverPart, solve
from replay.solver.integrator import Integrator
from replay.solver.kernels.element import Control
from replay.solver.kernels.lanes import compile_law
from replay.solver.kernels.materials import brain_isv

#: Shear rate of the gentle element [1/s], and the step [s].
RATE, STEP = 20.0, 1e-4
RESIDUAL = brain_isv.STATE.index("flow_residual")


def small(point: Point, f: np.ndarray, dt: float) -> Point:
    """What the small step makes of a point's next step."""
    other = Point(LAW, **BRAIN)
    other.module = SimpleNamespace(STATE=brain_isv.STATE, update=brain_isv.small_update)
    other.constants, other.stress, other.state, other.f = point.constants, point.stress, point.state, point.f
    other.to(f, dt)
    return other


@pytest.mark.parametrize("exponent", [1.0, 0.5, 2.0])
def test_a_small_step_is_the_whole_one_or_says_that_it_is_not(exponent: float) -> None:
    rng = np.random.default_rng(3)
    refused, held, worst = 0, 0, 0.0
    for step in range(2400):
        if step % 60 == 0:
            point = Point(LAW, **{**BRAIN, "rate_exponent": exponent, "pressure_sensitivity": 0.1})
            way = rng.normal(size=(3, 3))
            way -= np.eye(3) * np.trace(way) / 3
        size, dt = 10.0 ** rng.uniform(-6, -0.5), 10.0 ** rng.uniform(-8, -2)
        if rng.random() < 0.2:
            way = -way
        f = (np.eye(3) + size * (way + 0.2 * rng.normal(size=(3, 3)))) @ point.f
        if not 0.3 < np.linalg.det(f) < 3 or np.linalg.cond(f) > 30:
            continue
        before = value(point, "equivalent_plastic_strain")
        quick = small(point, f, dt)
        point.to(f, dt)
        if quick.state[RESIDUAL] < 0:
            refused += 1
            # as small as the steps of a run: none is refused
            assert exponent < 1 or dt > 1e-5 or max(size, value(point, "equivalent_plastic_strain") - before) > 3e-4
            continue
        held += 1
        scale = np.abs(np.array(point.state[9:15])).max() + np.abs(point.stress).max() + BRAIN["yield_stress_pa"]
        worst = max(worst, np.abs(np.subtract(quick.stress, point.stress)).max() / scale)
        np.testing.assert_allclose(quick.state[:RESIDUAL], point.state[:RESIDUAL], rtol=1e-9, atol=1e-9)
        assert quick.state[RESIDUAL] <= max(point.state[RESIDUAL], 1e-10)
    assert min(refused, held) > 200
    assert worst < 1e-9


@pytest.mark.parametrize("size", [1e-14, 1e-12, 1e-10, 1e-7, 1e-4])
def test_flow_near_rest_is_that_of_small_strain_and_its_equation_is_solved(size: float) -> None:
    # 1 + strain loses the digits of a small strain: what is solved may not lose more
    way = np.random.default_rng(5).normal(size=(3, 3))
    f, dt = np.eye(3) + size * way, 1e-6
    point = Point(LAW, **BRAIN)
    quick = small(point, f, dt)
    point.to(f, dt)
    strain = dev(0.5 * size * (way + way.T))
    # gdot = gdot0 tau / Y with tau = 2 mu |e| / sqrt2
    gdot = BRAIN["reference_rate_per_s"] * np.sqrt(2) * SHEAR * np.linalg.norm(strain) / BRAIN["yield_stress_pa"]
    for taken in (point, quick):
        assert value(taken, "equivalent_plastic_strain") == pytest.approx(
            gdot * dt / np.sqrt(3), rel=max(1e-2, 1e-15 / size)
        )
        assert 0.0 <= value(taken, "flow_residual") < 1e-12


def two_elements(violent: float, end: float = 1.0) -> Problem:
    """Two elements apart from one another: the first sheared gently, the second `violent` times as fast."""
    cube = 0.01 * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    nodes = np.vstack([cube, cube + np.array([0.1, 0.0, 0.0])])
    velocity = np.zeros_like(nodes)
    velocity[:, 0] = RATE * nodes[:, 1] * np.repeat([1.0, violent], 8)
    part = SolverPart(1, "brain", Material("brain", LAW, 1040.0, BRAIN))
    controls = Controls(end, mass_scaling_time_step_s=0.0)
    return Problem(nodes, np.arange(16).reshape(2, 8), np.zeros(2, int), (part,), controls, initial_velocity=velocity)


def one_step(violent: float) -> Integrator:
    """Both elements after one step of `STEP`."""
    run = Integrator(two_elements(violent), 1e9)
    run.forces()
    run.kick(STEP, drift=True)
    run.drift(STEP, STEP)
    run.forces()
    return run


def test_an_element_takes_the_whole_step_by_itself_and_its_neighbours_do_not_notice() -> None:
    violent = 2000.0
    alone, mixed = one_step(1.0), one_step(violent)
    point = Point(LAW, **BRAIN)
    f = np.eye(3)
    f[0, 1] = STEP * RATE * violent
    assert small(point, f, STEP).state[RESIDUAL] < 0
    point.to(f, STEP)
    for name in ("equivalent_plastic_strain", "phi", "flow_residual"):
        gentle, fast = mixed.variable(name)
        assert gentle == alone.variable(name)[0] >= 0.0
        assert fast == pytest.approx(value(point, name), rel=1e-6, abs=1e-13), name
    assert mixed.variable("equivalent_plastic_strain")[1] > 0.1


def test_a_run_tells_what_its_steps_have_left_of_the_flow_equation(tmp_path: Path) -> None:
    told = solve(two_elements(3.0, 2e-3), tmp_path, progress=None).flow_residual
    assert told is not None
    assert 0.0 < told < 1e-10


@pytest.mark.slow
@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="there is no machine code without the compiler")
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="its mnemonics are of another machine")
def test_the_lane_loop_is_packed_arithmetic() -> None:
    def array(kind: types.Type, dimensions: int) -> types.Array:
        return types.Array(kind, dimensions, "C")

    f, i = types.float64, types.int64
    block = compile_law(brain_isv).py_func.__globals__["run_block"]
    block.compile(
        (
            i, i, i, array(f, 2), array(types.uint32, 3), array(types.uint16, 3), array(f, 2), *(array(f, 3),) * 4,
            array(f, 2), i, types.NamedUniTuple(f, len(Control._fields), Control), f, *(array(f, 2),) * 3,
        )
    )  # fmt: skip
    (text,) = block.inspect_asm().values()
    # the loop's function alone, without the one for single elements that it calls
    ((_, loop),) = re.findall(
        r"^(_ZN6replay\S*block_forces_\S*):\n(.*?)^\s+\.size\s+\1,", text, re.MULTILINE | re.DOTALL
    )
    packed, single = (
        len(re.findall(rf"^\s+v?(?:mul|add|sub|div|sqrt){kind}\s", loop, re.MULTILINE)) for kind in ("pd", "sd")
    )
    assert packed > 1000
    assert single < 0.1 * packed
