"""The flow at inlets and outlets: what arrives from inside, characteristics, values of the buffers (theory: riemann#open).

At each site of an open side a linear fit of pressure and velocity of the fluid, not of the buffers, gives what arrives from
inside, w_out = p + Z u_n (n points outwards). What comes in, w_in = p - Z u_n, is such that the side has what is given, at
once, or where waves may leave on the mean of the side with a rate of `relaxation`:

    velocity given: w_in = w_out - 2 Z u_n,  pressure given: w_in = 2 p - w_out
    p* = (w_out + w_in)/2,  u_n* = (w_out - w_in)/(2 Z)

Buffer particles take p* + (distance to the side) dp/dn, so that a linear pressure is continued exactly, and the velocity of
the side, interpolated between its sites; the one across it with its slope too where waves may leave and fluid goes out.
"""

import functools
from typing import Any

import warp as wp

from .cells import make_grid
from .clock import STEP, TIME
from .crossing import make_open_side, make_outward
from .eos import make_eos
from .fields import BUFFER, FLUID
from .lanes import with_lanes
from .params import make_params, make_phase
from .side_fit import make_between, make_fit, make_signal, make_site_at, site_lanes, sites_of
from .spec import Spec, types, types_of

LEAST_PRESSURE = -0.5  # of the stiffness, in buffers: a density for less than -1 times it does not exist


@functools.cache
def make_excess(precision: str) -> Any:
    """Return the `wp.func` excess_of(p, stiffness, gamma): density excess at a pressure p without the background."""
    real = types(2, precision).real
    eos = make_eos(precision)

    @wp.func
    def excess_of(p: real, stiffness: real, gamma: real):
        held = wp.max(p, real(LEAST_PRESSURE) * stiffness)
        s = held / (stiffness * gamma)
        for _ in range(3):  # Newton: the start is off by (gamma - 1) s^2/2
            s -= (eos(s, stiffness, gamma) - held) / (stiffness * gamma * wp.pow(real(1.0) + s, gamma - real(1.0)))
        return s

    return excess_of


