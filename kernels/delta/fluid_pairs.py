"""Sums over the pairs of fluid in the sweeps of delta-plus-SPH: the loops that take most of their time.

Numbers alone, and no branch: so a CPU works on eight neighbours at once (docs/records/pair_loops.md#vectors).
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.eigenvalue import WHOLE
from warpsph.kernels.core.lanes import lanes_of
from warpsph.kernels.core.pair import list_access, make_at, make_part, way_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import Spec, types, types_of
from warpsph.kernels.core.viscosity import make_friction_slope, make_viscous_parts

CROWDING = 0.2  # R of the shift, which keeps particles from pairing; its exponent is 4 (theory: delta#d3)


@functools.cache
def make_crowding(precision: str) -> Any:
    """Return the `wp.func` crowding(w) = 1 + R w^4, w the smoothing kernel over that at a spacing."""
    real = types(2, precision).real

    @wp.func
    def crowding(w: real):
        return real(1.0) + real(CROWDING) * w * w * w * w

    return crowding


@functools.cache
def make_rate_sums(spec: Spec, flow_part: bool, slow_part: bool) -> tuple[Any, Any]:
    """Return the struct `RateSums` and the `wp.func` rate_sums(i, k, end, ...) -> RateSums of the entries from k to end.

    flow_part, slow_part: as for `make_delta_continuity`.
    """
    real, vec, mat, pair = types_of(spec)
    Params, slope = make_params(spec.dimension, spec.precision), make_smoothing(spec.kernel, spec.precision)[1]
    _, _, neighbour, Listed = list_access(spec)
    along, part, part_of_pair, at_real = way_of(spec), make_part(vec), make_part(pair), make_at(real)
    carries = spec.shift_form == "consistent" and slow_part
    diffuses = spec.density_diffusion and slow_part
    exact, roomy = spec.exact_divergence and flow_part, spec.room and flow_part
    *_, added, added_vec, added_mat = lanes_of(spec, real, vec, mat)

    @wp.struct
    class RateSums:
        rate: real  # sum F V (v_i - v_j).x_ij
        evening: real  # what D_i sums up, over -2 g_norm / (rho0 c^2)
        moved: real  # sum F V (dr_i + dr_j).x_ij (s_j - s_i)
        carry: vec  # the same of the velocity
        crowd: real  # -sum F V r^2, the dimension inside a fluid
        room: real  # sum of (1 - r^2/R^2)^2 V
        ragged: real  # sums of -F V over particles of a free surface, and over all others
        company: real
        flow: mat  # sum F V (v_j - v_i) (x) x_ij
        moment: mat  # -sum F V x_ij (x) x_ij

    @wp.func
    def rate_sums(
        i: int,
        begin: int,
        end: int,
        step: int,
        wrapped: bool,
        xi: vec,
        vi: vec,
        p_i: real,
        s_i: real,
        params: Params,
        neighbours: Listed,
        midway: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        pressure_gradient: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        wholeness: wp.array(dtype=real),
        density_excess: wp.array(dtype=real),
    ):
        # numbers in the loop, vectors behind it: what leaves a loop as a vector is one in it, see `make_part`
        d, carry_sum, flow_sum, moment_sum = vec(), vec(), mat(), mat()
        rate, evening, moved, crowd = real(0.0), real(0.0), real(0.0), real(0.0)
        room, ragged, company = real(0.0), real(0.0), real(0.0)
        k = int(begin)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            r2, closing, rise, shifted = real(0.0), real(0.0), real(0.0), real(0.0)
            for axis in range(wp.static(spec.dimension)):
                d[axis] = along(xi[axis], part(midway, j, axis), axis, wrapped, params)
                r2 += d[axis] * d[axis]
                closing += (vi[axis] - part(velocity, j, axis)) * d[axis]
                if wp.static(diffuses):
                    rise += (pressure_gradient[i][axis] + part(pressure_gradient, j, axis)) * d[axis]
                if wp.static(carries):
                    shifted += (shift[i][axis] + part(shift, j, axis)) * d[axis]
            volume = part_of_pair(state, j, 1)
            f = slope(wp.sqrt(r2) * params.inv_h) * volume
            if wp.static(flow_part):
                rate += f * closing
            if wp.static(exact or roomy):
                for axis in range(wp.static(spec.dimension)):
                    fd_axis = f * d[axis]
                    for row in range(wp.static(spec.dimension)):
                        flow_sum[row, axis] -= (vi[row] - part(velocity, j, row)) * fd_axis
                        moment_sum[row, axis] -= d[row] * fd_axis
            if wp.static(roomy):
                inside = wp.max(real(1.0) - r2 * params.inv_window, real(0.0))
                room += inside * inside * volume
                if wp.static(spec.free_surface):
                    whole = at_real(wholeness, j)
                    ragged -= wp.where(whole < real(WHOLE), f, real(0.0))
                    company -= wp.where(whole < real(WHOLE), real(0.0), f)
            if wp.static(diffuses):
                evening += f * (part_of_pair(state, j, 0) - p_i + real(0.5) * rise)
            if wp.static(carries):
                through = f * shifted
                for axis in range(wp.static(spec.dimension)):
                    carry_sum[axis] -= through * (vi[axis] - part(velocity, j, axis))
                moved += through * (at_real(density_excess, j) - s_i)
            if wp.static(spec.free_surface):
                crowd -= f * r2
        carry, flow, moment = vec(), mat(), mat()
        for axis in range(wp.static(spec.dimension)):
            carry[axis] = carry_sum[axis]
            for row in range(wp.static(spec.dimension)):
                flow[row, axis] = flow_sum[row, axis]
                moment[row, axis] = moment_sum[row, axis]
        sums = RateSums()
        if wp.static(flow_part):
            sums.rate = added(rate)
        if wp.static(diffuses):
            sums.evening = added(evening)
        if wp.static(carries):
            sums.moved = added(moved)
            sums.carry = added_vec(carry)
        if wp.static(spec.free_surface):
            sums.crowd = added(crowd)
        if wp.static(roomy):
            sums.room = added(room)
        if wp.static(roomy and spec.free_surface):
            sums.ragged = added(ragged)
            sums.company = added(company)
        if wp.static(exact or roomy):
            sums.flow = added_mat(flow)
            sums.moment = added_mat(moment)
        return sums

    return RateSums, rate_sums


def needs_moment(spec: Spec, measuring: bool) -> bool:
    """Return whether the momentum sweep needs the moment of the neighbourhood; `measuring`: as for `make_delta_momentum`."""
    return spec.tension_control == "gaps" or (measuring and (spec.density_diffusion or spec.free_surface))


@functools.cache
def make_force_sums(spec: Spec, measuring: bool) -> tuple[Any, Any]:
    """Return the struct `ForceSums` and the `wp.func` force_sums(i, k, end, ...) -> ForceSums of the entries from k to end.

    measuring: as for `make_delta_momentum`.
    """
    real, vec, mat, pair = types_of(spec)
    Params, (shape, slope) = make_params(spec.dimension, spec.precision), make_smoothing(spec.kernel, spec.precision)
    _, _, neighbour, Listed = list_access(spec)
    along, part, part_of_pair, at_real = way_of(spec), make_part(vec), make_part(pair), make_at(real)
    viscous, support = spec.viscosity != "none", KERNELS[spec.kernel].support
    forms = (spec.viscosity if viscous else "radial", "radial")
    (with_velocity, with_way), (_, artificial_way) = (
        make_viscous_parts(form, spec.dimension, spec.precision) for form in forms
    )
    friction_slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)
    crowding = make_crowding(spec.precision)
    diffuses, shifts = spec.density_diffusion and measuring, spec.shifting and measuring
    measured = needs_moment(spec, measuring)
    *_, added, added_vec, added_mat = lanes_of(spec, real, vec, mat)

    @wp.struct
    class ForceSums:
        pressures: vec  # sum p_j F V x_ij
        even: vec  # sum F V x_ij, zero on an even arrangement
        slope_p: vec  # sum of (p_j - p_i) F V x_ij
        friction: vec
        push: vec  # sum of [1 + R (W/W(dx))^4] F V x_ij
        inward: vec  # sum F V x_ij (lambda_j - lambda_i)
        moment: mat  # -sum F V x_ij (x) x_ij
        ragged: real  # particles of a free surface within the support

    @wp.func
    def force_sums(
        i: int,
        begin: int,
        end: int,
        step: int,
        wrapped: bool,
        xi: vec,
        vi: vec,
        p_i: real,
        whole_i: real,
        viscosity: real,
        artificial_viscosity: real,
        shift_peak: real,
        params: Params,
        neighbours: Listed,
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        wholeness_old: wp.array(dtype=real),
    ):
        # numbers in the loop, vectors behind it: what leaves a loop as a vector is one in it, see `make_part`
        d, p_sum, e_sum, slope_sum, push_sum = vec(), vec(), vec(), vec(), vec()
        friction_sum, inward_sum, moment_sum = vec(), vec(), mat()
        ragged = real(0.0)
        k = int(begin)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            r2, closing = real(0.0), real(0.0)
            for axis in range(wp.static(spec.dimension)):
                d[axis] = along(xi[axis], part(position, j, axis), axis, wrapped, params)
                r2 += d[axis] * d[axis]
                if wp.static(viscous or spec.artificial_viscosity):
                    closing += (vi[axis] - part(velocity, j, axis)) * d[axis]
            q = wp.sqrt(r2) * params.inv_h
            p_j, volume = part_of_pair(state, j, 0), part_of_pair(state, j, 1)
            f, rub = slope(q) * volume, viscosity * (friction_slope(q) * volume)
            drag, crowd, rise = real(0.0), real(0.0), real(0.0)
            if wp.static(viscous):
                drag += rub * with_way(closing, r2 + params.tiny, params.inv_h)
            if wp.static(spec.artificial_viscosity):
                drag += artificial_viscosity * f * artificial_way(closing, r2 + params.tiny, params.inv_h)
            if wp.static(shifts):
                crowd = crowding(shape(q) * shift_peak)
            if wp.static(spec.free_surface):
                whole_j = at_real(wholeness_old, j)
                rise = whole_j - whole_i
                ragged += wp.where(whole_j < real(WHOLE), wp.where(q < real(support), real(1.0), real(0.0)), real(0.0))
            for axis in range(wp.static(spec.dimension)):
                fd_axis = f * d[axis]
                p_sum[axis] += p_j * fd_axis
                e_sum[axis] += fd_axis
                if wp.static(measured):
                    for row in range(wp.static(spec.dimension)):
                        moment_sum[row, axis] -= d[row] * fd_axis
                if wp.static(diffuses):
                    slope_sum[axis] += (p_j - p_i) * fd_axis
                if wp.static(viscous and with_velocity != 0.0):
                    friction_sum[axis] += rub * real(with_velocity) * (vi[axis] - part(velocity, j, axis))
                if wp.static(viscous or spec.artificial_viscosity):
                    friction_sum[axis] += drag * d[axis]
                if wp.static(shifts):
                    push_sum[axis] += crowd * fd_axis
                if wp.static(spec.free_surface):
                    inward_sum[axis] += rise * fd_axis
        pressures, even, slope_p, friction, push, inward, moment = vec(), vec(), vec(), vec(), vec(), vec(), mat()
        for axis in range(wp.static(spec.dimension)):
            pressures[axis] = p_sum[axis]
            even[axis] = e_sum[axis]
            slope_p[axis] = slope_sum[axis]
            friction[axis] = friction_sum[axis]
            push[axis] = push_sum[axis]
            inward[axis] = inward_sum[axis]
            for row in range(wp.static(spec.dimension)):
                moment[row, axis] = moment_sum[row, axis]
        sums = ForceSums()
        sums.pressures = added_vec(pressures)
        sums.even = added_vec(even)
        if wp.static(diffuses):
            sums.slope_p = added_vec(slope_p)
        if wp.static(viscous or spec.artificial_viscosity):
            sums.friction = added_vec(friction)
        if wp.static(shifts):
            sums.push = added_vec(push)
        if wp.static(spec.free_surface):
            sums.inward = added_vec(inward)
        if wp.static(measured):
            sums.moment = added_mat(moment)
        if wp.static(spec.free_surface):
            sums.ragged = added(ragged)
        return sums

    return ForceSums, force_sums
