"""Finite-time Lyapunov exponents on the particles, from where they were (theory: lyapunov#backward, lyapunov#forward).

    ln(sigma)/age, sigma the largest singular value of grad X (backward) or of the gradient of x with respect to X (forward)
"""

import functools
from typing import Any

import warp as wp

from .cells import make_grid
from .clock import TIME
from .eigenvalue import make_least_eigenvalue
from .flow_map import THIN
from .mirror import code_shift, make_images, make_sides
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
        if least_eigenvalue(moment) > real(THIN):
            rate = stretching_rate(spread * params.g_norm * wp.inverse(moment), age)
        ftle_backward[i] = rate
        ftle_age[i] = age
        ftle_way[i] = xi - own

    return backward_exponent


@functools.cache
def make_seeds(spec: Spec) -> Any:
    """Return the kernel that writes where particles were when the oldest window began, and are now, in one image of the box.

    seed_point is that start within the box, as three single-precision numbers for the search, seed the same in the numbers
    of the run, and seed_now the present place in the same image. What was born since has none: `seed_weight` 0, else the
    volume.
    """
    real, vec, _, _ = types_of(spec)
    row = origins_type(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    oldest = make_oldest(spec.windows)
    dimension = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def write_seeds(
        first: int,
        grid: Grid,
        clock: wp.array(dtype=wp.float64),
        window_start: wp.array(dtype=wp.float64),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        origin: wp.array(dtype=row),
        born: wp.array(dtype=real),
        seed_point: wp.array(dtype=wp.vec3),
        seed: wp.array(dtype=vec),
        seed_now: wp.array(dtype=vec),
        seed_weight: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        window = oldest(window_start)
        now = position[i]
        start = vec()
        point = wp.vec3()
        for axis in range(wp.static(dimension)):
            x = origin[i][window * wp.static(dimension) + axis]
            period = grid.box[axis]
            if period > real(0.0):
                away = period * wp.floor((x - grid.origin[axis]) / period)
                x -= away
                now[axis] -= away
            start[axis] = x
            point[axis] = wp.float32(x)
        weight = rest_volume[i]
        if wp.static(spec.changing):
            if born[i] > real(window_start[window]):
                weight = real(0.0)
        seed_point[i] = point
        seed[i] = start
        seed_now[i] = now
        seed_weight[i] = weight

    return write_seeds


@functools.cache
def make_forward(spec: Spec) -> Any:
    """Return the kernel of the forward exponent of the oldest window, with the neighbours that a particle had at its start.

    F_i = sum_j (x_j - x_i) (x) M_i^-1 grad W(X_ij) V_j; 0 where that neighbourhood is too thin, and for the newborn.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Grid = make_grid(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    least_eigenvalue = make_least_eigenvalue(spec.dimension, spec.precision)
    stretching_rate = make_rate(spec.dimension, spec.precision)
    dimension = spec.dimension
    nx, ny, nz = (int(wraps) for wraps in ([*spec.periodic, False, False])[:3])

    @wp.kernel(module="unique", enable_backward=False)
    def forward_exponent(
        first: int,
        search: wp.uint64,
        reach: wp.float32,
        params: Params,
        grid: Grid,
        seed_point: wp.array(dtype=wp.vec3),
        seed: wp.array(dtype=vec),
        seed_now: wp.array(dtype=vec),
        seed_weight: wp.array(dtype=real),
        ftle_age: wp.array(dtype=real),
        ftle_forward: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        moment = mat()
        spread = mat()
        for image in range(wp.static((2 * nx + 1) * (2 * ny + 1) * (2 * nz + 1))):
            # the particle in each image of the box from which it can be a neighbour of what is in the box
            code = wp.vec3i(
                image % wp.static(2 * nx + 1) - nx,
                (image / wp.static(2 * nx + 1)) % wp.static(2 * ny + 1) - ny,
                image / wp.static((2 * nx + 1) * (2 * ny + 1)) - nz,
            )
            lift = vec()
            place = seed_point[i]
            inside = bool(True)
            for axis in range(wp.static(dimension)):
                lift[axis] = real(code[axis]) * grid.box[axis]
                place[axis] += wp.float32(lift[axis])
                if code[axis] != 0:
                    above = place[axis] - wp.float32(grid.origin[axis])
                    if above < -reach or above > wp.float32(grid.box[axis]) + reach:
                        inside = False
            if inside:
                for j in wp.hash_grid_query(search, place, reach):
                    weight = seed_weight[j]
                    if weight > real(0.0):
                        d = seed[i] + lift - seed[j]
                        fd = (slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * weight) * d
                        moment -= wp.outer(d, fd)
                        spread += wp.outer(seed_now[j] - seed_now[i] - lift, fd)
        moment = moment * params.g_norm
        rate = real(0.0)
        if seed_weight[i] > real(0.0) and least_eigenvalue(moment) > real(THIN):
            rate = stretching_rate(spread * params.g_norm * wp.inverse(moment), ftle_age[i])
        ftle_forward[i] = rate

    return forward_exponent
