"""Walls of a gas, which are mirrors: the pressure of an image under gravity, and particles that go through a mirror.

(theory: compressible#c1-walls)
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.mirror import NO_WALL, make_images, make_sides
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.spec import Spec, types_of


@functools.cache
def make_image_pressure(spec: Spec) -> Any:
    """Return the `wp.func` image_pressure(p_j, rho_j, x_j, code, params, sides) [Pa].

    p_j exp(rho_j g.(x_image - x_j)/p_j): what holds a gas of one temperature at rest before the wall, never below zero.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    lift = make_images(spec).lift

    @wp.func
    def image_pressure(p: real, rho: real, x: vec, code: int, params: Params, sides: Sides):
        result = p
        if wp.static(spec.gravity):
            if p > real(0.0):
                result = p * wp.exp(rho * wp.dot(params.gravity, lift(x, code, sides)) / p)
        return result

    return image_pressure


@functools.cache
def make_gas_reflect(spec: Spec) -> Any:
    """Return the kernel that makes a particle beyond a mirror its image, which is within.

    Both stand for the same gas: what they do to others is the same but for what pulls on them from outside. The list stays
    valid, since the image is nearer to where the particle was when the list was made than the particle is.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def gas_reflect(
        first: int,
        params: Params,
        sides: Sides,
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        x = position[i]
        for axis in range(wp.static(spec.dimension)):
            side = int(-1)
            plane = sides.lower[axis]
            if sides.kind[2 * axis] != NO_WALL and x[axis] < sides.lower[axis]:
                side = 2 * axis
            if sides.kind[2 * axis + 1] != NO_WALL and x[axis] > sides.upper[axis]:
                side = 2 * axis + 1
                plane = sides.upper[axis]
            if side >= 0:
                drive = params.gravity[axis] + params.body_force[axis]
                o = offset[i]
                v = velocity[i]
                a = acceleration[i]
                o[axis] = real(2.0) * (plane - anchor[i][axis]) - o[axis]
                v[axis] = real(2.0) * sides.velocity[side][axis] - v[axis]
                a[axis] = real(2.0) * drive - a[axis]
                offset[i] = o
                velocity[i] = v
                acceleration[i] = a
                position[i] = anchor[i] + o

    return gas_reflect
