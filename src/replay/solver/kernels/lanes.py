"""The lane loop: one scalar source of physics, sixteen elements at a time.

Elements stand in blocks of `LANES`; every value of a block is a row of sixteen doubles (arrays
``(n_blocks, n_values, LANES)``). A block gathers its nodes into arrays on the stack, runs the
scalar `element` for each lane, and copies the results out. Because everything the loop writes
is a stack array of its own, LLVM knows that no store can change a later load, and turns the
loop into packed arithmetic by itself: no vector types, no second source.
"""

# ruff: noqa: F821 - some names are bound for each law by `compile_law`
from __future__ import annotations

import types as python_types
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import prange, types
from numba.core import cgutils, config
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from replay.solver.kernels.device import compiled, device
from replay.solver.kernels.element import (
    elastic_hourglass,
    element,
    no_deformation,
    total_deformation,
    yielding_hourglass,
)

#: Elements of a block: two AVX-512 or four AVX2 registers a value; 64 is 15 % slower.
LANES = 16

#: Blocks of a batch, whose forces one thread sums: its rows fit the fast cache, and small models still have work
#: for every thread.
BATCH_BLOCKS = 32

#: Columns of the nodal array: one cache line a node.
POSITION = 0
VELOCITY = 4
NODE_COLUMNS = 8

# bound for each law by `compile_law`
N_STATE: int
STATE_SIZE: int
N_REFERENCE: int
N_PARAMETERS: int
physics: Callable[..., Any]
again: Callable[..., Any]
HAS_SMALL_UPDATE: bool
run_block: Callable[..., None]

# sizes of a block's stack arrays: the compiler wants names, not products
_CORNER = 48 * LANES
_OUT = 42 * LANES
_EXTRA = 4 * LANES

if config.DISABLE_JIT:  # type: ignore[attr-defined]
    # plain Python in place of the compiler, so that coverage and a debugger see the kernels

    def stack(count):
        """Uninitialised array of `count` doubles."""
        return np.empty(count)

    def load(array, start, stride, count):
        """Tuple of `count` values of a flat view, `stride` apart."""
        return tuple(array.reshape(-1)[start + stride * k] for k in range(count))

    def store(array, start, stride, values):
        """Write a tuple to a flat view, `stride` apart."""
        flat = array.reshape(-1)
        for k, value in enumerate(values):
            flat[start + stride * k] = value

else:

    def _pointer(context, builder, array_type, array, offset):
        data = context.make_array(array_type)(context, builder, array).data
        return builder.gep(data, [offset])

    @intrinsic(prefer_literal=True)
    def stack(typing_context, count):
        """Uninitialised array of `count` doubles on the stack; `count` must be a constant."""
        size = count.literal_value
        array_type = types.Array(types.float64, 1, "C")

        def build(context, builder, signature, arguments):
            kind = context.get_data_type(types.float64)
            room = cgutils.alloca_once(builder, ir.ArrayType(kind, size))
            room.align = 64
            item = context.get_constant(types.intp, 8)
            array = context.make_array(array_type)(context, builder)
            populate_array(
                array,
                data=builder.bitcast(room, kind.as_pointer()),
                shape=[context.get_constant(types.intp, size)],
                strides=[item],
                itemsize=item,
                meminfo=None,
            )
            return array._getvalue()

        return array_type(count), build

    @intrinsic(prefer_literal=True)
    def load(typing_context, array, start, stride, count):
        """Tuple of `count` values of a flat view, `stride` apart: no bounds, no wrap-around."""
        result = types.UniTuple(array.dtype, count.literal_value)

        def build(context, builder, signature, arguments):
            first = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
            word = arguments[2].type
            values = [
                builder.load(builder.gep(first, [builder.mul(arguments[2], ir.Constant(word, k))]))
                for k in range(result.count)
            ]
            return context.make_tuple(builder, result, values)

        return result(array, types.intp, types.intp, count), build

    @intrinsic
    def store(typing_context, array, start, stride, values):
        """Write a tuple to a flat view, `stride` apart."""

        def build(context, builder, signature, arguments):
            first = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
            word = arguments[2].type
            for k in range(len(values)):
                place = builder.gep(first, [builder.mul(arguments[2], ir.Constant(word, k))])
                value = context.cast(builder, builder.extract_value(arguments[3], k), values[k], array.dtype)
                builder.store(value, place)
            return context.get_dummy_value()

        return types.void(array, types.intp, types.intp, values), build


