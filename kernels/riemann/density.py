"""Continuity sweep: density from star velocities, then pressure and volume (theory: riemann#a2, riemann#a3; seed 000 eq 13).

    ds_i/dt = 2 (1+s_i) sum_j (v_i - v*_ij).grad_i W V_j,   s = rho/rho0 - 1

Walls have their own velocity, and the rate is divided by the share that it has of a compression (theory: delta#d6).
Beside bodies in filled scenes (`linear`) it is exact for a linear velocity and pressure on any arrangement.

Where sound is damped the pressure has alpha rho0 c h times that rate, less what pressure differences have in it.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import STEP
from warpsph.kernels.core.eos import make_eos
from warpsph.kernels.core.fields import FLUID
from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import NEAR, WRAPPED, list_access, look_ahead, make_at, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.sound_damping import make_damping
from warpsph.kernels.core.spec import Spec, curvature_type, pair_sweep, types, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NOW, make_forcing
from warpsph.kernels.core.viscosity import make_interface_stress
from warpsph.kernels.core.wall_share import make_cell_rate

from .body_flow import make_body_flow
from .disorder import make_disorder_due, make_disorder_friction
from .interface_flow import make_density_between
from .meeting_phases import make_parts_jump
from .own_pairs import make_own_rates
from .star import make_carried, make_jump, make_star

PRESSED = 1.1  # density over that at rest from which on the impedance follows it
SPARSE = 0.4  # of the dimension, which -sum F V r^2 is inside a fluid: fewer neighbours than a particle on a surface has
STIFFEST = 1.5  # rate, over a step, at which the pressure of a particle may follow that of its neighbours


@functools.cache
def make_state(spec: Spec) -> Any:
    """Return the kernel that evaluates pressure and volume of the fluid from the density excess."""
    real, vec, _, pair = types_of(spec)
    Phase = make_phase(spec.precision)
    eos = make_eos(spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def state_from_density(
        first: int,
        phases: wp.array(dtype=Phase),
        phase: wp.array(dtype=wp.int8),
        density_excess: wp.array(dtype=real),
        rest_volume: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        state_old: wp.array(dtype=pair),
    ):
        i = wp.tid() + first
        own = phases[0]
        if wp.static(spec.multiphase):
            own = phases[int(phase[i])]
        s = density_excess[i]
        both = pair(eos(s, own.stiffness, own.gamma) + own.background, rest_volume[i] / (real(1.0) + s))
        state[i] = both
        state_old[i] = both

    return state_from_density


@functools.cache
def make_hardening(precision: str) -> Any:
    """Return the `wp.func` hardening(pressed, gamma) -> (stiffness, mobility), both over those at rest.

    A gas that is pressed is stiffer by (1+s)^gamma, and its impedance rho c is larger by the power (gamma+1)/2: with the
    impedance at rest the pressures of neighbours would overshoot each other. A few per cent do not count.
    """
    real = types(2, precision).real

    @wp.func
    def hardening(pressed: real, gamma: real):
        hardened, softened = real(1.0), real(1.0)
        if pressed > real(1.0):
            hardened = wp.pow(pressed, gamma)
            softened = wp.pow(pressed, real(-0.5) * (gamma + real(1.0)))
        return hardened, softened

    return hardening


@functools.cache
def make_bounded(precision: str) -> Any:
    """Return the `wp.func` bounded(rate, stiffness, alone, own): the rate of the pressures that other phases have a part in.

    A heavy particle among light ones takes their pressure at up to twice the rate of one among its own, c sum |W'| V.
    Forward Euler bears 2 in a step: what is beyond three quarters of that, and beyond the rate that it would have among its
    own, is left out. stiffness, alone, own: rates times step at which its pressure follows that of others, would follow its
    own phase everywhere, and follows its own phase.
    """
    real = types(2, precision).real

    @wp.func
    def bounded(rate: real, stiffness: real, alone: real, own: real):
        allowed = wp.max(real(STIFFEST) - own, alone)
        if stiffness > allowed:
            return rate * (allowed / stiffness)
        return rate

    return bounded


@functools.cache
def make_evenly(spec: Spec) -> Any:
    """Return the `wp.func` evenly(stiffness, params): the share of the rate of pressure differences that crowded fluid has.

    The pressure of a particle follows that of its neighbours at the rate c sum |grad W| V. Forward Euler bears 2 of it in a
    step: at the usual step an even lattice has 1.1 in 2-D and 1.5 in 3-D. Where a splash has pressed more particles together
    than their densities say, what is beyond the rate of the lattice is left out (theory: riemann#evenly).
    """
    real = types_of(spec).real
    Params = make_params(spec.dimension, spec.precision)

    @wp.func
    def evenly(stiffness: real, params: Params):
        slope = stiffness * params.g_norm
        if slope > params.even_slope:
            return params.even_slope / slope
        return real(1.0)

    return evenly


@functools.cache
def make_remembered(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s (followed(i, room_part), remembered(s, crowd, i, thin)) of what no velocity tells.

    followed: rate [1/s] at which the density follows the room of the particles; remembered: the density excess without what
    spray remembers. With hardly a fluid neighbour (`crowd`, d inside a fluid) a density below rest is memory, not tension,
    and would draw spray into walls; in thin fluid away from walls any is: what it was pressed to would keep it apart as it
    does a gas, a tension would draw it together.
    """
    real = types_of(spec).real
    spray, roomy = spec.free_surface and not spec.multiphase, spec.surface_room

    @wp.func
    def followed(i: int, room_part: wp.array(dtype=real)):
        if wp.static(roomy):
            return room_part[i]
        return real(0.0)

    @wp.func
    def remembered(s: real, crowd: real, i: int, thin: wp.array(dtype=wp.int8)):
        result = s
        if wp.static(spray):
            if crowd < real(wp.static(SPARSE * spec.dimension)):
                result = wp.max(result, real(0.0))
        if wp.static(roomy):
            if thin[i] != wp.int8(0):
                result = real(0.0)
        return result

    return followed, remembered


@functools.cache
def make_continuity(spec: Spec) -> Any:
    """Return the continuity sweep of a `Spec`: reads the old state, writes density excess and new state."""
    real, vec, mat, pair = types_of(spec)
    Params, Phase = make_params(spec.dimension, spec.precision), make_phase(spec.precision)
    eos, slope = make_eos(spec.precision), make_smoothing(spec.kernel, spec.precision)[1]
    (list_begin, list_step, _, Listed), (look, taken, onward) = list_access(spec), look_ahead(spec)
    (star_velocity, _), density_between = make_star(spec.precision, spec.paper_star), make_density_between(spec)
    laplace_jump, carried = make_jump(spec.precision), make_carried(spec.dimension, spec.precision)
    parts_jump, curved, damps = make_parts_jump(spec), curvature_type(spec), spec.acoustic_damping
    hardening, bounded, damping = make_hardening(spec.precision), make_bounded(spec.precision), make_damping(spec)
    (gravity_of, _), separation, at_vec, at_pair = make_forcing(spec), separation_of(spec), make_at(vec), make_at(pair)
    periodic, jumps = any(spec.periodic), spec.tension == "pressure_jump" and not spec.triple
    spray, sided = spec.free_surface and not spec.multiphase, spec.multiphase and not spec.paper_star
    _, stress_jump = make_interface_stress(spec.dimension, spec.precision)
    (followed, remembered), (due_now, _) = make_remembered(spec), make_disorder_due(spec)
    (_, own_rates), uneven = make_own_rates(spec), make_disorder_friction(spec)
    particle_of, lane_of, part_of, added = lanes_of(spec, real)
    with_bodies, with_cells, evenly = make_body_flow(spec), make_cell_rate(spec), make_evenly(spec)

    @wp.kernel(**pair_sweep(spec))
    def continuity(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        tension: wp.array(dtype=real),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        velocity_gradient: wp.array(dtype=mat),
        gradient_at_interface: wp.array(dtype=mat),
        facing: wp.array(dtype=vec),
        interface_depth: wp.array(dtype=real),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        midway: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state_old: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        boundary_volume: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        pressure_gradient: wp.array(dtype=vec),
        curvature: wp.array(dtype=curved),
        interface_weight: wp.array(dtype=curved),
        density_excess: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        zone: wp.array(dtype=wp.int8),
        flow_gradient: wp.array(dtype=mat),
        disorder_speed: wp.array(dtype=real),
        disorder_force: wp.array(dtype=vec),
        room_part: wp.array(dtype=real),
        thin: wp.array(dtype=wp.int8),
        slip: wp.array(dtype=wp.uint8),
        wall_sides: wp.array(dtype=wp.uint8),
        wall_normal: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        inertia: wp.array(dtype=vec),
        counters: wp.array(dtype=int),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        xi, vi, p_i = midway[i], velocity[i], state_old[i][0]
        own_phase = int(0)
        if wp.static(spec.multiphase):
            own_phase = int(phase[i])
        own = phases[own_phase]
        wrapped, near = bool(False), bool(False)
        if wp.static(periodic or spec.multiphase):
            wrapped, near = (int(flags[i]) & WRAPPED) != 0, (int(flags[i]) & NEAR) != 0
        inv_z = own.mobility  # a quotient here would be pushed into the pair loop by the compiler
        hardened, softened = real(1.0), real(1.0)
        if wp.static(spec.dissipation and spec.multiphase):
            hardened, softened = hardening(rest_volume[i] / (state_old[i][1] * real(PRESSED)), own.gamma)
            inv_z *= softened
        # the rate; its parts from pressure differences beneath a free surface or where sound is damped, and to other phases
        rate, blur, evening = real(0.0), real(0.0), real(0.0)
        # its derivative by the own pressure, over c_i; what it would be among the own phase; that of pairs of that
        stiffness, plain_stiffness, own_stiffness = real(0.0), real(0.0), real(0.0)
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        ahead = look(neighbours, i, k, end)
        if wp.static(spec.multiphase):
            if near:
                kappa_i, w_i = real(0.0), real(0.0)
                if wp.static(jumps):
                    kappa_i, w_i = real(curvature[i]), real(interface_weight[i])
                while k < end:
                    j = taken(ahead, neighbours, i, k)
                    k, ahead = onward(neighbours, i, k, step, end)
                    d = separation(xi, at_vec(midway, j), wrapped, params)
                    r = wp.sqrt(wp.dot(d, d))
                    state_j = at_pair(state_old, j)
                    f = slope(r * params.inv_h) * state_j[1]
                    dp = p_i - state_j[0]
                    other_phase = int(phase[j])
                    if other_phase == own_phase:
                        if wp.static(spec.gravity):
                            dp -= own.density * wp.dot(gravity_of(params, forcing, GRAVITY_NOW), d)
                        term = wp.dot(vi - at_vec(velocity, j), d)
                        if wp.static(spec.dissipation):
                            term += dp * r * inv_z
                        if wp.static(sided):
                            own_stiffness -= f * r
                        rate += f * term
                    else:
                        other = phases[other_phase]
                        if wp.static(spec.gravity):
                            rho_ij = real(0.5) * (own.density + other.density)
                            if wp.static(sided):
                                rho_ij = density_between(i, j, facing, interface_depth, own.density, other.density)
                            dp -= rho_ij * wp.dot(gravity_of(params, forcing, GRAVITY_NOW), d)
                        if wp.static(spec.triple):
                            dp -= parts_jump(tension, own_phase, other_phase, curvature, interface_weight, i, j)
                        elif wp.static(jumps):
                            sigma = tension[own_phase * phases.shape[0] + other_phase]
                            dp -= laplace_jump(sigma, kappa_i, curvature[j], w_i, interface_weight[j])
                        if wp.static(spec.viscous_jump):
                            thick = wp.where(own.viscosity > other.viscosity, i, j)
                            dp -= stress_jump(own.viscosity, other.viscosity, gradient_at_interface[thick], facing[thick])
                        inv_r = real(1.0) / wp.max(r, real(1.0e-6) * params.h)
                        u_i, u_j = -wp.dot(vi, d) * inv_r, -wp.dot(at_vec(velocity, j), d) * inv_r
                        driving = params.dissipation * dp
                        if wp.static(sided):
                            # what drives the pressures of the two together is kept apart: it may not overshoot
                            both = own.resistance + other.resistance
                            evening += real(2.0) * f * r * driving / both
                            stiffness -= real(2.0) * f * r * own.impedance / both
                            plain_stiffness -= f * r
                            driving = real(0.0)
                        u_star = star_velocity(u_i, u_j, own.density, other.density, own.impedance, other.impedance, driving)
                        if wp.static(sided):
                            # what the weights leave out, from the own phase of the denser particle (`interface_flow`)
                            dense = wp.where(own.density < other.density, j, i)
                            u_star += carried(own.density, other.density, velocity_gradient[dense], d) * inv_r
                        rate += real(2.0) * f * (wp.dot(vi, d) + r * u_star)
                if wp.static(spec.lanes > 1):
                    rate, evening, stiffness = added(rate), added(evening), added(stiffness)
                    plain_stiffness, own_stiffness = added(plain_stiffness), added(own_stiffness)
        own_pairs = own_rates(
            i, k, end, step, wrapped, xi, vi, p_i, inv_z, own, params, forcing, neighbours, midway, velocity, state_old,
            pressure_gradient, inertia)  # fmt: skip
        if wp.static(spec.disorder and spec.lanes > 1):  # with one lane below: here it would move last bits
            if due_now(counters):
                disorder_force[i] = uneven(
                    i, lane, list_width, particle_count, wrapped, params, neighbours, fluid_neighbours, phase, midway,
                    velocity, state_old, rest_volume, disorder_speed, flow_gradient)  # fmt: skip
        if lane > 0:
            return
        k, step = end, stride
        rate += own_pairs.rate
        if wp.static(spray or damps or spec.walls):
            blur += own_pairs.blur
        else:
            rate += own_pairs.blur
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
        if wp.static(spec.walls and not spec.bodies):
            rate = with_cells(rate, i, k, end, step, wrapped, xi, vi, params, neighbours, position, velocity)
        if wp.static(spec.bodies):
            rate = with_bodies(
                rate, i, k, end, step, particle_count, wrapped, near, xi, vi, own_pairs.flow, own_pairs.moment, params,
                neighbours, position, boundary_volume, velocity, mirror_velocity, slip, wall_sides, wall_normal,
                wall_depth)  # fmt: skip
        if wp.static(spray):
            blur *= evenly(own_pairs.stiffness, params)
        if wp.static(sided):
            hard = real(clock[STEP]) * own.sound_speed * params.dissipation * params.g_norm * hardened
            alike = hard * softened * own.impedance / own.resistance
            rate += bounded(evening, hard * stiffness, alike * plain_stiffness, alike * own_stiffness)

        s = density_excess[i]
        damped = damping((real(1.0) + s) * params.g_norm * rate, params, own)
        s += real(clock[STEP]) * (real(1.0) + s) * (params.g_norm * (rate + blur) + followed(i, room_part))
        s = remembered(s, own_pairs.crowd * params.g_norm, i, thin)
        density_excess[i] = s
        if wp.static(spec.disorder and spec.lanes == 1):
            if due_now(counters):
                disorder_force[i] = uneven(
                    i, lane, list_width, particle_count, wrapped, params, neighbours, fluid_neighbours, phase, midway,
                    velocity, state_old, rest_volume, disorder_speed, flow_gradient)  # fmt: skip
        p = eos(s, own.stiffness, own.gamma) + own.background + damped
        state[i] = pair(p, rest_volume[i] / (real(1.0) + s))

    return shared(continuity, spec)
