"""Steps of the shared integrators: fields advanced with their rates, and a watch over speeds, ways and faults."""

import functools
from typing import Any

import warp as wp

from .clock import MAXIMA, RUNAWAY, STEP
from .spec import Spec, types, types_of


@functools.cache
def make_keep(dtype: Any) -> Any:
    """Return the kernel start = value, total = 0, which begins a Runge-Kutta step of a field."""
    zero = getattr(dtype, "_wp_scalar_type_", dtype)(0.0)

    @wp.kernel(module="unique", enable_backward=False)
    def keep_start(
        first: int,
        value: wp.array(dtype=dtype),
        start: wp.array(dtype=dtype),
        total: wp.array(dtype=dtype),
    ):
        i = wp.tid() + first
        start[i] = value[i]
        total[i] = dtype(zero)

    return keep_start


@functools.cache
def make_substep(dtype: Any, precision: str) -> Any:
    """Return the kernel total += weight rate, value = start + share dt rate."""
    real = types(2, precision).real

    @wp.kernel(module="unique", enable_backward=False)
    def substep(
        first: int,
        share: wp.float64,
        weight: wp.float64,
        clock: wp.array(dtype=wp.float64),
        rate: wp.array(dtype=dtype),
        start: wp.array(dtype=dtype),
        total: wp.array(dtype=dtype),
        value: wp.array(dtype=dtype),
    ):
        i = wp.tid() + first
        total[i] = total[i] + rate[i] * real(weight)
        value[i] = start[i] + rate[i] * real(share * clock[STEP])

    return substep


@functools.cache
def make_close(dtype: Any, precision: str) -> Any:
    """Return the kernel value = start + dt (total + weight rate), which ends a Runge-Kutta step of a field."""
    real = types(2, precision).real

    @wp.kernel(module="unique", enable_backward=False)
    def close_step(
        first: int,
        weight: wp.float64,
        clock: wp.array(dtype=wp.float64),
        rate: wp.array(dtype=dtype),
        start: wp.array(dtype=dtype),
        total: wp.array(dtype=dtype),
        value: wp.array(dtype=dtype),
    ):
        i = wp.tid() + first
        value[i] = start[i] + (total[i] + rate[i] * real(weight)) * real(clock[STEP])

    return close_step


@functools.cache
def make_add(dtype: Any, precision: str) -> Any:
    """Return the kernel value += share dt rate: a kick or a drift."""
    real = types(2, precision).real

    @wp.kernel(module="unique", enable_backward=False)
    def add_rate(
        first: int,
        share: wp.float64,
        clock: wp.array(dtype=wp.float64),
        rate: wp.array(dtype=dtype),
        value: wp.array(dtype=dtype),
    ):
        i = wp.tid() + first
        value[i] = value[i] + rate[i] * real(share * clock[STEP])

    return add_rate


@functools.cache
def make_place(spec: Spec) -> Any:
    """Return the kernel position = anchor + offset."""
    vec = types_of(spec).vec

    @wp.kernel(module="unique", enable_backward=False)
    def place(
        first: int, anchor: wp.array(dtype=vec), offset: wp.array(dtype=vec), position: wp.array(dtype=vec)
    ):
        i = wp.tid() + first
        position[i] = anchor[i] + offset[i]

    return place


@functools.cache
def make_watch(spec: Spec) -> Any:
    """Return the kernel that reports the largest speed and way to the clock, and what ran away or is not finite.

    The list follows the way, the step the speed: a program of a scheme with rates ends with it and `advance`.
    """
    real, vec, _, _ = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def watch(
        first: int,
        slot: int,
        clock: wp.array(dtype=wp.float64),
        velocity: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        alive: wp.array(dtype=wp.uint8),
        maxima: wp.array(dtype=real),
        faults: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        if wp.static(spec.changing):
            if alive[i] == wp.uint8(0):
                return
        v2 = wp.dot(velocity[i], velocity[i])
        o2 = wp.dot(offset[i], offset[i])
        if v2 > maxima[slot * MAXIMA]:
            wp.atomic_max(maxima, slot * MAXIMA, v2)
        if o2 > maxima[slot * MAXIMA + 2]:
            wp.atomic_max(maxima, slot * MAXIMA + 2, o2)
        limit = real(clock[RUNAWAY])
        # NaN fails every comparison
        if not (v2 < limit * limit and wp.dot(position[i], position[i]) < real(1.0e30)):
            wp.atomic_min(faults, slot, i)

    return watch
