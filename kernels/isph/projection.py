"""Incompressible SPH by projection: the sweeps of a step (theory: isph#b1 to isph#b6; seed 002; Cummins & Rudman 1999).

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

from warpsph.kernels.core.clock import MAXIMA, RUNAWAY, SPEED, STEP
from warpsph.kernels.core.mirror import NO_WALL, code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access, make_entry
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.viscosity import make_viscosity
from warpsph.kernels.core.weights import make_weights

from .surface import INSIDE, ISOLATED

# Determinant of the moment below which a neighbourhood is too thin for a corrected gradient, to the power 1/d: at a flat
# surface it is 0.6, at a right-angled edge 0.36.
SMALLEST_MOMENT = 0.45
CONTACT = 0.5  # distance of a collision, in spacings: shifted particles of a flow stay farther apart
CROWDED = 0.85  # distance below which particles next to a free surface are pushed apart, in spacings
PUSH = 0.25  # of A |grad u| dt, times the spacing
MOST_PUSH = 0.1  # of |grad u| dt: beyond it a push overshoots
MOST_FILTER = 0.5  # share of a velocity's deviation that one step may take out
MOST_SHIFT = 0.5  # of A |grad u| dt
UNSURE = 0.01  # excess E that disorder alone can make: its standard deviation is 0.0037 on shifted particles
PAIRING = 0.2  # extra weight (W/W(dx))^4 of near particles in the shift: sum grad W alone is even for pairs (Lind 2012)
TOUCH = 0.75  # distance from a wall particle at which a particle of the surface stops, in spacings; a resting row has 1
TENSION = 0.5  # largest, over rho u_max^2
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
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        v = velocity[i]
        old = velocity_old[i]
        half = real(wp.float64(0.5) * time_weights(clock)[3])
        way = offset[i] + (v + (v - old) * half) * real(clock[STEP])
        if wp.static(spec.shifting):
            way += shift[i]
            change = carried[i]
            v += change
            old += change
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
        if wp.static(spec.shifting or spec.mirror):
            velocity[i] = v
            velocity_old[i] = old
        offset[i] = way
        position[i] = x

    return advect


@functools.cache
def make_predict(spec: Spec) -> Any:
    """Return the sweep that finds what a neighbourhood looks like and the velocity u* without pressure.

    It also watches for faults. Writes the correction L, the gradient of the concentration
    sum [1 + 0.2 (W/W(dx))^4] grad W V, the divergence of the positions
    sum (x_j - x_i).grad W V, the outward normal, and u*.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, friction_velocity = images.apart, images.friction_velocity
    list_begin, list_step, neighbour, Listed = list_access(spec)
    viscous = spec.viscosity != "none"
    viscous_term = make_viscosity(spec.viscosity if viscous else "morris", spec.dimension, spec.precision)
    time_weights = make_weights(spec.second_order)
    periodic = any(spec.periodic)
    dimension = float(spec.dimension)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1
    smallest = SMALLEST_MOMENT**spec.dimension

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def predict(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
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
        correction: wp.array(dtype=mat),
        crowding: wp.array(dtype=vec),
        spread: wp.array(dtype=real),
        company: wp.array(dtype=real),
        surface_normal: wp.array(dtype=vec),
        velocity_star: wp.array(dtype=vec),
        pressure: wp.array(dtype=real),
        unknown: wp.array(dtype=real),
        faults: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        unknown[i] = pressure[i]  # the surface stage looks at the pressure around while it writes some
        xi = position[i]
        weights = time_weights(clock)
        omega = real(weights[3])
        v_now = velocity[i]
        v_old = velocity_old[i]
        # here, after the list has put the particles in order, their rows stay what they are to the end of the step; NaN
        # fails every comparison
        limit = real(clock[RUNAWAY])
        if not (wp.dot(v_now, v_now) < limit * limit and wp.dot(xi, xi) < real(1.0e30)):
            wp.atomic_min(faults, slot, i)
        vi = v_now + (v_now - v_old) * omega
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        moment = mat()
        even = vec()
        pairing = vec()
        among = real(0.0)
        per_spacing = real(1.0) / shape(params.spacing * params.inv_h)
        flow = mat()
        viscous_sum = vec()
        fluid_count = particle_count - slip.shape[0]
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
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
                near = shape(q) * per_spacing
                near = near * near
                pairing += (near * near) * fd
            if wp.static(viscous):
                vj = velocity[j]
                vj = vj + (vj - velocity_old[j]) * omega
                if wp.static(spec.mirror):
                    if code != 0:
                        vj = friction_velocity(vj, code, sides)
                flow += wp.outer(vj - vi, fd)
                viscous_sum += f * viscous_term(vi - vj, d, r2 + params.tiny, params.inv_h)
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = apart(xi, position[j], 0, wrapped, params, sides)
                r2 = wp.dot(d, d)
                f = slope(wp.sqrt(r2) * params.inv_h) * params.wall_volume
                fd = f * d
                moment -= wp.outer(d, fd)
                even += fd
                among -= f * r2
                if wp.static(spec.wall_no_slip):
                    if slip[j - fluid_count] == wp.uint8(0):
                        vj = mirror_velocity[j - fluid_count]
                        flow += wp.outer(vj - vi, fd)
                        viscous_sum += f * viscous_term(vi - vj, d, r2 + params.tiny, params.inv_h)
        g_norm = params.g_norm
        m = moment * g_norm
        spread[i] = wp.trace(m)
        company[i] = among * g_norm
        inverse = wp.identity(n=wp.static(spec.dimension), dtype=real)
        known = wp.determinant(m) > real(smallest)
        if known:
            inverse = wp.inverse(m)
        correction[i] = inverse
        crowding[i] = (even + real(PAIRING) * pairing) * g_norm
        outward = inverse * even
        length = wp.length(outward)
        normal = vec()
        if length * params.g_norm * params.h > real(1.0e-6):
            normal = outward * (real(-1.0) / length)
        surface_normal[i] = normal
        a = params.gravity + params.body_force
        if wp.static(spec.central_force):
            a -= params.pull * (xi - params.center)
        if wp.static(viscous):
            if known:
                # exact for a quadratic field on an even arrangement: take out what an uneven one makes of a linear field,
                # and divide by the second moment (theory: common#lattice, column L)
                shear = (flow * inverse) * g_norm
                linear = shear * even
                if wp.static(spec.viscosity == "radial"):
                    linear = linear + wp.transpose(shear) * even + wp.trace(shear) * even
                if spread[i] > real(wp.static(0.9 * dimension)):
                    viscous_sum = (viscous_sum - real(2.0) * linear) * (real(dimension) / spread[i])
            a += viscous_sum * (phases[0].viscosity / phases[0].density * g_norm)
        new = v_now * real(weights[0]) - v_old * real(weights[1])
        velocity_star[i] = new + a * real(weights[2] * clock[STEP])

    return predict


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
    time_weights = make_weights(spec.second_order)
    periodic = any(spec.periodic)
    dimension = float(spec.dimension)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

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
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        surface: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
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
    ):
        i = wp.tid() + first
        if wp.static(spec.free_surface):
            if surface[i] != wp.uint8(INSIDE):
                matrix_counts[i] = wp.int16(0)
                matrix_diagonal[i] = real(1.0)
                matrix_moment[i] = mat()
                unknown[i] = real(0.0)
                source[i] = real(0.0)
                return
        xi = position[i]
        vi = velocity_star[i]
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        rho = phases[0].density
        share = rest_volume[i] / params.wall_volume
        weight = real(-2.0) * params.g_norm * share / rho
        weights = time_weights(clock)
        beta = weights[2] * clock[STEP]
        # what gravity adds to u*: the pressure of images and walls balances it, so that it is not mirrored
        falling = params.gravity * real(beta)
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
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            xj = position[j]
            d = apart(xi, xj, code, wrapped, params, sides)
            r2 = wp.dot(d, d)
            f = slope(wp.sqrt(r2) * params.inv_h) * rest_volume[j]
            core = wp.max(real(1.0) - r2 * params.inv_window, real(0.0))
            crowd += core * core * rest_volume[j]
            w = weight * f
            vj = velocity_star[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj - falling, code, sides) + falling
                    if wp.static(spec.gravity):
                        right += w * rho * wp.dot(params.gravity, lift(xj, code, sides))
            flow += wp.outer(vj - vi, f * d)
            uneven += w * d
            known = bool(False)
            if wp.static(spec.free_surface):
                known = surface[j] != wp.uint8(INSIDE)
            if known:
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
        if wp.static(spec.walls):
            full = full and wall_neighbours[i] == wp.int16(0)
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = apart(xi, position[j], 0, wrapped, params, sides)
                f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * params.wall_volume
                w = weight * f
                # an image of this particle: velocity mirrored at that of the wall, pressure in balance with the weight
                flow += wp.outer(real(2.0) * (velocity[j] + falling - vi), f * d)
                uneven += w * d
                if wp.static(spec.gravity):
                    right -= w * rho * wp.dot(params.gravity, d)
        divergence = wp.trace(flow * correction[i]) * params.g_norm
        wanted = real(0.0)
        if full:
            excess = crowd * params.window_norm - real(1.0)
            excess = excess - wp.clamp(excess, real(-UNSURE), real(UNSURE))
            wanted = params.feedback * real(clock[SPEED]) * params.inv_h * excess
        if relaxed == 1:
            # BDF2 of dD/dt = -(D - wanted)/tau, the right side extrapolated: stable up to dt = tau
            rate = wp.min(wp.float64(2.0) * clock[SPEED] / wp.float64(params.h), wp.float64(1.0) / clock[STEP])
            now = wp.float64(dilation[i])
            old = wp.float64(dilation_old[i])
            left = now + weights[3] * (now - old) - wp.float64(wanted)
            divergence -= real(weights[0] * now - weights[1] * old - beta * rate * left)
        else:
            divergence -= wanted
        right -= share * (spread[i] / real(dimension)) * divergence / real(beta)
        right += deferred * wp.dot(lasting_gradient[i], uneven)
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

    A fluid with a free surface holds no more tension than its motion explains: in a thin tip that is torn apart it would
    pull single particles together like bullets. A rotating square, the case with most of it, needs 0.3 rho u_max^2.
    """
    real, _, _, pair = types_of(spec)
    Phase = make_phase(spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def accept(
        first: int,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        surface: wp.array(dtype=wp.uint8),
        unknown: wp.array(dtype=real),
        rest_volume: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
        state: wp.array(dtype=pair),
    ):
        i = wp.tid() + first
        if wp.static(spec.free_surface):
            if surface[i] == wp.uint8(INSIDE):
                speed = real(clock[SPEED])
                pressure[i] = wp.max(unknown[i], real(-TENSION) * phases[0].density * speed * speed)
        else:
            pressure[i] = unknown[i]
        state[i] = pair(pressure[i], rest_volume[i])

    return accept


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
    time_weights = make_weights(spec.second_order)
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
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
        correction: wp.array(dtype=mat),
        surface: wp.array(dtype=wp.uint8),
        velocity_star: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        pressure_gradient: wp.array(dtype=vec),
        lasting_gradient: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
    ):
        i = wp.tid() + first
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
            j = neighbour(neighbours, i, k)
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
                    p_j += rho * wp.dot(params.gravity, lift(xj, code, sides))
            f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * rest_volume[j]
            total += (f * (p_j + sign * p_i)) * d
        nearest = real(TOUCH) * params.spacing  # distance of the nearest wall particle
        off_wall = vec()
        wall_speed = vec()
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = apart(xi, position[j], 0, wrapped, params, sides)
                r = wp.length(d)
                if r < nearest and r > real(0.0):
                    nearest = r
                    off_wall = d / r
                    wall_speed = velocity[j]
                p_j = p_i
                if wp.static(spec.gravity):
                    p_j -= rho * wp.dot(params.gravity, d)
                f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * params.wall_volume
                total += (f * (p_j + sign * p_i)) * d
        gradient = total * params.g_norm
        if wp.static(spec.corrected):
            gradient = correction[i] * gradient
        if advancing == 0:
            pressure_gradient[i] = gradient
            lasting_gradient[i] = gradient
            return
        # The smaller of this gradient and the last, none if they oppose: an impact is over in the next step.
        before = pressure_gradient[i]
        lasting = vec()
        if wp.dot(gradient, before) > real(0.0):
            lasting = gradient * wp.min(real(1.0), wp.length(before) / wp.length(gradient))
        lasting_gradient[i] = lasting
        pressure_gradient[i] = gradient
        old = velocity[i]
        new = velocity_star[i] - gradient * (real(time_weights(clock)[2] * clock[STEP]) / rho)
        if wp.static(spec.walls and spec.free_surface):
            # a particle of the surface has no pressure that would keep it off an obstacle
            if surface[i] != wp.uint8(INSIDE):
                new -= off_wall * wp.min(wp.dot(new - wall_speed, off_wall), real(0.0))
        velocity_old[i] = old
        velocity[i] = new
        a = (new - old) / real(clock[STEP])
        acceleration[i] = a
        v2 = wp.dot(new, new)
        a2 = wp.dot(a, a)
        if v2 > maxima[slot * MAXIMA]:
            wp.atomic_max(maxima, slot * MAXIMA, v2)
        if a2 > maxima[slot * MAXIMA + 1]:
            wp.atomic_max(maxima, slot * MAXIMA + 1, a2)

    return correct


@functools.cache
def make_regularise(spec: Spec) -> Any:
    """Return the sweep that measures the divergence left over and finds the shift towards an even arrangement.

    dx = -A |grad u| dt h^2 grad C; what the particle carries changes by grad u dx. Next to a free surface that is done along
    it alone; across it particles nearer than CROWDED spacings are pushed apart by 0.25 A |grad u| dt dx sum (1 - r/r_0) e,
    which is zero on an even arrangement with or without neighbours outside. And the velocity is drawn to the linear field
    around it, du = f |grad u| dt sum W [u_j - u_i - grad u (x_j - x_i)]/sum W, f = `surface_filter`.
    With a free surface two particles that come nearer than CONTACT spacings lose their speed of approach, each one half of
    it, as in a plastic collision: in a splash no pressure acts between them.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, image_velocity = images.apart, images.image_velocity
    list_begin, list_step, neighbour, Listed = list_access(spec)
    periodic = any(spec.periodic)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def regularise(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        surface: wp.array(dtype=wp.uint8),
        surface_normal: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        correction: wp.array(dtype=mat),
        crowding: wp.array(dtype=vec),
        dilation: wp.array(dtype=real),
        dilation_old: wp.array(dtype=real),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        xi = position[i]
        vi = velocity[i]
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        flow = mat()
        impact = vec()  # change of velocity by collisions
        weight = shape(real(0.0))
        others = vec()  # sum W (u_j - u_i)
        arm = vec()  # sum W (x_i - x_j)
        apart_sum = vec()
        crowded = real(CROWDED) * params.spacing
        contact2 = real(CONTACT * CONTACT) * params.spacing * params.spacing
        outward = vec()  # normals of the surface near by
        if wp.static(spec.free_surface):
            if surface[i] != wp.uint8(INSIDE):
                outward = surface_normal[i] * shape(real(0.0))
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            d = apart(xi, position[j], code, wrapped, params, sides)
            r2 = wp.dot(d, d)
            q = wp.sqrt(r2) * params.inv_h
            vj = velocity[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj, code, sides)
            if wp.static(spec.free_surface):
                w = shape(q)
                weight += w
                others += w * (vj - vi)
                arm += w * d
                r = wp.sqrt(r2)
                if r < crowded and r > real(0.0):
                    apart_sum += d * (real(1.0) / r - real(1.0) / crowded)
                approach = wp.dot(vi - vj, d)
                if r2 < contact2 and approach < real(0.0):
                    impact -= d * (real(0.5) * approach / (r2 + params.tiny))
            flow += wp.outer(vj - vi, (slope(q) * rest_volume[j]) * d)
            if wp.static(spec.free_surface):
                if surface[j] != wp.uint8(INSIDE) and code == 0:
                    outward += surface_normal[j] * w
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = apart(xi, position[j], 0, wrapped, params, sides)
                f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * params.wall_volume
                flow += wp.outer(real(2.0) * (velocity[j] - vi), f * d)
        shear = (flow * correction[i]) * params.g_norm
        # a lone particle must not bring a divergence of any size into the next step
        most = real(clock[SPEED]) * params.inv_h
        dilation_old[i] = dilation[i]
        dilation[i] = wp.clamp(wp.trace(shear), -most, most)
        if wp.static(spec.shifting):
            dt = real(clock[STEP])
            strength = wp.sqrt(wp.ddot(shear, shear)) * dt
            # beyond half of h^2 grad C a shift overshoots what is even
            dx = crowding[i] * (-wp.min(params.shifting * strength, real(MOST_SHIFT)) * params.h * params.h)
            if wp.static(spec.free_surface):
                length = wp.length(outward)
                # at the rim of the support the weight is tiny, and its square zero
                if length > real(1.0e-6) * shape(real(0.0)):
                    n = outward / length
                    push = real(PUSH) * params.shifting * wp.min(strength, real(MOST_PUSH)) * params.spacing
                    dx += n * (push * wp.dot(apart_sum, n) - wp.dot(dx, n))
                    impact += (others + shear * arm) * (wp.min(params.filter * strength, real(MOST_FILTER)) / weight)
                if surface[i] == wp.uint8(ISOLATED):
                    dx = vec()
            length = wp.length(dx)
            cap = params.shift_cap * params.h
            if length > cap:
                dx = dx * (cap / length)
            shift[i] = dx
            change = shear * dx
            if wp.static(spec.free_surface):
                change += impact
            carried[i] = change
            s2 = wp.dot(dx, dx)
            if s2 > maxima[slot * MAXIMA + 3]:
                wp.atomic_max(maxima, slot * MAXIMA + 3, s2)

    return regularise


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
    ):
        i = wp.tid() + first
        way = offset[i] + (velocity[i] - velocity_old[i]) * real(wp.float64(0.5) * clock[STEP])
        offset[i] = way
        position[i] = anchor[i] + way

    return settle
