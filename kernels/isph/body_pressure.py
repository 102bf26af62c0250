"""Bodies in projection ISPH: the velocity that they see, and their part in the pressure equation (theory: isph#bodies)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import SPEED, STEP
from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types, types_of
from warpsph.kernels.core.weights import make_weights

from .surface import INSIDE

STALE = 0.1  # farthest that the pressure which is remembered may lie behind the particle, over h


@functools.cache
def make_remember_walls(spec: Spec) -> Any:
    """Return the kernel over wall particles that keeps their velocities at the start of the step and of that before."""
    _, vec, _, _ = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def remember_walls(
        first: int,
        fluid_count: int,
        velocity: wp.array(dtype=vec),
        wall_before: wp.array(dtype=vec),
        wall_before_old: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        wall_before_old[w] = wall_before[w]
        wall_before[w] = velocity[w + fluid_count]

    return remember_walls


@functools.cache
def make_look_ahead(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels over fluid and walls that extrapolate the velocity to the end of the step.

    Those of walls are extrapolated as those of the fluid that goes with them, so that differences between them and fits know
    no acceleration of a wall. `wall_jump` is what the velocity of the wall is beyond that: pressure adds it to the fluid.
    """
    real, vec, _, _ = types_of(spec)
    time_weights = make_weights(spec.second_order)

    @wp.kernel(module="unique", enable_backward=False)
    def look_ahead(
        first: int,
        clock: wp.array(dtype=wp.float64),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        velocity_ahead: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        v = velocity[i]
        velocity_ahead[i] = v + (v - velocity_old[i]) * real(time_weights(clock)[3])

    @wp.kernel(module="unique", enable_backward=False)
    def walls_ahead(
        first: int,
        fluid_count: int,
        clock: wp.array(dtype=wp.float64),
        velocity: wp.array(dtype=vec),
        wall_before: wp.array(dtype=vec),
        wall_before_old: wp.array(dtype=vec),
        wall_jump: wp.array(dtype=vec),
        velocity_ahead: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        v = velocity[w + fluid_count]
        if wp.static(spec.moving):
            ahead = wall_before[w] + (wall_before[w] - wall_before_old[w]) * real(time_weights(clock)[3])
            wall_jump[w] = v - ahead
            v = ahead
        velocity_ahead[w + fluid_count] = v

    return look_ahead, walls_ahead


@functools.cache
def make_friction_rate(precision: str) -> Any:
    """Return the `wp.func` friction_rate(h, phase) = nu/h^2, at which friction takes what is as short as h [1/s]."""
    real = types(2, precision).real
    Phase = make_phase(precision)

    @wp.func
    def friction_rate(h: real, phase: Phase):
        return phase.viscosity / (phase.density * h * h)

    return friction_rate


@functools.cache
def make_memory(dimension: int, precision: str) -> Any:
    """Return the `wp.func` memory(reach, clock, params, phase): steps that a pressure beside bodies is remembered for.

    beta dt nu/h^2, `reach` being beta dt [s], but no more than it takes the fastest particle to go STALE times h: what a
    particle remembers is the pressure of where it was (theory: isph#bodies).
    """
    real = types(2, precision).real
    Params = make_params(dimension, precision)
    Phase = make_phase(precision)
    friction_rate = make_friction_rate(precision)

    @wp.func
    def memory(reach: real, clock: wp.array(dtype=wp.float64), params: Params, phase: Phase):
        steps = reach * friction_rate(params.h, phase)
        way = real(clock[SPEED] * clock[STEP])  # of the fastest particle in a step [m]
        if steps * way > real(STALE) * params.h:
            steps = real(STALE) * params.h / way
        return steps

    return memory


@functools.cache
def make_room_of_walls(spec: Spec) -> Any:
    """Return the `wp.func` that sums (1 - r^2/R^2)^2 V over the wall particles of bodies in the list of particle i [m^d].

    `k` is where they begin in the list.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    _, list_step, neighbour, Listed = list_access(spec)

    @wp.func
    def room_of_walls(
        i: int,
        k: int,
        wall_neighbours: wp.array(dtype=wp.int16),
        particle_count: int,
        params: Params,
        neighbours: Listed,
        position: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
    ):
        room = real(0.0)
        step = list_step(particle_count)
        for number in range(int(wall_neighbours[i])):
            j = neighbour(neighbours, i, k + number * step)
            d = separation(position[i], position[j], True, params)
            core = wp.max(real(1.0) - wp.dot(d, d) * params.inv_window, real(0.0))
            room += core * core * boundary_volume[j - (particle_count - boundary_volume.shape[0])]
        return room

    return room_of_walls


@functools.cache
def make_body_source(spec: Spec) -> Any:
    """Return the sweep that adds the walls of bodies to the right-hand side of the pressure equation.

    A wall particle has the velocity continued through the surface; what the step adds to the velocity is that of the fluid
    particle, reversed across the wall.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    time_weights = make_weights(spec.second_order)
    memory = make_memory(spec.dimension, spec.precision)
    dimension = float(spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def body_source(
        first: int,
        particle_count: int,
        list_width: int,
        deferred: real,
        params: Params,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        surface: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity_ahead: wp.array(dtype=vec),
        velocity_star: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        boundary_volume: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        mirror_velocity: wp.array(dtype=vec),
        wall_jump: wp.array(dtype=vec),
        lasting_gradient: wp.array(dtype=vec),
        correction: wp.array(dtype=mat),
        spread: wp.array(dtype=real),
        source: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        if wall_neighbours[i] == wp.int16(0):
            return
        if wp.static(spec.free_surface):
            if surface[i] != wp.uint8(INSIDE):
                return
        rho = phases[0].density
        reach = real(time_weights(clock)[2] * clock[STEP])
        number = memory(reach, clock, params, phases[0])
        shared = (number + deferred) / (real(1.0) + number)
        ahead = velocity_ahead[i]
        jump = shared * lasting_gradient[i] - (velocity_star[i] - ahead) * (rho / reach)
        xi = position[i]
        flow = mat()
        right = real(0.0)
        step = list_step(particle_count)
        k = list_begin(i, list_width) + int(fluid_neighbours[i]) * step
        end = k + int(wall_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            b = j - (particle_count - boundary_volume.shape[0])
            n = wall_normal[b]
            d = separation(xi, position[j], True, params)
            f = slope(wp.length(d) * params.inv_h) * boundary_volume[b] * params.g_norm
            flow += wp.outer(mirror_velocity[b] - ahead, f * d)
            across = wp.dot(jump, n)
            if wp.static(spec.moving):
                across += wp.dot(wall_jump[b], n) * (rho / reach)
            right -= real(2.0) / rho * f * across * wp.dot(d, n)
        right -= spread[i] / real(dimension) * wp.trace(flow * correction[i]) / reach
        source[i] = source[i] + rest_volume[i] / params.wall_volume * right

    return body_source
