"""Particles that are where no fluid can be: beyond a wall of the domain or inside a body.

Inside a body is who is nearer than a spacing to one of its boundary particles, and deeper than SUNK spacings behind the
surface of all that are about as near as the nearest: at an edge some of them have the surface of the other face before them.
A row at rest stands half a spacing before the surface. Inside a body that is made of cells is who is nearer than INSIDE
spacings to the centre of one: the corners of a staircase are no surface, and what slides round one may graze it.

Beyond a wall is who is in the layers of its particles; where a side is open, fluid may come to lie beyond that over the rim.
They are counted whenever the neighbour list is built: nothing gets through a wall without a way that asks for a new list.
Who has gone over a rim and is twice as far beyond a wall as the kernel reaches is lost: nothing before the wall feels it. It
is brought to rest at each build, for in free fall it would soon be faster than anything inside, and shorten all time steps.
`leak_counts` holds, per phase: the particles counted at the last build, and the most that any build has found.
"""

import functools
from typing import Any

import warp as wp

from .clock import LIVE
from .mirror import NO_WALL, make_sides
from .pair import list_access, separation_of
from .params import make_params
from .spec import Spec, types_of

LAST, LARGEST = 0, 1
SUNK = 0.5  # depth behind the surface, in spacings: as far as a row at rest stands before it
ABOUT = 0.5  # farther than the nearest boundary particle, in spacings
EVERYWHERE = 1.0e30  # thickness of walls over which nothing can get
INSIDE = 0.4  # a flat face of a cell is half a spacing from its centre


@functools.cache
def make_leaks(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels (count_leaks over the fluid, close_leaks on one thread).

    `leaks_found` has one counter per thread and phase, `leak_counts` two per phase, see above.
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
        phase: wp.array(dtype=wp.int8),
        place: wp.array(dtype=vec),
        alive: wp.array(dtype=wp.uint8),
        leaks_found: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        x = place[i]
        outside = bool(False)
        gone = bool(False)
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


@functools.cache
def make_hold_spilled(spec: Spec) -> Any:
    """Return the kernel over the fluid that brings to rest who is beyond a wall by more than twice its thickness."""
    real, vec, _, _ = types_of(spec)
    Sides = make_sides(spec.dimension, spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def hold_spilled(
        first: int,
        sides: Sides,
        wall_thickness: real,
        anchor: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        x = anchor[i]
        lost = bool(False)
        for axis in range(wp.static(spec.dimension)):
            below, above = sides.lower[axis] - x[axis], x[axis] - sides.upper[axis]
            lost = lost or (sides.kind[2 * axis] != NO_WALL and below > real(2.0) * wall_thickness)
            lost = lost or (sides.kind[2 * axis + 1] != NO_WALL and above > real(2.0) * wall_thickness)
        if lost:
            velocity[i] = vec()

    return hold_spilled


@functools.cache
def make_sunk(spec: Spec) -> Any:
    """Return the kernel over the fluid that counts what is inside bodies, from the list; see `make_leaks`.

    Wall bodies up to the number `side_walls` are sides of the domain.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def count_sunk(
        first: int,
        slot: int,
        phase_count: int,
        side_walls: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        wall_body: wp.array(dtype=int),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        counters: wp.array(dtype=int),
        leaks_found: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        if wp.static(spec.changing):
            if i >= counters[LIVE]:
                return
        step = list_step(particle_count)
        begin = list_begin(i, list_width) + int(fluid_neighbours[i]) * step
        end = begin + int(wall_neighbours[i]) * step
        wall_first = particle_count - wall_depth.shape[0]
        nearest = real(1.0e30)
        k = begin
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            if wall_body[j - wall_first] > side_walls:
                nearest = wp.min(nearest, wp.length(separation(position[i], position[j], True, params)))
        before = real(-1.0e30)  # clearance from the surface, the largest of those that count
        k = begin
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(position[i], position[j], True, params)
            if wall_body[j - wall_first] > side_walls and wp.length(d) < nearest + real(ABOUT) * params.spacing:
                before = wp.max(before, wp.dot(d, wall_normal[j - wall_first]) - wall_depth[j - wall_first])
        if nearest < params.spacing and before < real(-SUNK) * params.spacing:
            own = int(0)
            if wp.static(spec.multiphase):
                own = int(phase[i])
            wp.atomic_add(leaks_found, slot * phase_count + own, 1)

    return count_sunk


@functools.cache
def make_in_cells(spec: Spec) -> Any:
    """Return the kernel over the fluid that counts what is inside the cells of bodies, from the list; see `make_leaks`.

    Beyond the sides of the domain `count_leaks` counts; within them the cells of a side are half a spacing away.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def count_in_cells(
        first: int,
        slot: int,
        phase_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        counters: wp.array(dtype=int),
        leaks_found: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        if wp.static(spec.changing):
            if i >= counters[LIVE]:
                return
        x = position[i]
        for axis in range(wp.static(spec.dimension)):
            below = sides.kind[2 * axis] != NO_WALL and x[axis] < sides.lower[axis]
            if below or (sides.kind[2 * axis + 1] != NO_WALL and x[axis] > sides.upper[axis]):
                return
        step = list_step(particle_count)
        k = list_begin(i, list_width) + int(fluid_neighbours[i]) * step
        end = k + int(wall_neighbours[i]) * step
        nearest = real(1.0e30)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            nearest = wp.min(nearest, wp.length(separation(x, position[j], True, params)))
        if nearest < real(INSIDE) * params.spacing:
            own = int(0)
            if wp.static(spec.multiphase):
                own = int(phase[i])
            wp.atomic_add(leaks_found, slot * phase_count + own, 1)

    return count_in_cells
