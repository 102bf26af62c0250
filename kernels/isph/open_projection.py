"""Inlets and outlets of projection ISPH: what holds at their sites, and what the buffers beyond carry (theory: isph#open).

Where the pressure is given, buffer particles are known entries of the pressure equation: p = p_s + (distance) dp/dn, with
the slope of the fit of the last solved pressure; their velocity is that of the fit of the fluid, with its
slope where it goes out. Where the velocity is given they have that velocity, and no entry in the matrix: pressure changes
towards them by what brings the velocity of the step to the given one. Before its gradient is taken, the solved pressure is
continued into them by the fit.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.cells import make_grid
from warpsph.kernels.core.clock import STEP, TIME
from warpsph.kernels.core.crossing import make_open_side, make_outward
from warpsph.kernels.core.fields import BUFFER, FLUID
from warpsph.kernels.core.lanes import with_lanes
from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.side_fit import make_between, make_fit, make_signal, site_lanes, sites_of
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NEXT, make_forcing
from warpsph.kernels.core.weights import make_weights


@functools.cache
def make_rows(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels (over the sites, over the fluid) that say how fast rows move in the coming step.

    The speed of a site is extrapolated to the middle of the step, as `advect` does with that of the fluid: rows whose way
    is that of another rule leave gaps where the flow speeds up. `site_ahead` goes down by it.
    """
    real, vec, _, _ = types_of(spec)
    OpenSide = make_open_side(spec.precision)
    time_weights, (corners_of, between) = make_weights(spec.second_order), make_between(spec)
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def site_way(
        first: int,
        clock: wp.array(dtype=wp.float64),
        open_sides: wp.array(dtype=OpenSide),
        site_side: wp.array(dtype=int),
        face_velocity: wp.array(dtype=vec),
        face_before: wp.array(dtype=vec),
        site_speed: wp.array(dtype=real),
        site_ahead: wp.array(dtype=wp.float64),
    ):
        k = wp.tid() + first
        v = face_velocity[k][axis]
        v += (v - face_before[k][axis]) * real(wp.float64(0.5) * time_weights(clock)[3])
        site_speed[k] = v
        side = open_sides[site_side[k]]
        site_ahead[k] = site_ahead[k] - wp.float64(v * side.outward) * clock[STEP]

    @wp.kernel(module="unique", enable_backward=False)
    def row_way(
        first: int,
        open_sides: wp.array(dtype=OpenSide),
        site_open: wp.array(dtype=wp.uint8),
        site_speed: wp.array(dtype=real),
        position: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        row_speed: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        which = int(zone[i]) - BUFFER
        if which < 0:
            return
        side = open_sides[which]
        row_speed[i] = between(site_speed, corners_of(position[i], side, site_open))

    return site_way, row_way


@functools.cache
def make_side_given(spec: Spec) -> Any:
    """Return the kernel over sites that evaluates what is given there at the end of the step."""
    real, vec, _, pair = types_of(spec)
    OpenSide = make_open_side(spec.precision)
    signal_at = make_signal()

    @wp.kernel(module="unique", enable_backward=False)
    def side_given(
        first: int,
        clock: wp.array(dtype=wp.float64),
        open_sides: wp.array(dtype=OpenSide),
        signals: wp.array(dtype=wp.float64),
        signal_step: wp.float64,
        site_side: wp.array(dtype=int),
        site_velocity: wp.array(dtype=vec),
        site_pressure: wp.array(dtype=real),
        given_velocity: wp.array(dtype=vec),
        face_pressure: wp.array(dtype=pair),
    ):
        k = wp.tid() + first
        side = open_sides[site_side[k]]
        time = clock[TIME] + clock[STEP]
        factor = real(signal_at(time, side.signal_begin, side.signal_count, signal_step, signals))
        given_velocity[k] = site_velocity[k] * factor
        if side.gives_velocity == 0:
            face_pressure[k] = pair(site_pressure[k] * factor, face_pressure[k][1])

    return side_given


@functools.cache
def make_side_pressure(spec: Spec) -> Any:
    """Return the kernel over sites that fits the pressure of the fluid: (value [Pa], slope outwards [Pa/m])."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Grid = make_grid(spec.dimension, spec.precision)
    OpenSide = make_open_side(spec.precision)
    fit = make_fit(spec)
    site_of, lane_of = sites_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def side_pressure(
        first: int,
        params: Params,
        grid: Grid,
        open_sides: wp.array(dtype=OpenSide),
        site_side: wp.array(dtype=int),
        site_position: wp.array(dtype=vec),
        cell_start: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        zone: wp.array(dtype=wp.int8),
        face_pressure: wp.array(dtype=pair),
    ):
        t = wp.tid()
        k, lane = site_of(t) + first, lane_of(t)
        side = open_sides[site_side[k]]
        inside = fit(site_position[k], lane, params, grid, cell_start, position, velocity, state, zone)
        if lane > 0:
            return
        p = inside.pressure
        if side.gives_velocity == 0:
            p = wp.float64(face_pressure[k][0])
        face_pressure[k] = pair(real(p), real(inside.slope) * side.outward)

    return with_lanes(side_pressure, site_lanes(spec))


@functools.cache
def make_side_velocity(spec: Spec) -> Any:
    """Return the kernel over sites that gives them the velocity at the end of the step; `beginning` 1: that of the start.

    The velocity before time 0 is that of the fluid, also where another one is given from then on: an inlet that opens at
    once accelerates the fluid by a pressure.
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Grid = make_grid(spec.dimension, spec.precision)
    OpenSide = make_open_side(spec.precision)
    fit = make_fit(spec)
    site_of, lane_of = sites_of(spec)
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def side_velocity(
        first: int,
        beginning: int,
        params: Params,
        grid: Grid,
        open_sides: wp.array(dtype=OpenSide),
        site_side: wp.array(dtype=int),
        site_position: wp.array(dtype=vec),
        given_velocity: wp.array(dtype=vec),
        cell_start: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        zone: wp.array(dtype=wp.int8),
        face_velocity: wp.array(dtype=vec),
        face_before: wp.array(dtype=vec),
        face_stretch: wp.array(dtype=real),
    ):
        t = wp.tid()
        k, lane = site_of(t) + first, lane_of(t)
        side = open_sides[site_side[k]]
        if side.gives_velocity == 1 and beginning == 0:
            if lane == 0:
                face_stretch[k] = real(0.0)
                face_before[k] = face_velocity[k]
                face_velocity[k] = given_velocity[k]
            return
        inside = fit(site_position[k], lane, params, grid, cell_start, position, velocity, state, zone)
        if lane > 0:
            return
        face_stretch[k] = real(0.0)
        face_before[k] = face_velocity[k]
        v = inside.velocity
        if side.gives_velocity == 0:
            if v[axis] * side.outward > real(0.0):
                face_stretch[k] = real(inside.stretch) * side.outward
            else:
                along = v[axis]
                v = vec()  # what comes in across a side of given pressure comes in straight
                v[axis] = along
        face_velocity[k] = v
        if beginning == 1:
            face_before[k] = v

    return with_lanes(side_velocity, site_lanes(spec))


@functools.cache
def make_buffer_pressure(spec: Spec) -> Any:
    """Return the kernel that continues pressure and its gradient from the sites into the buffers.

    Where the velocity is given it also writes the velocity at the end of the step, `velocity_star`.
    """
    real, vec, _, pair = types_of(spec)
    OpenSide = make_open_side(spec.precision)
    beyond, (corners_of, between) = make_outward(spec.dimension, spec.precision), make_between(spec)
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def buffer_pressure(
        first: int,
        open_sides: wp.array(dtype=OpenSide),
        site_open: wp.array(dtype=wp.uint8),
        face_pressure: wp.array(dtype=pair),
        given_velocity: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
        velocity_star: wp.array(dtype=vec),
        pressure: wp.array(dtype=real),
        pressure_gradient: wp.array(dtype=vec),
        lasting_gradient: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
    ):
        i = wp.tid() + first
        which = int(zone[i]) - BUFFER
        if which < 0:
            return
        side = open_sides[which]
        x = position[i]
        corners = corners_of(x, side, site_open)
        face = between(face_pressure, corners)
        velocity_star[i] = between(given_velocity, corners)
        p = face[0] + face[1] * wp.min(beyond(x, side, axis), side.reach)  # further out no fluid sees it
        pressure[i] = p
        state[i] = pair(p, rest_volume[i])
        gradient = vec()
        gradient[axis] = face[1] * side.outward
        pressure_gradient[i] = gradient
        lasting_gradient[i] = gradient

    return buffer_pressure


@functools.cache
def make_buffer_velocity(spec: Spec) -> Any:
    """Return the kernel that gives the buffers the velocity of the sites at the end of the step.

    Only what the fluid sees of them has a slope, not the way that they go (`make_rows`).
    """
    real, vec, _, _ = types_of(spec)
    OpenSide = make_open_side(spec.precision)
    beyond, (corners_of, between) = make_outward(spec.dimension, spec.precision), make_between(spec)
    axis = spec.open_axis

    @wp.kernel(module="unique", enable_backward=False)
    def buffer_velocity(
        first: int,
        open_sides: wp.array(dtype=OpenSide),
        site_open: wp.array(dtype=wp.uint8),
        face_velocity: wp.array(dtype=vec),
        face_before: wp.array(dtype=vec),
        face_stretch: wp.array(dtype=real),
        position: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        which = int(zone[i]) - BUFFER
        if which < 0:
            return
        side = open_sides[which]
        x = position[i]
        corners = corners_of(x, side, site_open)
        v = between(face_velocity, corners)
        old = between(face_before, corners)
        stretch = between(face_stretch, corners)
        way = stretch * wp.min(beyond(x, side, axis), side.reach)
        v[axis] = v[axis] + way
        old[axis] = old[axis] + way
        velocity_old[i] = old
        velocity[i] = v
        acceleration[i] = vec()

    return buffer_velocity


@functools.cache
def make_rows_outside(spec: Spec) -> Any:
    """Return the kernel over the rows of the matrix that leaves those without a fluid particle out of the systems."""
    real, _, mat, _ = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def rows_outside(
        first: int,
        zone: wp.array(dtype=wp.int8),
        matrix_counts: wp.array(dtype=wp.int16),
        matrix_diagonal: wp.array(dtype=real),
        matrix_moment: wp.array(dtype=mat),
        unknown: wp.array(dtype=real),
        source: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        if int(zone[i]) != FLUID:
            matrix_counts[i] = wp.int16(0)
            matrix_diagonal[i] = real(1.0)
            matrix_moment[i] = mat()
            unknown[i] = real(0.0)
            source[i] = real(0.0)

    return rows_outside


@functools.cache
def make_open_source(spec: Spec) -> Any:
    """Return the sweep that adds the buffers of open sides to the pressure equation (theory: isph#open).

    What forces and friction add to the velocity of a buffer particle in the step is what they add to that of its neighbour:
    u*_j - u*_i is the difference of what both have been, c_0 u^n - c_1 u^{n-1}. Across a side of given velocity
    p_i - p_j = q.n n.x_ij + (what the last gradient makes of the way along the side), q = rho (u*_j - u_j^{n+1})/(beta dt);
    across one of given pressure p_j is known.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    OpenSide = make_open_side(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, image_velocity, lift = images.apart, images.image_velocity, images.lift
    list_begin, list_step, neighbour, Listed = list_access(spec)
    gravity_of, _ = make_forcing(spec)
    time_weights = make_weights(spec.second_order)
    beyond = make_outward(spec.dimension, spec.precision)
    dimension = float(spec.dimension)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1
    axis = spec.open_axis

    @wp.func
    def sees(x: vec, open_sides: wp.array(dtype=OpenSide)):
        near = bool(False)
        for number in range(open_sides.shape[0]):
            near = near or beyond(x, open_sides[number], axis) > -open_sides[number].reach
        return near

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def open_source(
        first: int,
        particle_count: int,
        list_width: int,
        deferred: real,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        open_sides: wp.array(dtype=OpenSide),
        zone: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        velocity_star: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
        lasting_gradient: wp.array(dtype=vec),
        correction: wp.array(dtype=mat),
        spread: wp.array(dtype=real),
        matrix_counts: wp.array(dtype=wp.int16),
        matrix_diagonal: wp.array(dtype=real),
        source: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        if int(zone[i]) != FLUID or matrix_counts[i] == wp.int16(0):
            return
        xi = position[i]
        if not sees(xi, open_sides):
            return
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        rho = phases[0].density
        weights = time_weights(clock)
        reach = real(weights[2] * clock[STEP])
        falling = gravity_of(params, forcing, GRAVITY_NEXT) * reach
        star = velocity_star[i]
        added = star - (velocity[i] * real(weights[0]) - velocity_old[i] * real(weights[1]))
        last = lasting_gradient[i] * deferred
        share = rest_volume[i] / params.wall_volume
        weight = real(-2.0) * params.g_norm * share / rho
        flow = mat()
        coupling = real(0.0)
        right = real(0.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            which = int(zone[j]) - BUFFER
            if which < 0:
                continue
            d = apart(xi, position[j], code, wrapped, params, sides)
            f = slope(wp.length(d) * params.inv_h) * rest_volume[j]
            w = weight * f
            vj = velocity[j] * real(weights[0]) - velocity_old[j] * real(weights[1]) + added
            along = d[axis]
            if open_sides[which].gives_velocity == 1:
                push = (vj[axis] - velocity_star[j][axis]) * (rho / reach)
                right += w * along * (last[axis] - push)
            else:
                coupling += w
                right += w * (pressure[j] + wp.dot(last, d))
                if wp.static(spec.mirror and spec.gravity):
                    if code != 0:
                        right += w * rho * wp.dot(gravity_of(params, forcing, GRAVITY_NEXT), lift(position[j], code, sides))
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj - falling, code, sides) + falling
            flow += wp.outer(vj - star, f * d)
        right -= share * (spread[i] / real(dimension)) * (wp.trace(flow * correction[i]) * params.g_norm) / reach
        matrix_diagonal[i] = matrix_diagonal[i] + coupling
        source[i] = source[i] + right

    return open_source
