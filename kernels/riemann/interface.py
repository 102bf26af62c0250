"""Geometry of the interfaces, on the particles of the interface band alone (theory: riemann#a6).

Everything is seen from a particle's own phase, so that any number of phases needs one number a particle:
    fraction_i  = sum_{j in own phase} W V_j / sum_j W V_j          (Shepard; the own phase is 1 in the bulk)
    n_i         = L_i sum_j (c_j - fraction_i) grad_i W V_j      c_j: i's phase at j, fraction_j or 1 - fraction_j
                  L_i = [sum_j grad_i W (x) (x_j - x_i) V_j]^-1
    kappa_i     = div(-n/|n|) = tr(M^-1 D)                            positive where the own phase is convex
The curvature at a particle follows from the places of the *other* particles, mostly those across the interface. Used as it
is, it drives the first rows of both sides apart, at any density ratio (docs/records/tension.md). So it is made the same on
both sides (`make_evened`). Two errors of the order h^2 are taken out: what the bend of the interface adds
(`make_straightened`), and what is smoothed along it (`sharpness`).
Next to walls `contact` turns the normals. Where they take no part, as for weights without a tension, drops set down at
60 and 120 degrees creep towards 90 on a no-slip wall (73 and 91 after 12 and 16 capillary times) and slosh on a free-slip
one.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import BAND_COUNT
from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import BAND, NEAR, list_access, look_ahead, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types, types_of

FAINTEST = 0.01  # |n| h below which a particle has no normal
SMALLEST_MOMENT = 0.02  # determinant below which the normals and their divergence are not corrected
SHARPEST = 2.0  # largest curvature, times h


@functools.cache
def make_fraction(spec: Spec) -> Any:
    """Return the kernel of the own-phase fraction."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, _, Listed = list_access(spec)
    look, taken, onward = look_ahead(spec)
    particle_of, lane_of, part_of, added = lanes_of(spec, real)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def own_fraction(
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
        phases: wp.array(dtype=Phase),
        contact_angles: wp.array(dtype=real),
        fraction: wp.array(dtype=real),
        contact_cosine: wp.array(dtype=real),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        if (int(flags[i]) & NEAR) == 0:
            fraction[i] = real(1.0)
            if wp.static(spec.leaning):
                contact_cosine[i] = real(0.0)
            return
        xi = position[i]
        own = phase[i]
        same = shape(real(0.0)) * state[i][1]
        if wp.static(spec.lanes > 1):
            same = wp.where(lane == 0, same, real(0.0))  # its own place counts once
        other = real(0.0)
        cosine = real(0.0)
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        ahead = look(neighbours, i, k, end)
        while k < end:
            j = taken(ahead, neighbours, i, k)
            k, ahead = onward(neighbours, i, k, step, end)
            d = separation(xi, position[j], True, params)
            w = shape(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]
            if phase[j] == own:
                same += w
            else:
                other += w
                if wp.static(spec.leaning):
                    cosine += w * contact_angles[int(own) * phases.shape[0] + int(phase[j])]
        if wp.static(spec.lanes > 1):
            same, other = added(same), added(other)
            if wp.static(spec.leaning):
                cosine = added(cosine)
            if lane > 0:
                return
        # exactly 1 without another phase in reach, which same/(same + other) is not by the quick division of a GPU
        fraction[i] = real(1.0) - other / (same + other)
        if wp.static(spec.leaning):
            contact_cosine[i] = cosine / wp.max(other, real(1.0e-30))

    return shared(own_fraction, spec)


@functools.cache
def make_normal(spec: Spec) -> Any:
    """Return the kernel of the fraction's gradient n [1/m] and its weight (|n| h)^2, zero where |n| < 0.01/h.

    Exact for a fraction that is linear, whatever the arrangement: without the moment a flow that has drawn rows out or
    slanted them turns the normals, and the interface comes to rest where it is not flat (docs/records/tension.md#memory).
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, _, Listed = list_access(spec)
    look, taken, onward = look_ahead(spec)
    particle_of, lane_of, part_of, added_vec, added_mat = lanes_of(spec, vec, mat)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def colour_normal(
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
        normal: wp.array(dtype=vec),
        interface_weight: wp.array(dtype=real),
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
        own = phase[i]
        f_i = fraction[i]
        n = vec()
        moment = mat()
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        ahead = look(neighbours, i, k, end)
        while k < end:
            j = taken(ahead, neighbours, i, k)
            k, ahead = onward(neighbours, i, k, step, end)
            d = separation(xi, position[j], True, params)
            share = fraction[j]
            if phase[j] != own:
                share = real(1.0) - share
            fd = (slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1] * params.g_norm) * d
            n += (share - f_i) * fd
            moment -= wp.outer(d, fd)
        if wp.static(spec.lanes > 1):
            n, moment = added_vec(n), added_mat(moment)
            if lane > 0:
                return
        if wp.determinant(moment) > real(SMALLEST_MOMENT):
            n = wp.inverse(moment) * n
        strength = wp.length(n) * params.h
        weight = strength * strength
        if strength < real(FAINTEST):
            weight = real(0.0)
        normal[i] = n
        interface_weight[i] = weight

    return shared(colour_normal, spec)


# What the bend of an interface adds to its curvature: relative errors, times (R/h)^2, of a circle in two dimensions and of a
# cylinder and a sphere in three, for particles without end (`python scripts/curvature_error.py`). Times the variance of the
# kernel, 2.0 to 2.1 of a circle or cylinder and 2.5 to 2.7 of a sphere.
BEND = {
    "wendland_c2": (0.575, 0.548, 0.688),
    "wendland_c4": (0.435, 0.417, 0.524),
    "wendland_c6": (0.349, 0.337, 0.423),
    "cubic": (0.665, 0.620, 0.780),
    "quintic": (0.996, 0.963, 1.219),
    "gaussian": (1.000, 0.998, 1.256),
}


@functools.cache
def make_straightened(kernel: str, dimension: int, precision: str) -> Any:
    """Return the `wp.func` of the curvature without what the bend of the interface adds to it, from S = h grad(-n/|n|).

    With the principal curvatures k1 and k2, times h, tr S comes out as (k1 + k2)(1 + x) with
    x = a (k1^2 - k1 k2 + k2^2) + b k1 k2, a of a cylinder and a + b of a sphere. The factor (1 + 2 x)/(1 + 3 x) is the
    inverse to second order; it leaves two thirds where the curvature is too strong for an expansion. Returns kappa h.
    """
    real, _, mat, _ = types(dimension, precision)
    circle, cylinder, sphere = BEND[kernel]
    product = 0.5 * (sphere - 2.0 * cylinder)

    @wp.func
    def straightened(shape: mat):
        kappa = wp.trace(shape)
        if wp.static(dimension == 2):
            x = real(circle) * kappa * kappa
        else:
            squares = wp.trace(shape * shape)
            x = real(cylinder) * squares + real(product) * (kappa * kappa - squares)
        return kappa * (real(1.0) + real(2.0) * x) / (real(1.0) + real(3.0) * x)

    return straightened


@functools.cache
def make_curvature(spec: Spec) -> Any:
    """Return the kernel of the interface curvature [1/m], clamped to what the kernel can resolve."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, _, Listed = list_access(spec)
    look, taken, onward = look_ahead(spec)
    particle_of, lane_of, part_of, added = lanes_of(spec, mat)
    straightened = make_straightened(spec.kernel, spec.dimension, spec.precision)
    d_real = float(spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def interface_curvature(
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
        normal: wp.array(dtype=vec),
        interface_weight: wp.array(dtype=real),
        curvature: wp.array(dtype=real),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        kappa = real(0.0)
        if interface_weight[i] > real(0.0):
            xi = position[i]
            own = phase[i]
            unit_i = wp.normalize(normal[i])
            moment = mat()
            spread = mat()
            begin, stride = list_begin(i, list_width), list_step(particle_count)
            end = begin + int(fluid_neighbours[i]) * stride
            k, step = part_of(begin, stride, lane)
            ahead = look(neighbours, i, k, end)
            while k < end:
                j = taken(ahead, neighbours, i, k)
                k, ahead = onward(neighbours, i, k, step, end)
                if interface_weight[j] > real(0.0):
                    d = separation(xi, position[j], True, params)
                    f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1] * params.g_norm
                    unit_j = wp.normalize(normal[j])
                    if phase[j] != own:
                        unit_j = -unit_j
                    moment -= f * wp.outer(d, d)
                    # normals point into the own phase; kappa is the divergence of the opposite direction
                    spread += f * wp.outer(d, unit_i - unit_j)
            if wp.static(spec.lanes > 1):
                moment, spread = added(moment), added(spread)
            if wp.determinant(moment) > real(SMALLEST_MOMENT):
                kappa = straightened(params.h * wp.inverse(moment) * spread) * params.inv_h
            else:
                kappa = real(d_real) * wp.trace(spread) / wp.max(wp.trace(moment), real(1.0e-6))
            limit = real(SHARPEST) * params.inv_h
            kappa = wp.clamp(kappa, -limit, limit)
        if wp.static(spec.lanes > 1):
            if lane > 0:
                return
        curvature[i] = kappa

    return shared(interface_curvature, spec)


# Narrowness of the means across an interface: weights exp(-NARROW t^2/h^2) of the way t along it. Wider than this the first
# rows drive each other apart again, narrower ones take more noise for curvature: half and double in docs/records/tension.md.
NARROW = 1.0


def sharpness(kernel: str, dimension: int) -> float:
    """Factor c of kappa = mean + c (mean - mean of it) that gives back all that was smoothed along the interface.

    Of a wave of the number k the fraction, its gradient and the divergence leave 1 - 3/2 v (k h)^2, v the variance of the
    kernel along an axis, and the mean leaves 1 - (k h)^2/(4 NARROW), which the difference of both means measures.
    """
    return 1.0 + 6.0 * NARROW * KERNELS[kernel].variance[dimension - 1]


@functools.cache
def make_evened(spec: Spec, sharp: bool) -> Any:
    """Return the kernel of the mean of the curvature across the interface; `sharp`: that of the curvature, not smoothed.

        mean_i  = sum_j w_j^2 a_ij exp(-NARROW t_ij^2/h^2) V_j kappa_j / sum_j (the same without kappa_j),   i included
        kappa_i = mean_i + c (mean_i - the same mean of mean_i),   c of `sharpness`

    t_ij is the way along the interface at i, whatever the distance across, so that both sides see the same particles;
    a_ij = max(n_i.n_j/(|n_i| |n_j|), 0) leaves out other interfaces in reach. Signs of other phases are turned.
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, _, Listed = list_access(spec)
    look, taken, onward = look_ahead(spec)
    particle_of, lane_of, part_of, added = lanes_of(spec, real)
    reach2 = KERNELS[spec.kernel].support ** 2
    sharper = sharpness(spec.kernel, spec.dimension)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def evened_curvature(
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
        normal: wp.array(dtype=vec),
        interface_weight: wp.array(dtype=real),
        curvature: wp.array(dtype=real),
        mean_curvature: wp.array(dtype=real),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        own_value = curvature[i]
        if wp.static(sharp):
            own_value = mean_curvature[i]
        mean = real(0.0)
        if interface_weight[i] > real(0.0):
            xi = position[i]
            own = phase[i]
            unit_i = wp.normalize(normal[i])
            inv_width2 = real(NARROW) * params.inv_h * params.inv_h
            total = interface_weight[i] * interface_weight[i] * state[i][1]
            if wp.static(spec.lanes > 1):
                total = wp.where(lane == 0, total, real(0.0))  # its own place counts once
            mean = total * own_value
            begin, stride = list_begin(i, list_width), list_step(particle_count)
            end = begin + int(fluid_neighbours[i]) * stride
            k, step = part_of(begin, stride, lane)
            ahead = look(neighbours, i, k, end)
            while k < end:
                j = taken(ahead, neighbours, i, k)
                k, ahead = onward(neighbours, i, k, step, end)
                d = separation(xi, position[j], True, params)
                r2 = wp.dot(d, d)
                if interface_weight[j] > real(0.0) and r2 * params.inv_h * params.inv_h < real(reach2):
                    side = real(1.0)
                    if phase[j] != own:
                        side = real(-1.0)
                    across = wp.dot(d, unit_i)
                    alike = wp.max(side * wp.dot(unit_i, wp.normalize(normal[j])), real(0.0))
                    w = alike * interface_weight[j] * interface_weight[j] * state[j][1]
                    w *= wp.exp((across * across - r2) * inv_width2)
                    total += w
                    if wp.static(sharp):
                        mean += side * w * mean_curvature[j]
                    else:
                        mean += side * w * curvature[j]
            if wp.static(spec.lanes > 1):
                mean, total = added(mean), added(total)
            mean = mean / total
        if wp.static(spec.lanes > 1):
            if lane > 0:
                return
        if wp.static(sharp):
            limit = real(SHARPEST) * params.inv_h
            curvature[i] = wp.clamp(own_value + real(sharper) * (own_value - mean), -limit, limit)
        else:
            mean_curvature[i] = mean

    return shared(evened_curvature, spec)
