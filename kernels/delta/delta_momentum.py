"""Momentum sweep of the delta-plus scheme; it also finds the shift and the pressure gradient (theory: delta#d1 to delta#d4).

    a_i = -(1/rho_i) sum_j (p_j +- p_i) grad_i W V_j + viscosity + f

with minus where p_i < 0 and no free surface is near (`tension_control`; "gaps": and where a
neighbour is missing, see `make_has_gap`), else plus. The shift of the coming step is

    dr_i = -A U dt h sum_j [1 + 0.2 (W_ij/W(dx))^4] grad_i W V_j,   |dr_i| <= min(U dt/2, dx/10)

and the pressure gradient G_i = M_i^-1 sum_j (p_j - p_i) grad_i W V_j, M_i = sum_j (x_j - x_i) (x) grad_i W V_j. The least
eigenvalue of M_i tells how much of the neighbourhood is there: 1 inside, 1/2 at a flat surface.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.buffer_gradient import LEAST_EIGENVALUE
from warpsph.kernels.core.clock import MAXIMA, SPEED, STEP
from warpsph.kernels.core.dry_walls import make_seen
from warpsph.kernels.core.eigenvalue import WHOLE, make_least_eigenvalue
from warpsph.kernels.core.fields import FLUID
from warpsph.kernels.core.friction_slide import make_friction_slide
from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import WRAPPED, list_access, make_at, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.planes import make_planes
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NEXT, make_forcing
from warpsph.kernels.core.viscosity import make_friction_slope, make_viscosity

from .delta_contact import make_contact_of
from .fluid_pairs import make_crowding, make_force_sums, needs_moment

BESIDE = 1.0  # distance to a body, in spacings, up to which a particle is of the first row, whose neighbours are walls
ALONE = 0.4  # least eigenvalue up to which a particle is not shifted; up to WHOLE it goes along the surface alone


@functools.cache
def make_delta_momentum(spec: Spec, measuring: bool = True) -> Any:
    """Return the sweep that writes acceleration, and with `measuring` pressure gradient, wholeness and shift too."""
    real, vec, mat, pair = types_of(spec)
    Params, Phase = make_params(spec.dimension, spec.precision), make_phase(spec.precision)
    (shape, slope), separation = make_smoothing(spec.kernel, spec.precision), separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    (_, force_sums), at_vec, at_pair = make_force_sums(spec, measuring), make_at(vec), make_at(pair)
    driving_force, least_eigenvalue = make_driving_force(spec), make_least_eigenvalue(spec.dimension, spec.precision)
    viscous = spec.viscosity != "none"
    viscous_term = make_viscosity(spec.viscosity if viscous else "radial", spec.dimension, spec.precision)
    friction_slide = make_friction_slide(spec)
    friction_slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)
    limit_shift, crowding = make_limit_shift(spec), make_crowding(spec.precision)
    (braked, held, ahead), seen = make_contact_of(spec), make_seen(spec)
    particle_of, lane_of, part_of = lanes_of(spec)
    no_planes, noted = make_planes(spec.dimension, spec.precision)
    diffuses, shifts = spec.density_diffusion and measuring, spec.shifting and measuring
    measured, has_gap = needs_moment(spec, measuring), make_has_gap(spec)

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
        slip_slope: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        wall_body: wp.array(dtype=int),
        side_walls: int,
        wholeness_old: wp.array(dtype=real),
        wholeness: wp.array(dtype=real),
        pressure_gradient: wp.array(dtype=vec),
        pressure_sign: wp.array(dtype=wp.int8),
        acceleration: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return  # nothing pushes a buffer, and none is shifted
        xi = position[i]
        vi = velocity[i]
        p_i = state[i][0]
        own = phases[0]
        rho_i = own.density * rest_volume[i] / state[i][1]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        whole_i = real(1.0)
        if wp.static(spec.free_surface):
            whole_i = wholeness_old[i]
        least = whole_i  # 0 where a particle of a free surface is within the support
        into_wall = vec()  # sum F V x_ij over walls
        # of bodies, and of the sides of the domain; without bodies of their cells
        faces, sides = no_planes(params.spacing), no_planes(params.spacing)
        body2 = real(4.0) * params.h * params.h  # square of the distance to the nearest foot on a body [m^2]
        half_cell = vec(real(0.5) * params.spacing)
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        pairs = force_sums(
            i, k, end, step, wrapped, xi, vi, p_i, whole_i, own.viscosity, artificial_viscosity, shift_peak, params,
            neighbours, position, velocity, state, wholeness_old)  # fmt: skip
        if lane > 0:
            return
        k, step = end, stride
        pressures, even, slope_p = vec() + pairs.pressures, vec() + pairs.even, vec() + pairs.slope_p
        friction, push, moment = vec() + pairs.friction, vec() + pairs.push, mat() + pairs.moment
        if pairs.ragged > real(0.0):
            least = real(0.0)
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, at_vec(position, j), wrapped, params)
                r2 = wp.dot(d, d)
                q = wp.sqrt(r2) * params.inv_h
                state_j = at_pair(state, j)
                if wp.static(spec.dry_walls):
                    w = j - fluid_count
                    state_j[1] = seen(d, state_j[1], boundary_volume[w], wall_normal[w], wall_depth[w], params.spacing)
                f = slope(q) * state_j[1]
                fd = f * d
                pressures += state_j[0] * fd
                even += fd
                into_wall += fd
                if wp.static(not spec.bodies):
                    beyond = wp.max(wp.abs(d) - half_cell, vec())
                    for axis in range(wp.static(spec.dimension)):
                        clear = wp.abs(d[axis]) - half_cell[axis]
                        if wp.dot(beyond, beyond) == beyond[axis] * beyond[axis]:  # straight ahead
                            n_w = vec()
                            n_w[axis] = wp.sign(d[axis])
                            faces = noted(faces, n_w, clear, clear * wp.abs(clear), wp.dot(at_vec(velocity, j), n_w))
                else:
                    w = j - fluid_count
                    n_w = wall_normal[w]
                    clear = wp.dot(d, n_w) - wall_depth[w]
                    foot2 = r2 - wall_depth[w] * (real(2.0) * clear + wall_depth[w])
                    body2 = wp.where(wall_body[w] > side_walls, wp.min(body2, foot2), body2)
                    if foot2 < params.spacing * params.spacing:
                        if wall_body[w] > side_walls:
                            faces = noted(faces, n_w, clear, foot2, wp.dot(at_vec(velocity, j), n_w))
                        elif wp.max(wp.abs(n_w)) > real(0.99):  # an edge of the domain is no plane
                            sides = noted(sides, n_w, clear, foot2, wp.dot(at_vec(velocity, j), n_w))
                if wp.static(measured):
                    moment -= wp.outer(d, fd)
                if wp.static(diffuses):
                    slope_p += (state_j[0] - p_i) * fd
                if wp.static(shifts):
                    push += crowding(shape(q) * shift_peak) * fd
                if wp.static(viscous and (spec.bodies or spec.wall_no_slip)):
                    rubs = bool(True)
                    if wp.static(not spec.bodies):
                        rubs = slip[j - fluid_count] == wp.uint8(0)
                    if rubs:
                        mirror = mirror_velocity[j - fluid_count]
                        slide = friction_slide(j - fluid_count, vi, mirror, d, slip, wall_normal, slip_slope)
                        rub = own.viscosity * (friction_slope(q) * state_j[1])
                        friction += rub * viscous_term(slide, d, r2 + params.tiny, params.inv_h)
        g_norm = params.g_norm
        whole = real(1.0)
        if wp.static(measured):
            moment = moment * g_norm
            whole = least_eigenvalue(moment)
        sign = real(1.0)
        if wp.static(spec.tension_control != ""):
            torn = least >= real(WHOLE)
            if wp.static(spec.tension_control == "gaps"):
                torn = torn and has_gap(even * g_norm, whole, state[i][1], body2, params)
            if p_i < real(0.0) and torn:
                sign = real(-1.0)
            pressure_sign[i] = wp.int8(sign)
        a = (friction - pressures - (sign * p_i) * even) * (g_norm / rho_i)
        a += driving_force(xi, params, forcing)
        if wp.static(spec.walls):
            stiff = real(2.0) * own.sound_speed * wp.length(into_wall) * g_norm
            if wp.static(spec.bodies):
                nearest2 = wp.min(wp.min(faces.foot2), wp.min(sides.foot2))
                faces.gap = ahead(faces.gap, faces.foot2, nearest2, body2, params.spacing)
                sides.gap = ahead(sides.gap, sides.foot2, nearest2, body2, params.spacing)
                a = braked(a, vi, sides.gap, sides.speed, sides.normal, params.spacing, stiff, real(clock[STEP]))
            a = braked(a, vi, faces.gap, faces.speed, faces.normal, params.spacing, stiff, real(clock[STEP]))
        acceleration[i] = a
        if wp.dot(a, a) > maxima[slot * MAXIMA + 1]:
            wp.atomic_max(maxima, slot * MAXIMA + 1, wp.dot(a, a))
        if wp.static(spec.free_surface and measuring):
            wholeness[i] = whole
        if wp.static(diffuses):
            gradient = slope_p * g_norm
            if whole > real(LEAST_EIGENVALUE):
                gradient = wp.inverse(moment) * gradient
            pressure_gradient[i] = gradient
        if wp.static(shifts):
            way = wp.min(real(clock[SPEED]), shift_speed) * real(clock[STEP])
            cap = wp.min(real(0.5) * way, params.shift_cap * params.h)
            dx = limit_shift(push * (-params.shifting * way * params.h * g_norm), cap, whole, least, pairs.inward)
            if wp.static(spec.walls):
                dx = held(held(dx, faces.gap, faces.normal, params.spacing), sides.gap, sides.normal, params.spacing)
            shift[i] = dx
            if wp.dot(dx, dx) > maxima[slot * MAXIMA + 3]:
                wp.atomic_max(maxima, slot * MAXIMA + 3, wp.dot(dx, dx))

    return shared(delta_momentum, spec)


@functools.cache
def make_driving_force(spec: Spec) -> Any:
    """Return the `wp.func` driving_force(x, params, forcing) of gravity, body force and central force at a place [m/s^2]."""
    vec = types_of(spec).vec
    Params = make_params(spec.dimension, spec.precision)
    gravity_of, body_force_of = make_forcing(spec)

    @wp.func
    def driving_force(x: vec, params: Params, forcing: wp.array(dtype=vec)):
        a = vec()
        if wp.static(spec.gravity):
            a += gravity_of(params, forcing, GRAVITY_NEXT)
        if wp.static(spec.body_force):
            a += body_force_of(params, forcing)
        if wp.static(spec.central_force):
            a -= params.pull * (x - params.center)
        return a

    return driving_force


@functools.cache
def make_limit_shift(spec: Spec) -> Any:
    """Return the `wp.func` limit_shift(dx, cap, whole, least, inward): a shift of at most `cap` that leaves a surface alone.

    whole: least eigenvalue of the moment, least: below WHOLE where one of the neighbourhood is, inward: any vector along the
    gradient of it.
    Between ALONE and WHOLE the shift goes along the surface, below there is none. Next to such particles it does not go
    outwards: the fluid would swell row by row.
    """
    real, vec, _, _ = types_of(spec)

    @wp.func
    def limit_shift(dx: vec, cap: real, whole: real, least: real, inward: vec):
        result = dx
        if wp.static(spec.free_surface):
            if whole < real(WHOLE):
                size2 = wp.dot(inward, inward)
                if whole < real(ALONE) or size2 == real(0.0):
                    result = vec()
                else:
                    result = dx - inward * (wp.dot(dx, inward) / size2)
            elif least < real(WHOLE) and wp.dot(dx, inward) < real(0.0):
                result = dx - inward * (wp.dot(dx, inward) / wp.dot(inward, inward))
        length = wp.length(result)
        if length > cap:
            result = result * (cap / length)
        return result

    return limit_shift


@functools.cache
def make_has_gap(spec: Spec) -> Any:
    """Return the `wp.func` has_gap(even, whole, volume, body2, params): whether a neighbour is missing (theory: delta#d2).

    even: sum grad W V over all neighbours [1/m], whole: least eigenvalue of the moment, volume: of the particle [m^d],
    body2: square of the distance to the nearest body [m^2]. A neighbour one spacing away has the part b = |grad W(dx)| V of
    the one, b dx of the other. What is crowded has the one too, but not the other; beside the nose of an airfoil as sharp
    as a spacing walls are missing, no neighbours.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)

    @wp.func
    def has_gap(even: vec, whole: real, volume: real, body2: real, params: Params):
        spacing = params.spacing
        if body2 < real(BESIDE * BESIDE) * spacing * spacing:
            return False
        one = wp.abs(slope(spacing * params.inv_h)) * spacing * volume * params.g_norm
        return wp.length(even) > one and whole < real(1.0) - one * spacing

    return has_gap
