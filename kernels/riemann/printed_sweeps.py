"""Continuity and momentum sweep as Yang et al. 2019 print them, eqs (13), (25) to (27) (theory: printed#yang; seed 000).

    d rho_i/dt = 2 rho_i sum_j (v_i - v*_ij).grad_i W V_j
    dv_i/dt = -(2/rho_i) sum_j P*_ij grad_i W V_j + (sigma/rho_i) kappa_i n_i
              - (zeta/rho_i) sum_other (|p_i| + |p_j|) grad_i W V_j + g

All pairs alike, of one phase and of two, and none of what the default form adds. Walls are the one-sided problem of (17),
(18), a state of its own for each pair of a fluid and a wall particle.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import MAXIMA, STEP
from warpsph.kernels.core.eos import make_eos
from warpsph.kernels.core.pair import WRAPPED, list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NEXT, GRAVITY_NOW, make_forcing

from .printed_pair import make_printed_states, make_printed_wall


@functools.cache
def make_slip_normal(spec: Spec) -> Any:
    """Return the `wp.func` slip_normal(...): unit normal of the free-slip walls in reach, zero where there are none."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    _, _, neighbour, Listed = list_access(spec)

    @wp.func
    def slip_normal(
        i: int, first: int, end: int, step: int, fluid_count: int, x: vec, wrapped: bool, params: Params,
        neighbours: Listed, position: wp.array(dtype=vec), slip: wp.array(dtype=wp.uint8),
    ):  # fmt: skip
        total = vec()
        k = first
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            slips = bool(True)
            if wp.static(spec.wall_no_slip):
                slips = slip[j - fluid_count] != wp.uint8(0)
            if slips:
                d = separation(x, position[j], wrapped, params)
                total += slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * d
        return wp.normalize(total)

    return slip_normal


