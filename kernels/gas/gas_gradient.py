"""Gradients of density, velocity and pressure, exact for linear fields, and what stretches pressure forces.

(theory: compressible#c2-pairs, compressible#c1-moment)
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of

from .gas_density import LEAST_OMEGA
from .gas_fields import HELD
from .gas_walls import make_image_pressure

# Share of the full moment below which neighbours do not tell a direction apart: gradients are then left out.
THIN = 1.0e-3
SUDDEN = 0.05  # -h div v/c of half the share; a shock has near 1, sound and vortices of a Mach number M less than M h/L
UNEVEN = 0.75  # det of a moment over that of an even one of the same trace, below which its trace alone is taken


@functools.cache
def make_gas_gradient(spec: Spec) -> Any:
    """Return the kernel of gradients and of `stretching`, T/rho^2.

    grad q = L sum_j V_j (q_j - q_i) grad W, L^-1 = sum_j V_j (x_j - x_i) (x) grad W;
    T^-1 = sum_j (m_j/rho_i) (x_j - x_i) (x) grad W, whose trace is d Omega; 1/Omega in its place where the gas closes in as
    in a shock.
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, image_velocity = images.apart, images.image_velocity
    image_pressure = make_image_pressure(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    particle_of, lane_of, part_of, added_vec, added_mat = lanes_of(spec, vec, mat)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.func
    def inverted(m: mat):
        """The inverse of a moment, zero where it is thin."""
        result = mat()
        if wp.static(spec.dimension == 1):
            if m[0, 0] > real(THIN):
                result[0, 0] = real(1.0) / m[0, 0]
        elif wp.determinant(m) > real(THIN):
            result = wp.inverse(m)
        return result

    @wp.func
    def stretched(m: mat):
        """The inverse of a moment of masses; that of its trace where it hardly knows some direction."""
        even = wp.max(wp.trace(m) * real(wp.static(1.0 / spec.dimension)), real(LEAST_OMEGA))
        result = wp.identity(n=wp.static(spec.dimension), dtype=real) / even
        if wp.static(spec.dimension > 1):
            unit = m / even
            if wp.determinant(unit) > real(UNEVEN):
                result = wp.inverse(unit) / even
        return result

    @wp.func
    def gentleness(closing: real, c2: real):
        """Share of the moment of masses: 0 where the gas closes in over h as in a shock; closing [m/s], c^2 [m^2/s^2]."""
        inward = wp.max(closing, real(0.0))
        result = real(0.0)
        if c2 > real(0.0):
            result = c2 / (c2 + inward * inward * real(wp.static(1.0 / SUDDEN**2)))
        return result

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def gas_gradient(
        first: int,
        particle_count: int,
        list_width: int,
        w_norm: real,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        held: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        smoothing: wp.array(dtype=real),
        density: wp.array(dtype=real),
        stiffening: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        density_gradient: wp.array(dtype=vec),
        pressure_gradient: wp.array(dtype=vec),
        velocity_gradient: wp.array(dtype=mat),
        stretching: wp.array(dtype=mat),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        xi = position[i]
        vi = velocity[i]
        inverse = real(1.0) / smoothing[i]
        norm = w_norm * inverse * inverse
        for _axis in range(wp.static(spec.dimension)):
            norm = norm * inverse
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        gamma = phases[0].gamma
        rho = density[i]
        moment = mat()
        masses = mat()
        of_density = vec()
        of_pressure = vec()
        of_velocity = mat()
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
            q = wp.sqrt(wp.dot(way, way)) * inverse
            rise = (-norm * slope(q) * state[j][1]) * way  # V_j grad W
            vj = velocity[j]
            pj = state[j][0]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj, code, sides)
                    pj = image_pressure(pj, density[j], position[j], code, params, sides)
            product = wp.outer(way, rise)
            moment += product
            masses += (density[j] / rho) * product
            of_density += (density[j] - rho) * rise
            of_pressure += (pj - state[i][0]) * rise
            of_velocity += wp.outer(vj - vi, rise)
        if wp.static(spec.lanes > 1):
            moment, masses, of_velocity = added_mat(moment), added_mat(masses), added_mat(of_velocity)
            of_density, of_pressure = added_vec(of_density), added_vec(of_pressure)
            if lane > 0:
                return
        correction = inverted(moment)
        density_gradient[i] = correction * of_density
        pressure_gradient[i] = correction * of_pressure
        slopes = of_velocity * wp.transpose(correction)
        velocity_gradient[i] = slopes
        even = stiffening[i] * wp.identity(n=wp.static(spec.dimension), dtype=real)
        gentle = gentleness(-wp.trace(slopes) * smoothing[i], gamma * state[i][0] / rho)
        if wp.static(spec.held):
            if held[i] == wp.uint8(HELD):
                gentle = real(0.0)  # what is beyond the open side is not there to be summed
        stretching[i] = even + gentle * (stretched(masses) / (rho * rho) - even)

    return shared(gas_gradient, spec)
