"""Momentum sweep of the delta-plus scheme; it also finds the shift and the pressure gradient (theory: delta#d1 to delta#d4).

    a_i = -(1/rho_i) sum_j (p_j +- p_i) grad_i W V_j + viscosity + f

with minus where p_i < 0 and no free surface is near (`tension_control`), else plus. The shift of the coming step is

    dr_i = -A U dt h sum_j [1 + 0.2 (W_ij/W(dx))^4] grad_i W V_j,   |dr_i| <= min(U dt/2, dx/10)

and the pressure gradient G_i = M_i^-1 sum_j (p_j - p_i) grad_i W V_j, M_i = sum_j (x_j - x_i) (x) grad_i W V_j. The least
eigenvalue of M_i tells how much of the neighbourhood is there: 1 inside, 1/2 at a flat surface.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import MAXIMA, SPEED, STEP
from warpsph.kernels.core.eigenvalue import make_least_eigenvalue
from warpsph.kernels.core.pair import WRAPPED, list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NEXT, make_forcing
from warpsph.kernels.core.viscosity import make_viscosity

from .delta_contact import make_contact_of

CROWDING = 0.2  # R of the shift, which keeps particles from pairing; its exponent is 4 (theory: delta#d3)
THIN = 0.2  # least eigenvalue below which a moment is not inverted
ALONE, WHOLE = 0.4, 0.75  # least eigenvalues up to which a particle is not shifted, and only along the surface


@functools.cache
def make_delta_momentum(spec: Spec, measuring: bool = True) -> Any:
    """Return the sweep that writes acceleration, and with `measuring` pressure gradient, wholeness and shift too."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    gravity_of, body_force_of = make_forcing(spec)
    viscous = spec.viscosity != "none"
    viscous_term = make_viscosity(spec.viscosity if viscous else "radial", spec.dimension, spec.precision)
    artificial_term = make_viscosity("radial", spec.dimension, spec.precision)
    least_eigenvalue = make_least_eigenvalue(spec.dimension, spec.precision)
    limit_shift = make_limit_shift(spec)
    touch_of, braked = make_contact_of(spec)
    periodic = any(spec.periodic)
    reach = KERNELS[spec.kernel].support
    diffuses = spec.density_diffusion and measuring
    shifts = spec.shifting and measuring
    surface = spec.free_surface and measuring
    measured = diffuses or surface  # the moment is needed

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def delta_momentum(
        first: int,
        slot: int,
        particle_count: int,
        fluid_count: int,
        list_width: int,
        artificial_viscosity: real,
        shift_speed: real,
        shift_peak: real,
        params: Params,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wholeness_old: wp.array(dtype=real),
        wholeness: wp.array(dtype=real),
        pressure_gradient: wp.array(dtype=vec),
        pressure_sign: wp.array(dtype=wp.int8),
        acceleration: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        xi = position[i]
        vi = velocity[i]
        p_i = state[i][0]
        own = phases[0]
        rho_i = own.density * rest_volume[i] / state[i][1]
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        whole_i = real(1.0)
        if wp.static(spec.free_surface):
            whole_i = wholeness_old[i]
        least = whole_i  # wholeness of the neighbourhood
        outward = vec()  # sum F V x_ij (lambda_j - lambda_i)
        pressures = vec()  # sum p_j F V x_ij
        even = vec()  # sum F V x_ij, zero on an even arrangement
        slope_p = vec()  # sum of (p_j - p_i) F V x_ij
        friction = vec()
        push = vec()  # sum of [1 + R (W/W(dx))^4] F V x_ij
        moment = mat()
        into_wall = vec()  # sum F V x_ij over walls
        nearest2 = params.spacing * params.spacing  # square of the distance to the nearest foot on a body
        gap = params.spacing  # distance from the surface there
        approach = real(0.0)
        normal = vec()
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], wrapped, params)
            r2 = wp.dot(d, d)
            q = wp.sqrt(r2) * params.inv_h
            state_j = state[j]
            f = slope(q) * state_j[1]
            fd = f * d
            pressures += state_j[0] * fd
            even += fd
            if wp.static(measured):
                moment -= wp.outer(d, fd)
            if wp.static(diffuses):
                slope_p += (state_j[0] - p_i) * fd
            if wp.static(viscous):
                friction += (own.viscosity * f) * viscous_term(vi - velocity[j], d, r2 + params.tiny, params.inv_h)
            if wp.static(spec.artificial_viscosity):
                friction += (artificial_viscosity * f) * artificial_term(
                    vi - velocity[j], d, r2 + params.tiny, params.inv_h
                )
            if wp.static(shifts):
                near = shape(q) * shift_peak
                push += (real(1.0) + real(CROWDING) * near * near * near * near) * fd
            if wp.static(spec.free_surface):
                if q < real(reach):
                    least = wp.min(least, wholeness_old[j])
                outward += (wholeness_old[j] - whole_i) * fd
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, position[j], wrapped, params)
                r2 = wp.dot(d, d)
                q = wp.sqrt(r2) * params.inv_h
                state_j = state[j]
                f = slope(q) * state_j[1]
                fd = f * d
                pressures += state_j[0] * fd
                even += fd
                if wp.static(spec.bodies):
                    into_wall += fd
                    n_w = wall_normal[j - fluid_count]
                    depth = wall_depth[j - fluid_count]
                    clear = wp.dot(d, n_w) - depth
                    foot2 = r2 - depth * (real(2.0) * clear + depth)
                    if foot2 < nearest2:
                        nearest2 = foot2
                        gap = clear
                        normal = n_w
                        approach = wp.dot(velocity[j] - vi, n_w)
                if wp.static(measured):
                    moment -= wp.outer(d, fd)
                if wp.static(diffuses):
                    slope_p += (state_j[0] - p_i) * fd
                if wp.static(shifts):
                    near = shape(q) * shift_peak
                    push += (real(1.0) + real(CROWDING) * near * near * near * near) * fd
                if wp.static(viscous and (spec.bodies or spec.wall_no_slip)):
                    rubs = bool(True)
                    if wp.static(not spec.bodies):
                        rubs = slip[j - fluid_count] == wp.uint8(0)
                    if rubs:
                        mirror = mirror_velocity[j - fluid_count]
                        friction += (own.viscosity * f) * viscous_term(vi - mirror, d, r2 + params.tiny, params.inv_h)
        g_norm = params.g_norm
        sign = real(1.0)
        if wp.static(spec.tension_control):
            if p_i < real(0.0) and least >= real(WHOLE):
                sign = real(-1.0)
            pressure_sign[i] = wp.int8(sign)
        a = (friction - pressures - (sign * p_i) * even) * (g_norm / rho_i)
        if wp.static(spec.gravity):
            a += gravity_of(params, forcing, GRAVITY_NEXT)
        if wp.static(spec.body_force):
            a += body_force_of(params, forcing)
        if wp.static(spec.central_force):
            a -= params.pull * (xi - params.center)
        touch = real(0.0)
        if wp.static(spec.bodies):
            touch = touch_of(gap, params.spacing)
            if touch > real(0.0):
                stiff = real(2.0) * own.sound_speed * wp.length(into_wall) * g_norm
                a = braked(a, approach, normal, touch, stiff, real(clock[STEP]))
        acceleration[i] = a
        a2 = wp.dot(a, a)
        if a2 > maxima[slot * MAXIMA + 1]:
            wp.atomic_max(maxima, slot * MAXIMA + 1, a2)
        whole = real(1.0)
        if wp.static(measured):
            moment = moment * g_norm
            whole = least_eigenvalue(moment)
        if wp.static(surface):
            wholeness[i] = whole
        if wp.static(diffuses):
            gradient = slope_p * g_norm
            if whole > real(THIN):
                gradient = wp.inverse(moment) * gradient
            pressure_gradient[i] = gradient
        if wp.static(shifts):
            speed = wp.min(real(clock[SPEED]), shift_speed) * real(clock[STEP])
            dx = push * (-params.shifting * speed * params.h * g_norm)
            dx = limit_shift(dx, wp.min(real(0.5) * speed, params.shift_cap * params.h), whole, outward)
            if wp.static(spec.bodies):
                dx -= (touch * wp.min(wp.dot(dx, normal), real(0.0))) * normal
            shift[i] = dx
            s2 = wp.dot(dx, dx)
            if s2 > maxima[slot * MAXIMA + 3]:
                wp.atomic_max(maxima, slot * MAXIMA + 3, s2)

    return delta_momentum


@functools.cache
def make_limit_shift(spec: Spec) -> Any:
    """Return the `wp.func` limit_shift(dx, cap, whole, outward): a shift not longer than `cap` that leaves a surface alone.

    whole: least eigenvalue of the moment; outward: any vector along its gradient. Between ALONE and WHOLE the shift goes
    along the surface, below there is none.
    """
    real, vec, _, _ = types_of(spec)

    @wp.func
    def limit_shift(dx: vec, cap: real, whole: real, outward: vec):
        result = dx
        if wp.static(spec.free_surface):
            if whole < real(WHOLE):
                size2 = wp.dot(outward, outward)
                if whole < real(ALONE) or size2 == real(0.0):
                    result = vec()
                else:
                    result = dx - outward * (wp.dot(dx, outward) / size2)
        length = wp.length(result)
        if length > cap:
            result = result * (cap / length)
        return result

    return limit_shift
