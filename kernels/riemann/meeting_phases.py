"""Geometry of interfaces where three and more phases meet, on the particles of the interface band (riemann#a6-three).

Two phases need one number a particle, since the interface of a phase is that of the other (`interface`). Where a third one
is in reach each phase k has an interface of its own, seen by all particles, of whatever phase:
    C_k(i)     = sum_{j in k} W V_j / sum_j W V_j                     share of the phase, itself included
    n_k(i)     = L_i sum_j (C_k(j) - C_k(i)) grad_i W V_j             into the phase; L_i as in `interface`
    kappa_k(i) = div(-n_k/|n_k|)                                      positive where the phase is convex
and the tension of a pair is shared out to its phases, sigma_ij = s_i + s_j for the three that meet at a point. With the jump
J = s_i kappa_i - s_j kappa_j the pull of phase k on the points of its corner is s_k times the sum of both directions in
which its sides leave, whatever the angle between them, and all three together are sum sigma t (Smith, Solis & Chopp 2002).
Of four and more phases the third is the one whose share changes most there. With two phases in reach n_1 = -n_2,
kappa_1 = -kappa_2, and everything is what `interface` has.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import BAND_COUNT
from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import BAND, list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, phase_types_of, types_of

from .interface import FAINTEST, NARROW, SHARPEST, SMALLEST_MOMENT, make_straightened, sharpness


@functools.cache
def make_parts_jump(spec: Spec) -> Any:
    """Return the `wp.func` parts_jump(tension, a, b, curvature, weight, i, j) = J_ij = s_a k_a - s_b k_b [Pa].

    Arguments of the function: the tensions of all pairs [N/m], row by row; the phases a of i and b of j; of all particles
    the curvatures of the phases [1/m] and the weights of their gradients; the particles i and j. k_a is the mean of i and j
    with these weights, and s_a = (sigma_ab + sigma_ac - sigma_bc)/2 with the third phase c, of several that whose gradient
    is the strongest there. J_ji = -J_ij.
    """
    real, (phased, _), count = types_of(spec).real, phase_types_of(spec), max(spec.triple, 3)

    @wp.func
    def parts_jump(
        tension: wp.array(dtype=real),
        a: int,
        b: int,
        curvature: wp.array(dtype=phased),
        weight: wp.array(dtype=phased),
        i: int,
        j: int,
    ):
        kappa_i, kappa_j = curvature[i], curvature[j]
        w_i, w_j = weight[i], weight[j]
        c = 3 - a - b
        if wp.static(count > 3):
            strongest = real(-1.0)
            for each in range(count):
                strength = w_i[each] + w_j[each]
                if each != a and each != b and strength > strongest:
                    strongest = strength
                    c = each
        joint = tension[a * count + b]
        skew = tension[a * count + c] - tension[b * count + c]
        jump = real(0.0)
        both = w_i[a] + w_j[a]
        if both > real(1.0e-9):
            jump += real(0.5) * (joint + skew) * (w_i[a] * kappa_i[a] + w_j[a] * kappa_j[a]) / both
        both = w_i[b] + w_j[b]
        if both > real(1.0e-9):
            jump -= real(0.5) * (joint - skew) * (w_i[b] * kappa_i[b] + w_j[b] * kappa_j[b]) / both
        return jump

    return parts_jump


@functools.cache
def make_phase_shares(spec: Spec) -> Any:
    """Return the kernel of the shares C_k of the phases around a particle."""
    real, vec, _, pair = types_of(spec)
    phased, _ = phase_types_of(spec)
    phases = spec.triple
    Params = make_params(spec.dimension, spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    particle_of, lane_of, part_of, added = lanes_of(spec, phased)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def phase_shares(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        counters: wp.array(dtype=int),
        band: wp.array(dtype=int),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        fraction: wp.array(dtype=real),
        share: wp.array(dtype=phased),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        xi = position[i]
        own = int(phase[i])
        found = phased()
        found[own] = shape(real(0.0)) * state[i][1]
        if wp.static(spec.lanes > 1):
            found[own] = wp.where(lane == 0, found[own], real(0.0))  # its own place counts once
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], True, params)
            found[int(phase[j])] += shape(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]
        if wp.static(spec.lanes > 1):
            found = added(found)
            if lane > 0:
                return
        every = real(0.0)
        for each in range(phases):
            every += found[each]
        found = found / every
        # exactly 1 without another phase in reach, which a quotient is not by the quick division of a GPU
        others = real(0.0)
        for each in range(phases):
            if each != own:
                others += found[each]
        found[own] = real(1.0) - others
        share[i] = found
        fraction[i] = found[own]

    return shared(phase_shares, spec)


@functools.cache
def make_phase_normals(spec: Spec) -> Any:
    """Return the kernel of the gradients n_k [1/m] and their weights (|n_k| h)^2, zero where |n_k| < 0.01/h.

    `normal` is that of the own phase, for outputs and gauges.
    """
    real, vec, mat, pair = types_of(spec)
    phased, normals = phase_types_of(spec)
    phases = spec.triple
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    particle_of, lane_of, part_of, added_normals, added_mat = lanes_of(spec, normals, mat)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def phase_normals(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        counters: wp.array(dtype=int),
        band: wp.array(dtype=int),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        share: wp.array(dtype=phased),
        phase_normal: wp.array(dtype=normals),
        interface_weight: wp.array(dtype=phased),
        normal: wp.array(dtype=vec),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        xi = position[i]
        share_i = share[i]
        n = normals()
        moment = mat()
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], True, params)
            fd = (slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1] * params.g_norm) * d
            n += wp.outer(share[j] - share_i, fd)
            moment -= wp.outer(d, fd)
        if wp.static(spec.lanes > 1):
            n, moment = added_normals(n), added_mat(moment)
            if lane > 0:
                return
        if wp.determinant(moment) > real(SMALLEST_MOMENT):
            n = n * wp.inverse(moment)  # symmetric
        weight = phased()
        for each in range(phases):
            strength2 = wp.length_sq(n[each]) * params.h * params.h
            if strength2 >= real(FAINTEST * FAINTEST):
                weight[each] = strength2
        phase_normal[i] = n
        interface_weight[i] = weight
        normal[i] = n[int(phase[i])]

    return shared(phase_normals, spec)


@functools.cache
def make_phase_curvatures(spec: Spec) -> Any:
    """Return the kernel of the curvatures kappa_k [1/m] of the phases, clamped to what the kernel can resolve."""
    real, vec, mat, pair = types_of(spec)
    phased, normals = phase_types_of(spec)
    phases = spec.triple
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    particle_of, lane_of, part_of, added = lanes_of(spec, mat)
    straightened = make_straightened(spec.kernel, spec.dimension, spec.precision)
    d_real = float(spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def phase_curvatures(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        counters: wp.array(dtype=int),
        band: wp.array(dtype=int),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        phase_normal: wp.array(dtype=normals),
        interface_weight: wp.array(dtype=phased),
        curvature: wp.array(dtype=phased),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        xi = position[i]
        kappas = phased()
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        own_begin, step = part_of(begin, stride, lane)
        each = int(0)
        while each < phases:
            if interface_weight[i][each] > real(0.0):
                unit_i = wp.normalize(phase_normal[i][each])
                moment = mat()
                spread = mat()
                k = int(own_begin)
                while k < end:
                    j = neighbour(neighbours, i, k)
                    k += step
                    if interface_weight[j][each] > real(0.0):
                        d = separation(xi, position[j], True, params)
                        f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1] * params.g_norm
                        unit_j = wp.normalize(phase_normal[j][each])
                        moment -= f * wp.outer(d, d)
                        spread += f * wp.outer(d, unit_i - unit_j)
                if wp.static(spec.lanes > 1):
                    moment, spread = added(moment), added(spread)
                kappa = real(d_real) * wp.trace(spread) / wp.max(wp.trace(moment), real(1.0e-6))
                if wp.determinant(moment) > real(SMALLEST_MOMENT):
                    kappa = straightened(params.h * wp.inverse(moment) * spread) * params.inv_h
                limit = real(SHARPEST) * params.inv_h
                kappas[each] = wp.clamp(kappa, -limit, limit)
            each += 1
        if wp.static(spec.lanes > 1):
            if lane > 0:
                return
        curvature[i] = kappas

    return shared(phase_curvatures, spec)


@functools.cache
def make_phase_evened(spec: Spec, sharp: bool) -> Any:
    """Return the kernel of the means of the curvatures across the interfaces, as `make_evened`, of each phase for itself.

    Of the phase k both sides of its interface take part, with the same sign.
    """
    real, vec, _, pair = types_of(spec)
    phased, normals = phase_types_of(spec)
    phases = spec.triple
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    particle_of, lane_of, part_of, added = lanes_of(spec, real)
    reach2 = KERNELS[spec.kernel].support ** 2
    sharper = sharpness(spec.kernel, spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def phase_evened(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        counters: wp.array(dtype=int),
        band: wp.array(dtype=int),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        phase_normal: wp.array(dtype=normals),
        interface_weight: wp.array(dtype=phased),
        curvature: wp.array(dtype=phased),
        mean_curvature: wp.array(dtype=phased),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        xi = position[i]
        own = curvature[i]
        if wp.static(sharp):
            own = mean_curvature[i]
        means = phased()
        inv_width2 = real(NARROW) * params.inv_h * params.inv_h
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        own_begin, step = part_of(begin, stride, lane)
        each = int(0)
        while each < phases:
            weight = interface_weight[i][each]
            if weight > real(0.0):
                unit_i = wp.normalize(phase_normal[i][each])
                total = weight * weight * state[i][1]
                if wp.static(spec.lanes > 1):
                    total = wp.where(lane == 0, total, real(0.0))  # its own place counts once
                mean = total * own[each]
                k = int(own_begin)
                while k < end:
                    j = neighbour(neighbours, i, k)
                    k += step
                    d = separation(xi, position[j], True, params)
                    r2 = wp.dot(d, d)
                    w = interface_weight[j][each]
                    if w > real(0.0) and r2 * params.inv_h * params.inv_h < real(reach2):
                        across = wp.dot(d, unit_i)
                        alike = wp.max(wp.dot(unit_i, wp.normalize(phase_normal[j][each])), real(0.0))
                        w = alike * w * w * state[j][1] * wp.exp((across * across - r2) * inv_width2)
                        total += w
                        if wp.static(sharp):
                            mean += w * mean_curvature[j][each]
                        else:
                            mean += w * curvature[j][each]
                if wp.static(spec.lanes > 1):
                    mean, total = added(mean), added(total)
                means[each] = mean / total
            each += 1
        if wp.static(spec.lanes > 1):
            if lane > 0:
                return
        if wp.static(sharp):
            limit = real(SHARPEST) * params.inv_h
            for each in range(phases):
                means[each] = wp.clamp(own[each] + real(sharper) * (own[each] - means[each]), -limit, limit)
            curvature[i] = means
        else:
            mean_curvature[i] = means

    return shared(phase_evened, spec)
