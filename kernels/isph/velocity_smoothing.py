"""Smoothing of the velocity by central forces between pairs (theory: isph#b6)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.fields import FLUID
from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access, natural
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of


@functools.cache
def make_smooth_velocity(spec: Spec) -> Any:
    """Return the sweep that draws velocities to the linear field around them.

    A pair exchanges momentum on its line of centres,

        du_i = d sum_j V_j W_ij k_ij e_ij (e_ij.[u_j - u_i - G_ij (x_j - x_i)]),    e_ij = x_ij/|x_ij|

    k_ij = (k_i + k_j)/2 and G_ij = (G_i + G_j)/2 with the shares and the velocity gradients that `regularise` has left:
    f |grad u| dt less what friction does itself, 0 in reach of a body under a surface and away from that surface. It is
    friction between pairs less what it makes of a field of second order. Inside the fluid d sum V W e (x) e is the
    identity: k is the share of a deviation that a step takes out.

    Both ends of a pair find the same impulse with opposite signs, on their line: linear and angular momentum are conserved,
    but for the images behind walls.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, image_velocity, sticks = images.apart, images.image_velocity, images.sticks
    list_begin, list_step, neighbour, Listed = list_access(spec)
    dimension = float(spec.dimension)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def smooth_velocity(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        velocity_gradient: wp.array(dtype=mat),
        smoothing: wp.array(dtype=real),
        carried: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        xi = position[i]
        vi = velocity[i]
        own_rate = smoothing[i]
        own_gradient = velocity_gradient[i]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
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
            rate = real(0.5) * (own_rate + smoothing[j])
            if rate > real(0.0):
                d = apart(xi, position[j], code, wrapped, params, sides)
                vj = velocity[j]
                other = velocity_gradient[j] * d
                if wp.static(spec.mirror):
                    if code != 0:
                        # the field of an image is R u(R x), its gradient R G R; R a is the image of a less that of rest
                        rest = image_velocity(vec(), code, sides)
                        vj = image_velocity(vj, code, sides)
                        mirrored = image_velocity(d, code, sides) - rest
                        other = image_velocity(velocity_gradient[j] * mirrored, code, sides) - rest
                        if wp.static(spec.viscosity != "none"):
                            if sticks(code, sides):
                                rate = real(0.0)  # friction alone knows such a side
                deviation = vj - vi + real(0.5) * (own_gradient * d + other)
                r2 = wp.dot(d, d)
                weight = shape(wp.sqrt(r2) * params.inv_h) * rest_volume[j]
                total += d * (rate * weight * wp.dot(d, deviation) / (r2 + params.tiny))
        carried[i] = carried[i] + total * (real(dimension) * params.g_norm * params.h * params.h)

    return smooth_velocity
