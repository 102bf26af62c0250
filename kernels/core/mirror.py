"""Straight walls by mirror images: a list entry may name the image of a particle across sides (theory: isph#b5).

No image is ever stored: an entry is the index of the particle plus a code of two bits an axis, 1 for the lower and 2 for
the upper side, so that an edge or a corner is the reflection at two or three sides at once. A reflection keeps lengths,
|x_a - R x_b| = |R x_a - x_b|, so the images near a are found by a search about R x_a, and the pair weights of a and b
across a wall are the same from both ends: the pressure matrix stays symmetric.

    velocity of an image: the component across the side changes sign against the wall's; for the friction of a no-slip wall
    all do, 2 u_w - u. The divergence of a velocity mirrored like that would be wrong by u/h times the disorder where the
    layer at the wall is thinner than a particle.
    pressure of an image: p_g = p_b + rho g.(x_g - x_b)
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from .pair import separation_of
from .params import make_params
from .spec import Spec, types

NO_WALL = 0  # kinds of a side
NO_SLIP = 1
FREE_SLIP = 2


def code_shift(dimension: int) -> int:
    """Return the bit at which the code of an image starts in a list entry; indices stay below 2 to that power."""
    return 31 - 2 * dimension


@functools.cache
def make_sides(dimension: int, precision: str) -> Any:
    """Return the `Sides` struct: planes, kinds and velocities of the sides of the domain.

    Side 2 axis is the lower one of an axis, 2 axis + 1 the upper one.
    """
    _, vec, _, _ = types(dimension, precision)

    @wp.struct
    class Sides:
        lower: vec  # planes of the lower sides [m]
        upper: vec  # planes of the upper sides [m]
        kind: wp.array(dtype=int)  # (2 d,) NO_WALL, NO_SLIP or FREE_SLIP
        velocity: wp.array(dtype=vec)  # (2 d,) velocity of the walls [m/s]

    return Sides


class Images(NamedTuple):
    """`wp.func`s of list entries that may be images.

    reflect(x, code, sides): the point mirrored.
    apart(x_i, x_j, code, wrapped, params, sides): x_i - x_j or x_i minus the image of x_j [m].
    image_velocity(v, code, sides): velocity of the image, mirrored across the sides [m/s].
    friction_velocity(v, code, sides): the same for the viscous term: reversed at no-slip walls.
    lift(x_j, code, sides): the image's position minus the particle's [m].
    sticks(code, sides): whether one of the sides is a no-slip wall.
    """

    reflect: Any
    apart: Any
    image_velocity: Any
    friction_velocity: Any
    lift: Any
    sticks: Any


@functools.cache
def make_images(spec: Spec) -> Images:
    """Return the functions of the images of a `Spec`."""
    real, vec, _, _ = types(spec.dimension, spec.precision)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    separation = separation_of(spec)
    dimension = spec.dimension

    @wp.func
    def reflect(x: vec, code: int, sides: Sides):
        result = x + vec()
        for axis in range(wp.static(dimension)):
            digit = (code >> (2 * axis)) & 3
            if digit == 1:
                result[axis] = real(2.0) * sides.lower[axis] - x[axis]
            elif digit == 2:
                result[axis] = real(2.0) * sides.upper[axis] - x[axis]
        return result

    @wp.func
    def apart(xi: vec, xj: vec, code: int, wrapped: bool, params: Params, sides: Sides):
        if wp.static(spec.mirror):
            if code != 0:
                return separation(xi, reflect(xj, code, sides), wrapped, params)
        return separation(xi, xj, wrapped, params)

    @wp.func
    def lift(xj: vec, code: int, sides: Sides):
        return reflect(xj, code, sides) - xj

    @wp.func
    def image_velocity(v: vec, code: int, sides: Sides):
        result = v + vec()
        for axis in range(wp.static(dimension)):
            digit = (code >> (2 * axis)) & 3
            if digit != 0:
                result[axis] = real(2.0) * sides.velocity[2 * axis + digit - 1][axis] - v[axis]
        return result

    @wp.func
    def friction_velocity(v: vec, code: int, sides: Sides):
        result = image_velocity(v, code, sides)
        for axis in range(wp.static(dimension)):
            digit = (code >> (2 * axis)) & 3
            if digit != 0:
                side = 2 * axis + digit - 1
                if sides.kind[side] == NO_SLIP:
                    result = real(2.0) * sides.velocity[side] - v
        return result

    @wp.func
    def sticks(code: int, sides: Sides):
        result = bool(False)
        for axis in range(wp.static(dimension)):
            digit = (code >> (2 * axis)) & 3
            if digit != 0:
                result = result or sides.kind[2 * axis + digit - 1] == NO_SLIP
        return result

    return Images(reflect, apart, image_velocity, friction_velocity, lift, sticks)
