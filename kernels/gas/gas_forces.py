"""Acceleration and power of the gas: pairs of Riemann problems, or artificial viscosity (theory: compressible#c2-pairs)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.lanes import lanes_of, make_largest, shared
from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_inner_slope
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of

from .gas_fields import GOING, HELD
from .gas_walls import make_image_pressure
from .limiters import make_limiters
from .riemann_states import make_acoustic_states, make_exact_states

# Jump of a pair, over its pressure, below which the acoustic star state is as good as the exact one: its error is of the
# second order in the jump, a part in a million of the pressure. Most pairs of most flows are below.
WEAK = 1.0e-3
CLOSE = 0.01  # of h^2, added to r^2 so that the viscosity of a pair that touches stays finite (Monaghan 1992)
# A pair takes from a particle at most LARGEST_SHARE p g (c + |u_j - u_i|): what sound and motion carry off, and nothing from
# one that has nothing left. Star states of unlike gases know no such bound: a hot thin neighbour emptied a cold one.
LARGEST_SHARE = 1.0
STEP_LOSS = 0.5  # share of its energy that a particle may lose in a step, as predicted
SLOTS = 64  # of the array that the largest signal rate is gathered in


@functools.cache
def make_gas_exchange(spec: Spec) -> tuple[Any, Any]:
    """Return the struct `Side` and the `wp.func` exchange(i, j, ...) -> (force, power) of a pair, per unit mass of both.

    What the Riemann problem adds to the pressures of the particles (theory: compressible#c2-pairs). With
    g = |W'(h_i)|/(Omega_i rho_i^2) + |W'(h_j)|/(Omega_j rho_j^2), u along the way from i to j, and the star state of
    the reconstructed sides:
        force = (p* - (p_L + p_R)/2) g
        power = (p* - (p_L + p_R)/2) g u* + (p_i + p_j)/2 g (u* - (u_L + u_R)/2)
    Both are the same seen from j, but for the sign of the direction: momentum and energy are exchanged to rounding. Neither
    side loses more than `bounded` lets it (theory: compressible#c2-cold).
    """
    real = types_of(spec).real
    limiters = make_limiters(spec.precision)
    ordered_step, even_share, shock_switch = limiters.ordered_step, limiters.even_share, limiters.shock_switch
    acoustic, exact = make_acoustic_states(spec.precision), make_exact_states(spec.precision)

    @wp.struct
    class Side:
        rho: real
        u: real  # velocity along the way from i to j [m/s]
        p: real
        c: real
        g: real  # |W'|/(Omega rho^2)
        rho_rise: real  # gradients times the way from i to j
        u_rise: real
        p_rise: real

    @wp.func
    def bounded(a: Side, b: Side, force: real, power: real):
        """Force and power of which neither side loses more than sound and motion carry off; the same seen from j."""
        speed = real(LARGEST_SHARE) * (real(0.5) * (a.c + b.c) + wp.abs(b.u - a.u))
        lean_a = wp.min(b.rho / a.rho, real(1.0))  # g of a thin neighbour is large by the square of the ratio
        lean_b = wp.min(a.rho / b.rho, real(1.0))
        most_a = speed * a.p * (a.g + lean_a * lean_a * b.g)
        most_b = speed * b.p * (b.g + lean_b * lean_b * a.g)
        lost = force * (b.u - a.u)  # by both
        push = force
        if lost > most_a + most_b:
            push = force * ((most_a + most_b) / lost)
            lost = most_a + most_b
        return push, push * a.u + wp.clamp(power - force * a.u, lost - most_b, most_a)

    @wp.func
    def exchange(a: Side, b: Side, gamma: real):
        g = a.g + b.g
        rho_l = a.rho
        rho_r = b.rho
        u_l = a.u
        u_r = b.u
        p_l = a.p
        p_r = b.p
        c_l = a.c
        c_r = b.c
        if wp.static(spec.limited):
            half = real(0.5) * shock_switch(u_l, u_r, c_l, c_r)
            rho_l = a.rho + half * ordered_step(b.rho - a.rho, a.rho_rise)
            rho_r = b.rho - half * ordered_step(b.rho - a.rho, b.rho_rise)
            share = half * even_share(a.u_rise, b.u_rise)
            u_l = a.u + share * a.u_rise
            u_r = b.u - share * b.u_rise
            p_l = a.p + half * ordered_step(b.p - a.p, a.p_rise)
            p_r = b.p - half * ordered_step(b.p - a.p, b.p_rise)
            c_l = wp.sqrt(gamma * p_l / rho_l)
            c_r = wp.sqrt(gamma * p_r / rho_r)
        star_p, star_u = acoustic(rho_l, u_l, p_l, c_l, rho_r, u_r, p_r, c_r, gamma)
        if wp.static(spec.star == "exact"):
            strength = wp.abs(p_l - p_r) + wp.max(rho_l * c_l, rho_r * c_r) * wp.abs(u_l - u_r)
            if strength >= real(WEAK) * wp.min(p_l, p_r):
                star_p, star_u = exact(rho_l, u_l, p_l, c_l, rho_r, u_r, p_r, c_r, gamma)
        shock = (star_p - real(0.5) * (p_l + p_r)) * g
        heat = real(0.5) * (a.p + b.p) * g * (star_u - real(0.5) * (u_l + u_r))
        return bounded(a, b, shock, shock * star_u + heat)

    return Side, exchange


@functools.cache
def make_viscous_exchange(spec: Spec) -> Any:
    """Return the `wp.func` of the artificial viscosity Pi_ij [m^5/(kg s^2) in 3-D] (theory: compressible#c1-viscosity)."""
    real = types_of(spec).real

    @wp.func
    def viscosity(closing: real, r: real, h: real, rho: real, c: real, alpha: real, beta: real):
        mu = h * closing * r / (r * r + real(CLOSE) * h * h)  # positive where the pair closes in
        return (alpha * c * mu + beta * mu * mu) / rho

    return viscosity


@functools.cache
def make_gas_forces(spec: Spec) -> Any:
    """Return the kernel of acceleration, power, growth of smoothing lengths and the largest rate that limits the step [1/s].

    The power is that of the pairs seen by a particle that moves along, so that no kinetic energy of a fast gas hides it;
    Runge-Kutta adds the work on the motion. The rate is (c + closing/2)/h, `swell_weight` times that of the growth of h, or
    `courant` over the step that would cost the particle STEP_LOSS of its energy (theory: compressible#c1-time).
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    inner_slope = make_inner_slope(spec.kernel, spec.dimension, spec.precision)
    images = make_images(spec)
    apart, image_velocity = images.apart, images.image_velocity
    image_pressure = make_image_pressure(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    particle_of, lane_of, part_of, added, added_vec = lanes_of(spec, real, vec)
    largest = make_largest(spec.lanes, real)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1
    Side, exchange = make_gas_exchange(spec)
    viscosity = make_viscous_exchange(spec)
    riemann = not spec.artificial_viscosity

    @wp.func
    def mirrored(v: vec, code: int):
        """A gradient seen in the mirrors of a code."""
        result = v + vec()
        for axis in range(wp.static(spec.dimension)):
            if ((code >> (2 * axis)) & 3) != 0:
                result[axis] = -v[axis]
        return result

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def gas_forces(
        first: int,
        particle_count: int,
        list_width: int,
        w_norm: real,
        alpha: real,
        beta: real,
        conductivity: real,
        courant: real,
        swell_weight: real,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        held: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        mass: wp.array(dtype=real),
        smoothing: wp.array(dtype=real),
        density: wp.array(dtype=real),
        energy: wp.array(dtype=real),
        stiffening: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        density_gradient: wp.array(dtype=vec),
        pressure_gradient: wp.array(dtype=vec),
        velocity_gradient: wp.array(dtype=mat),
        stretching: wp.array(dtype=mat),
        acceleration: wp.array(dtype=vec),
        power: wp.array(dtype=real),
        swelling: wp.array(dtype=real),
        signal_rates: wp.array(dtype=real),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.held):
            if held[i] == wp.uint8(HELD):
                acceleration[i] = vec()
                power[i] = real(0.0)
                if wp.static(not spec.constant_h):
                    swelling[i] = real(0.0)
                return
        gamma = phases[0].gamma
        xi = position[i]
        vi = velocity[i]
        hi = smoothing[i]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        a = Side()
        b = Side()
        a.rho = density[i]
        a.p = state[i][0]
        a.c = wp.sqrt(gamma * a.p / a.rho)
        total = vec()
        work = real(0.0)
        parting = real(0.0)
        fastest = a.c
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            way = -apart(xi, position[j], code, wrapped, params, sides)
            r = wp.sqrt(wp.dot(way, way))
            hj = smoothing[j]
            slope_i = inner_slope(w_norm, r, hi)
            slope_j = inner_slope(w_norm, r, hj)
            if slope_i + slope_j <= real(0.0):
                continue
            toward = way / r
            vj = velocity[j]
            b.p = state[j][0]
            b.rho = density[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj, code, sides)
                    b.p = image_pressure(b.p, b.rho, position[j], code, params, sides)
            # seen from i: what its own motion does to its kinetic energy is left out
            a.u = real(0.0)
            b.u = wp.dot(vj - vi, toward)
            b.c = wp.sqrt(gamma * b.p / b.rho)
            a.g = slope_i * stiffening[i]
            b.g = slope_j * stiffening[j]
            closing = wp.max(a.u - b.u, real(0.0))
            if wp.static(not spec.constant_h):
                parting += mass[j] * slope_i * (b.u - a.u)
            fastest = wp.max(fastest, real(0.5) * (a.c + b.c + closing))
            push_i = (a.p * a.g) * toward
            push_j = (b.p * b.g) * toward
            force = real(0.0)  # what makes shocks
            rate = real(0.0)
            if wp.static(riemann):
                if wp.static(spec.limited):
                    push_i = (a.p * slope_i) * (stretching[i] * toward)
                    push_j = (b.p * slope_j) * (stretching[j] * toward)
                    if wp.static(spec.mirror):
                        push_j = (b.p * slope_j) * mirrored(stretching[j] * mirrored(toward, code), code)
                    a.rho_rise = wp.dot(density_gradient[i], way)
                    a.p_rise = wp.dot(pressure_gradient[i], way)
                    a.u_rise = wp.dot(velocity_gradient[i] * way, toward)
                    back = way + vec()
                    if wp.static(spec.mirror):
                        back = mirrored(way, code)
                    b.rho_rise = wp.dot(density_gradient[j], back)
                    b.p_rise = wp.dot(pressure_gradient[j], back)
                    if wp.static(spec.mirror and spec.gravity):
                        b.p_rise += b.rho * wp.dot(params.gravity, way - back)  # the weight is not mirrored
                    rise = velocity_gradient[j] * back
                    if wp.static(spec.mirror):
                        rise = mirrored(rise, code)
                    b.u_rise = wp.dot(rise, toward)
                force, rate = exchange(a, b, gamma)
            else:
                rho = real(0.5) * (a.rho + b.rho)
                h = real(0.5) * (hi + hj)
                mean_slope = real(0.5) * (slope_i + slope_j)
                push = viscosity(closing, r, h, rho, real(0.5) * (a.c + b.c), alpha, beta) * mean_slope
                force = push
                rate = real(0.5) * push * (a.u + b.u)
                if wp.static(spec.conduction):
                    speed = wp.sqrt(wp.abs(a.p - b.p) / rho)
                    rate += conductivity * speed / rho * (energy[i] - energy[j]) * mean_slope
            total -= mass[j] * (push_i + push_j + force * toward)
            work -= mass[j] * (wp.dot(push_i, vj - vi) + rate)  # push_j works on the motion of i alone
        if wp.static(spec.lanes > 1):
            total, work, fastest = added_vec(total), added(work), largest(fastest)
            if wp.static(not spec.constant_h):
                parting = added(parting)
            if lane > 0:
                return
        rate_here = fastest / hi
        if wp.static(riemann):
            # energy + work dt - |total dt|^2/2 is (1 - STEP_LOSS) energy after 1/dt = |total|^2/(work + root)
            a2 = wp.dot(total, total)
            spare = work + wp.sqrt(work * work + real(wp.static(2.0 * STEP_LOSS)) * a2 * wp.max(energy[i], real(0.0)))
            if spare > real(0.0):
                rate_here = wp.max(rate_here, courant * a2 / spare)
        if wp.static(spec.gravity or spec.body_force):
            drive = params.gravity + params.body_force
            total += drive
        acceleration[i] = total
        if wp.static(spec.runge_kutta):
            work += wp.dot(total, vi)
        power[i] = work
        if wp.static(not spec.constant_h):
            growth = parting * stiffening[i] * a.rho * real(wp.static(1.0 / spec.dimension))
            swelling[i] = growth
            rate_here = wp.max(rate_here, swell_weight * growth)
        if wp.static(spec.held):
            if held[i] == wp.uint8(GOING):
                acceleration[i] = vec()
                power[i] = real(0.0)
        slot = i % wp.static(SLOTS)
        if rate_here > signal_rates[slot]:
            wp.atomic_max(signal_rates, slot, rate_here)

    return shared(gas_forces, spec)
