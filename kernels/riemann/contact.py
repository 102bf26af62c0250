"""Contact angles: the normals of interfaces where they meet a wall (theory: riemann#a8; Brackbill 1992, Breinlinger 2013).

At a wall with the unit normal n_w into the fluid, an interface with the contact angle theta has the normal
    nhat_w = t sin(theta) + n_w cos(theta),  t = (nhat - (nhat.n_w) n_w) / |.|
out of the phase in which theta is measured. Away from the wall the computed normal takes over with the distance y:
    nhat <- (f nhat + (1 - f) nhat_w) / |.|,  f = (y/y_max)^2
as far as the interface meets the wall: y/sin, the way to the wall along an interface whose normal has the angle to n_w, is
one reach of walls at most where 1 - f counts whole, and two where it is gone. A bubble beside a wall keeps its normals.
The curvature of these normals then drives the contact line: across the band it adds up to the angle that is left to turn.
The square, because with half a support the computed normals lean towards 90 degrees: at 60 by 6 degrees in the first row,
by 3 in the second, at 30 by 13 and 6. Height of a drop at rest with f = y/y_max and with the square, 10 particles a radius
(`sessile_drop-R_10*`): 6.4 and 2.4 % off at 60 degrees, -0.7 and 0.7 % at 90, -2.6 and 0.1 % at 120.

Where sides of the domain or cells meet at an edge, each turns the normal by itself; of bodies with a surface n_w is the mean
in reach. Of several other phases around a particle the cosines are averaged; that of a pair without an angle is 0: 90
degrees. Where no pair has another angle, no cosines are summed (`Spec.leaning`).

Of three and more phases whose interfaces may meet (`meeting_phases`) each has a normal of its own, which turns to its own
angle: with the shares C of the phases the cosine of phase k is
    sum_j W V_j sum_{l != k} C_l(j) cos(theta_kl) / sum_j W V_j sum_{l != k} C_l(j)
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import BAND_COUNT
from warpsph.kernels.core.pair import BAND, list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, phase_types_of, types, types_of

# Sine of the angle between interface and wall below which the prescribed normal fades out: an interface along the wall is
# that of a film and does not meet the wall here; the direction in which it leans is noise.
LEANING = 0.2


@functools.cache
def make_wall_normal(dimension: int, precision: str) -> Any:
    """Return the `wp.func` wall_normal(unit, wall, cosine, height) = nhat next to a wall, a unit vector.

    unit: nhat, out of the phase in which the angle is measured; wall: n_w, into the fluid; cosine: of the contact angle;
    height: y/y_max, 0 at the wall, 1 out of its reach.
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def wall_normal(unit: vec, wall: vec, cosine: real, height: real):
        along = unit - wp.dot(unit, wall) * wall
        size = wp.length(along)
        result = unit
        if size > real(1.0e-6):
            sine = wp.sqrt(wp.max(real(1.0) - cosine * cosine, real(0.0)))
            prescribed = along * (sine / size) + wall * cosine
            meets = wp.clamp(real(2.0) - height / size, real(0.0), real(1.0)) * wp.min(size / real(LEANING), real(1.0))
            weight = (real(1.0) - height * height) * meets
            result = wp.normalize((real(1.0) - weight) * unit + weight * prescribed)
        return result

    return wall_normal


