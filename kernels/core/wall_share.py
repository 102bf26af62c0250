"""Walls with a velocity of their own in continuity, and what it has of a compression beside them (theory: delta#d6)."""

import functools
from typing import Any

import warp as wp

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
