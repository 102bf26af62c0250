"""What walls with a surface of their own add to the continuity sweep (theory: riemann#bodies, delta#d6)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.core.wall_share import LEAST_SHARE, PARALLEL, make_slides

SMALLEST_MOMENT = 0.1  # determinant below which a neighbourhood is too thin to correct


def continues_flow(spec: Spec) -> bool:
    """In the continuity sweep bodies that the fluid sticks to have the velocity of the flow that is continued into them."""
    return spec.bodies and spec.wall_no_slip and not (spec.multiphase or spec.free_surface)


@functools.cache
def make_body_flow(spec: Spec) -> Any:
    """Return the `wp.func` with_bodies(rate of the fluid, ...): the rate of continuity beside walls with a surface.

    They have their own velocity, and the rate is divided by its share of a compression along the normal (theory: delta#d6).
    Before a plane what runs along it has no part: all that the sum has of it is how the wall's particles lie. In one fluid
    that fills its domain, bodies that it sticks to have the velocity of the flow that is continued into them. Several fluids
    have the image of their own velocity before any other wall than a plane: their one-sided pressures know nothing of
    paths that bend (docs/records/walls.md#spreading).

    With the corrected gradient the rate also takes out what the arrangement of all neighbours makes of a linear velocity
    without divergence, but beside walls with their own velocity, where velocities jump. Pressure differences are those
    of the fluid alone: one with a wall would be continued along the fit, and not evened (docs/records/walls.md#first-row).
    Arguments that are not those of the sweep: `flow` and `moment`, the sums of (v_j - v_i) (x) F V x_ij and
    -x_ij (x) F V x_ij over the fluid.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    _, _, neighbour, Listed = list_access(spec)
    continued, slides_at = continues_flow(spec), make_slides(spec.own_sides)

    @wp.func
    def with_bodies(
        fluid_rate: real,
        i: int,
        start: int,
        end: int,
        step: int,
        particle_count: int,
        wrapped: bool,
        near: bool,
        xi: vec,
        vi: vec,
        flow: mat,
        moment: mat,
        params: Params,
        neighbours: Listed,
        position: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        velocity: wp.array(dtype=vec),
        mirror_velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_sides: wp.array(dtype=wp.uint8),
        wall_normal: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
    ):
        fluid_rows = particle_count - boundary_volume.shape[0]
        rate = fluid_rate
        wall_flow = mat()
        wall_moment = mat()
        share = real(1.0)
        along, across = real(0.0), real(0.0)  # rate of walls that the fluid slides along; what normals have of it
        first_normal = vec()  # of those walls
        plane, sliding = bool(True), bool(False)  # all their normals are parallel; there are any
        k = start
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            w = j - fluid_rows
            d = separation(xi, position[j], wrapped, params)
            f = slope(wp.length(d) * params.inv_h) * boundary_volume[w]
            slides = f < real(0.0)
            if wp.static(continued):
                slides = slides and slides_at(w, slip, wall_sides)
            if slides:
                normal = wall_normal[w]
                meets = wp.dot(normal, f * d)
                share += wall_depth[w] * meets * params.g_norm
                if not sliding:
                    first_normal = normal
                plane = plane and wp.dot(normal, first_normal) > real(PARALLEL)
                sliding = True
                along += wp.dot(vi - velocity[j], f * d)
                across += wp.dot(vi - velocity[j], normal) * meets
            if wp.static(continued):
                mirrored = mirror_velocity[w]
                if not slides:
                    rate += f * wp.dot(vi - mirrored, d)
                if wp.static(spec.corrected):
                    wall_flow += wp.outer(mirrored - vi, f * d)
                    wall_moment -= wp.outer(d, f * d)
        rate += wp.where(plane, across, along)
        if wp.static(spec.multiphase):
            if not plane:
                rate += along  # twice, as the image of the particle's own velocity
                share = real(1.0)
        if wp.static(spec.corrected):
            if end > start and not near and not sliding:
                m = (moment + wall_moment) * params.g_norm
                total = flow + wall_flow
                if wp.determinant(m) > real(SMALLEST_MOMENT):
                    rate -= wp.trace(total * wp.inverse(m)) - wp.trace(total)
        return rate / wp.max(share, real(LEAST_SHARE))

    return with_bodies
