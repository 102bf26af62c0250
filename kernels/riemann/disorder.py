"""Friction of disorder: evens what velocities of neighbours differ by beyond their gradients (theory: riemann#disorder).

    a_i = (rho0/rho_i) sum_j b_ij [(v_ij - (G_i + G_j)/2 x_ij).e_ij] x_ij F_ij V_j,   b_ij = (b_i + b_j)/2
    b_i = max(A |G_i| h - 6 nu/h, 0), at most c/5; beside no-slip walls 60 nu/h

over the own phase, e the unit vector of the pair, G the velocity gradient, A `numerics.disorder_friction`. A linear flow
feels nothing of it on any arrangement, a smooth one at fourth order in h, disordered particles all of it. Pairs exchange
momentum along their line. Every fourth step finds it, and each of the four has it.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import STEPS
from warpsph.kernels.core.lanes import lanes_of
from warpsph.kernels.core.pair import list_access, make_at, make_element, make_part, way_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of

from .body_flow import SMALLEST_MOMENT

# What it takes from velocities that know nothing of each other is b <r>/(2 d nu) of what the viscosity takes,
# <r> = sum |F| r V / sum |F| V = 2h/3 in 2-D and 6h/7 in 3-D (Wendland C2): as much at b = 6 and 7 nu/h.
AS_VISCOUS = 6.0
# How much more is taken off within reach of a no-slip wall. A gradient of one side is off by half of what the flow bends
# over h, which is no disorder: where the layer at the wall is resolved, |G| h^2 < 15 nu, it is left alone.
RESOLVED = 10.0
# Of the sound speed: a step of h/(2c) then takes up to a quarter of what velocities differ by from one particle to the next.
FASTEST = 0.2
UNKNOWN = -1.0  # b of particles whose neighbours leave the gradient open; they take no part


# Steps that it is held for: the most that it may take of a difference in one, a quarter, so often is all of it.
HELD = 4


@functools.cache
def make_disorder_due(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s (due(counters), near(counters)): a step finds the friction anew, or the one after it does.

    Without it in a `Spec` none does. The first step does, and has gradients of the start.
    """

    @wp.func
    def due(counters: wp.array(dtype=int)):
        if wp.static(spec.disorder):
            return counters[STEPS] % HELD == 0
        return False

    @wp.func
    def near(counters: wp.array(dtype=int)):
        if wp.static(spec.disorder):
            return counters[STEPS] == 0 or (counters[STEPS] + 1) % HELD == 0
        return False

    return due, near


@functools.cache
def make_disorder_speed(spec: Spec) -> Any:
    """Return the `wp.func` disorder_speed(G, clings, params, phase) -> b [m/s], beside a no-slip wall or not."""
    real, _, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)

    @wp.func
    def disorder_speed(gradient: mat, clings: bool, params: Params, own: Phase):
        turning = params.disorder * wp.sqrt(wp.ddot(gradient, gradient)) * params.h
        viscous = real(AS_VISCOUS) * own.viscosity / (own.density * params.h)
        if clings:
            viscous *= real(RESOLVED)
        return wp.clamp(turning - viscous, real(0.0), real(FASTEST) * own.sound_speed)

    return disorder_speed


@functools.cache
def make_own_gradient(spec: Spec) -> Any:
    """Return the `wp.func` own_gradient(i, ...) -> (G, whether the neighbours say it), of the own phase without walls."""
    real, vec, mat, pair = types_of(spec)
    Params, slope = make_params(spec.dimension, spec.precision), make_smoothing(spec.kernel, spec.precision)[1]
    way, part, part_of_pair = way_of(spec), make_part(vec), make_part(pair)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    _, _, part_of, added = lanes_of(spec, mat)

    @wp.func
    def own_gradient(
        i: int,
        lane: int,
        list_width: int,
        particle_count: int,
        wrapped: bool,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
    ):
        x, v, d = position[i], velocity[i], vec()
        flow, moment = mat(), mat()  # sums of (v_j - v_i) (x) F V x_ij and of -x_ij (x) F V x_ij
        own_phase = wp.int8(0)
        if wp.static(spec.multiphase):
            own_phase = phase[i]
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            r2 = real(0.0)
            for axis in range(wp.static(spec.dimension)):
                d[axis] = way(x[axis], part(position, j, axis), axis, wrapped, params)
                r2 += d[axis] * d[axis]
            f = slope(wp.sqrt(r2) * params.inv_h) * part_of_pair(state, j, 1)
            if wp.static(spec.multiphase):
                f = wp.where(phase[j] == own_phase, f, real(0.0))
            for a in range(wp.static(spec.dimension)):
                for b in range(wp.static(spec.dimension)):
                    flow[a, b] += (part(velocity, j, a) - v[a]) * (f * d[b])
                    moment[a, b] -= d[a] * (f * d[b])
        if wp.static(spec.lanes > 1):
            flow, moment = added(flow), added(moment)
        m = moment * params.g_norm
        if wp.determinant(m) > real(SMALLEST_MOMENT):
            return (flow * params.g_norm) * wp.inverse(m), True
        return mat(), False

    return own_gradient


@functools.cache
def make_disorder_friction(spec: Spec) -> Any:
    """Return the `wp.func` disorder_friction(i, ...): the acceleration that it is."""
    real, vec, mat, pair = types_of(spec)
    Params, slope = make_params(spec.dimension, spec.precision), make_smoothing(spec.kernel, spec.precision)[1]
    way, part, part_of_pair = way_of(spec), make_part(vec), make_part(pair)
    at, element = make_at(real), make_element(mat)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    _, _, part_of, added = lanes_of(spec, vec)

    @wp.func
    def disorder_friction(
        i: int,
        lane: int,
        list_width: int,
        particle_count: int,
        wrapped: bool,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        speeds: wp.array(dtype=real),
        gradients: wp.array(dtype=mat),
    ):
        x, v, own, gradient, d, total = position[i], velocity[i], speeds[i], gradients[i], vec(), vec()
        own_phase = wp.int8(0)
        if wp.static(spec.multiphase):
            own_phase = phase[i]
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin
        if own >= real(0.0):
            end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            r2, beyond = real(0.0), real(0.0)
            for axis in range(wp.static(spec.dimension)):
                d[axis] = way(x[axis], part(position, j, axis), axis, wrapped, params)
                r2 += d[axis] * d[axis]
                beyond += (v[axis] - part(velocity, j, axis)) * d[axis]
            for a in range(wp.static(spec.dimension)):
                for b in range(wp.static(spec.dimension)):
                    beyond -= real(0.5) * (gradient[a, b] + element(gradients, j, a, b)) * d[a] * d[b]
            r, other = wp.sqrt(r2), at(speeds, j)
            f = slope(r * params.inv_h) * part_of_pair(state, j, 1)
            push = f * (real(0.5) * (own + other)) * beyond / wp.where(r > real(0.0), r, real(1.0))
            push = wp.where(other >= real(0.0), push, real(0.0))
            if wp.static(spec.multiphase):
                push = wp.where(phase[j] == own_phase, push, real(0.0))
            for axis in range(wp.static(spec.dimension)):
                total[axis] += push * d[axis]
        if wp.static(spec.lanes > 1):
            total = added(total)
        return total * (params.g_norm * state[i][1] / rest_volume[i])

    return disorder_friction
