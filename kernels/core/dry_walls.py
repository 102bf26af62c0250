"""Walls that no fluid has come to are not there (theory: delta#dry).

A particle that touches a wall meets all of it, so that nothing pushes where a surface meets a wall. And a foot that another
wall stands before is left out: fluid may fill all of a crevice and be farther from its end.
"""

import functools
from typing import Any

import warp as wp

from .cells import make_cell_of, make_grid, make_window
from .pair import separation_of
from .params import make_params
from .spec import Spec, types, types_of

# Distance [spacings] from the foot on a surface to the nearest particle up to which a wall is there. Fluid that rests on it
# has one within half the diagonal of a cell, 0.71 in 2-D and 0.87 in 3-D, uneven rows at up to 1.
WET = 1.0
FADE = 0.5  # spacings beyond that in which it goes: smoothly, or fluid that lands would meet it at once
BEFORE = 0.25  # spacings before a surface from which on a wall particle is none of its own, be it as bent as it may
ROW = 0.5  # spacings from the surface of another wall to its first layer
SIDE = 2  # cells to either side that are searched, each half as wide as the list reaches: four spacings with h = 2 spacings


@functools.cache
def make_wetted(precision: str) -> Any:
    """Return the `wp.func` wetted(nearest2, spacing): share of a wall that is there for the fluid.

    nearest2: square of the distance from the foot of the wall particle to the nearest fluid particle [m^2].
    """
    real = types(2, precision).real

    @wp.func
    def wetted(nearest2: real, spacing: real):
        away = wp.sqrt(nearest2) / spacing
        return wp.clamp((real(wp.static(WET + FADE)) - away) / real(FADE), real(0.0), real(1.0))

    return wetted


@functools.cache
def make_seen(spec: Spec) -> Any:
    """Return the `wp.func` seen(d, there, whole, normal, depth, spacing): volume of a wall particle for a fluid one [m^d].

    d: from the wall particle to the fluid particle [m]; there: volume for what does not touch that wall [m^d]; whole: its
    own; normal, depth: of the surface before it.
    """
    real, vec, _, _ = types_of(spec)

    @wp.func
    def seen(d: vec, there: real, whole: real, normal: vec, depth: real, spacing: real):
        result = there
        if wp.static(spec.dry_walls):
            clear = (wp.dot(d, normal) - depth) / spacing
            result = wp.max(there, whole * wp.clamp((real(WET) - clear) / real(FADE), real(0.0), real(1.0)))
        return result

    return seen


@functools.cache
def make_covered(spec: Spec) -> Any:
    """Return the kernel over walls that marks the feet that another wall is before, as near as fluid would have to be."""
    real, vec, _, _ = types_of(spec)
    Params, Grid = make_params(spec.dimension, spec.precision), make_grid(spec.dimension, spec.precision)
    cell_of, separation = make_cell_of(spec.dimension, spec.precision), separation_of(spec)
    window = make_window(SIDE)
    px, py, pz = ([*spec.periodic, False, False])[:3]

    @wp.kernel(module="unique", enable_backward=False)
    def mark_covered(
        first: int,
        fluid_count: int,
        skin_length: real,
        params: Params,
        grid: Grid,
        cell_start: wp.array(dtype=int),
        anchor: wp.array(dtype=vec),
        wall_area: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        covered: wp.array(dtype=wp.uint8),
    ):
        w = wp.tid() + first
        covered[w] = wp.uint8(0)
        if wall_area[w] == real(0.0):
            return
        x, normal = anchor[w + fluid_count], wall_normal[w]
        c = cell_of(x, grid)
        x0, x1 = window(c[0], grid.nx, px)
        y0, y1 = window(c[1], grid.ny, py)
        z0, z1 = window(c[2], grid.nz, pz)
        reach = real(wp.static(WET + FADE + ROW)) * params.spacing + skin_length
        for cz in range(z0, z1):
            for cy in range(y0, y1):
                for cx in range(x0, x1):
                    line = ((cz + grid.nz) % grid.nz) * grid.ny + (cy + grid.ny) % grid.ny
                    cell = grid.cell_count + line * grid.nx + (cx + grid.nx) % grid.nx
                    for j in range(cell_start[cell], cell_start[cell + 1]):
                        way = separation(anchor[j], x, True, params) - wall_depth[w] * normal
                        ahead = wp.dot(way, normal)
                        if ahead > real(BEFORE) * params.spacing and wp.dot(way, way) < reach * reach:
                            covered[w] = wp.uint8(1)

    return mark_covered
