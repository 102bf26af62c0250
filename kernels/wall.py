"""Wall particles: pressure and mirrored velocity extrapolated from the fluid (methods A5, Adami 2012).

    p_w = sum_f (p_f + rho_f g.(x_w - x_f)) W / sum_f W ;   v_mirror = 2 v_w - sum_f v_f W / sum_f W
"""

import functools
from typing import Any

import warp as wp

from .pair import make_entry, separation_of
from .params import make_params, make_phase
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types_of


@functools.cache
def make_wall(spec: Spec) -> Any:
    """Return the kernel over wall particles; a wall particle without fluid near gets p = 0 and its own velocity."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step = make_entry(spec.row_list)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def wall_state(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        neighbours: wp.array(dtype=int),
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        mirror_velocity: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        i = w + fluid_count
        count = int(fluid_neighbours[i])
        p = real(0.0)
        v = vec()
        weight = real(0.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + count * step
        xi = position[i]
        while k < end:
            j = neighbours[k]
            k += step
            d = separation(xi, position[j], True, params)
            w_ij = shape(wp.sqrt(wp.dot(d, d)) * params.inv_h)
            term = state[j][0]
            if wp.static(spec.gravity):
                own = int(0)
                if wp.static(spec.multiphase):
                    own = int(phase[j])
                term += phases[own].density * wp.dot(params.gravity, d)
            p += term * w_ij
            weight += w_ij
            if wp.static(spec.wall_no_slip):
                v += velocity[j] * w_ij
        own_velocity = velocity[i]
        if weight > real(1.0e-6):
            p = p / weight
            v = own_velocity * real(2.0) - v / weight
        else:
            p = real(0.0)
            v = own_velocity
        if wp.static(spec.free_surface):
            p = wp.max(p, real(0.0))  # a wall does not pull on a fluid that may leave it
        state[i] = pair(p, params.wall_volume)
        if wp.static(spec.wall_no_slip):
            mirror_velocity[w] = v

    return wall_state
