"""Particles that are where no fluid can be: beyond a wall of the domain or inside a body.

Inside a body is who is nearer than INSIDE spacings to the centre of one of its cells: the corners of its staircase are none
of its surface, and what slides round one may graze it.

Beyond a wall is who is in the layers of its particles; where a side is open, fluid may come to lie beyond that over the rim.
They are counted whenever the neighbour list is built: nothing gets through a wall without a way that asks for a new list.
`leak_counts` holds, per phase: the particles counted at the last build, and the most that any build has found.
"""

import functools
from typing import Any

import warp as wp

from .mirror import NO_WALL, make_sides
from .spec import Spec, types_of

LAST, LARGEST = 0, 1
INSIDE = 0.4  # a flat face of a cell is half a spacing from its centre


@functools.cache
def make_leaks(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels (count_leaks over the fluid, close_leaks on one thread).

    `leaks_found` has one counter per thread and phase, `leak_counts` two per phase, see above; `solid_cells` one entry per
    lattice cell of the domain, 1 inside a body, the last axis fastest; none if there is no body.
    """
    real, vec, _, _ = types_of(spec)
    Sides = make_sides(spec.dimension, spec.precision)
    dimension = spec.dimension
    px, py, pz = (bool(wraps) for wraps in ([*spec.periodic, False, False])[:3])

    @wp.kernel(module="unique", enable_backward=False)
    def count_leaks(
        first: int,
        slot: int,
        phase_count: int,
        sides: Sides,
        wall_thickness: real,
        solid_shape: wp.vec3i,
        solid_cells: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        place: wp.array(dtype=vec),
        alive: wp.array(dtype=wp.uint8),
        leaks_found: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        x = place[i]
        outside = bool(False)
        gone = bool(False)
        cell = int(0)
        from_centre = real(0.0)
        for axis in range(wp.static(dimension)):
            below, above = sides.lower[axis] - x[axis], x[axis] - sides.upper[axis]
            wraps = (axis == 0 and px) or (axis == 1 and py) or (axis == 2 and pz)
            if below > real(0.0):
                if sides.kind[2 * axis] != NO_WALL and below < wall_thickness:
                    outside = True
                else:
                    gone = gone or not wraps
            if above > real(0.0):
                if sides.kind[2 * axis + 1] != NO_WALL and above < wall_thickness:
                    outside = True
                else:
                    gone = gone or not wraps
            share = (x[axis] - sides.lower[axis]) / (sides.upper[axis] - sides.lower[axis])
            cells = share * real(solid_shape[axis])
            index = wp.clamp(int(wp.floor(cells)), 0, solid_shape[axis] - 1)
            cell = cell * solid_shape[axis] + index
            off = cells - real(index) - real(0.5)
            from_centre += off * off
        if solid_cells.shape[0] > 0:
            outside = outside or (solid_cells[cell] != wp.uint8(0) and from_centre < real(INSIDE * INSIDE))
        if wp.static(spec.changing):
            gone = gone or alive[i] == wp.uint8(0)
        if outside and not gone:
            own = int(0)
            if wp.static(spec.multiphase):
                own = int(phase[i])
            wp.atomic_add(leaks_found, slot * phase_count + own, 1)

    @wp.kernel(module="unique", enable_backward=False)
    def close_leaks(phase_count: int, leaks_found: wp.array(dtype=int), leak_counts: wp.array(dtype=int)):
        for own in range(phase_count):
            found = int(0)
            k = own
            while k < leaks_found.shape[0]:
                found += leaks_found[k]
                leaks_found[k] = 0
                k += phase_count
            leak_counts[2 * own + LAST] = found
            leak_counts[2 * own + LARGEST] = wp.max(leak_counts[2 * own + LARGEST], found)

    return count_leaks, close_leaks
