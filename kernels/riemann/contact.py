"""Contact angles: the normals of interfaces where they meet a wall (theory: riemann#a8; Brackbill 1992, Breinlinger 2013).

At a wall with the unit normal n_w into the fluid, an interface with the contact angle theta has the normal
    nhat_w = t sin(theta) + n_w cos(theta),  t = (nhat - (nhat.n_w) n_w) / |.|
out of the phase in which theta is measured. Away from the wall the computed normal takes over with the distance y:
    nhat <- (f nhat + (1 - f) nhat_w) / |.|,  f = (y/y_max)^2
The curvature of these normals then drives the contact line: across the band it adds up to the angle that is left to turn.
The square, because with half a support the computed normals lean towards 90 degrees: at 60 by 6 degrees in the first row,
by 3 in the second, at 30 by 13 and 6. Height of a drop at rest with f = y/y_max and with the square, 10 particles a radius
(`sessile_drop-R_10*`): 6.4 and 2.4 % off at 60 degrees, -0.7 and 0.7 % at 90, -2.6 and 0.1 % at 120.

Where walls meet at an edge, n_w is the mean of both. Of several other phases around a particle the cosines are averaged;
that of a pair without an angle is 0: 90 degrees.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import BAND_COUNT
from warpsph.kernels.core.pair import BAND, list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types, types_of

# Sine of the angle between interface and wall below which the prescribed normal fades out: an interface along the wall is
# that of a film and does not meet the wall here; the direction in which it leans is noise.
LEANING = 0.2


@functools.cache
def make_wall_normal(dimension: int, precision: str) -> Any:
    """Return the `wp.func` wall_normal(unit, wall, cosine, share) = nhat next to a wall, a unit vector.

    unit: nhat, out of the phase in which the angle is measured; wall: n_w, into the fluid; cosine: of the contact angle;
    share: f, 0 at the wall, 1 out of its reach.
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def wall_normal(unit: vec, wall: vec, cosine: real, share: real):
        along = unit - wp.dot(unit, wall) * wall
        size = wp.length(along)
        result = unit
        if size > real(1.0e-6):
            sine = wp.sqrt(wp.max(real(1.0) - cosine * cosine, real(0.0)))
            prescribed = along * (sine / size) + wall * cosine
            weight = (real(1.0) - share) * wp.min(size / real(LEANING), real(1.0))
            result = wp.normalize((real(1.0) - weight) * unit + weight * prescribed)
        return result

    return wall_normal


@functools.cache
def make_contact(spec: Spec) -> Any:
    """Return the kernel that turns the normals of the interface band next to walls; their lengths stay."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    wall_normal = make_wall_normal(spec.dimension, spec.precision)
    reach = KERNELS[spec.kernel].support

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
        walls = int(wall_neighbours[i])
        if walls == 0 or interface_weight[i] == real(0.0):
            return
        xi = position[i]
        step = list_step(particle_count)
        begin = list_begin(i, list_width)
        middle = begin + int(fluid_neighbours[i]) * step
        end = middle + walls * step
        wall = vec()
        k = middle
        while k < end:
            d = separation(xi, position[neighbour(neighbours, i, k)], True, params)
            k += step
            wall -= slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * d
        size = wp.length(wall)
        if size == real(0.0):
            return  # in the list, but out of reach
        wall = wall / size
        # the outermost row of a wall is half a spacing behind its surface
        support = real(reach) * params.h
        half = real(0.5) * params.spacing
        depth = support
        k = middle
        while k < end:
            d = separation(xi, position[neighbour(neighbours, i, k)], True, params)
            k += step
            if wp.dot(d, d) < support * support:
                depth = wp.min(depth, wp.dot(d, wall))
        share = wp.clamp((depth - half) / (support - half), real(0.0), real(1.0))
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
        if every > real(0.0):
            inward = normal[i]  # into the own phase, where the angle is measured between the wall and its outside
            strength = wp.length(inward)
            normal[i] = -strength * wall_normal(-inward / strength, wall, cosine / every, share * share)

    return contact_normal
