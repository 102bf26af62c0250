"""What walls with a surface of their own add to the continuity sweep (theory: riemann#a5)."""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of

SMALLEST_MOMENT = 0.1  # determinant below which a neighbourhood is too thin to correct


class BodyFlow(NamedTuple):
    """`wp.func`s of a `Spec` with bodies.

    Attributes:
        walls: (rate, flow, moment) over the wall neighbours, whose velocity is the mirrored one; `weight` is rho g [Pa/m].
        uneven: what the arrangement makes of a linear velocity that has no divergence, to be taken from the rate.
    """

    walls: Any
    uneven: Any


@functools.cache
def make_body_flow(spec: Spec) -> BodyFlow:
    """Return the functions; for a `Spec` without bodies they are never called."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    _, _, neighbour, Listed = list_access(spec)

    @wp.func
    def walls(
        i: int,
        start: int,
        end: int,
        step: int,
        particle_count: int,
        wrapped: bool,
        xi: vec,
        vi: vec,
        dissipated: real,
        p_i: real,
        weight: vec,
        params: Params,
        neighbours: Listed,
        position: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
    ):
        fluid_rows = particle_count - boundary_volume.shape[0]
        rate = real(0.0)
        flow = mat()
        moment = mat()
        k = start
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            w = j - fluid_rows
            d = separation(xi, position[j], wrapped, params)
            r = wp.sqrt(wp.dot(d, d))
            f = slope(r * params.inv_h) * boundary_volume[w]
            rate += f * wp.dot(vi - mirror_velocity[w], d)
            if wp.static(spec.dissipation and not spec.corrected):
                rate += f * (p_i - state[j][0] - wp.dot(weight, d)) * r * dissipated
            if wp.static(spec.corrected):
                flow += wp.outer(mirror_velocity[w] - vi, f * d)
                moment -= wp.outer(d, f * d)
        return rate, flow, moment

    @wp.func
    def uneven(flow: mat, moment: mat, g_norm: real):
        result = real(0.0)
        m = moment * g_norm
        if wp.determinant(m) > real(SMALLEST_MOMENT):
            result = wp.trace(flow * wp.inverse(m)) - wp.trace(flow)
        return result

    return BodyFlow(walls, uneven)
