"""What every neighbour sum needs of a pair: its separation across periodic images and its place in the list."""

import functools
from typing import Any

import warp as wp

from .params import make_params
from .spec import Spec, types_of

# bits of the field `flags`
WRAPPED = 1  # the list of this particle reaches across a periodic boundary
NEAR = 2  # a particle of another phase is in the list (first ring of the interface)
BAND = 4  # the list holds a first-ring particle (second ring, or the first itself)


@functools.cache
def make_separation(dimension: int, precision: str, periodic: tuple[bool, ...]) -> Any:
    """Return the `wp.func` separation(x_i, x_j, wrapped, params) = x_i - x_j of the nearest images [m]."""
    spec = Spec(dimension=dimension, precision=precision, periodic=periodic)
    real, vec, _, _ = types_of(spec)
    Params = make_params(dimension, precision)
    axes = [axis for axis in range(dimension) if periodic[axis]]
    has_x, has_y, has_z = (axis in axes for axis in range(3))
    any_axis = bool(axes)

    @wp.func
    def nearest(d: real, period: real, half: real):
        result = d
        if d > half:
            result = d - period
        elif d < -half:
            result = d + period
        return result

    @wp.func
    def separation(xi: vec, xj: vec, wrapped: bool, params: Params):
        d = xi - xj
        if wp.static(any_axis):
            if wrapped:
                if wp.static(has_x):
                    d[0] = nearest(d[0], params.box[0], params.half_box[0])
                if wp.static(has_y):
                    d[1] = nearest(d[1], params.box[1], params.half_box[1])
                if wp.static(has_z):
                    d[2] = nearest(d[2], params.box[2], params.half_box[2])
        return d

    return separation


def separation_of(spec: Spec) -> Any:
    """Return the separation function of a `Spec`."""
    return make_separation(spec.dimension, spec.precision, spec.periodic)


@functools.cache
def make_entry(row_list: bool) -> tuple[Any, Any]:
    """Return the `wp.func`s (list_begin(i, width), list_step(particle_count)) of a list layout.

    Row: the neighbours of a particle are contiguous (best for a CPU core, measured 5-10 % faster there).
    Column: the k-th neighbours of consecutive particles are contiguous (coalesced reads on a GPU).
    """
    if row_list:

        @wp.func
        def list_begin(i: int, width: int):
            return i * width

        @wp.func
        def list_step(count: int):
            return 1

    else:

        @wp.func
        def list_begin(i: int, width: int):
            return i

        @wp.func
        def list_step(count: int):
            return count

    return list_begin, list_step
