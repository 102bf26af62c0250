"""Room that particles take where a fluid has a free surface (theory: riemann#splashed; as delta#d8, delta#thin).

Continuity follows velocities and knows no places: what a splash leaves at too wide or too close a spacing would stay so.
Every few steps two sweeps say, for each particle, at which rate the continuity sweep lets its density follow the room:

    ds_i/dt += (1+s_i) b |D| E_i,   E_i = sum_j V_j (1 - r^2/R^2)^4 / integral - 1

where the neighbourhood is full, elsewhere where E_i > 0 alone, |D| the shear rate; and whether it is in fluid that is
thinner than the kernel reaches, away from walls. That has no pressure.
"""

import functools
import math
from typing import Any

import warp as wp

from warpsph.kernels.core.eigenvalue import WHOLE, make_least_eigenvalue
from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import Spec, types_of

from .room import make_window


@functools.cache
def make_surface_room(spec: Spec) -> Any:
    """Return the sweep that finds how whole a neighbourhood is, and the rate of density that its room asks for."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation, least_eigenvalue = separation_of(spec), make_least_eigenvalue(spec.dimension, spec.precision)
    window, (particle_of, lane_of, part_of, added, added_mat) = make_window(spec.precision), lanes_of(spec, real, mat)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def surface_room(
        first: int,
        particle_count: int,
        fluid_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        boundary_volume: wp.array(dtype=real),
        wholeness: wp.array(dtype=real),
        room_part: wp.array(dtype=real),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        x, v = position[i], velocity[i]
        moment, flow = mat(), mat()  # -sum of x_ij (x) F V x_ij, sum of (v_j - v_i) (x) F V x_ij over the fluid
        room = state[i][1]  # sum of (1 - r^2/R^2)^4 V, its own place included
        if wp.static(spec.lanes > 1):
            room = wp.where(lane == 0, room, real(0.0))  # its own place counts once
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(x, position[j], True, params)
            r2 = wp.dot(d, d)
            fd = (slope(wp.sqrt(r2) * params.inv_h) * state[j][1]) * d
            moment -= wp.outer(d, fd)
            flow += wp.outer(velocity[j] - v, fd)
            room += window(r2, params.inv_window) * state[j][1]
        if wp.static(spec.lanes > 1):
            moment, flow, room = added_mat(moment), added_mat(flow), added(room)
            if lane > 0:
                return
        k, step = end, stride
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(x, position[j], True, params)
                r2 = wp.dot(d, d)
                volume = params.wall_volume
                if wp.static(spec.bodies):
                    volume = boundary_volume[j - fluid_count]
                moment -= wp.outer(d, (slope(wp.sqrt(r2) * params.inv_h) * volume) * d)
                room += window(r2, params.inv_window) * volume
        wholeness[i] = least_eigenvalue(moment * params.g_norm)
        strain = (flow + wp.transpose(flow)) * real(wp.static(math.sqrt(0.5)))  # a body of fluid that turns is not strained
        pace = wp.sqrt(wp.ddot(strain, strain)) * params.g_norm
        room_part[i] = params.room * pace * (room * params.window_norm - real(1.0))

    return shared(surface_room, spec)


@functools.cache
def make_thin(spec: Spec) -> Any:
    """Return the sweep that marks particles of thin fluid, and leaves a fall of density to full neighbourhoods."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation, support = separation_of(spec), KERNELS[spec.kernel].support
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def mark_thin(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        position: wp.array(dtype=vec),
        wholeness: wp.array(dtype=real),
        room_part: wp.array(dtype=real),
        thin: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        x, reach = position[i], real(support) * params.h
        full = wholeness[i] >= real(WHOLE)
        alone = not full  # nothing whole within the support, and no wall
        step = list_step(particle_count)
        k = list_begin(i, list_width)
        end = k + int(fluid_neighbours[i]) * step
        while k < end and (full or alone):
            j = neighbour(neighbours, i, k)
            k += step
            if wp.length(separation(x, position[j], True, params)) < reach:
                whole = wholeness[j] >= real(WHOLE)
                full, alone = full and whole, alone and not whole
        if wp.static(spec.walls):
            if alone:
                k = list_begin(i, list_width) + int(fluid_neighbours[i]) * step
                end = k + int(wall_neighbours[i]) * step
                while k < end and alone:
                    alone = wp.length(separation(x, position[neighbour(neighbours, i, k)], True, params)) >= reach
                    k += step
        if not full:  # what a neighbourhood lacks would count as room; it can have too many particles all the same
            room_part[i] = wp.max(room_part[i], real(0.0))
        thin[i] = wp.int8(wp.where(alone, 1, 0))

    return mark_thin
