"""Wall particles: pressure and mirrored velocity extrapolated from the fluid (theory: riemann#a5, Adami 2012).

    p_w = sum_f (p_f + rho_f g.(x_w - x_f)) W / sum_f W
    v_mirror = v_w + (v_w - <v>) depth / (<distance> - depth),  <.> = sum_f . W / sum_f W

Scenes of several fluids use p_w for output alone: there each fluid particle meets the wall with the one-sided state of its
own fluid, p_i + rho_i g.(x_w - x_i), in the momentum sweep.

The second-order projection takes <v> of the velocity extrapolated to the end of the step, where its viscous term is.

depth is how far the wall particle is behind the surface; where it is not known v_mirror = 2 v_w - <v>.
"""

import functools
from typing import Any

import warp as wp

from .lanes import lanes_of, shared
from .pair import list_access, separation_of
from .params import make_params, make_phase
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types_of
from .time_signals import GRAVITY_NEXT, make_forcing
from .weights import make_weights


@functools.cache
def make_wall(spec: Spec) -> Any:
    """Return the kernel over wall particles; a wall particle without fluid near gets p = 0 and its own velocity."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    gravity_of, _ = make_forcing(spec)
    particle_of, lane_of, part_of, added, added_vec = lanes_of(spec, real, vec)
    extrapolated = spec.second_order
    time_weights = make_weights(spec.second_order)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def wall_state(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        wall_depth: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        mirror_ratio: wp.array(dtype=real),
    ):
        t = wp.tid()
        w, lane = particle_of(t) + first, lane_of(t)
        i = w + fluid_count
        count = int(fluid_neighbours[i])
        p = real(0.0)
        v = vec()
        weight = real(0.0)
        reach = vec()
        omega = real(0.0)
        if wp.static(extrapolated):
            omega = real(time_weights(clock)[3])
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + count * stride
        k, step = part_of(begin, stride, lane)
        xi = position[i]
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], True, params)
            w_ij = shape(wp.sqrt(wp.dot(d, d)) * params.inv_h)
            state_j = state[j]
            term = state_j[0]
            if wp.static(spec.gravity):
                own = int(0)
                if wp.static(spec.multiphase):
                    own = int(phase[j])
                # the density it has, not that at rest: else the first row sinks into the floor
                rho = phases[own].density * rest_volume[j] / state_j[1]
                term += rho * wp.dot(gravity_of(params, forcing, GRAVITY_NEXT), d)
            p += term * w_ij
            weight += w_ij
            if wp.static(spec.wall_no_slip):
                v_j = velocity[j]
                if wp.static(extrapolated):
                    v_j = v_j + (v_j - velocity_old[j]) * omega
                v += v_j * w_ij
                reach += d * w_ij
        if wp.static(spec.lanes > 1):
            p, weight = added(p), added(weight)
            if wp.static(spec.wall_no_slip):
                v, reach = added_vec(v), added_vec(reach)
            if lane > 0:
                return
        own_velocity = velocity[i]
        if weight > real(1.0e-20):
            p = p / weight
            # the mean velocity is that at the mean distance: continued in a straight line through the surface of the wall,
            # where the fluid has the wall's velocity
            ratio = real(1.0)
            if wp.static(spec.wall_no_slip):
                depth = wall_depth[w]
                if depth > real(0.0):
                    ratio = depth / wp.max(wp.length(reach) / weight - depth, real(0.25) * params.spacing)
                if wp.static(spec.viscous_stages > 1):
                    mirror_ratio[w] = ratio
            v = own_velocity + (own_velocity - v / weight) * ratio
        else:
            p = real(0.0)
            v = own_velocity
        if wp.static(spec.free_surface):
            p = wp.max(p, real(0.0))  # a wall does not pull on a fluid that may leave it
        state[i] = pair(p, params.wall_volume)
        if wp.static(spec.wall_no_slip):
            mirror_velocity[w] = v

    return shared(wall_state, spec)