@device
def keep(out, after, extra, lane, answer):
    """Put what `element` returned for a lane into the block's stack arrays."""
    fx, fy, fz, stress, hourglass, state, step, work = answer
    store(out, lane, LANES, fx)
    store(out, 8 * LANES + lane, LANES, fy)
    store(out, 16 * LANES + lane, LANES, fz)
    store(out, 24 * LANES + lane, LANES, stress)
    store(out, 30 * LANES + lane, LANES, hourglass[0])
    store(out, 33 * LANES + lane, LANES, hourglass[1])
    store(out, 36 * LANES + lane, LANES, hourglass[2])
    store(out, 39 * LANES + lane, LANES, hourglass[3])
    store(after, lane, LANES, state)
    store(extra, lane, LANES, (step,))
    store(extra, LANES + lane, LANES, work)


def one_element(
    block, lane, nodal, connectivity, mass, reference, stress, hourglass, state, p, control, dt
):  # fmt: skip
    """Answer of one lane by the law's `update`, from the block's arrays as they were before the step.

    Compiled by itself and told nothing of the block's stack arrays, so that their loop stays packed.
    """
    corner = stack(48)
    for a in range(8):
        node = connectivity[block, a, lane]
        for k in range(3):
            corner[k * 8 + a] = nodal[node, POSITION + k]
            corner[24 + k * 8 + a] = nodal[node, VELOCITY + k]
    q = load(hourglass, block * 12 * LANES + lane, LANES, 12)
    return physics(
        load(corner, 0, 1, 8),
        load(corner, 8, 1, 8),
        load(corner, 16, 1, 8),
        load(corner, 24, 1, 8),
        load(corner, 32, 1, 8),
        load(corner, 40, 1, 8),
        load(mass, block * LANES + lane, LANES, 1)[0],
        load(reference, block * N_REFERENCE * LANES + lane, LANES, N_REFERENCE),
        load(stress, block * 6 * LANES + lane, LANES, 6),
        ((q[0], q[1], q[2]), (q[3], q[4], q[5]), (q[6], q[7], q[8]), (q[9], q[10], q[11])),
        load(state, block * N_STATE * LANES + lane, LANES, N_STATE),
        dt,
        p,
        control,
    )


def block_forces(
    block, fill, first_row, nodal, connectivity, place, mass, reference, stress, hourglass, state, parameters, part,
    control, dt, force, step, work,
):  # fmt: skip
    """Advance the elements of one block; see `law_forces` for the arguments."""
    corner = stack(_CORNER)
    out = stack(_OUT)
    after = stack(STATE_SIZE)
    extra = stack(_EXTRA)
    for a in range(8):
        for lane in range(LANES):
            node = connectivity[block, a, lane]
            for k in range(3):
                corner[(k * 8 + a) * LANES + lane] = nodal[node, POSITION + k]
                corner[(24 + k * 8 + a) * LANES + lane] = nodal[node, VELOCITY + k]
    p = load(parameters, part * N_PARAMETERS, 1, N_PARAMETERS)
    for lane in range(LANES):
        q = load(hourglass, block * 12 * LANES + lane, LANES, 12)
        answer = physics(
            load(corner, lane, LANES, 8),
            load(corner, 8 * LANES + lane, LANES, 8),
            load(corner, 16 * LANES + lane, LANES, 8),
            load(corner, 24 * LANES + lane, LANES, 8),
            load(corner, 32 * LANES + lane, LANES, 8),
            load(corner, 40 * LANES + lane, LANES, 8),
            load(mass, block * LANES + lane, LANES, 1)[0],
            load(reference, block * N_REFERENCE * LANES + lane, LANES, N_REFERENCE),
            load(stress, block * 6 * LANES + lane, LANES, 6),
            ((q[0], q[1], q[2]), (q[3], q[4], q[5]), (q[6], q[7], q[8]), (q[9], q[10], q[11])),
            load(state, block * N_STATE * LANES + lane, LANES, N_STATE),
            dt,
            p,
            control,
        )
        keep(out, after, extra, lane, answer)
    if HAS_SMALL_UPDATE:
        for lane in range(LANES):
            # a comparison with a value that is not a number is false
            if not after[(N_STATE - 1) * LANES + lane] >= 0.0:
                answer = again(
                    block, lane, nodal, connectivity, mass, reference, stress, hourglass, state, p, control, dt
                )
                keep(out, after, extra, lane, answer)
    for a in range(8):
        for lane in range(fill):
            row = first_row + place[block, a, lane]
            for k in range(3):
                force[row, k] += out[(k * 8 + a) * LANES + lane]
    for k in range(6):
        for lane in range(LANES):
            stress[block, k, lane] = out[(24 + k) * LANES + lane]
    for k in range(12):
        for lane in range(LANES):
            hourglass[block, k, lane] = out[(30 + k) * LANES + lane]
    for k in range(N_STATE):
        for lane in range(LANES):
            state[block, k, lane] = after[k * LANES + lane]
    for lane in range(LANES):
        step[block, lane] = extra[lane]
    for k in range(3):
        total = 0.0
        for lane in range(fill):
            total += extra[(k + 1) * LANES + lane]
        work[block, k] = total


