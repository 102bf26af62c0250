"""How far a body is wet: what of it mirrors a fluid with a free surface (theory: isph#wetness)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of

REACH = 1.5  # spacings, in which fluid before a wall counts
# Sum of V (1 - r/R)^4 (1 + 4 r/R)/dx^d, Wendland's kernel over its value at 0, up to which a wall is dry, and from which it
# is wet. On lattices it is 0.9 or more before a wet wall, wherever the place is between the rows, and 0.06 half a spacing
# above a surface; in the largest hole of a shifted arrangement 0.7.
DRY, WET = 0.15, 0.65
DEEP = 2.0  # spacings: the two rows behind a surface that fluid before it sees


@functools.cache
def make_wetness(spec: Spec) -> Any:
    """Return the kernel over wall particles that finds how far each is wet, 0 to 1.

    It looks for fluid nearer than REACH to a place half a spacing before the foot of its leader, where the first row stands;
    and, as behind an edge leaders look to one side alone, for particles of the first row that have it straight behind their
    wall, nearer than DEEP.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    shape, _ = make_smoothing("wendland_c2", spec.precision)
    dimension = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def wetness(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        row_of_wall: wp.array(dtype=int),
        leader: wp.array(dtype=int),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        beside: wp.array(dtype=vec),
        wall_gap: wp.array(dtype=real),
        wetness: wp.array(dtype=real),
    ):
        w = wp.tid() + first
        lead = row_of_wall[leader[w]]
        i = lead + fluid_count
        place = position[i] + wall_normal[lead] * (wall_depth[lead] + real(0.5) * params.spacing)
        per_reach = real(2.0) / (real(REACH) * params.spacing)  # the support of the kernel is 2
        before = real(0.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            before += shape(wp.length(separation(place, position[j], True, params)) * per_reach) * rest_volume[j]
        i = w + fluid_count
        behind = real(0.0)
        k = list_begin(i, list_width)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            n = beside[j]
            if wp.dot(n, n) > real(0.0) and wall_gap[j] < params.spacing:
                d = separation(position[i], position[j], True, params)
                deep = -wp.dot(n, d) - wall_gap[j]
                if deep < real(DEEP) * params.spacing:
                    behind += shape(wp.length(d - n * wp.dot(n, d)) * per_reach) * rest_volume[j]
        total = wp.max(before, behind) / shape(real(0.0))
        for _ in range(wp.static(dimension)):
            total /= params.spacing
        wetness[w] = wp.clamp((total - real(DRY)) / real(wp.static(WET - DRY)), real(0.0), real(1.0))

    return wetness