@functools.cache
def make_walls_beside(spec: Spec) -> Any:
    """Return the `wp.func` walls_beside(neighbours, position, xi, i, begin, end, list_step, params) = walls, heights.

    walls: a matrix of unit normals into the fluid, a row a wall; heights: y/y_max of each, 1 where there is none. Arguments:
    the list and its entries of wall particles from begin to end. Walls of cells are planes across the axes, each by itself:
    those in the column of cells in which a particle lies. A layer on the floor that meets a side does not meet the floor.
    A body with a surface is one wall, with the mean of the normals in reach, and the sides of its scene count with it.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    _, _, neighbour, Listed = list_access(spec)
    reach = KERNELS[spec.kernel].support
    dimension = spec.dimension

    @wp.func
    def heights_of(depths: vec, params: Params):
        # the outermost row of a wall is half a spacing behind its surface
        support = real(reach) * params.h
        half = real(0.5) * params.spacing
        heights = vec()
        for axis in range(dimension):
            heights[axis] = wp.clamp((depths[axis] - half) / (support - half), real(0.0), real(1.0))
        return heights

    @wp.func
    def walls_beside(
        neighbours: Listed,
        position: wp.array(dtype=vec),
        xi: vec,
        i: int,
        begin: int,
        end: int,
        step: int,
        params: Params,
    ):
        walls = mat()
        support = real(reach) * params.h
        depths = vec(support)
        if wp.static(spec.bodies):
            mean = vec()
            k = begin
            while k < end:
                d = separation(xi, position[neighbour(neighbours, i, k)], True, params)
                k += step
                mean -= slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * d
            size = wp.length(mean)
            if size > real(0.0):  # else in the list, but out of reach
                walls[0] = mean / size
                k = begin
                while k < end:
                    d = separation(xi, position[neighbour(neighbours, i, k)], True, params)
                    k += step
                    if wp.dot(d, d) < support * support:
                        depths[0] = wp.min(depths[0], wp.dot(d, mean) / size)
        else:
            k = begin
            while k < end:
                d = separation(xi, position[neighbour(neighbours, i, k)], True, params)
                k += step
                for axis in range(dimension):
                    aside = real(0.0)
                    for other in range(dimension):
                        if other != axis:
                            aside = wp.max(aside, wp.abs(d[other]))
                    if aside < real(0.75) * params.spacing and wp.abs(d[axis]) < depths[axis]:
                        depths[axis] = wp.abs(d[axis])
                        walls[axis, axis] = wp.sign(d[axis])
        return walls, heights_of(depths, params)

    return walls_beside


@functools.cache
def make_contact(spec: Spec) -> Any:
    """Return the kernel that turns the normals of the interface band next to walls; their lengths stay."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    walls_beside = make_walls_beside(spec)
    dimension = spec.dimension
    wall_normal = make_wall_normal(spec.dimension, spec.precision)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def contact_normal(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        counters: wp.array(dtype=int),
        band: wp.array(dtype=int),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        fraction: wp.array(dtype=real),
        contact_cosine: wp.array(dtype=real),
        interface_weight: wp.array(dtype=real),
        normal: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        beside = int(wall_neighbours[i])
        if beside == 0 or interface_weight[i] == real(0.0):
            return
        xi = position[i]
        step = list_step(particle_count)
        begin = list_begin(i, list_width)
        middle = begin + int(fluid_neighbours[i]) * step
        walls, heights = walls_beside(neighbours, position, xi, i, middle, middle + beside * step, step, params)
        if wp.min(heights) == real(1.0):
            return
        inward = normal[i]  # into the own phase, where the angle is measured between the wall and its outside
        strength = wp.length(inward)
        cosine = real(0.0)
        if wp.static(spec.leaning):
            # The second ring of the interface has no other phase in reach: it takes the cosines of the first.
            own = phase[i]
            every = shape(real(0.0)) * state[i][1] * (real(1.0) - fraction[i])
            cosine = every * contact_cosine[i]
            k = begin
            while k < middle:
                j = neighbour(neighbours, i, k)
                k += step
                if phase[j] == own:
                    d = separation(xi, position[j], True, params)
                    w = shape(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1] * (real(1.0) - fraction[j])
                    every += w
                    cosine += w * contact_cosine[j]
            if every == real(0.0):
                return
            cosine = cosine / every
        unit = -inward / strength
        for axis in range(dimension):
            unit = wall_normal(unit, walls[axis], cosine, heights[axis])
        normal[i] = -strength * unit

    return contact_normal


@functools.cache
def make_phase_contact(spec: Spec) -> Any:
    """Return the kernel that turns the normals of each phase next to walls; their lengths stay."""
    real, vec, _, pair = types_of(spec)
    phased, normals = phase_types_of(spec)
    phases = spec.triple
    Params = make_params(spec.dimension, spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    walls_beside = make_walls_beside(spec)
    dimension = spec.dimension
    wall_normal = make_wall_normal(spec.dimension, spec.precision)

    @wp.func
    def cosines_of(share: phased, contact_angles: wp.array(dtype=real)):
        """Return the cosines of the phases against the others, each times the others' share."""
        found = phased()
        for each in range(phases):
            for other in range(phases):
                found[each] += share[other] * contact_angles[phases * each + other]  # 0 of a phase against itself
        return found

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def phase_contact(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        counters: wp.array(dtype=int),
        band: wp.array(dtype=int),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        contact_angles: wp.array(dtype=real),
        share: wp.array(dtype=phased),
        interface_weight: wp.array(dtype=phased),
        phase_normal: wp.array(dtype=normals),
        normal: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        beside = int(wall_neighbours[i])
        if beside == 0:
            return
        xi = position[i]
        step = list_step(particle_count)
        begin = list_begin(i, list_width)
        middle = begin + int(fluid_neighbours[i]) * step
        walls, heights = walls_beside(neighbours, position, xi, i, middle, middle + beside * step, step, params)
        if wp.min(heights) == real(1.0):
            return
        cosines = phased()
        if wp.static(spec.leaning):
            one = phased(real(1.0))
            w = shape(real(0.0)) * state[i][1]
            every = w * (one - share[i])
            cosines = w * cosines_of(share[i], contact_angles)
            k = begin
            while k < middle:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, position[j], True, params)
                w = shape(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]
                every += w * (one - share[j])
                cosines += w * cosines_of(share[j], contact_angles)
            for each in range(phases):
                cosines[each] = cosines[each] / wp.max(every[each], real(1.0e-30))
        n = phase_normal[i]
        for each in range(phases):
            if interface_weight[i][each] > real(0.0):
                strength = wp.length(n[each])
                unit = -n[each] / strength
                for axis in range(dimension):
                    unit = wall_normal(unit, walls[axis], cosines[each], heights[axis])
                n[each] = -strength * unit
        phase_normal[i] = n
        normal[i] = n[int(phase[i])]

    return phase_contact
