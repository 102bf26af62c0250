"""Where each particle was when a window of time began: windows that follow each other, kept material (theory: lyapunov#map).

`origin` holds the place X of a particle at the start of each of the `Spec.windows` windows that run at once, one after the
other. What flows keeps its X. A shift dr moves a particle off the fluid that it stood for, so that it takes on X of its
new place, dX = grad X dr. X belongs to the image of the particle that is in the box: where a particle wraps, X moves by the
same period, and X_j - X_i of two neighbours is that of the images that are neighbours.
"""

import functools
from typing import Any

import warp as wp

from .clock import TIME
from .eigenvalue import make_least_eigenvalue
from .mirror import code_shift, make_images, make_sides
from .origins import LEAST_EIGENVALUE, NEXT, SLOT
from .pair import WRAPPED, list_access
from .params import make_params
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, origins_type, types_of

EARLY = 1.0e-9  # of a window's period: a start this much ahead of its time is due, because the sum of the steps is rounded


@functools.cache
def make_turn(spec: Spec) -> Any:
    """Return the one-thread kernel that finds the window that begins anew in this step, in the place of the oldest one.

    window_start: time at which each window began [s]; window_period: time from one start to the next [s].
    """
    windows = max(spec.windows, 1)

    @wp.kernel(module="unique", enable_backward=False)
    def turn_windows(
        window_period: wp.float64,
        clock: wp.array(dtype=wp.float64),
        window_start: wp.array(dtype=wp.float64),
        window_turn: wp.array(dtype=int),
    ):
        window_turn[SLOT] = -1
        number = int(wp.floor(clock[TIME] / window_period + wp.float64(EARLY)))
        if number >= window_turn[NEXT]:
            slot = number % windows
            window_turn[NEXT] = number + 1
            window_turn[SLOT] = slot
            window_start[slot] = clock[TIME]

    return turn_windows


@functools.cache
def make_carry(spec: Spec) -> Any:
    """Return the kernel that gives X what the shift of this step changes, and begins the window that is due.

    It stands before the particles move: the way that a shift takes them is part of X of a window that begins.
    """
    real, vec, _, _ = types_of(spec)
    row = origins_type(spec)
    dimension = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def carry_origins(
        first: int,
        window_turn: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        origin_change: wp.array(dtype=row),
        origin: wp.array(dtype=row),
    ):
        i = wp.tid() + first
        x = origin[i]
        if wp.static(spec.shifting):
            x += origin_change[i]
        slot = window_turn[SLOT]
        if slot >= 0:
            here = position[i]
            if wp.static(spec.shifting):
                here += shift[i]
            for axis in range(wp.static(dimension)):
                x[slot * wp.static(dimension) + axis] = here[axis]
        origin[i] = x

    return carry_origins


@functools.cache
def make_follow(spec: Spec) -> Any:
    """Return the sweep dX_i = sum_j (X_j - X_i) M_i^-1 grad W V_j . dr_i over the fluid, of all windows at once.

    M_i = sum_j (x_j - x_i) (x) grad W V_j is that of the fluid too, so that a linear X is met exactly next to walls. No
    component goes beyond those of the neighbours: beyond a row at a wall the gradient is an extrapolation, which a shift
    that presses against the wall would repeat in every step. Where the fluid is too thin for a gradient X goes with the
    particle, as if nothing had been strained.
    """
    real, vec, mat, _ = types_of(spec)
    row = origins_type(spec)
    slopes = wp.types.matrix(shape=(max(spec.windows, 1) * spec.dimension, spec.dimension), dtype=real)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    apart = make_images(spec).apart
    least_eigenvalue = make_least_eigenvalue(spec.dimension, spec.precision)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    periodic = any(spec.periodic)
    dimension, windows = spec.dimension, spec.windows
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def follow_shift(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        shift: wp.array(dtype=vec),
        origin: wp.array(dtype=row),
        origin_change: wp.array(dtype=row),
    ):
        i = wp.tid() + first
        dx = shift[i]
        if wp.dot(dx, dx) == real(0.0):
            origin_change[i] = row()
            return
        xi = position[i]
        own = origin[i]
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        moment = mat()
        spread = slopes()
        low = row()
        high = row()
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            if wp.static(spec.mirror):
                if (j >> image_bit) != 0:
                    continue  # where an image was is not known
                j = j & index_mask
            d = apart(xi, position[j], 0, wrapped, params, sides)
            fd = (slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * rest_volume[j]) * d
            moment -= wp.outer(d, fd)
            other = origin[j] - own
            if wp.static(periodic):
                if wrapped:
                    image = (xi - d) - position[j]
                    for axis in range(wp.static(dimension)):
                        for window in range(wp.static(windows)):
                            other[window * wp.static(dimension) + axis] += image[axis]
            spread += wp.outer(other, fd)
            low = wp.min(low, other)
            high = wp.max(high, other)
        moment = moment * params.g_norm
        change = row()
        if least_eigenvalue(moment) > real(LEAST_EIGENVALUE):
            change = spread * (wp.inverse(moment) * dx * params.g_norm)
            change = wp.max(low, wp.min(high, change))
        else:
            for window in range(wp.static(windows)):
                for axis in range(wp.static(dimension)):
                    change[window * wp.static(dimension) + axis] = dx[axis]
        origin_change[i] = change

    return follow_shift
