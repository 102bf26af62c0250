"""Forward finite-time Lyapunov exponents: the neighbours that particles had when a window began (theory: lyapunov#forward).

    ln(sigma)/age, sigma the largest singular value of the gradient of x with respect to X

Run from the host when an output is due: the search among the places X is made for it.
"""

import functools
from typing import Any

import warp as wp

from .cells import make_grid
from .eigenvalue import make_least_eigenvalue
from .lyapunov import make_oldest, make_rate
from .origins import LEAST_EIGENVALUE
from .params import make_params
from .smoothing import make_smoothing
from .spec import Spec, origins_type, types_of


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
        if seed_weight[i] > real(0.0) and least_eigenvalue(moment) > real(LEAST_EIGENVALUE):
            rate = stretching_rate(spread * params.g_norm * wp.inverse(moment), ftle_age[i])
        ftle_forward[i] = rate

    return forward_exponent
