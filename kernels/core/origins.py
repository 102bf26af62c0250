"""What a list build, stages and outputs have to know of the places at the start of windows, see `flow_map`."""

import functools
from typing import Any

import warp as wp

from .cells import make_grid
from .spec import Spec, origins_type, types_of

LEAST_EIGENVALUE = 0.025  # of a moment of the fluid, below which there is no gradient; at a flat wall it is 1/2
# entries of `window_turn`
NEXT = 0  # number of the next start of a window, counted from time 0
SLOT = 1  # window that begins anew in this step, -1: none
TURN_SIZE = 2


@functools.cache
def make_wrap(spec: Spec) -> Any:
    """Return the kernel that moves X with the particles that the coming list build wraps, see `cells.make_keys`."""
    real, vec, _, _ = types_of(spec)
    row = origins_type(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    dimension, windows = spec.dimension, spec.windows

    @wp.kernel(module="unique", enable_backward=False)
    def wrap_origins(
        first: int,
        grid: Grid,
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        origin: wp.array(dtype=row),
    ):
        i = wp.tid() + first
        new = anchor[i] + offset[i]
        moved = origin[i]
        for axis in range(wp.static(dimension)):
            period = grid.box[axis]
            way = real(0.0)
            if period > real(0.0):
                if new[axis] < grid.origin[axis]:
                    way = period
                elif new[axis] >= grid.origin[axis] + period:
                    way = -period
            for window in range(wp.static(windows)):
                moved[window * wp.static(dimension) + axis] += way
        origin[i] = moved

    return wrap_origins
