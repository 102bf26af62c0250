"""The planes of walls that a particle may touch: one for each axis that a normal may lie nearest to, at the nearest foot.

And those that walls of whole cells, which have no normals, make along the axes of the lattice.
"""

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


class CellFaces(NamedTuple):
    """`wp.func`s of the plane that cells of a wall make; vectors have an entry, 0 or 1, for each axis.

    Attributes:
        before: before(d, half_cell), 1 for the axis along which a cell at the distance d is straight ahead.
        along: along(before, low, high, spacing), 1 for an axis along which the cells are a plane.
    """

    before: Any
    along: Any


@functools.cache
def make_cell_faces(dimension: int, precision: str) -> CellFaces:
    """Return the faces of cells of a dimension and precision.

    Cells are a plane along an axis if some are straight ahead along another one and none along this, and if what is in
    reach of them, from `low` to `high` [m], is as far on both sides to a spacing: so it is, wherever above them a particle
    is, but where they end or meet other walls.
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def before(d: vec, half_cell: real):
        result = vec()
        for axis in range(wp.static(dimension)):
            ahead = bool(True)
            for other in range(wp.static(dimension)):
                if other != axis and wp.abs(d[other]) > half_cell:
                    ahead = False
            if ahead:
                result[axis] = real(1.0)
        return result

    @wp.func
    def along(before: vec, low: vec, high: vec, spacing: real):
        result = vec()
        if wp.dot(before, before) > real(0.0):
            for axis in range(wp.static(dimension)):
                if before[axis] == real(0.0) and wp.abs(low[axis] + high[axis]) <= spacing:
                    result[axis] = real(1.0)
        return result

    return CellFaces(before, along)


@functools.cache
def make_along_plane(dimension: int, precision: str, cells: bool) -> Any:
    """Return the `wp.func` along_plane(plane, v): the part of the vector v along a plane, 0 where `plane` is 0.

    `plane` is the normal of the plane, or of `cells` what `along` of `make_cell_faces` returns.
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def along_plane(plane: vec, v: vec):
        if wp.static(cells):
            return wp.cw_mul(plane, v)
        result = vec()
        if wp.dot(plane, plane) > real(0.0):
            result = v - plane * wp.dot(plane, v)
        return result

    return along_plane