def law_forces(
    nodal, connectivity, place, first_row, fill, part, mass, reference, stress, hourglass, state, parameters, control,
    dt, force, step, work,
):  # fmt: skip
    """Forces, state and stable steps of all elements of one law.

    Parameters
    ----------
    nodal : (n_nodes, 8) float64
        Positions in columns 0-2 [m], velocities in columns 4-6 [m/s].
    connectivity : (n_blocks, 8, LANES) uint32
        Node rows; lanes beyond `fill` repeat the last element of the block.
    place : (n_blocks, 8, LANES) uint16
        Row of every corner within its batch.
    first_row : (n_batches + 1,) int64
        Rows of `force` that each batch sums into.
    fill : (n_blocks,) int64
        Elements of each block.
    part : (n_blocks,) int64
        Row of `parameters` of each block.
    mass : (n_blocks, LANES) float64
        Element masses, added mass included [kg].
    reference : (n_blocks, 1 or 19, LANES) float64
        V0 [m^3] and, for laws in total form, G0 / V0 [1/m].
    stress, hourglass, state : (n_blocks, 6 | 12 | n_state, LANES) float64
        Updated in place.
    parameters : (n_parts, n_parameters) float64
        Constants of each part's material.
    control : Control
        Numerical controls.
    dt : float
        Length of the step that has moved the nodes [s]; zero before the first.
    force : (n_rows, 3) float64
        Sums of each batch; x, y and z side by side for the nodes to gather [N] (output).
    step : (n_blocks, LANES) float64
        Stable steps [s], negative for an inverted element (output).
    work : (n_blocks, 3) float64
        Work of the step in stress, hourglass forces and bulk viscosity, summed over the block [J] (output).
    """
    batches = first_row.shape[0] - 1
    blocks = connectivity.shape[0]
    for index in prange(batches):
        batch = np.int64(index)  # the loop's own index is unsigned; one type, one compilation
        begin = first_row[batch]
        force[begin : first_row[batch + 1]] = 0.0
        for block in range(batch * BATCH_BLOCKS, min((batch + 1) * BATCH_BLOCKS, blocks)):
            run_block(
                block, fill[block], begin, nodal, connectivity, place, mass, reference, stress, hourglass, state,
                parameters, part[block], control, dt, force, step, work,
            )  # fmt: skip


def specialise(template: Callable[..., Any], name: str, **names: Any) -> Callable[..., Any]:
    """Copy a function under a new name, with some of its global names bound to `names`.

    One text, several compilations: numba resolves a global when it compiles, and its cache
    tells functions apart by their name.
    """
    bound = {**template.__globals__, **names}
    function = python_types.FunctionType(template.__code__, bound, name, template.__defaults__, template.__closure__)
    function.__qualname__ = name
    function.__module__ = template.__module__
    function.__doc__ = template.__doc__
    return function


def compile_law(law: Any) -> Any:
    """Compile `law_forces` for one material law (a module of `materials`).

    The lane loop stays a function of its own inside the parallel loop, so that it is
    optimised once, alone. Where the law has a `small_update` the loop runs that, and then `update` for the lanes
    whose step it did not hold for: an element's result depends on nothing but the element.
    """
    alone = numba.njit(nogil=True, error_model="numpy")
    kind = total_deformation if law.TOTAL_FORM else no_deformation
    hold = yielding_hourglass if getattr(law, "HOURGLASS_YIELDS", False) else elastic_hourglass
    sizes: dict[str, Any] = {
        "N_STATE": state_size(law),
        "STATE_SIZE": state_size(law) * LANES,
        "N_REFERENCE": reference_size(law),
        "N_PARAMETERS": law.N_CONSTANTS,
    }
    small = getattr(law, "small_update", None)
    kinds = {"deformation": kind, "hold": hold}
    physics = device(specialise(element, f"element_{law.NAME}", update=law.update, **kinds))
    sizes["again"] = alone(specialise(one_element, f"one_element_{law.NAME}", physics=physics, **sizes))
    sizes["HAS_SMALL_UPDATE"] = small is not None
    if small is not None:
        physics = device(specialise(element, f"small_element_{law.NAME}", update=small, **kinds))
    block = alone(specialise(block_forces, f"block_forces_{law.NAME}", physics=physics, **sizes))
    return compiled(specialise(law_forces, f"law_forces_{law.NAME}", run_block=block), parallel=True)


def state_size(law: Any) -> int:
    """Values of state kept per element; one unused value where the law has none, so that no array is empty."""
    return max(len(law.STATE), 1)


def reference_size(law: Any) -> int:
    """Values of the reference state that a law reads: V0 alone, or with the 18 of G0 / V0."""
    return 19 if law.TOTAL_FORM else 1
