"""The pressure equation of ISPH: its matrix and right-hand side, and what its solution does to the velocity."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import MAXIMA, SPEED, STEP
from warpsph.kernels.core.fields import FLUID, implicit_at_bodies
from warpsph.kernels.core.mirror import NO_WALL, code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access, make_entry, natural
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.poses import make_pose
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NEXT, make_forcing
from warpsph.kernels.core.weights import make_weights

from .body_contact import make_contact
from .body_pressure import make_friction_rate, make_memory, make_room_of_walls
from .projection import CLOSEST, SMALLEST_MOMENT
from .surface import INSIDE

UNSURE = 0.01  # excess E that disorder alone can make: its standard deviation is 0.0037 on shifted particles
TOUCH = 0.75  # distance from a wall particle at which a particle of the surface stops, in spacings; a resting row has 1
TOUCHING = 1.001  # distance below which a particle has come as near to a side as it may, over that distance
TENSION = 0.5  # largest, over rho u_max^2


@functools.cache
def make_takes_part(spec: Spec) -> Any:
    """Return the `wp.func` takes_part(i, surface, zone): whether the pressure of a fluid row is an unknown."""

    @wp.func
    def takes_part(i: int, surface: wp.array(dtype=wp.uint8), zone: wp.array(dtype=wp.int8)):
        result = bool(True)
        if wp.static(spec.free_surface):
            result = surface[i] == wp.uint8(INSIDE)
        if wp.static(spec.open_axis >= 0):
            result = int(zone[i]) == FLUID
        return result

    return takes_part


@functools.cache
def make_let_go(dimension: int, precision: str) -> Any:
    """Return the `wp.func` that gives the divergence by which an excess of the room that a particle has is let go [1/s].

    None where `full` is false: the sum `crowd` of (1 - r^2/R^2)^2 V [m^d] has not all of the neighbourhood then.
    """
    real = types(dimension, precision).real
    Params = make_params(dimension, precision)

    @wp.func
    def let_go(full: bool, crowd: real, speed: real, params: Params):
        result = real(0.0)
        if full:
            excess = crowd * params.window_norm - real(1.0)
            excess = excess - wp.clamp(excess, real(-UNSURE), real(UNSURE))
            result = params.feedback * speed * params.inv_h * excess
        return result

    return let_go


def keeps_share(spec: Spec) -> bool:
    """Return whether a share of the last pressure stays in the equation (theory: isph#bodies)."""
    full = not spec.free_surface and spec.open_axis < 0
    return spec.bodies or (spec.mirror and spec.implicit_viscosity and full)


@functools.cache
def make_assemble(spec: Spec) -> Any:
    """Return the sweep that fills the pressure matrix, its right-hand side and what the multigrid needs of them.

    Row i times its volume share: sum_j w_ij (p_i - p_j) = -V (div u* - D)/(beta dt) + grad p^n.sum_j w_ij (x_i - x_j), all
    neighbours; particles of the surface are known and out of the system, images belong to the column of their particle.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, image_velocity, lift = images.apart, images.image_velocity, images.lift
    list_begin, list_step, neighbour, Listed = list_access(spec)
    row_begin, row_stride, _, Columns, put_column = make_entry(spec.row_list, spec.wide_list)
    _, _, _, Values, put_value = make_entry(spec.row_list, spec.wide_list, real)
    gravity_of, _ = make_forcing(spec)
    time_weights = make_weights(spec.second_order)
    friction_rate = make_friction_rate(spec.precision)
    memory = make_memory(spec.dimension, spec.precision)
    takes_part = make_takes_part(spec)
    remembers = keeps_share(spec)
    room_of_walls, let_go = make_room_of_walls(spec), make_let_go(spec.dimension, spec.precision)
    dimension = float(spec.dimension)
    image_bit = code_shift(spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def assemble(
        first: int,
        particle_count: int,
        fluid_count: int,
        list_width: int,
        matrix_width: int,
        deferred: real,
        relaxed: int,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        surface: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        wall_acceleration: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        velocity_star: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
        lasting_gradient: wp.array(dtype=vec),
        dilation: wp.array(dtype=real),
        dilation_old: wp.array(dtype=real),
        correction: wp.array(dtype=mat),
        spread: wp.array(dtype=real),
        matrix_columns: Columns,
        matrix_values: Values,
        matrix_counts: wp.array(dtype=wp.int16),
        matrix_diagonal: wp.array(dtype=real),
        matrix_moment: wp.array(dtype=mat),
        unknown: wp.array(dtype=real),
        source: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if not takes_part(i, surface, zone):
            matrix_counts[i] = wp.int16(0)
            matrix_diagonal[i] = real(1.0)
            matrix_moment[i] = mat()
            unknown[i] = real(0.0)
            source[i] = real(0.0)
            return
        wall_first = particle_count - wall_acceleration.shape[0]
        xi = position[i]
        vi = velocity_star[i]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        rho = phases[0].density
        share = rest_volume[i] / params.wall_volume
        weight = real(-2.0) * params.g_norm * share / rho
        weights = time_weights(clock)
        beta = weights[2] * clock[STEP]
        # what gravity adds to u*: the pressure of images and walls balances it, so that it is not mirrored
        falling = gravity_of(params, forcing, GRAVITY_NEXT) * real(beta)
        lagged = deferred
        lifted = rho
        if wp.static(remembers):
            new = real(1.0) / (real(1.0) + memory(real(beta), clock, params, phases[0]))
            kept = real(1.0) - new  # share of the last pressure, of its gradient in u* and of its Laplacian in the equation
            lifted = rho * new
            falling = falling * new
            lagged = deferred * new
            push = kept * real(beta) / rho
            vi = vi - push * lasting_gradient[i]
        crowd = rest_volume[i]
        full = bool(True)
        flow = mat()
        uneven = vec()  # sum of w x_ij over all neighbours
        moment = mat()
        diagonal = real(0.0)
        coupling = real(0.0)
        right = real(0.0)
        count = int(0)
        entry = row_begin(i, matrix_width)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        row_step = row_stride(fluid_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = natural(neighbour(neighbours, i, k))
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & wp.static((1 << image_bit) - 1)
            xj = position[j]
            d = apart(xi, xj, code, wrapped, params, sides)
            r2 = wp.dot(d, d)
            f = slope(wp.sqrt(r2) * params.inv_h) * rest_volume[j]
            core = wp.max(real(1.0) - r2 * params.inv_window, real(0.0))
            crowd += core * core * rest_volume[j]
            if wp.static(spec.open_axis >= 0):
                if int(zone[j]) != FLUID:
                    continue  # see `open_projection.make_open_source`
            w = weight * f
            vj = velocity_star[j]
            if wp.static(remembers):
                vj = vj - push * lasting_gradient[j]
                right += (kept * w) * (pressure[i] - pressure[j])
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj - falling, code, sides) + falling
                    if wp.static(spec.gravity):
                        right += w * lifted * wp.dot(gravity_of(params, forcing, GRAVITY_NEXT), lift(xj, code, sides))
            flow += wp.outer(vj - vi, f * d)
            uneven += w * d
            if not takes_part(j, surface, zone):
                full = False
                coupling += w
                right += w * pressure[j]
            elif j != i and w > real(0.0):
                # the image of a particle in its own row cancels out
                diagonal += w
                moment += wp.outer(d, (real(0.5) * w) * d)
                put_column(matrix_columns, i, entry, j)
                put_value(matrix_values, i, entry, -w)
                entry += row_step
                count += 1
        if wp.static(spec.bodies):
            crowd += room_of_walls(i, end, wall_neighbours, particle_count, params, neighbours, position, boundary_volume)
        if wp.static(spec.walls and not spec.bodies):
            full = full and wall_neighbours[i] == wp.int16(0)
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = natural(neighbour(neighbours, i, k))
                k += step
                d = apart(xi, position[j], 0, wrapped, params, sides)
                f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * params.wall_volume
                w = weight * f
                # an image of this particle: velocity mirrored at that of the wall, pressure in balance with the weight
                uneven += w * d
                if wp.static(spec.moving):
                    # what pressure balances at a wall that accelerates
                    borne = gravity_of(params, forcing, GRAVITY_NEXT) - wall_acceleration[j - wall_first]
                    flow += wp.outer(real(2.0) * (velocity[j] + borne * real(beta) - vi), f * d)
                    right -= w * rho * wp.dot(borne, d)
                else:
                    flow += wp.outer(real(2.0) * (velocity[j] + falling - vi), f * d)
                    if wp.static(spec.gravity):
                        right -= w * rho * wp.dot(gravity_of(params, forcing, GRAVITY_NEXT), d)
        divergence = wp.trace(flow * correction[i]) * params.g_norm
        wanted = let_go(full, crowd, real(clock[SPEED]), params)
        if relaxed == 1:
            # BDF2 of dD/dt = -(D - wanted)/tau, the right side extrapolated: stable up to dt = tau
            rate = wp.float64(2.0) * clock[SPEED] / wp.float64(params.h)
            if wp.static(spec.viscosity != "none"):
                rate += wp.float64(friction_rate(params.h, phases[0]))
            rate = wp.min(rate, wp.float64(1.0) / clock[STEP])
            left_now = wp.float64(dilation[i])
            left_old = wp.float64(dilation_old[i])
            left = left_now + weights[3] * (left_now - left_old) - wp.float64(wanted)
            divergence -= real(weights[0] * left_now - weights[1] * left_old - beta * rate * left)
        else:
            divergence -= wanted
        right -= share * (spread[i] / real(dimension)) * divergence / real(beta)
        right += lagged * wp.dot(lasting_gradient[i], uneven)
        matrix_counts[i] = wp.int16(count)
        matrix_diagonal[i] = diagonal + coupling
        matrix_moment[i] = moment
        unknown[i] = pressure[i]
        source[i] = right
        if diagonal + coupling <= real(0.0):
            matrix_diagonal[i] = real(1.0)  # no neighbour at all
            source[i] = real(0.0)

    return assemble


@functools.cache
def make_accept(spec: Spec) -> Any:
    """Return the kernel that takes the solution as pressure; particles of the surface keep theirs.

    A fluid with a free surface holds no more tension than its motion and friction explain: in a thin tip that is torn apart
    it would pull single particles together like bullets. A rotating square, the case with most of it, needs 0.3 rho u_max^2;
    friction across a surface that is drawn together is balanced by a tension of up to 2 mu |grad u|.
    """
    real, _, mat, pair = types_of(spec)
    Phase = make_phase(spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def accept(
        first: int,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        surface: wp.array(dtype=wp.uint8),
        unknown: wp.array(dtype=real),
        rest_volume: wp.array(dtype=real),
        velocity_gradient: wp.array(dtype=mat),
        pressure: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        if wp.static(spec.free_surface):
            if surface[i] == wp.uint8(INSIDE):
                speed = real(clock[SPEED])
                most = real(TENSION) * phases[0].density * speed * speed
                if wp.static(spec.viscosity != "none"):
                    g = velocity_gradient[i]
                    most += real(2.0) * phases[0].viscosity * wp.sqrt(wp.ddot(g, g))
                pressure[i] = wp.max(unknown[i], -most)
        else:
            pressure[i] = unknown[i]
        state[i] = pair(pressure[i], rest_volume[i])

    return accept


@functools.cache
def make_without_walls(spec: Spec) -> Any:
    """Return the `wp.func` without_walls(a, velocity, x, params, sides): an acceleration less what sides take away again.

    A particle that has come as near to a side as it may stops there at the start of the next step, whatever drives it on:
    in a corner friction does so for ever, at a rate that says nothing of how fast the flow changes.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    dimension = spec.dimension

    @wp.func
    def without_walls(a: vec, velocity: vec, x: vec, params: Params, sides: Sides):
        result = vec() + a
        if wp.static(spec.mirror):
            near = real(TOUCHING * CLOSEST) * params.spacing
            for axis in range(wp.static(dimension)):
                if sides.kind[2 * axis] != NO_WALL and x[axis] - sides.lower[axis] < near and velocity[axis] < real(0.0):
                    result[axis] = real(0.0)
                if sides.kind[2 * axis + 1] != NO_WALL and sides.upper[axis] - x[axis] < near and velocity[axis] > real(0.0):
                    result[axis] = real(0.0)
        return result

    return without_walls


@functools.cache
def make_without_impacts(spec: Spec) -> Any:
    """Return the `wp.func` without_impacts(gradient, before): the smaller one of the last two pressure gradients.

    None if they oppose: an impact is over in the next step.
    """
    real, vec, _, _ = types_of(spec)

    @wp.func
    def without_impacts(gradient: vec, before: vec):
        lasting = vec()
        if wp.dot(gradient, before) > real(0.0):
            lasting = gradient * wp.min(real(1.0), wp.length(before) / wp.length(gradient))
        return lasting

    return without_impacts


@functools.cache
def make_of_fluid(spec: Spec) -> Any:
    """Return the `wp.func` of_fluid(total, correction, walls, gradient, lasting): the lasting gradient as the fluid has it.

    `total` is the sum over the fluid neighbours that `gradient` is made of, `walls` that of F x (x) x V over the walls of
    bodies, negative. `gradient` answers what the step adds across a wall, this does not; where pressure balances that, both
    are equal. Where there is too little fluid for it, it is the lasting gradient itself (theory: isph#b1).
    """
    real, vec, mat, _ = types_of(spec)
    smallest = SMALLEST_MOMENT**spec.dimension

    @wp.func
    def of_fluid(total: vec, correction: mat, walls: mat, gradient: vec, lasting: vec):
        result = lasting
        moment = wp.inverse(correction) + walls
        size = wp.length(gradient)
        if wp.determinant(moment) > real(smallest) and size > real(0.0):
            result = wp.inverse(moment) * total * (wp.length(lasting) / size)
        return result

    return of_fluid


@functools.cache
def make_correct(spec: Spec) -> Any:
    """Return the sweep that takes the pressure gradient off: u^{n+1} = u* - (beta dt/rho) grad p.

    grad p = L sum (p_j - p_i) grad W V, or the printed conservative sum (p_j + p_i) grad W V. With `advancing` 0 only the
    gradient is found.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, lift = images.apart, images.lift
    list_begin, list_step, neighbour, Listed = list_access(spec)
    gravity_of, body_force_of = make_forcing(spec)
    time_weights = make_weights(spec.second_order)
    contact = make_contact(spec)
    without_walls = make_without_walls(spec)
    without_impacts, of_fluid = make_without_impacts(spec), make_of_fluid(spec)
    Pose = make_pose()
    periodic = any(spec.periodic)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def correct(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        advancing: int,
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
        rest_volume: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
        correction: wp.array(dtype=mat),
        boundary_volume: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        wall_area: wp.array(dtype=real),
        surface: wp.array(dtype=wp.uint8),
        velocity_ahead: wp.array(dtype=vec),
        velocity_star: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        wall_acceleration: wp.array(dtype=vec),
        wall_jump: wp.array(dtype=vec),
        wall_body: wp.array(dtype=int),
        body_motion: wp.array(dtype=int),
        poses: wp.array(dtype=Pose),
        velocity_old: wp.array(dtype=vec),
        pressure_gradient: wp.array(dtype=vec),
        lasting_gradient: wp.array(dtype=vec),
        fluid_gradient: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        beside: wp.array(dtype=vec),
        wall_gap: wp.array(dtype=real),
        wall_pace: wp.array(dtype=real),
        beside_2: wp.array(dtype=vec),
        wall_gap_2: wp.array(dtype=real),
        wall_pace_2: wp.array(dtype=real),
        maxima: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        wall_first = particle_count - wall_acceleration.shape[0]
        xi = position[i]
        p_i = pressure[i]
        rho = phases[0].density
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        sign = real(-1.0)
        if wp.static(not spec.corrected):
            sign = real(1.0)
        total = vec()
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
            xj = position[j]
            d = apart(xi, xj, code, wrapped, params, sides)
            p_j = pressure[j]
            if wp.static(spec.mirror and spec.gravity):
                if code != 0:
                    p_j += rho * wp.dot(gravity_of(params, forcing, GRAVITY_NEXT), lift(xj, code, sides))
            f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * rest_volume[j]
            total += (f * (p_j + sign * p_i)) * d
        walls, shut = mat(), mat()
        push = vec()
        added = vec()
        if wp.static(spec.bodies):
            # what the pressure has to balance: at the start, when no step has been made, the forces
            added = (gravity_of(params, forcing, GRAVITY_NEXT) + body_force_of(params, forcing)) * rho
            weights = time_weights(clock)
            reach = real(weights[2] * clock[STEP])
            if reach > real(0.0):
                added = (velocity_star[i] - velocity_ahead[i]) * (rho / reach)
        nearest = real(TOUCH) * params.spacing  # distance of the nearest wall particle
        off_wall = vec()
        wall_speed = vec()
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = natural(neighbour(neighbours, i, k))
                k += step
                d = apart(xi, position[j], 0, wrapped, params, sides)
                r = wp.length(d)
                if wp.static(spec.bodies):
                    b = j - (particle_count - boundary_volume.shape[0])
                    n = wall_normal[b]
                    fd = (slope(r * params.inv_h) * boundary_volume[b] * params.g_norm) * d
                    walls += wp.outer(fd, d)
                    # along the wall as the fluid has it, across it what stops the velocity
                    shut += wp.outer(fd, d - n * wp.dot(n, d))
                    across = wp.dot(n, added)
                    if wp.static(spec.moving):
                        if reach > real(0.0):
                            across -= wp.dot(n, wall_jump[b]) * (rho / reach)
                        else:
                            across -= wp.dot(n, wall_acceleration[b]) * rho
                    push -= fd * (wp.dot(n, d) * across)
                    continue
                if r < nearest and r > real(0.0):
                    nearest = r
                    off_wall = d / r
                    wall_speed = velocity[j]
                p_j = p_i
                if wp.static(spec.moving):
                    borne = gravity_of(params, forcing, GRAVITY_NEXT) - wall_acceleration[j - wall_first]
                    p_j -= rho * wp.dot(borne, d)
                elif wp.static(spec.gravity):
                    p_j -= rho * wp.dot(gravity_of(params, forcing, GRAVITY_NEXT), d)
                f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * params.wall_volume
                total += (f * (p_j + sign * p_i)) * d
        if wp.static(spec.bodies):
            contact(
                i, xi, particle_count, list_width, params, neighbours, fluid_neighbours, wall_neighbours, position, velocity,
                wall_normal, wall_depth, wall_area, wall_body, body_motion, poses, beside, wall_gap, wall_pace,
                beside_2, wall_gap_2, wall_pace_2,
            )  # fmt: skip
        gradient = total * params.g_norm
        if wp.static(spec.corrected):
            if wp.static(spec.bodies):
                if wall_neighbours[i] > wp.int16(0):
                    gradient = wp.inverse(wp.inverse(correction[i]) + shut) * (gradient + push)
                else:
                    gradient = correction[i] * gradient
            else:
                gradient = correction[i] * gradient
        if advancing == 0:
            pressure_gradient[i] = gradient
            lasting_gradient[i] = gradient
            if wp.static(implicit_at_bodies(spec)):
                fluid_gradient[i] = gradient
            return
        lasting = without_impacts(gradient, pressure_gradient[i])
        lasting_gradient[i] = lasting
        if wp.static(implicit_at_bodies(spec)):
            if wall_neighbours[i] > wp.int16(0):
                lasting = of_fluid(total * params.g_norm, correction[i], walls, gradient, lasting)
            fluid_gradient[i] = lasting
        pressure_gradient[i] = gradient
        old = velocity[i]
        new = velocity_star[i] - gradient * (real(time_weights(clock)[2] * clock[STEP]) / rho)
        if wp.static(spec.walls and spec.free_surface and not spec.bodies):
            # a particle of the surface has no pressure that would keep it off a body
            if surface[i] != wp.uint8(INSIDE):
                new -= off_wall * wp.min(wp.dot(new - wall_speed, off_wall), real(0.0))
        velocity_old[i] = old
        velocity[i] = new
        a = (new - old) / real(clock[STEP])
        acceleration[i] = a
        v2 = wp.dot(new, new)
        a2 = wp.length_sq(without_walls(a, new, xi, params, sides))
        if v2 > maxima[slot * MAXIMA]:
            wp.atomic_max(maxima, slot * MAXIMA, v2)
        if a2 > maxima[slot * MAXIMA + 1]:
            wp.atomic_max(maxima, slot * MAXIMA + 1, a2)

    return correct
