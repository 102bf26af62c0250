"""Inlets and outlets: layers of particles beyond a side, which become fluid and are made of it (theory: riemann#open).

A buffer is `depth` thick and full of particles that move across the side alone, each row at the velocity of its site. What
crosses the side inwards becomes fluid, fluid that crosses it outwards becomes a buffer particle, and what goes beyond the
depth dies. At the outer end new particles follow in rows, a spacing apart: how many does not depend on who crosses the side
and how often, so that the mass which comes in is that of the given flow. All of this happens right before a neighbour list
is made; `zone` says who is what.
"""

import functools
from typing import Any

import warp as wp

from .clock import FAULT, FAULT_CAPACITY, LIVE, NEXT_ID, ROOM, RUNNING, STEP, TIME, WANTED
from .fields import BUFFER, FLUID, NOBODY
from .spec import Spec, origins_type, types, types_of

MOST_SIDES = 2
BLOCKS = {True: 64, False: 1024}  # stretches of particles that births are counted in, on a CPU and on a GPU


@functools.cache
def make_open_side(precision: str) -> Any:
    """Return the `OpenSide` struct: where an inlet or outlet is, what is given there, and its sites.

    Sites stand in the middle of the lattice cells of the side; the first transverse axis runs fastest. Axes that a dimension
    does not have are its own axis with one site.
    """
    real = types(2, precision).real

    @wp.struct
    class OpenSide:
        face: real  # coordinate of the side [m]
        outward: real  # 1 at the upper side of the axis, -1 at the lower
        depth: real  # thickness of the buffer [m]
        reach: real  # support of the smoothing kernel [m]
        gives_velocity: int  # 1 if the velocity is given, 0 if the pressure is
        relaxation: wp.float64  # rate at which what comes in from outside returns to what is given [1/s]; 0: at once
        first_site: int
        first_axis: int  # the transverse axes
        second_axis: int
        first_count: int
        second_count: int
        first_origin: real  # coordinates of the first site [m]
        second_origin: real
        first_spacing: real
        second_spacing: real
        first_wraps: int  # whether the transverse axis is periodic
        second_wraps: int
        sponge_length: real  # of the layer inside that damps [m]; 0 for none
        sponge_rate: real  # of it at the side [1/s]
        sponge_moves: int  # whether it draws the velocity
        signal_begin: int  # place of its factors among `signals`
        signal_count: int

    return OpenSide


@functools.cache
def make_set_origins(spec: Spec) -> Any:
    """Return the `wp.func` set_origins(x): the place x as that of the start of each window, see `flow_map`."""
    vec = types_of(spec).vec
    row = origins_type(spec)
    dimension, windows = spec.dimension, max(spec.windows, 1)

    @wp.func
    def set_origins(x: vec):
        result = row()
        for window in range(wp.static(windows)):
            for axis in range(wp.static(dimension)):
                result[window * wp.static(dimension) + axis] = x[axis]
        return result

    return set_origins


