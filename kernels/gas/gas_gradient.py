"""Gradients of density, velocity and pressure, exact for linear fields (theory: compressible#c2-pairs)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of

# Share of the full moment below which neighbours do not tell a direction apart: gradients are then left out.
THIN = 1.0e-3


@functools.cache
def make_gas_gradient(spec: Spec) -> Any:
    """Return the kernel grad q = L sum_j V_j (q_j - q_i) grad W, L^-1 = sum_j V_j (x_j - x_i) (x) grad W."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, image_velocity = images.apart, images.image_velocity
    list_begin, list_step, neighbour, Listed = list_access(spec)
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

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def gas_gradient(
        first: int,
        particle_count: int,
        list_width: int,
        w_norm: real,
        params: Params,
        sides: Sides,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        smoothing: wp.array(dtype=real),
        density: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        density_gradient: wp.array(dtype=vec),
        pressure_gradient: wp.array(dtype=vec),
        velocity_gradient: wp.array(dtype=mat),
    ):
        i = wp.tid() + first
        xi = position[i]
        vi = velocity[i]
        inverse = real(1.0) / smoothing[i]
        norm = w_norm * inverse * inverse
        for _axis in range(wp.static(spec.dimension)):
            norm = norm * inverse
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        moment = mat()
        of_density = vec()
        of_pressure = vec()
        of_velocity = mat()
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
            way = -apart(xi, position[j], code, wrapped, params, sides)
            q = wp.sqrt(wp.dot(way, way)) * inverse
            rise = (-norm * slope(q) * state[j][1]) * way  # V_j grad W
            vj = velocity[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj, code, sides)
            moment += wp.outer(way, rise)
            of_density += (density[j] - density[i]) * rise
            of_pressure += (state[j][0] - state[i][0]) * rise
            of_velocity += wp.outer(vj - vi, rise)
        correction = inverted(moment)
        density_gradient[i] = correction * of_density
        pressure_gradient[i] = correction * of_pressure
        velocity_gradient[i] = of_velocity * wp.transpose(correction)

    return gas_gradient
