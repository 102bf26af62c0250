"""Backward finite-time Lyapunov exponents on the particles, from where they were (theory: lyapunov#backward).

    ln(sigma)/age, sigma the largest singular value of grad X
"""

import functools
from typing import Any

import warp as wp

from .clock import TIME
from .eigenvalue import make_least_eigenvalue
from .mirror import code_shift, make_images, make_sides
from .origins import LEAST_EIGENVALUE
from .pair import WRAPPED, list_access
from .params import make_params
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, origins_type, types, types_of


@functools.cache
def make_oldest(windows: int) -> Any:
    """Return the `wp.func` oldest(window_start): the window that began first."""

    @wp.func
    def oldest(window_start: wp.array(dtype=wp.float64)):
        found = int(0)
        for window in range(1, windows):
            if window_start[window] < window_start[found]:
                found = window
        return found

    return oldest


@functools.cache
def make_rate(dimension: int, precision: str) -> Any:
    """Return the `wp.func` stretching_rate(g, age) = ln(largest singular value of g)/age [1/s]; 0 at age 0."""
    real, _, mat, _ = types(dimension, precision)
    least_eigenvalue = make_least_eigenvalue(dimension, precision)

    @wp.func
    def stretching_rate(g: mat, age: real):
        largest = -least_eigenvalue(-(wp.transpose(g) * g))
        result = real(0.0)
        if age > real(0.0) and largest > real(0.0):
            result = real(0.5) * wp.log(largest) / age
        return result

    return stretching_rate


@functools.cache
def make_backward(spec: Spec) -> Any:
    """Return the sweep of the backward exponent of the oldest window, and of the way and age of each particle in it.

    Where the fluid is too thin for a gradient the exponent is 0.
    """
    real, vec, mat, _ = types_of(spec)
    row = origins_type(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    apart = make_images(spec).apart
    least_eigenvalue = make_least_eigenvalue(spec.dimension, spec.precision)
    stretching_rate = make_rate(spec.dimension, spec.precision)
    oldest = make_oldest(spec.windows)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    periodic = any(spec.periodic)
    dimension = spec.dimension
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.func
    def origin_of(rows: row, window: int):
        place = vec()
        for axis in range(wp.static(dimension)):
            place[axis] = rows[window * wp.static(dimension) + axis]
        return place

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def backward_exponent(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        clock: wp.array(dtype=wp.float64),
        window_start: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        origin: wp.array(dtype=row),
        born: wp.array(dtype=real),
        ftle_backward: wp.array(dtype=real),
        ftle_age: wp.array(dtype=real),
        ftle_way: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        window = oldest(window_start)
        xi = position[i]
        own = origin_of(origin[i], window)
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        moment = mat()
        spread = mat()
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
            other = origin_of(origin[j], window) - own
            if wp.static(periodic):
                if wrapped:
                    other += (xi - d) - position[j]
            spread += wp.outer(other, fd)
        moment = moment * params.g_norm
        age = real(clock[TIME] - window_start[window])
        if wp.static(spec.changing):
            age = wp.min(age, real(clock[TIME]) - born[i])
        rate = real(0.0)
        if least_eigenvalue(moment) > real(LEAST_EIGENVALUE):
            rate = stretching_rate(spread * params.g_norm * wp.inverse(moment), age)
        ftle_backward[i] = rate
        ftle_age[i] = age
        ftle_way[i] = xi - own

    return backward_exponent