@functools.cache
def make_printed_continuity(spec: Spec) -> Any:
    """Return the sweep of eq (13): reads the old state, writes density excess and new state."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    eos = make_eos(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    printed_velocity, _ = make_printed_states(spec.dimension, spec.precision)
    wall_excess, reflected_velocity = make_printed_wall(spec.dimension, spec.precision)
    slip_normal = make_slip_normal(spec)
    gravity_of, _ = make_forcing(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_continuity(
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
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        midway: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        state_old: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        density_excess: wp.array(dtype=real),
        state: wp.array(dtype=pair),
    ):
        i = wp.tid() + first
        xi, vi = midway[i], velocity[i]
        p_i = state_old[i][0]
        own = phases[0]
        if wp.static(spec.multiphase):
            own = phases[int(phase[i])]
        rho_i = own.density * rest_volume[i] / state_old[i][1]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        rate = real(0.0)  # sum of (u_i - u*) F r V_j
        k, step = list_begin(i, list_width), list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, midway[j], wrapped, params)
            r = wp.sqrt(wp.dot(d, d) + params.tiny)
            other = own
            if wp.static(spec.multiphase):
                other = phases[int(phase[j])]
            rho_j = other.density * rest_volume[j] / state_old[j][1]
            u_i, u_j = -wp.dot(vi, d) / r, -wp.dot(velocity[j], d) / r
            dp = params.dissipation * (p_i - state_old[j][0])
            u_star = printed_velocity(u_i, u_j, dp, rho_i, rho_j, own.sound_speed, other.sound_speed)
            rate -= (u_i - u_star) * r * slope(r * params.inv_h) * state_old[j][1]
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            normal = slip_normal(i, k, end, step, fluid_count, xi, wrapped, params, neighbours, position, slip)
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, position[j], wrapped, params)
                r = wp.sqrt(wp.dot(d, d) + params.tiny)
                p_j = p_i
                if wp.static(spec.gravity):
                    p_j -= rho_i * wp.dot(gravity_of(params, forcing, GRAVITY_NOW), d)
                s_j = wall_excess(p_j - own.background, own.stiffness, own.gamma)
                slips = bool(True)
                if wp.static(spec.wall_no_slip):
                    slips = slip[j - fluid_count] != wp.uint8(0)
                u_i = -wp.dot(vi, d) / r
                u_j = -wp.dot(reflected_velocity(vi, velocity[j], normal, slips), d) / r
                u_star = printed_velocity(
                    u_i, u_j, params.dissipation * (p_i - p_j), rho_i, own.density * (real(1.0) + s_j),
                    own.sound_speed, own.sound_speed,
                )  # fmt: skip
                volume = params.wall_volume / (real(1.0) + s_j)
                rate -= (u_i - u_star) * r * slope(r * params.inv_h) * volume
        s = density_excess[i]
        s += real(clock[STEP]) * (real(1.0) + s) * real(2.0) * params.g_norm * rate
        density_excess[i] = s
        state[i] = pair(eos(s, own.stiffness, own.gamma) + own.background, rest_volume[i] / (real(1.0) + s))

    return printed_continuity


@functools.cache
def make_printed_momentum(spec: Spec) -> Any:
    """Return the sweep of eq (27): writes the acceleration."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    _, printed_pressure = make_printed_states(spec.dimension, spec.precision)
    wall_excess, reflected_velocity = make_printed_wall(spec.dimension, spec.precision)
    slip_normal = make_slip_normal(spec)
    gravity_of, body_force_of = make_forcing(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_momentum(
        first: int,
        slot: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        tension: wp.array(dtype=real),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        state: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        normal: wp.array(dtype=vec),
        curvature: wp.array(dtype=real),
        acceleration: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        xi, vi = position[i], velocity[i]
        p_i = state[i][0]
        own = phases[0]
        own_phase, other_phase = int(0), int(0)
        if wp.static(spec.multiphase):
            own_phase = int(phase[i])
            other_phase = own_phase
            own = phases[own_phase]
        rho_i = own.density * rest_volume[i] / state[i][1]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        total = vec()  # sum of 2 P* F V_j x_ij, with the interface force
        beside = int(own_phase)  # another phase within the support, its own where there is none
        k, step = list_begin(i, list_width), list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], wrapped, params)
            r = wp.sqrt(wp.dot(d, d) + params.tiny)
            f = slope(r * params.inv_h) * state[j][1]
            other = own
            if wp.static(spec.multiphase):
                other_phase = int(phase[j])
                other = phases[other_phase]
            closing = -wp.dot(vi - velocity[j], d) / r
            p_star = printed_pressure(p_i, state[j][0], own.viscosity, other.viscosity, closing, params.inv_h)
            total += (real(2.0) * p_star * f) * d
            if wp.static(spec.multiphase):
                if other_phase != own_phase and f < real(0.0):
                    beside = other_phase
                    if wp.static(spec.interface_force):
                        total += (params.zeta * (wp.abs(p_i) + wp.abs(state[j][0])) * f) * d
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            towards = slip_normal(i, k, end, step, fluid_count, xi, wrapped, params, neighbours, position, slip)
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, position[j], wrapped, params)
                r = wp.sqrt(wp.dot(d, d) + params.tiny)
                p_j = p_i
                if wp.static(spec.gravity):
                    p_j -= rho_i * wp.dot(gravity_of(params, forcing, GRAVITY_NEXT), d)
                s_j = wall_excess(p_j - own.background, own.stiffness, own.gamma)
                slips = bool(True)
                if wp.static(spec.wall_no_slip):
                    slips = slip[j - fluid_count] != wp.uint8(0)
                closing = -wp.dot(vi - reflected_velocity(vi, velocity[j], towards, slips), d) / r
                p_star = printed_pressure(p_i, p_j, own.viscosity, own.viscosity, closing, params.inv_h)
                volume = params.wall_volume / (real(1.0) + s_j)
                total += (real(2.0) * p_star * slope(r * params.inv_h) * volume) * d
        a = total * (-params.g_norm / rho_i)
        if wp.static(spec.tension != "none"):
            if beside != own_phase:
                # on the particles within 2 h of the interface alone
                a += normal[i] * (tension[own_phase * phases.shape[0] + beside] * curvature[i] / rho_i)
        if wp.static(spec.gravity):
            a += gravity_of(params, forcing, GRAVITY_NEXT)
        if wp.static(spec.body_force):
            a += body_force_of(params, forcing)
        if wp.static(spec.central_force):
            a -= params.pull * (xi - params.center)
        acceleration[i] = a
        a2 = wp.dot(a, a)
        if a2 > maxima[slot * MAXIMA + 1]:
            wp.atomic_max(maxima, slot * MAXIMA + 1, a2)

    return printed_momentum
