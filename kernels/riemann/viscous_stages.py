"""Viscosity in stages: steps far beyond the limit of explicit friction without a linear system (theory: riemann#stages).

The momentum sweep has found the acceleration a, friction included. With A the friction of a particle against its neighbours,
without what corrects it for disorder, this stage is one of the Runge-Kutta-Chebyshev stages that solve

    dy/dt = a - tau A y,   y(0) = 0,   0 <= t <= 1,   tau the longest step that there may be

y(1) = phi(tau A) a takes the place of a, with phi(z) about 1 for small z and 1/z for large z, much like backward Euler.
What is at rest stays so, whatever tau, and flow that is steady is that of explicit friction. A is symmetric, its pairs
conserve momentum (and the radial form angular momentum), and so does y.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import COURANT, MAXIMA, SOUND, STEP_CAP
from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import NEAR, WRAPPED, list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.viscosity import make_friction_slope, make_series_mean, make_viscosity


@functools.cache
def make_viscous_stage(spec: Spec, closing: bool) -> Any:
    """Return the kernel of one stage: the next y from the last two; the closing one writes it to `acceleration`.

    Neighbours are read of `rate_now` alone, so that `rate_next` may be the array of `rate_before`, but not of `rate_now`.
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    viscous_term = make_viscosity(spec.viscosity, spec.dimension, spec.precision)
    slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)
    series_mean = make_series_mean(spec.precision)
    particle_of, lane_of, part_of, added = lanes_of(spec, vec)
    periodic = any(spec.periodic)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def viscous_stage(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        scale_now: wp.float64,
        weight_now: wp.float64,
        weight_before: wp.float64,
        weight_step: wp.float64,
        params: Params,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        slip: wp.array(dtype=wp.uint8),
        mirror_ratio: wp.array(dtype=real),
        interface_depth: wp.array(dtype=real),
        rate_now: wp.array(dtype=vec),
        rate_before: wp.array(dtype=vec),
        rate_next: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        xi = position[i]
        y = rate_now[i]
        own = phases[0]
        own_phase = int(0)
        wrapped = bool(False)
        near = bool(False)
        if wp.static(spec.multiphase):
            own_phase = int(phase[i])
            own = phases[own_phase]
            near = (int(flags[i]) & NEAR) != 0
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        friction = vec()
        half_row = real(0.5) * params.spacing * params.inv_h  # least depth that friction counts
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        if wp.static(spec.multiphase):
            if near:
                while k < end:
                    j = neighbour(neighbours, i, k)
                    k += step
                    d = separation(xi, position[j], wrapped, params)
                    r2 = wp.dot(d, d)
                    f = slope(wp.sqrt(r2) * params.inv_h) * state[j][1]
                    mu = own.viscosity
                    if int(phase[j]) != own_phase:
                        other = phases[int(phase[j])].viscosity
                        if wp.static(spec.unlike_viscosity):
                            mu = series_mean(own.viscosity, other, interface_depth[i], interface_depth[j], half_row)
                        else:
                            mu = series_mean(own.viscosity, other, real(1.0), real(1.0), real(0.0))
                    friction += (mu * f) * viscous_term(y - rate_now[j], d, r2 + params.tiny, params.inv_h)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], wrapped, params)
            r2 = wp.dot(d, d)
            f = slope(wp.sqrt(r2) * params.inv_h) * state[j][1]
            friction += (own.viscosity * f) * viscous_term(y - rate_now[j], d, r2 + params.tiny, params.inv_h)
        if wp.static(spec.lanes > 1):
            friction = added(friction)
            if lane > 0:
                return
        k, step = end, stride
        if wp.static(spec.wall_no_slip):
            end += int(wall_neighbours[i]) * step
            wall_first = particle_count - slip.shape[0]
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                if slip[j - wall_first] == wp.uint8(0):
                    d = separation(xi, position[j], wrapped, params)
                    r2 = wp.dot(d, d)
                    f = slope(wp.sqrt(r2) * params.inv_h) * params.wall_volume
                    # what the wall mirrors, of this particle instead of the mean around the wall particle
                    mirrored = y * (real(1.0) + mirror_ratio[j - wall_first])
                    friction += (own.viscosity * f) * viscous_term(mirrored, d, r2 + params.tiny, params.inv_h)
        rho = own.density * rest_volume[i] / state[i][1]
        tau = real(wp.min(clock[STEP_CAP], clock[COURANT] / clock[SOUND]))
        slope_of_y = acceleration[i] + friction * (real(scale_now) * tau * params.g_norm / rho)
        result = real(weight_now * scale_now) * y + real(weight_before) * rate_before[i] + real(weight_step) * slope_of_y
        if wp.static(closing):
            acceleration[i] = result
            a2 = wp.dot(result, result)
            if a2 > maxima[slot * MAXIMA + 1]:
                wp.atomic_max(maxima, slot * MAXIMA + 1, a2)
        else:
            rate_next[i] = result

    return shared(viscous_stage, spec)
