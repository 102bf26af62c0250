"""What walls with a surface of their own add to the continuity sweep (theory: riemann#bodies)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of

SMALLEST_MOMENT = 0.1  # determinant below which a neighbourhood is too thin to correct


@functools.cache
def make_body_flow(spec: Spec) -> Any:
    """Return the `wp.func` of the rate of continuity that wall neighbours make; without bodies it is never called.

    Their velocity is the mirrored one; for several fluids it is that of the one-sided Riemann problem of each, in which the
    wall moves at u*. With the corrected gradient the rate also takes out what the arrangement of all neighbours makes of a
    linear velocity without divergence. Pressure differences are those of the fluid alone: one with a wall would be
    continued along the fit, and not evened (docs/records/walls.md#first-row). Arguments that are not those of the sweep:
    `flow` and `moment`, the sums of (v_j - v_i) (x) F V x_ij and -x_ij (x) F V x_ij over the fluid.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    _, _, neighbour, Listed = list_access(spec)

    @wp.func
    def rate_at_bodies(
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
    ):
        fluid_rows = particle_count - boundary_volume.shape[0]
        rate = real(0.0)
        wall_flow = mat()
        wall_moment = mat()
        k = start
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            w = j - fluid_rows
            d = separation(xi, position[j], wrapped, params)
            f = slope(wp.length(d) * params.inv_h) * boundary_volume[w]
            mirrored = mirror_velocity[w]
            if wp.static(spec.multiphase):
                mirrored = real(2.0) * velocity[j] - vi
            rate += f * wp.dot(vi - mirrored, d)
            if wp.static(spec.corrected):
                wall_flow += wp.outer(mirrored - vi, f * d)
                wall_moment -= wp.outer(d, f * d)
        if wp.static(spec.corrected):
            if end > start and not near:
                m = (moment + wall_moment) * params.g_norm
                total = flow + wall_flow
                if wp.determinant(m) > real(SMALLEST_MOMENT):
                    rate -= wp.trace(total * wp.inverse(m)) - wp.trace(total)
        return rate

    return rate_at_bodies
