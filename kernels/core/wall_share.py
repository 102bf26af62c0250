"""Walls with a velocity of their own in continuity, and what it has of a compression beside them (theory: delta#d6).

Walls that are whole cells have no normals: there the share of a compression is the fluid's part of the integral of W, which
before a plane is the same. It is that of all walls in reach, 1/4 in a right-angled corner.
"""

import functools
from typing import Any

import warp as wp

from .pair import list_access, make_at, separation_of
from .params import make_params
from .smoothing import make_smoothing
from .spec import Spec, types_of

LEAST_SHARE = 0.25  # in a right-angled corner whose two faces a particle touches
PARALLEL = 1.0 - 1.0e-6  # cosine from which on normals are those of one plane: rounding, or a thousand supports of radius


@functools.cache
def make_slides(marked: bool) -> Any:
    """Return the `wp.func` slides(w, slip, wall_sides): the wall particle has its own velocity in continuity.

    marked: the fluid may stick to walls, and those that are sides of the domain have their own velocity all the same.
    """

    @wp.func
    def slides(w: int, slip: wp.array(dtype=wp.uint8), wall_sides: wp.array(dtype=wp.uint8)):
        free = slip[w] != wp.uint8(0)
        if wp.static(marked):
            free = free or wall_sides[w] != wp.uint8(0)
        return free

    return slides


@functools.cache
def make_cell_rate(spec: Spec) -> Any:
    """Return the `wp.func` with_cells(rate of the fluid, ...): the rate of continuity beside walls of whole cells.

    (sum_f + sum_w) (v_i - v).grad_i W V / (1 - sum_w W V), with the velocity of the wall itself. Rates lack `g_norm`.
    """
    real, vec, _, _ = types_of(spec)
    Params, separation, at_vec = make_params(spec.dimension, spec.precision), separation_of(spec), make_at(vec)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    _, _, neighbour, Listed = list_access(spec)

    @wp.func
    def with_cells(
        fluid_rate: real,
        i: int,
        start: int,
        end: int,
        step: int,
        wrapped: bool,
        xi: vec,
        vi: vec,
        params: Params,
        neighbours: Listed,
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
    ):
        along, blocked = real(0.0), real(0.0)
        k = start
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, at_vec(position, j), wrapped, params)
            q = wp.length(d) * params.inv_h
            along += slope(q) * wp.dot(vi - at_vec(velocity, j), d)
            blocked += shape(q)
        share = real(1.0) - blocked * (params.wall_volume * params.g_norm * params.h * params.h)
        return (fluid_rate + along * params.wall_volume) / wp.max(share, real(LEAST_SHARE))

    return with_cells
