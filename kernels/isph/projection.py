"""Incompressible SPH by projection: the step (theory: isph#b1 to isph#b6; seed 002; Cummins & Rudman 1999).

Here the particles move and get their velocity without pressure; the pressure equation: `pressure`; shift: `regularise`.

With omega = dt_n/dt_{n-1}, c_0 = (1 + omega)^2/(1 + 2 omega), c_1 = omega^2/(1 + 2 omega), beta = (1 + omega)/(1 + 2 omega):

    x^{n+1} = x^n + dt [(1 + omega/2) u^n - omega/2 u^{n-1}]
    u*      = c_0 u^n - c_1 u^{n-1} + beta dt [nu lap u + g]        operators at x^{n+1}, u extrapolated to n+1
    div((1/rho) grad p) = (div u* - D)/(beta dt)
    u^{n+1} = u* - (beta dt/rho) grad p

BDF2: the pressure belongs to the new positions and has no memory of its own, so that its errors do not swing from step
to step. The printed scheme is omega = 0 (x* = x^n + dt u^n) with x^{n+1} = x^n + dt (u^n + u^{n+1})/2 at the end.

What the pressure equation needs to be accurate on moving particles:
- Gradient and divergence are corrected to be exact for linear fields, L = [sum (x_j - x_i) (x) grad W V]^-1.
- The Laplacian sum w_ij (p_i - p_j), w = -2 V F/rho, is symmetric, but exact for a linear p on even arrangements alone.
  What it makes of the last gradient, grad p^n.sum w_ij (x_i - x_j), goes to the right-hand side: without it the pressure
  of a drop is three times as wrong. An impact is over in the next step, so that the smaller one of the last two gradients
  is taken, and none if they oppose.
- The projection is approximate: what is left of div u, and the divergence of a particle that has just stopped being part
  of the surface, is taken out within the time tau = h/(2 u_max), dD/dt = -D/tau, not at once: an impulse would need a
  pressure ~ 1/dt.
- Nothing else remembers the volume. E = sum V (1 - r^2/R^2)^2/integral - 1 over the support R is unbiased at particles
  (+1e-4 on shifted ones, where sum W V is 6e-3 off, since a particle sees its own peak): div u is drawn to 0.1 E u_max/h.
- p = 0 is at the free surface, outside of the particles that are at it by half of the room of their row: those take
  p = -depth n.grad p^n, see `kernels/isph/surface.py`.
- Along a free surface nothing evens out what particles that join and leave it do to the velocity, and the shift has no
  part across it. There the velocity is drawn to the linear field around, and particles that are too near are pushed
  apart. Without the filter a drop in a central force swells by a third in ten periods.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import RUNAWAY, STEP
from warpsph.kernels.core.fields import FLUID, NOBODY, slipping
from warpsph.kernels.core.friction_slide import make_curved_slide
from warpsph.kernels.core.mirror import NO_WALL, code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access, natural
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NEXT, make_forcing
from warpsph.kernels.core.viscosity import make_friction_slope, make_viscosity
from warpsph.kernels.core.weights import make_weights

# Determinant of the moment below which a neighbourhood is too thin for a corrected gradient, to the power 1/d: at a flat
# surface it is 0.6, at a right-angled edge 0.36.
SMALLEST_MOMENT = 0.45
PAIRING = 0.2  # extra weight (W/W(dx))^4 of near particles in the shift: sum grad W alone is even for pairs (Lind 2012)
FILLED = 0.9  # spread, of the dimension, above which friction is divided by it where there is no free surface
CLOSEST = 0.4  # distance to which a particle may come to a wall, in spacings; a resting row has 0.5


@functools.cache
def make_advect(spec: Spec) -> Any:
    """Return the kernel that moves the fluid to the positions of the step."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    time_weights = make_weights(spec.second_order)
    dimension = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def advect(
        first: int,
        params: Params,
        sides: Sides,
        clock: wp.array(dtype=wp.float64),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        beside: wp.array(dtype=vec),
        wall_gap: wp.array(dtype=real),
        wall_pace: wp.array(dtype=real),
        beside_2: wp.array(dtype=vec),
        wall_gap_2: wp.array(dtype=real),
        wall_pace_2: wp.array(dtype=real),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        row_speed: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                # a buffer moves across its side alone, so that its rows stay whole
                if int(zone[i]) != NOBODY:
                    along = offset[i]
                    along[wp.static(max(spec.open_axis, 0))] += row_speed[i] * real(clock[STEP])
                    offset[i] = along
                    position[i] = anchor[i] + along
                return
        v = velocity[i]
        old = velocity_old[i]
        half = real(wp.float64(0.5) * time_weights(clock)[3])
        way = offset[i] + (v + (v - old) * half) * real(clock[STEP])
        if wp.static(spec.shifting):
            way += shift[i]
            change = carried[i]
            v += change
            old += change
        if wp.static(spec.bodies):
            # as at the sides below, with the walls as the last step has left them
            for plane in range(2):
                n, gap_n, pace = vec() + beside[i], real(0.0) + wall_gap[i], real(0.0) + wall_pace[i]
                if plane == 1:
                    n, gap_n, pace = vec() + beside_2[i], real(0.0) + wall_gap_2[i], real(0.0) + wall_pace_2[i]
                if wp.dot(n, n) > real(0.0):
                    left = gap_n + wp.dot(way - offset[i], n) - pace * real(clock[STEP])
                    need = real(CLOSEST) * params.spacing - left
                    if need > real(0.0):
                        way += need * n
                        # what it had gathered of a turn along the wall it keeps, or it would run into the wall again
                        stop = n * wp.max(pace - wp.dot(v, n), real(0.0))
                        v += stop
                        old += stop
        x = anchor[i] + way
        if wp.static(spec.mirror):
            # Pressure keeps the fluid off a wall, but a particle of the surface has none: it ends at the wall like a drop.
            gap = real(CLOSEST) * params.spacing
            for axis in range(wp.static(dimension)):
                under = sides.lower[axis] + gap - x[axis]
                over = x[axis] + gap - sides.upper[axis]
                if sides.kind[2 * axis] != NO_WALL and under > real(0.0):
                    way[axis] += under
                    v[axis] = wp.max(v[axis], real(0.0))
                    old[axis] = wp.max(old[axis], real(0.0))
                if sides.kind[2 * axis + 1] != NO_WALL and over > real(0.0):
                    way[axis] -= over
                    v[axis] = wp.min(v[axis], real(0.0))
                    old[axis] = wp.min(old[axis], real(0.0))
            x = anchor[i] + way
        if wp.static(spec.shifting or spec.mirror or spec.bodies):
            velocity[i] = v
            velocity_old[i] = old
        offset[i] = way
        position[i] = x

    return advect


@functools.cache
def make_inverted(dimension: int, precision: str) -> Any:
    """Return the `wp.func` inverted(m): the inverse of a moment, 1 where the neighbourhood is too thin for it."""
    real, _, mat, _ = types(dimension, precision)
    smallest = SMALLEST_MOMENT**dimension

    @wp.func
    def inverted(m: mat):
        inverse = wp.identity(n=wp.static(dimension), dtype=real)
        if wp.determinant(m) > real(smallest):
            inverse = wp.inverse(m)
        return inverse

    return inverted


@functools.cache
def make_fourth(precision: str) -> Any:
    """Return the `wp.func` fourth(x) = x^4."""
    real = types(2, precision).real

    @wp.func
    def fourth(x: real):
        return (x * x) * (x * x)

    return fourth


@functools.cache
def make_predict(spec: Spec) -> Any:
    """Return the sweep that finds what a neighbourhood looks like and the velocity u* without pressure.

    It also watches for faults. Writes the correction L, the gradient of the concentration
    sum [1 + 0.2 (W/W(dx))^4] grad W V, the divergence of the positions
    sum (x_j - x_i).grad W V, the outward normal, and u*.
    """
    real, vec, mat, _ = types_of(spec)
    Params, Phase = make_params(spec.dimension, spec.precision), make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, friction_velocity = images.apart, images.friction_velocity
    list_begin, list_step, neighbour, Listed = list_access(spec)
    gravity_of, body_force_of = make_forcing(spec)
    viscous = spec.viscosity != "none"
    viscous_term = make_viscosity(spec.viscosity if viscous else "morris", spec.dimension, spec.precision)
    isotropic = spec.viscosity == "isotropic"
    friction_slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)
    time_weights = make_weights(spec.second_order)
    inverted, fourth = make_inverted(spec.dimension, spec.precision), make_fourth(spec.precision)
    periodic, dimension = any(spec.periodic), float(spec.dimension)
    image_bit, index_mask = code_shift(spec.dimension), (1 << code_shift(spec.dimension)) - 1
    smallest, curved_slide = SMALLEST_MOMENT**spec.dimension, make_curved_slide(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def predict(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        full_spread: real,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_normal: wp.array(dtype=vec),
        slip_slope: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        wetness: wp.array(dtype=real),
        correction: wp.array(dtype=mat),
        crowding: wp.array(dtype=vec),
        spread: wp.array(dtype=real),
        company: wp.array(dtype=real),
        surface_normal: wp.array(dtype=vec),
        velocity_gradient: wp.array(dtype=mat),
        velocity_star: wp.array(dtype=vec),
        pressure: wp.array(dtype=real),
        unknown: wp.array(dtype=real),
        faults: wp.array(dtype=int),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) == NOBODY:
                return
        unknown[i] = pressure[i]  # the surface stage looks at the pressure around while it writes some
        xi = position[i]
        weights = time_weights(clock)
        omega = real(weights[3])
        v_now = velocity[i]
        v_old = velocity_old[i]
        # here, after the list has put the particles in order, their rows stay what they are to the end of the step; NaN
        # fails every comparison
        if not (wp.dot(v_now, v_now) < real(clock[RUNAWAY] * clock[RUNAWAY]) and wp.dot(xi, xi) < real(1.0e30)):
            wp.atomic_min(faults, slot, i)
        vi = v_now + (v_now - v_old) * omega
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        moment = mat()
        beyond = mat()  # what of it and of `even` bodies above the surface have
        above, even, pairing = vec(), vec(), vec()
        among = real(0.0)
        per_spacing = real(1.0) / shape(params.spacing * params.inv_h)
        flow = mat()
        viscous_sum = vec()
        uneven = vec()  # first and second moments of the weights of friction
        width = real(0.0)
        fluid_count = particle_count - slip.shape[0]
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = natural(neighbour(neighbours, i, k))
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            d = apart(xi, position[j], code, wrapped, params, sides)
            r2 = wp.dot(d, d)
            q = wp.sqrt(r2) * params.inv_h
            f = slope(q) * rest_volume[j]
            fd = f * d
            moment -= wp.outer(d, fd)
            even += fd
            if code == 0 or j != i:
                among -= f * r2  # the own images make no crowd
            if wp.static(spec.shifting):
                pairing += fourth(shape(q) * per_spacing) * fd
            if wp.static(viscous):
                vj = velocity[j] + (velocity[j] - velocity_old[j]) * omega
                if wp.static(spec.mirror):
                    if code != 0:
                        vj = friction_velocity(vj, code, sides)
                flow += wp.outer(vj - vi, fd)
                if wp.static(isotropic):
                    f = friction_slope(q) * rest_volume[j]
                    uneven += f * d
                    width -= f * r2
                viscous_sum += f * viscous_term(vi - vj, d, r2 + params.tiny, params.inv_h)
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = natural(neighbour(neighbours, i, k))
                k += step
                d = apart(xi, position[j], 0, wrapped, params, sides)
                r2 = wp.dot(d, d)
                wall_volume = params.wall_volume
                if wp.static(spec.bodies):
                    wall_volume = boundary_volume[j - (particle_count - boundary_volume.shape[0])]
                q = wp.sqrt(r2) * params.inv_h
                f = slope(q) * wall_volume
                fd = f * d
                moment -= wp.outer(d, fd)
                even += fd
                among -= f * r2
                wet = real(1.0)
                if wp.static(spec.bodies and spec.free_surface):
                    # above the surface a body mirrors nothing
                    wet = wetness[j - (particle_count - boundary_volume.shape[0])]
                    above += (real(1.0) - wet) * fd
                    beyond -= wp.outer(d, (real(1.0) - wet) * fd)
                if wp.static(spec.shifting):
                    pairing += fourth(shape(q) * per_spacing) * wet * fd
                if wp.static(isotropic):
                    f = friction_slope(q) * wall_volume
                    uneven += f * d
                    width -= f * r2
                if wp.static(spec.wall_no_slip):
                    if slip[j - fluid_count] == wp.uint8(0):
                        vj = mirror_velocity[j - fluid_count]
                        flow += wp.outer(vj - vi, fd)
                        viscous_sum += f * viscous_term(vi - vj, d, r2 + params.tiny, params.inv_h)
                if wp.static(slipping(spec)):
                    slide = curved_slide(j - (particle_count - boundary_volume.shape[0]), d, slip, wall_normal, slip_slope)
                    viscous_sum += f * viscous_term(slide, d, r2 + params.tiny, params.inv_h)
        g_norm = params.g_norm
        m = moment * g_norm
        known = wp.determinant(m) > real(smallest)
        inverse = inverted(m)
        correction[i] = inverse
        m -= beyond * g_norm
        spread[i] = wp.trace(m)
        company[i] = (among - wp.trace(beyond)) * g_norm
        crowding[i] = (even - above + real(PAIRING) * pairing) * g_norm
        outward = inverted(m) * (even - above)
        length = wp.length(outward)
        unit = outward * (real(-1.0) / wp.max(length, real(1.0e-30)))
        surface_normal[i] = wp.where(length * params.g_norm * params.h > real(1.0e-6), unit, vec())
        a = gravity_of(params, forcing, GRAVITY_NEXT) + body_force_of(params, forcing)
        if wp.static(spec.central_force):
            a -= params.pull * (xi - params.center)
        if wp.static(viscous):
            if wp.static(spec.free_surface):
                velocity_gradient[i] = mat()
            if known:
                # exact for a quadratic field on an even arrangement: take out what an uneven one makes of a linear field,
                # and divide by the second moment (theory: common#lattice, column L)
                shear = (flow * inverse) * g_norm
                if wp.static(spec.free_surface):
                    velocity_gradient[i] = shear
                if wp.static(not isotropic):
                    uneven = even
                    width = wp.trace(moment)
                linear = shear * uneven
                if wp.static(spec.viscosity == "radial" or isotropic):
                    linear = linear + wp.transpose(shear) * uneven + wp.trace(shear) * uneven
                if spread[i] > full_spread:
                    viscous_sum = (viscous_sum - real(2.0) * linear) * (real(dimension) / (width * g_norm))
            a += viscous_sum * (phases[0].viscosity / phases[0].density * g_norm)
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return  # its velocity is given or comes from inside
        velocity_star[i] = v_now * real(weights[0]) - v_old * real(weights[1]) + a * real(weights[2] * clock[STEP])

    return predict


@functools.cache
def make_settle(spec: Spec) -> Any:
    """Return the kernel that ends a step of the printed scheme: x^{n+1} = x^n + dt (u^n + u^{n+1})/2."""
    real, vec, _, _ = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def settle(
        first: int,
        clock: wp.array(dtype=wp.float64),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        way = offset[i] + (velocity[i] - velocity_old[i]) * real(wp.float64(0.5) * clock[STEP])
        offset[i] = way
        position[i] = anchor[i] + way

    return settle
