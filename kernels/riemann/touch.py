"""What keeps a particle off the planes of walls that it touches (theory: riemann#a5)."""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.spec import types

# Gaps [spacings] at which a particle begins to touch a wall, half of the place of its row, and at which it is stopped.
TOUCH, STOP = 0.25, 0.1


class Touch(NamedTuple):
    """`wp.func`s of planes, one for each axis.

    Attributes:
        touching: touching(gap, spacing), the shares 0..1 of what drives a particle into planes at the distances `gap` [m]
            that these take up.
        held_off: held_off(a, v, touch, speed, normal, damping), the acceleration a [m/s^2] without that, and with what
            brakes a particle of the velocity v [m/s] at the rate `damping` [1/s] from the speeds of the planes [m/s] along
            their normals, the rows of `normal`, into the fluid.
    """

    touching: Any
    held_off: Any


@functools.cache
def make_touch(dimension: int, precision: str) -> Touch:
    """Return the functions of a dimension and precision."""
    real, vec, mat, _ = types(dimension, precision)

    @wp.func
    def touching(gap: vec, spacing: real):
        result = vec()
        for axis in range(wp.static(dimension)):
            result[axis] = wp.clamp(
                (real(TOUCH) - gap[axis] / spacing) / real(wp.static(TOUCH - STOP)), real(0.0), real(1.0)
            )
        return result

    @wp.func
    def held_off(a: vec, v: vec, touch: vec, speed: vec, normal: mat, damping: real):
        result = a
        for axis in range(wp.static(dimension)):
            n_w = normal[axis]
            drive = wp.max(-wp.dot(result, n_w), real(0.0))
            approach = wp.max(speed[axis] - wp.dot(v, n_w), real(0.0))
            result += (touch[axis] * (drive + approach * damping)) * n_w
        return result

    return Touch(touching, held_off)
