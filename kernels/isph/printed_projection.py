"""Projection ISPH as Qiu 2013 prints it, eqs (3) to (7), (10), (13) to (16), (20), (21) (theory: printed#qiu; seed 002).

    r* = r^n + dt u^n
    u* = u^n + dt [sum_b 2 V_b (mu/rho) (r_ab.grad W)/(r^2 + 0.01 h^2) (u_a - u_b) + g]
    sum_b 2 (V_b/rho) (p_a - p_b) (r_ab.grad W)/(r^2 + 0.01 h^2) = (1/dt) sum_b V_b (u*_b - u*_a).grad W
    u^{n+1} = u* - (dt/rho) sum_b V_b (p_a + p_b) grad W
    r^{n+1} = r^n + dt (u^n + u^{n+1})/2, then moved by C dt u_max sum_{r<h} (r_mean/r)^2 n_ab

p = 0 where sum_b V_b (r_b - r_a).grad W is below 1.5 (in 2-D, three quarters of that inside). Walls are images of
the particles within one h of them, of the same pressure and the reversed velocity. Nothing is corrected for disorder.
`advect` and `settle` of `projection` move the particles.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import MAXIMA, RUNAWAY, SPEED, STEP
from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access, make_entry
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NEXT, make_forcing

from .surface import INSIDE, SURFACE

AT_SURFACE = 0.75  # of d: divergence of the positions below which a particle is at the surface, 1.5 in 2-D
SOFTENED = 0.01  # of h^2, added to the square of distances


@functools.cache
def make_printed_laplacian(precision: str) -> Any:
    """Return the `wp.func` printed_laplacian(f, r2, h) = f r^2/(r^2 + 0.01 h^2), f = W'/r: r_ab.grad W over softened r^2."""
    real = types(2, precision).real

    @wp.func
    def printed_laplacian(f: real, r2: real, h: real):
        return f * r2 / (r2 + real(SOFTENED) * h * h)

    return printed_laplacian


@functools.cache
def make_has_image(spec: Spec) -> Any:
    """Return the `wp.func` has_image(x, code, sides, h): whether a particle is within one h of the sides that mirror it."""
    real, vec, _, _ = types_of(spec)
    Sides = make_sides(spec.dimension, spec.precision)

    @wp.func
    def has_image(x: vec, code: int, sides: Sides, h: real):
        result = bool(True)
        for axis in range(wp.static(spec.dimension)):
            digit = (code >> (2 * axis)) & 3
            if digit == 1:
                result = result and x[axis] - sides.lower[axis] <= h
            elif digit == 2:
                result = result and sides.upper[axis] - x[axis] <= h
        return result

    return has_image