@functools.cache
def make_arrival(spec: Spec) -> Any:
    """Return the kernel over the sites of all open sides that finds what arrives there from inside.

    site_arrival: (pressure [Pa], velocity outwards [m/s], what is given: one of both).
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Grid = make_grid(spec.dimension, spec.precision)
    OpenSide = make_open_side(spec.precision)
    fit, signal_at = make_fit(spec), make_signal()
    site_of, lane_of = sites_of(spec)
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def face_arrival(
        first: int,
        beginning: int,
        params: Params,
        grid: Grid,
        clock: wp.array(dtype=wp.float64),
        phases: wp.array(dtype=Phase),
        open_sides: wp.array(dtype=OpenSide),
        signals: wp.array(dtype=wp.float64),
        signal_step: wp.float64,
        site_side: wp.array(dtype=int),
        site_position: wp.array(dtype=vec),
        site_velocity: wp.array(dtype=vec),
        site_pressure: wp.array(dtype=real),
        site_ahead: wp.array(dtype=wp.float64),
        site_arrival: wp.array(dtype=wp.vec3d),
        cell_start: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        zone: wp.array(dtype=wp.int8),
        face_pressure: wp.array(dtype=pair),
        face_velocity: wp.array(dtype=vec),
        face_stretch: wp.array(dtype=real),
    ):
        t = wp.tid()
        k, lane = site_of(t) + first, lane_of(t)
        side = open_sides[site_side[k]]
        inside = fit(site_position[k], lane, params, grid, cell_start, position, velocity, state, zone)
        if lane > 0:
            return
        if beginning == 0:
            # the way of its row in the drift of this step
            site_ahead[k] = site_ahead[k] - wp.float64(face_velocity[k][axis] * side.outward) * clock[STEP]
        time = clock[TIME] + clock[STEP]
        factor = signal_at(time, side.signal_begin, side.signal_count, signal_step, signals)
        wanted = site_velocity[k] * real(factor)
        given = wp.float64(site_pressure[k]) * factor + wp.float64(phases[0].background)
        if side.gives_velocity == 1:
            given = wp.float64(wanted[axis] * side.outward)
        v = inside.velocity
        if inside.valid == 0:
            inside.pressure = wp.float64(phases[0].background)
            v = wanted
        site_arrival[k] = wp.vec3d(inside.pressure, wp.float64(v[axis] * side.outward), given)
        if side.gives_velocity == 1:
            v = wanted
        face_velocity[k] = v
        face_pressure[k] = pair(real(inside.pressure), real(inside.slope) * side.outward)
        face_stretch[k] = real(inside.stretch) * side.outward

    return with_lanes(face_arrival, site_lanes(spec))


@functools.cache
def make_site_sums(spec: Spec) -> Any:
    """Return the kernel that adds up what arrives at the sites, over `side_stretches` stretches of each side.

    site_sums: (pressure [Pa], velocity outwards [m/s], what is given, number) over the sites that have fluid before them.
    """
    OpenSide = make_open_side(spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def sum_sites(
        first: int,
        side_stretches: int,
        open_sides: wp.array(dtype=OpenSide),
        site_open: wp.array(dtype=wp.uint8),
        site_arrival: wp.array(dtype=wp.vec3d),
        site_sums: wp.array(dtype=wp.vec4d),
    ):
        m = wp.tid() + first
        side = open_sides[m / side_stretches]
        count = side.first_count * side.second_count
        stretch = (count + side_stretches - 1) / side_stretches
        begin = wp.min((m % side_stretches) * stretch, count)
        total = wp.vec4d()
        for k in range(side.first_site + begin, side.first_site + wp.min(begin + stretch, count)):
            if site_open[k] == wp.uint8(1):
                arrival = site_arrival[k]
                total += wp.vec4d(arrival[0], arrival[1], arrival[2], wp.float64(1.0))
        site_sums[m] = total

    return sum_sites


@functools.cache
def make_side(spec: Spec) -> Any:
    """Return the kernel over the open sides: by how much what holds there differs from what is given, for sound to leave.

    Only the mean of a side is sound that goes out: single sites that let go of what is given would take every change of a
    velocity profile for a pressure of Z times it. side_memory holds w_in and what of it was known in the step before: 2 p or
    -2 Z u_n, and beside a given pressure -Z times the velocity at which what comes in at the other side goes out here. Of a
    flow that speeds up what is known need not come back by relaxation. `beginning` = 1 sets w_in to what the fluid inside
    has, with that velocity.
    """
    Phase = make_phase(spec.precision)
    OpenSide = make_open_side(spec.precision)

    @wp.func
    def total_of(i: int, side_stretches: int, site_sums: wp.array(dtype=wp.vec4d)):
        total = wp.vec4d()
        for m in range(i * side_stretches, (i + 1) * side_stretches):
            total += site_sums[m]
        return total

    @wp.kernel(module="unique", enable_backward=False)
    def side_state(
        first: int,
        beginning: int,
        side_stretches: int,
        clock: wp.array(dtype=wp.float64),
        phases: wp.array(dtype=Phase),
        open_sides: wp.array(dtype=OpenSide),
        site_sums: wp.array(dtype=wp.vec4d),
        side_memory: wp.array(dtype=wp.vec2d),
        side_excess: wp.array(dtype=wp.float64),
    ):
        i = wp.tid() + first
        side = open_sides[i]
        side_excess[i] = wp.float64(0.0)
        if side.relaxation == wp.float64(0.0):
            return
        total = total_of(i, side_stretches, site_sums)
        count = wp.max(total[3], wp.float64(1.0))
        mean = total / count
        z = wp.float64(phases[0].impedance)
        given = mean[2]
        going = mean[0] + z * mean[1]
        speed = mean[1]  # outwards, of the start
        if side.gives_velocity == 1:
            coming = going - wp.float64(2.0) * z * given
            made = wp.float64(-2.0) * z * given
        else:
            coming = wp.float64(2.0) * given - going
            made = wp.float64(2.0) * given
            known = bool(False)
            expected = wp.float64(0.0)  # the flow that comes in across the sides with a given velocity
            for other in range(open_sides.shape[0]):
                if open_sides[other].gives_velocity == 1:
                    known = True
                    expected -= total_of(other, side_stretches, site_sums)[2]
            if known:
                speed = expected / count
                made -= z * speed
        if beginning == 1:
            coming = mean[0] - z * speed
        else:
            memory = side_memory[i]
            held = memory[0] + made - memory[1]
            coming = held + (coming - held) * (wp.float64(1.0) - wp.exp(-side.relaxation * clock[STEP]))
        side_memory[i] = wp.vec2d(coming, made)
        value = wp.float64(0.5) * (going + coming)
        if side.gives_velocity == 1:
            value = wp.float64(0.5) * (going - coming) / z
        side_excess[i] = value - given

    return side_state


@functools.cache
def make_face(spec: Spec) -> Any:
    """Return the kernel over the sites of all open sides that gives them pressure and velocity."""
    real, vec, _, pair = types_of(spec)
    Phase = make_phase(spec.precision)
    OpenSide = make_open_side(spec.precision)
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def face_state(
        first: int,
        phases: wp.array(dtype=Phase),
        open_sides: wp.array(dtype=OpenSide),
        site_side: wp.array(dtype=int),
        site_arrival: wp.array(dtype=wp.vec3d),
        side_excess: wp.array(dtype=wp.float64),
        face_pressure: wp.array(dtype=pair),
        face_velocity: wp.array(dtype=vec),
        face_stretch: wp.array(dtype=real),
    ):
        k = wp.tid() + first
        side = open_sides[site_side[k]]
        z = wp.float64(phases[0].impedance)
        arrival = site_arrival[k]
        p = arrival[2] + side_excess[site_side[k]]
        normal = arrival[1] + (arrival[0] - p) / z
        if side.gives_velocity == 1:
            normal = p
            p = arrival[0] + z * (arrival[1] - normal)
        v = face_velocity[k]
        if side.gives_velocity == 0 and normal <= wp.float64(0.0):
            v = vec()  # what comes in across a side of given pressure comes in straight
        v[axis] = real(normal) * side.outward
        face_velocity[k] = v
        face_pressure[k] = pair(real(p), face_pressure[k][1])
        if side.relaxation == wp.float64(0.0) or normal <= wp.float64(0.0):
            # a wave that leaves goes on beyond the side; rows that come in keep their spacing
            face_stretch[k] = real(0.0)

    return face_state


@functools.cache
def make_buffer(spec: Spec) -> Any:
    """Return the kernel that gives the buffer particles the pressure and velocity that the sides continue outwards.

    What comes in takes the volume of its cell, so that it has the density that goes with the pressure; what goes out keeps
    its mass. All move at the velocity of the side: only what the fluid sees of them is continued beyond it.
    """
    real, vec, _, pair = types_of(spec)
    Phase = make_phase(spec.precision)
    OpenSide = make_open_side(spec.precision)
    beyond = make_outward(spec.dimension, spec.precision)
    excess_of = make_excess(spec.precision)
    corners_of, between = make_between(spec)
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def buffer_state(
        first: int,
        phases: wp.array(dtype=Phase),
        open_sides: wp.array(dtype=OpenSide),
        cell_volume: real,
        site_open: wp.array(dtype=wp.uint8),
        face_pressure: wp.array(dtype=pair),
        face_velocity: wp.array(dtype=vec),
        face_stretch: wp.array(dtype=real),
        position: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        velocity: wp.array(dtype=vec),
        density_excess: wp.array(dtype=real),
        rest_volume: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        row_speed: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        which = int(zone[i]) - BUFFER
        if which < 0:
            return
        side = open_sides[which]
        x = position[i]
        corners = corners_of(x, side, site_open)
        face = between(face_pressure, corners)
        v = between(face_velocity, corners)
        stretch = between(face_stretch, corners)
        row_speed[i] = v[axis]
        way = wp.min(beyond(x, side, axis), side.reach)  # further out no fluid sees it
        v[axis] = v[axis] + stretch * way
        p = face[0] + face[1] * way
        s = excess_of(p - phases[0].background, phases[0].stiffness, phases[0].gamma)
        if row_speed[i] * side.outward < real(0.0):
            rest_volume[i] = cell_volume * (real(1.0) + s)
        velocity[i] = v
        density_excess[i] = s
        state[i] = pair(p, rest_volume[i] / (real(1.0) + s))

    return buffer_state


@functools.cache
def make_sponge(spec: Spec) -> Any:
    """Return the kernel of the layers inside of open sides that draw the flow to what is given there (theory: riemann#open).

        a -= s (c/L) (1 - x/L)^2 (v - v_given),  the density likewise where a pressure is given; x: distance to the side
    """
    real, vec, _, _ = types_of(spec)
    Phase = make_phase(spec.precision)
    OpenSide = make_open_side(spec.precision)
    beyond = make_outward(spec.dimension, spec.precision)
    excess_of, site_at, signal_at = make_excess(spec.precision), make_site_at(spec), make_signal()
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def sponge(
        first: int,
        clock: wp.array(dtype=wp.float64),
        phases: wp.array(dtype=Phase),
        open_sides: wp.array(dtype=OpenSide),
        signals: wp.array(dtype=wp.float64),
        signal_step: wp.float64,
        site_pressure: wp.array(dtype=real),
        sponge_velocity: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        density_excess: wp.array(dtype=real),
        acceleration: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        if int(zone[i]) != FLUID:
            return
        x = position[i]
        for number in range(open_sides.shape[0]):
            side = open_sides[number]
            share = real(1.0) + beyond(x, side, axis) / wp.max(side.sponge_length, real(1.0e-30))
            if side.sponge_length > real(0.0) and share > real(0.0):
                rate = side.sponge_rate * share * share
                time = clock[TIME] + clock[STEP]
                factor = real(signal_at(time, side.signal_begin, side.signal_count, signal_step, signals))
                wanted = vec()
                p = real(0.0)
                for corner in range(4):
                    k, weight = site_at(x, side, corner)
                    wanted += (weight * factor) * sponge_velocity[k]
                    p += weight * factor * site_pressure[k]
                if side.sponge_moves == 1:
                    acceleration[i] = acceleration[i] - rate * (velocity[i] - wanted)
                if side.gives_velocity == 0:
                    s = excess_of(p, phases[0].stiffness, phases[0].gamma)
                    density_excess[i] = density_excess[i] - rate * real(clock[STEP]) * (density_excess[i] - s)

    return sponge
