"""Particles that leave the domain and particles that enter it: a flag here, the list build drops and sorts them."""

import functools
from typing import Any

import warp as wp

from .clock import CARE, FAULT, FAULT_CAPACITY, LIVE, NEXT_ID, REBUILD, ROOM, RUNNING, TIME, WANTED
from .mirror import make_sides
from .spec import Spec, types_of


@functools.cache
def make_exit(spec: Spec) -> Any:
    """Return the kernel that ends the life of fluid particles beyond an open side of the domain.

    Until the next list build they stay in their rows, `alive` = 0.
    """
    vec = types_of(spec).vec
    Sides = make_sides(spec.dimension, spec.precision)
    dimension = spec.dimension
    px, py, pz = (bool(wraps) for wraps in ([*spec.periodic, False, False])[:3])

    @wp.kernel(module="unique", enable_backward=False)
    def leave(
        first: int,
        sides: Sides,
        position: wp.array(dtype=vec),
        alive: wp.array(dtype=wp.uint8),
    ):
        i = wp.tid() + first
        x = position[i]
        for axis in range(wp.static(dimension)):
            wraps = (axis == 0 and px) or (axis == 1 and py) or (axis == 2 and pz)
            if not wraps:
                if x[axis] < sides.lower[axis] or x[axis] > sides.upper[axis]:
                    alive[i] = wp.uint8(0)

    return leave


@functools.cache
def make_due() -> tuple[Any, Any]:
    """Return the one-thread kernels around a birth of layers: (how many are due, and is there room; count them in).

    A layer of `layer_size` particles is born at each multiple of `layer_period` [s], the first after time 0. How many have
    been is told from the id of the next particle, so that a restart knows it. `layers_due` holds the number that is due.
    """

    @wp.kernel(module="unique", enable_backward=False)
    def layers_that_are_due(
        layer_size: int,
        layer_period: wp.float64,
        first_id: int,
        fluid_count: int,
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=int),
        layers_due: wp.array(dtype=int),
    ):
        born = (counters[NEXT_ID] - first_id) / layer_size
        due = int(wp.floor(clock[TIME] / layer_period)) - born
        layers_due[0] = wp.max(due, 0)
        wanted = counters[LIVE] + layers_due[0] * layer_size
        if wanted > fluid_count:
            layers_due[0] = 0
            counters[WANTED] = wanted
            counters[FAULT] = FAULT_CAPACITY
            counters[RUNNING] = 0
            counters[ROOM] = 0

    @wp.kernel(module="unique", enable_backward=False)
    def count_births(
        layer_size: int,
        counters: wp.array(dtype=int),
        layers_due: wp.array(dtype=int),
    ):
        if layers_due[0] > 0:
            counters[LIVE] = counters[LIVE] + layers_due[0] * layer_size
            counters[NEXT_ID] = counters[NEXT_ID] + layers_due[0] * layer_size
            # the new particles take part from the next list on, which is made at once
            counters[REBUILD] = 1
            counters[CARE] = 1

    return layers_that_are_due, count_births