@functools.cache
def make_printed_predict(spec: Spec) -> Any:
    """Return the sweep of eqs (13) and (16): velocity without pressure, and which particles are at the surface."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    apart, reversed_velocity = make_images(spec).apart, make_images(spec).friction_velocity
    has_image, printed_laplacian = make_has_image(spec), make_printed_laplacian(spec.precision)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    gravity_of, body_force_of = make_forcing(spec)
    image_bit = code_shift(spec.dimension)
    threshold = AT_SURFACE * spec.dimension

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_predict(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        velocity_star: wp.array(dtype=vec),
        spread: wp.array(dtype=real),
        surface: wp.array(dtype=wp.uint8),
        pressure: wp.array(dtype=real),
        faults: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        xi, vi = position[i], velocity[i]
        limit = real(clock[RUNAWAY])
        # NaN fails every comparison
        if not (wp.dot(vi, vi) < limit * limit and wp.dot(xi, xi) < real(1.0e30)):
            wp.atomic_min(faults, slot, i)
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        divergence = real(0.0)  # of the positions, eq (16)
        friction = vec()
        k, step = list_begin(i, list_width), list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & wp.static((1 << image_bit) - 1)
                if not has_image(position[j], code, sides, params.h):
                    continue
            vj = velocity[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = reversed_velocity(vj, code, sides)
            d = apart(xi, position[j], code, wrapped, params, sides)
            r2 = wp.dot(d, d)
            f = slope(wp.sqrt(r2) * params.inv_h) * rest_volume[j]
            divergence -= f * r2
            friction += printed_laplacian(f, r2, params.h) * (vi - vj)
        spread[i] = divergence * params.g_norm
        a = gravity_of(params, forcing, GRAVITY_NEXT) + body_force_of(params, forcing)
        if wp.static(spec.central_force):
            a -= params.pull * (xi - params.center)
        a += friction * (real(2.0) * params.g_norm * phases[0].viscosity / phases[0].density)
        velocity_star[i] = vi + a * real(clock[STEP])
        if wp.static(spec.free_surface):
            surface[i] = wp.uint8(INSIDE)
            if spread[i] < real(threshold):
                surface[i] = wp.uint8(SURFACE)
                pressure[i] = real(0.0)

    return printed_predict


@functools.cache
def make_printed_assemble(spec: Spec) -> Any:
    """Return the sweep of eq (14), times -V_a/V: positive definite and symmetric. Particles of the surface are out of it."""
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    apart, reversed_velocity = make_images(spec).apart, make_images(spec).friction_velocity
    has_image, printed_laplacian = make_has_image(spec), make_printed_laplacian(spec.precision)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    row_begin, row_stride, _, Columns, put_column = make_entry(spec.row_list, spec.wide_list)
    _, _, _, Values, put_value = make_entry(spec.row_list, spec.wide_list, real)
    image_bit = code_shift(spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_assemble(
        first: int,
        particle_count: int,
        fluid_count: int,
        list_width: int,
        matrix_width: int,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        surface: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity_star: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
        matrix_columns: Columns,
        matrix_values: Values,
        matrix_counts: wp.array(dtype=wp.int16),
        matrix_diagonal: wp.array(dtype=real),
        matrix_moment: wp.array(dtype=mat),
        unknown: wp.array(dtype=real),
        source: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        known = bool(False)
        if wp.static(spec.free_surface):
            known = surface[i] != wp.uint8(INSIDE)
        matrix_counts[i] = wp.int16(0)
        matrix_diagonal[i] = real(1.0)
        matrix_moment[i] = mat()
        unknown[i] = real(0.0)
        source[i] = real(0.0)
        if known:
            return
        xi, vi = position[i], velocity_star[i]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        share = rest_volume[i] / params.wall_volume
        weight = real(-2.0) * params.g_norm * share / phases[0].density
        moment = mat()
        diagonal = real(0.0)
        divergence = real(0.0)
        count = int(0)
        entry = row_begin(i, matrix_width)
        row_step = row_stride(fluid_count)
        k, step = list_begin(i, list_width), list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & wp.static((1 << image_bit) - 1)
                if not has_image(position[j], code, sides, params.h):
                    continue
            vj = velocity_star[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = reversed_velocity(vj, code, sides)
            d = apart(xi, position[j], code, wrapped, params, sides)
            r2 = wp.dot(d, d)
            f = slope(wp.sqrt(r2) * params.inv_h) * rest_volume[j]
            divergence += f * wp.dot(vj - vi, d)
            w = weight * printed_laplacian(f, r2, params.h)
            inside = j != i and w > real(0.0)  # the image of a particle in its own row cancels out
            if wp.static(spec.free_surface):
                if surface[j] != wp.uint8(INSIDE):
                    inside = False
                    diagonal += w  # p = 0 there
            if inside:
                diagonal += w
                moment += wp.outer(d, (real(0.5) * w) * d)
                put_column(matrix_columns, i, entry, j)
                put_value(matrix_values, i, entry, -w)
                entry += row_step
                count += 1
        matrix_counts[i] = wp.int16(count)
        matrix_moment[i] = moment
        if diagonal > real(0.0):
            matrix_diagonal[i] = diagonal
            unknown[i] = pressure[i]
            source[i] = divergence * (-share * params.g_norm / real(clock[STEP]))

    return printed_assemble


@functools.cache
def make_printed_accept(spec: Spec) -> Any:
    """Return the kernel that takes the solution as pressure, 0 at the surface."""
    real, _, _, pair = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def printed_accept(
        first: int,
        unknown: wp.array(dtype=real),
        rest_volume: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
        state: wp.array(dtype=pair),
    ):
        i = wp.tid() + first
        pressure[i] = unknown[i]
        state[i] = pair(unknown[i], rest_volume[i])

    return printed_accept


@functools.cache
def make_printed_correct(spec: Spec) -> Any:
    """Return the sweep of eq (15): velocity of the end of the step."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    apart, has_image = make_images(spec).apart, make_has_image(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    image_bit = code_shift(spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_correct(
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
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
        velocity_star: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        xi = position[i]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        total = vec()
        k, step = list_begin(i, list_width), list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & wp.static((1 << image_bit) - 1)
                if not has_image(position[j], code, sides, params.h):
                    continue
            d = apart(xi, position[j], code, wrapped, params, sides)
            total += (slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * rest_volume[j] * (pressure[i] + pressure[j])) * d
        old = velocity[i]
        new = velocity_star[i] - total * (real(clock[STEP]) * params.g_norm / phases[0].density)
        velocity_old[i] = old
        velocity[i] = new
        a = (new - old) / real(clock[STEP])
        acceleration[i] = a
        v2, a2 = wp.dot(new, new), wp.dot(a, a)
        if v2 > maxima[slot * MAXIMA]:
            wp.atomic_max(maxima, slot * MAXIMA, v2)
        if a2 > maxima[slot * MAXIMA + 1]:
            wp.atomic_max(maxima, slot * MAXIMA + 1, a2)

    return printed_correct


@functools.cache
def make_printed_shift(spec: Spec) -> Any:
    """Return the sweep of eqs (20), (21): the shift of the coming step, of places alone; and the divergence left over."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    apart, reversed_velocity = make_images(spec).apart, make_images(spec).friction_velocity
    has_image = make_has_image(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    image_bit = code_shift(spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_shift(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        dilation: wp.array(dtype=real),
        dilation_old: wp.array(dtype=real),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        xi, vi = position[i], velocity[i]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        divergence = real(0.0)
        distances = real(0.0)
        count = real(0.0)
        direction = vec()  # sum of n_ab/r^2, n_ab from b to a
        k, step = list_begin(i, list_width), list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & wp.static((1 << image_bit) - 1)
                if not has_image(position[j], code, sides, params.h):
                    continue
            vj = velocity[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = reversed_velocity(vj, code, sides)
            d = apart(xi, position[j], code, wrapped, params, sides)
            r = wp.sqrt(wp.dot(d, d) + params.tiny)
            f = slope(r * params.inv_h)
            divergence += f * rest_volume[j] * wp.dot(vj - vi, d)
            if r < params.h:  # the nearest ones; over all of them the sum has no limit
                distances += r
                count += real(1.0)
                direction += d / (r * r * r)
        dilation_old[i] = dilation[i]
        dilation[i] = divergence * params.g_norm
        if wp.static(spec.shifting):
            mean = distances / wp.max(count, real(1.0))
            dx = direction * (params.shifting * real(clock[STEP] * clock[SPEED]) * mean * mean)
            shift[i] = dx
            carried[i] = vec()
            s2 = wp.dot(dx, dx)
            if s2 > maxima[slot * MAXIMA + 3]:
                wp.atomic_max(maxima, slot * MAXIMA + 3, s2)

    return printed_shift
