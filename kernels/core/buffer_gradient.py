"""The pressure gradient of the buffers beyond inlets and outlets, for terms with those of both of a pair (theory: delta#d8).

    G_i = M_i^-1 sum_j (p_j - p_i) grad_i W V_j,   M_i = sum_j (x_j - x_i) (x) grad_i W V_j

as in the momentum sweep, which leaves buffers out. It is exact for a linear pressure at the outer end of what fluid sees
too, and a particle that comes in has it in its first step.
"""

import functools
from typing import Any

import warp as wp

from .eigenvalue import make_least_eigenvalue
from .fields import BUFFER
from .pair import WRAPPED, list_access, separation_of
from .params import make_params
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types_of

LEAST_EIGENVALUE = 0.2  # least eigenvalue below which a moment is not inverted


@functools.cache
def make_buffer_gradient(spec: Spec) -> Any:
    """Return the kernel over the fluid that writes the pressure gradient of buffer particles [Pa/m]."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    least_eigenvalue = make_least_eigenvalue(spec.dimension, spec.precision)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def buffer_gradient(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        zone: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        pressure_gradient: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        if int(zone[i]) < BUFFER:
            return
        xi = position[i]
        p_i = state[i][0]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        slope_p = vec()  # sum of (p_j - p_i) F V x_ij
        moment = mat()  # -sum F V x_ij (x) x_ij
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        listed = int(fluid_neighbours[i])
        if wp.static(spec.walls):
            listed += int(wall_neighbours[i])
        end = k + listed * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], wrapped, params)
            fd = (slope(wp.length(d) * params.inv_h) * state[j][1]) * d
            slope_p += (state[j][0] - p_i) * fd
            moment -= wp.outer(d, fd)
        gradient = slope_p * params.g_norm
        moment = moment * params.g_norm
        if least_eigenvalue(moment) > real(LEAST_EIGENVALUE):
            gradient = wp.inverse(moment) * gradient
        pressure_gradient[i] = gradient

    return buffer_gradient