@functools.cache
def make_fill(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels that fill the buffers of a fresh start: (write the particles, count them in)."""
    real, vec, _, _ = types_of(spec)
    row = origins_type(spec)
    set_origins = make_set_origins(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def fill_buffers(
        first: int,
        fill_position: wp.array(dtype=vec),
        fill_zone: wp.array(dtype=wp.int8),
        cell_volume: real,
        counters: wp.array(dtype=int),
        anchor: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        particle_id: wp.array(dtype=int),
        zone: wp.array(dtype=wp.int8),
        alive: wp.array(dtype=wp.uint8),
        origin: wp.array(dtype=row),
    ):
        k = wp.tid() + first
        i = counters[LIVE] + k
        if wp.static(spec.windows > 0):
            origin[i] = set_origins(fill_position[k])
        anchor[i] = fill_position[k]
        position[i] = fill_position[k]
        rest_volume[i] = cell_volume
        particle_id[i] = counters[NEXT_ID] + k
        zone[i] = fill_zone[k]
        alive[i] = wp.uint8(1)

    @wp.kernel(module="unique", enable_backward=False)
    def count_buffers(fill_zone: wp.array(dtype=wp.int8), counters: wp.array(dtype=int)):
        counters[LIVE] = counters[LIVE] + fill_zone.shape[0]
        counters[NEXT_ID] = counters[NEXT_ID] + fill_zone.shape[0]

    return fill_buffers, count_buffers


@functools.cache
def make_outward(dimension: int, precision: str) -> Any:
    """Return the `wp.func` beyond(x, side, axis): how far outside of an open side a point is [m]; inside it is negative."""
    vec = types(dimension, precision).vec
    OpenSide = make_open_side(precision)

    @wp.func
    def beyond(x: vec, side: OpenSide, axis: int):
        return (x[axis] - side.face) * side.outward

    return beyond


@functools.cache
def make_births(spec: Spec) -> tuple[Any, Any, Any]:
    """Return the kernels (count the births of each block of sites, find places for them, write the newborn), see the module.

    A site whose particles come in has the next one ready `site_ahead` [m] inside of the outer end of the buffer, negative:
    beyond it. It is born once it is inside, and the one after it is a spacing further out. A site whose particles go out
    takes the place of the particle that dies there for the next one.

    step_share: 1 where lists are made in the middle of a step, before the clock goes on to the time of positions, else 0.

    Blocks are stretches of sites, so that rows and numbers of the newborn do not depend on the number of threads. If there
    is no room for all, none is born and nothing crosses, and the loop stops until there is.
    """
    real, vec, _, pair = types_of(spec)
    row = origins_type(spec)
    set_origins = make_set_origins(spec)
    OpenSide = make_open_side(spec.precision)
    axis = spec.open_axis

    @wp.func
    def due(ahead: wp.float64, spacing: wp.float64):
        result = int(0)
        if ahead >= wp.float64(0.0):
            result = int(ahead / spacing) + 1
        return result

    @wp.kernel(module="unique", enable_backward=False)
    def count_births(
        first: int,
        crossing_blocks: int,
        row_spacing: wp.float64,
        site_open: wp.array(dtype=wp.uint8),
        site_ahead: wp.array(dtype=wp.float64),
        births: wp.array(dtype=int),
    ):
        block = wp.tid() + first
        sites = site_open.shape[0]
        chunk = (sites + crossing_blocks - 1) / crossing_blocks
        found = int(0)
        for k in range(wp.min(block * chunk, sites), wp.min((block + 1) * chunk, sites)):
            found += int(site_open[k]) * due(site_ahead[k], row_spacing)
        births[block] = found

    @wp.kernel(module="unique", enable_backward=False)
    def place_births(
        crossing_blocks: int,
        fluid_count: int,
        counters: wp.array(dtype=int),
        births: wp.array(dtype=int),
    ):
        # births becomes the running sum up to each block, and the last entry the sum of all; -1: nothing may cross
        total = int(0)
        for block in range(crossing_blocks):
            found = births[block]
            births[block] = total
            total += found
        births[crossing_blocks] = total
        wanted = counters[LIVE] + total
        if wanted > fluid_count:
            births[crossing_blocks] = -1
            counters[WANTED] = wanted
            counters[FAULT] = FAULT_CAPACITY
            counters[RUNNING] = 0
            counters[ROOM] = 0

    @wp.kernel(module="unique", enable_backward=False)
    def give_birth(
        first: int,
        crossing_blocks: int,
        step_share: wp.float64,
        row_spacing: wp.float64,
        cell_volume: real,
        open_sides: wp.array(dtype=OpenSide),
        counters: wp.array(dtype=int),
        births: wp.array(dtype=int),
        site_side: wp.array(dtype=int),
        site_open: wp.array(dtype=wp.uint8),
        site_position: wp.array(dtype=vec),
        site_ahead: wp.array(dtype=wp.float64),
        face_pressure: wp.array(dtype=pair),
        face_velocity: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        density_excess: wp.array(dtype=real),
        rest_volume: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        wall_impact: wp.array(dtype=real),
        pressure_gradient: wp.array(dtype=vec),
        particle_id: wp.array(dtype=int),
        row_speed: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
        alive: wp.array(dtype=wp.uint8),
        clock: wp.array(dtype=wp.float64),
        origin: wp.array(dtype=row),
        origin_change: wp.array(dtype=row),
        born: wp.array(dtype=real),
    ):
        block = wp.tid() + first
        if births[crossing_blocks] < 0:
            return
        sites = site_open.shape[0]
        chunk = (sites + crossing_blocks - 1) / crossing_blocks
        newborn = births[block]
        for k in range(wp.min(block * chunk, sites), wp.min((block + 1) * chunk, sites)):
            ahead = site_ahead[k]
            side = open_sides[site_side[k]]
            for _ in range(int(site_open[k]) * due(ahead, row_spacing)):
                i = counters[LIVE] + newborn
                x = site_position[k]
                x[axis] = side.face + side.outward * (side.depth - real(ahead))
                anchor[i] = x
                offset[i] = vec()
                position[i] = x
                velocity[i] = face_velocity[k]
                row_speed[i] = face_velocity[k][axis]
                acceleration[i] = vec()
                # too far out for the fluid to see; the coming step gives it density and volume
                density_excess[i] = real(0.0)
                rest_volume[i] = cell_volume
                state[i] = pair(face_pressure[k][0], cell_volume)
                if wp.static(spec.shifting):
                    shift[i] = vec()
                    carried[i] = vec()
                if wp.static(spec.density_diffusion):
                    pressure_gradient[i] = vec()
                if wp.static(spec.walls):
                    if i < wall_impact.shape[0]:  # which the Riemann scheme alone has
                        wall_impact[i] = real(0.0)
                particle_id[i] = counters[NEXT_ID] + newborn
                zone[i] = wp.int8(BUFFER + site_side[k])
                alive[i] = wp.uint8(1)
                if wp.static(spec.windows > 0):
                    origin[i] = set_origins(x)
                    born[i] = real(clock[TIME] + step_share * clock[STEP])
                    if wp.static(spec.shifting):
                        origin_change[i] = row()
                ahead -= row_spacing
                newborn += 1
            if ahead < -row_spacing:
                ahead += row_spacing * wp.floor(-ahead / row_spacing)
            site_ahead[k] = ahead

    return count_births, place_births, give_birth


@functools.cache
def make_crossing(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels (let particles cross open sides and die, count them and their mass in), see the module.

    It runs over blocks of particles, stretches of the rows before the newborn, each with the mass that crosses in it.
    """
    real, vec, _, _ = types_of(spec)
    row = origins_type(spec)
    OpenSide = make_open_side(spec.precision)
    beyond = make_outward(spec.dimension, spec.precision)
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def cross(
        first: int,
        crossing_blocks: int,
        open_sides: wp.array(dtype=OpenSide),
        rest_mass: wp.float64,
        counters: wp.array(dtype=int),
        births: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        row_speed: wp.array(dtype=real),
        acceleration: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        alive: wp.array(dtype=wp.uint8),
        crossed: wp.array(dtype=wp.float64),
        origin_change: wp.array(dtype=row),
    ):
        block = wp.tid() + first
        for entry in range(2 * MOST_SIDES):
            crossed[2 * MOST_SIDES * block + entry] = wp.float64(0.0)
        if births[crossing_blocks] < 0:
            return
        live = counters[LIVE]
        chunk = (live + crossing_blocks - 1) / crossing_blocks
        for i in range(wp.min(block * chunk, live), wp.min((block + 1) * chunk, live)):
            k = int(zone[i]) - BUFFER
            if k >= 0:
                way = beyond(position[i], open_sides[k], axis)
                if way > open_sides[k].depth:
                    zone[i] = wp.int8(NOBODY)
                    alive[i] = wp.uint8(0)
                elif way <= real(0.0):
                    zone[i] = wp.int8(FLUID)
                    crossed[2 * (MOST_SIDES * block + k)] += rest_mass * wp.float64(rest_volume[i])
            elif int(zone[i]) == FLUID:
                for other in range(open_sides.shape[0]):
                    if beyond(position[i], open_sides[other], axis) > real(0.0):
                        zone[i] = wp.int8(BUFFER + other)
                        crossed[2 * (MOST_SIDES * block + other) + 1] += rest_mass * wp.float64(rest_volume[i])
                        row_speed[i] = velocity[i][axis]
                        acceleration[i] = vec()
                        if wp.static(spec.shifting):
                            shift[i] = vec()
                            carried[i] = vec()
                            if wp.static(spec.windows > 0):
                                origin_change[i] = row()

    @wp.kernel(module="unique", enable_backward=False)
    def count_in(
        crossing_blocks: int,
        counters: wp.array(dtype=int),
        births: wp.array(dtype=int),
        crossed: wp.array(dtype=wp.float64),
        through: wp.array(dtype=wp.float64),
    ):
        born = births[crossing_blocks]
        if born >= 0:
            counters[LIVE] = counters[LIVE] + born
            counters[NEXT_ID] = counters[NEXT_ID] + born
            for entry in range(2 * MOST_SIDES):
                total = wp.float64(0.0)
                for block in range(crossing_blocks):
                    total += crossed[2 * MOST_SIDES * block + entry]
                through[entry] = through[entry] + total

    return cross, count_in
