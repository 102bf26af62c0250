"""Free surface of an incompressible fluid: which particles are at it (theory: isph#b4; Lee 2008, Marrone 2010).

    spread_i = sum_j V_j (x_j - x_i).grad_i W        d inside, about d/2 at a flat surface
(without the own images behind a wall). A particle with a spread below the threshold is a candidate; it is at the surface
unless a neighbour stands in front of it, within 45 degrees of the outward normal, or nearer than h to the point h in front
of it. With a spread far below it is at one anyway.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of

INSIDE = 0
SURFACE = 1
ISOLATED = 2
# of the dimension: the second row of a flat surface has 0.92 (Wendland C2, h = 1.5 dx), the first 0.62, spray less than 0.3
CANDIDATE = 0.875
LONE = 0.3
CORNER = 0.6
CONE = 0.7  # cosine of 45 degrees less a margin, so that on a lattice rounding decides nothing
# Below this a particle is at a surface or at a void inside the fluid, in whatever direction: a void must be free to open and
# to close, where the pressure equation would pull it together with any tension.
SPARSE = 0.75
# A ridge or a splash has too few neighbours on too few sides for a gradient across its surface.
FLAT = 0.5
# From here on a particle has neighbours on all sides.
WHOLE = 0.97
# Depth of a particle of the surface, in that of an even row.
SHALLOWEST = 0.2
DEEPEST = 3.0
# Share of the spread that has to come from other particles inside: the middle row of three has 0.25 or more.
WITHIN = 0.15


@functools.cache
def make_surface(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels (find_surface, drop_fragments) that flag the particles at the surface and give them their pressure.

    The surface is outside of them: p = p_s - depth n.grad p^n, but no farther from p_s than the mean pressure around them,
    which is that further inside. p_s balances friction across the surface (`surface_friction`) and is 0 without; an isolated
    one has p = 0. A crowded row is deeper below its surface than an even one, a stretched one less deep. How deep a
    particle is that comes to the surface follows from the spread, which is `first_row` for the outermost and `second_row`
    for the next row of an even arrangement, half a spacing (`surface_depth`) and three times that below. From then on
    `regularise` lets the depth follow the flow.

    A particle that is inside, but among particles of the surface alone, is part of a splash of a few. Its pressure would
    push them away and pull itself after them, faster and faster: it is counted to the surface.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    apart = make_images(spec).apart
    _, slope = make_smoothing(spec.kernel, spec.precision)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    periodic = any(spec.periodic)
    dimension = float(spec.dimension)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.kernel(module="unique", enable_backward=False)
    def find_surface(
        first: int,
        particle_count: int,
        list_width: int,
        surface_depth: real,
        first_row: real,
        second_row: real,
        params: Params,
        sides: Sides,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        wetness: wp.array(dtype=real),
        company: wp.array(dtype=real),
        spread: wp.array(dtype=real),
        surface_normal: wp.array(dtype=vec),
        surface_stress: wp.array(dtype=real),
        lasting_gradient: wp.array(dtype=vec),
        unknown: wp.array(dtype=real),
        exposed: wp.array(dtype=wp.uint8),
        pressure: wp.array(dtype=real),
        row_depth: wp.array(dtype=real),
        spread_depth: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        spread_depth[i] = real(0.0)
        share = company[i] / real(dimension)
        # in a corner of walls the own images are a quarter of the spread, and a resting particle there is no candidate
        if share >= real(CANDIDATE) or (share >= real(CORNER) and spread[i] >= real(wp.static(CANDIDATE * dimension))):
            exposed[i] = wp.uint8(INSIDE)
            return
        if share < real(LONE):
            exposed[i] = wp.uint8(ISOLATED)
            pressure[i] = real(0.0)
            return
        xi = position[i]
        n = surface_normal[i]
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        far = real(1.4142135) * params.h
        covered = wp.dot(n, n) == real(0.0)  # alike on all sides, as the middle row of three
        mean = real(0.0)
        found = real(0.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        count = int(fluid_neighbours[i])
        if wp.static(spec.walls):
            count += int(wall_neighbours[i])
        end = k + count * step
        while k < end and not covered:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            if wp.static(spec.bodies):
                wall = j - (particle_count - wetness.shape[0])
                if wall >= 0:
                    if wetness[wall] < real(0.5):
                        continue
            e = -apart(xi, position[j], code, wrapped, params, sides)
            r = wp.length(e)
            if r < far:
                covered = wp.dot(e, n) > real(CONE) * r
            else:
                covered = wp.length(e - n * params.h) < params.h
            if j < company.shape[0]:
                mean += unknown[j]
                found += real(1.0)
        if covered and share >= real(SPARSE):
            exposed[i] = wp.uint8(INSIDE)
        else:
            exposed[i] = wp.uint8(SURFACE)
            stress = real(0.0)  # what balances the friction across the surface
            if wp.static(spec.viscosity != "none"):
                stress = surface_stress[i]
            p = stress
            if share > real(FLAT) and not covered:
                most = wp.abs(mean / wp.max(found, real(1.0)) - stress)
                rows = real(2.0) * (spread[i] / real(dimension) - first_row) / (second_row - first_row)
                even = wp.clamp(real(1.0) + rows, real(SHALLOWEST), real(DEEPEST))
                spread_depth[i] = even
                if row_depth[i] <= real(0.0):
                    row_depth[i] = even  # new at the surface
                depth = surface_depth * row_depth[i]
                p = stress + wp.clamp(-depth * wp.dot(n, lasting_gradient[i]), -most, most)
            pressure[i] = p

    @wp.kernel(module="unique", enable_backward=False)
    def drop_fragments(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        company: wp.array(dtype=real),
        exposed: wp.array(dtype=wp.uint8),
        surface: wp.array(dtype=wp.uint8),
        surface_stress: wp.array(dtype=real),
        pressure: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        kind = exposed[i]
        if kind == wp.uint8(INSIDE) and company[i] < real(wp.static(WHOLE * dimension)):
            xi = position[i]
            wrapped = bool(False)
            if wp.static(periodic):
                wrapped = (int(flags[i]) & WRAPPED) != 0
            within = real(0.0)
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
                if j != i and exposed[j] == wp.uint8(INSIDE):
                    d = apart(xi, position[j], code, wrapped, params, sides)
                    r2 = wp.dot(d, d)
                    within -= slope(wp.sqrt(r2) * params.inv_h) * r2
            if within * params.g_norm * params.wall_volume < real(wp.static(WITHIN * dimension)):
                kind = wp.uint8(SURFACE)
                pressure[i] = real(0.0)
                if wp.static(spec.viscosity != "none"):
                    pressure[i] = surface_stress[i]
        surface[i] = kind

    return find_surface, drop_fragments
