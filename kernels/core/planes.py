"""The planes of walls that a particle may touch: one for each axis that a normal may lie nearest to, at the nearest foot."""

import functools
from typing import Any, NamedTuple

import warp as wp

from .spec import types


class Planes(NamedTuple):
    """`wp.func`s of the struct of planes, which has for each axis

    gap: distance of the particle, m; foot2: square of the distance of the foot, m^2; speed: of the plane along its normal,
    m/s; normal: in each row that of a plane, into the fluid, 0 where there is none.

    Attributes:
        none: none(spacing), no planes: gaps and feet a spacing away.
        noted: noted(planes, normal, gap, foot2, speed), with another one if its foot is nearer than that of its axis.
    """

    none: Any
    noted: Any


@functools.cache
def make_planes(dimension: int, precision: str) -> Planes:
    """Return the planes of a dimension and precision."""
    real, vec, mat, _ = types(dimension, precision)

    @wp.struct
    class TouchedPlanes:
        gap: vec
        foot2: vec
        speed: vec
        normal: mat

    @wp.func
    def none(spacing: real):
        result = TouchedPlanes()
        result.gap = vec(spacing)
        result.foot2 = vec(spacing * spacing)
        return result

    @wp.func
    def noted(planes: TouchedPlanes, normal: vec, gap: real, foot2: real, speed: real):
        result = planes
        steep = wp.max(wp.abs(normal))
        for axis in range(wp.static(dimension)):
            if wp.abs(normal[axis]) == steep and foot2 < result.foot2[axis]:
                result.gap[axis] = gap
                result.foot2[axis] = foot2
                result.speed[axis] = speed
                for part in range(wp.static(dimension)):
                    result.normal[axis, part] = normal[part]
        return result

    return Planes(none, noted)
