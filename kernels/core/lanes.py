"""Several threads for one particle: with a thread each, a few thousand particles leave most of a GPU idle.

The lanes of a particle are threads side by side. Each works on some of its neighbours, what they sum up is added over
the lanes, and the first goes on alone:

    t = wp.tid()
    i, lane = particle_of(t) + first, lane_of(t)
    ...
    k, step = part_of(place of the first neighbour, way to the next, lane)
    while k < end:
        ...
    total = added(total)
    if lane > 0:
        return

All lanes of a particle have to come to each `added`: what decides whether they do is the same for all of them. With one lane
these functions change nothing. A kernel with lanes is marked by `shared`, so that a launch of it has as many threads.
"""

import functools
from typing import Any

import warp as wp

from .spec import Spec

WARP = 32
"""Threads of a GPU that hand numbers to each other without memory."""

MOST = 8
"""Lanes of a particle at most: with sixteen each has two neighbours in 2-D, and adding up takes longer than these."""

BUSY = 1024
"""Threads of a multiprocessor up to which more lanes make a step of one phase in 2-D shorter (docs/speed.md#lanes)."""

SEVERAL, DEEP = 4, 12
"""How many times that many with several phases or in a gas, and in 3-D: more work a pair, more pairs a particle."""

RESIDENT = 2048
"""Threads that a multiprocessor holds: more than it holds are never worth so many lanes as `MOST`."""


@functools.cache
def make_lanes(lanes: int) -> tuple[Any, Any, Any]:
    """Return the `wp.func`s (particle_of(t), lane_of(t), part_of(begin, step, lane)) of so many lanes a particle.

    particle_of, lane_of: row and lane of a thread; part_of: the place of the first neighbour of a lane in the list, and the
    way to its next. `lanes`: a power of two, at most `WARP`.
    """
    if lanes not in (1, 2, 4, 8, 16, WARP):
        raise ValueError(f"lanes: {lanes} is no power of two up to {WARP}")

    @wp.func
    def particle_of(t: int):
        if wp.static(lanes > 1):
            return t / lanes
        else:
            return t

    @wp.func
    def lane_of(t: int):
        if wp.static(lanes > 1):
            return t % lanes
        else:
            return 0

    @wp.func
    def part_of(begin: int, step: int, lane: int):
        if wp.static(lanes > 1):
            return begin + lane * step, lanes * step
        else:
            return begin, step

    return particle_of, lane_of, part_of


@functools.cache
def make_exchange(lanes: int, number: Any, update: str) -> Any:
    """Return the `wp.func` exchanged(value) of a number: what C++ makes of `value` and `other`, over the lanes.

    Neighbours in pairs, then pairs of these, so that all lanes have the same bits.
    """
    group = f"{(1 << lanes) - 1:#x}u << (threadIdx.x & {(WARP - 1) & ~(lanes - 1)}u)"
    snippet = f"""
#if defined(__CUDA_ARCH__)
    for (int way = 1; way < {lanes}; way <<= 1) {{
        const auto other = __shfl_xor_sync({group}, value, way);
        value = {update};
    }}
#endif
    return value;
"""

    @wp.func_native(snippet)
    def exchanged(value: number) -> number: ...

    return exchanged


@functools.cache
def make_added(lanes: int, dtype: Any) -> Any:
    """Return the `wp.func` added(value): the sum over the lanes of a particle, of numbers, vectors or matrices."""
    shape = getattr(dtype, "_shape_", ())
    exchanged = make_exchange(lanes, getattr(dtype, "_wp_scalar_type_", dtype), "value + other")

    @wp.func
    def added(value: dtype):
        if wp.static(lanes == 1):
            return value
        elif wp.static(len(shape) == 0):
            return exchanged(value)
        elif wp.static(len(shape) == 1):
            total = dtype()
            for n in range(wp.static(shape[0])):
                total[n] = exchanged(value[n])
            return total
        else:
            total = dtype()
            for row in range(wp.static(shape[0])):
                for column in range(wp.static(shape[1])):
                    total[row, column] = exchanged(value[row, column])
            return total

    return added


@functools.cache
def make_largest(lanes: int, number: Any) -> Any:
    """Return the `wp.func` largest(value): the largest number of the lanes of a particle."""
    exchanged = make_exchange(lanes, number, "value < other ? other : value")

    @wp.func
    def largest(value: number):
        if wp.static(lanes == 1):
            return value
        else:
            return exchanged(value)

    return largest


def lanes_for(spec: Spec, count: int, multiprocessors: int) -> int:
    """Return the lanes of each of `count` particles on a GPU of so many multiprocessors; in 3-D two at least."""
    if spec.dimension == 1:
        return 1
    room = BUSY
    if spec.dimension == 3:
        room *= DEEP
    elif spec.multiphase or spec.varying_h:
        room *= SEVERAL
    if MOST * count <= min(room, RESIDENT) * multiprocessors:
        return MOST
    lanes = MOST // 2
    while lanes > 1 and lanes * count > room * multiprocessors:
        lanes //= 2
    return max(lanes, 2) if spec.dimension == 3 else lanes


def lanes_of(spec: Spec, *dtypes: Any) -> tuple[Any, ...]:
    """Return what `make_lanes` gives for a `Spec`, and an `added` for each of the types."""
    return (*make_lanes(spec.lanes), *(make_added(spec.lanes, dtype) for dtype in dtypes))


def shared(kernel: Any, spec: Spec) -> Any:
    """Return a kernel of which each row has the lanes of a `Spec`, marked as such."""
    return with_lanes(kernel, spec.lanes)


def with_lanes(kernel: Any, lanes: int) -> Any:
    """Return a kernel of which each row has so many lanes, marked as such."""
    kernel.lanes = lanes
    return kernel


def threads_of(kernel: Any) -> int:
    """Return how many threads of a kernel work on a row: its lanes, or one."""
    return int(getattr(kernel, "lanes", 1))
