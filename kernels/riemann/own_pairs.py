"""Sums over the pairs of one phase in the continuity sweep (theory: riemann#a2): the loop that takes most of its time.

Numbers alone, and no branch: so a CPU works on eight neighbours at once (docs/records/pair_loops.md#vectors).
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.lanes import lanes_of
from warpsph.kernels.core.pair import list_access, look_ahead, make_part, way_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NOW, make_forcing

from .inertia import make_loud


@functools.cache
def make_own_rates(spec: Spec) -> tuple[Any, Any]:
    """Return the struct `OwnRates` and the `wp.func` own_rates(i, k, end, ...) -> OwnRates of the entries from k to end."""
    real, vec, mat, pair = types_of(spec)
    Params, Phase = make_params(spec.dimension, spec.precision), make_phase(spec.precision)
    slope, loud, (gravity_of, _) = make_smoothing(spec.kernel, spec.precision)[1], make_loud(spec), make_forcing(spec)
    way, part, part_of_pair = way_of(spec), make_part(vec), make_part(pair)
    (_, _, _, Listed), (look, taken, onward) = list_access(spec), look_ahead(spec)
    spray, linear = spec.free_surface and not spec.multiphase, spec.bodies and spec.corrected

    *_, added, added_mat = lanes_of(spec, real, mat)

    @wp.struct
    class OwnRates:
        rate: real  # sum of F V (v_i - v_j).x_ij
        blur: real  # the same of pressure differences
        stiffness: real  # derivative of that by the own pressure, over c_i
        crowd: real  # sum of -F V r^2, d inside a fluid
        flow: mat  # sums of (v_j - v_i) (x) F V x_ij and of -x_ij (x) F V x_ij
        moment: mat

    @wp.func
    def own_rates(
        i: int,
        begin: int,
        end: int,
        step: int,
        wrapped: bool,
        xi: vec,
        vi: vec,
        p_i: real,
        inv_z: real,
        own: Phase,
        params: Params,
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        midway: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state_old: wp.array(dtype=pair),
        pressure_gradient: wp.array(dtype=vec),
        inertia: wp.array(dtype=vec),
    ):
        # numbers in the loop, matrices behind it: what leaves a loop as a matrix is one in it, see `make_part`
        d, weight, flow, moment, flow_of_all, moment_of_all = vec(), vec(), mat(), mat(), mat(), mat()
        if wp.static(spec.gravity):
            weight = own.density * gravity_of(params, forcing, GRAVITY_NOW)
        rate, blur, stiffness, crowd = real(0.0), real(0.0), real(0.0), real(0.0)
        k, ahead = int(begin), look(neighbours, i, begin, end)
        while k < end:
            j = taken(ahead, neighbours, i, k)
            k, ahead = onward(neighbours, i, k, step, end)
            r2, closing, borne, spared = real(0.0), real(0.0), real(0.0), real(0.0)
            for axis in range(wp.static(spec.dimension)):
                d[axis] = way(xi[axis], part(midway, j, axis), axis, wrapped, params)
                r2 += d[axis] * d[axis]
                closing += (vi[axis] - part(velocity, j, axis)) * d[axis]
                if wp.static(linear):
                    borne += real(0.5) * (pressure_gradient[i][axis] + part(pressure_gradient, j, axis)) * d[axis]
                elif wp.static(spec.gravity):
                    borne += weight[axis] * d[axis]
                if wp.static(spec.inertia):
                    spared += real(0.5) * own.density * (inertia[i][axis] + part(inertia, j, axis)) * d[axis]
            r = wp.sqrt(r2)
            f = slope(r * params.inv_h) * part_of_pair(state_old, j, 1)
            rate += f * closing
            if wp.static(spec.dissipation):
                blur += f * (loud(p_i - part_of_pair(state_old, j, 0) - borne, spared) * r * inv_z)
            if wp.static(linear):
                for axis in range(wp.static(spec.dimension)):
                    for row in range(wp.static(spec.dimension)):
                        flow[row, axis] += (part(velocity, j, row) - vi[row]) * (f * d[axis])
                        moment[row, axis] -= d[row] * (f * d[axis])
            if wp.static(spray):
                stiffness -= f * r
                crowd -= f * r2
        sums = OwnRates()
        sums.rate = added(rate)
        sums.blur = added(blur)
        if wp.static(spray):
            sums.stiffness = added(stiffness)
            sums.crowd = added(crowd)
        for row in range(wp.static(spec.dimension)):
            for axis in range(wp.static(spec.dimension)):
                flow_of_all[row, axis] = flow[row, axis]
                moment_of_all[row, axis] = moment[row, axis]
        if wp.static(linear):
            sums.flow = added_mat(flow_of_all)
            sums.moment = added_mat(moment_of_all)
        return sums

    return OwnRates, own_rates
