"""Geometry of the interfaces, on the particles of the interface band alone (theory: riemann#a6).

Everything is seen from a particle's own phase, so that any number of phases needs one number a particle:
    fraction_i  = sum_{j in own phase} W V_j / sum_j W V_j          (Shepard; the own phase is 1 in the bulk)
    n_i         = sum_j (c_j - fraction_i) grad_i W V_j      c_j: i's phase at j, fraction_j or 1 - fraction_j
    kappa_i     = div(-n/|n|) = tr(M^-1 D)                            positive where the own phase is convex
The curvature at a particle follows from the places of the *other* particles, mostly those across the interface. Used as it
is, it drives the first rows of both sides apart, at any density ratio (docs/records/tension.md). So it is made the same on
both sides, and what that smooths of it along the interface is put back (`make_evened`).
Walls take no part unless `contact` turns the normals next to them. That prescribes no contact angle: drops set down at
60 and 120 degrees creep towards 90 on a no-slip wall (73 and 91 after 12 and 16 capillary times) and slosh on a free-slip
one.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import BAND_COUNT
from warpsph.kernels.core.pair import BAND, NEAR, list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of

FAINTEST = 0.01  # |n| h below which a particle has no normal
SMALLEST_MOMENT = 0.02  # determinant below which the divergence of the normals is not corrected
SHARPEST = 2.0  # largest curvature, times h


@functools.cache
def make_fraction(spec: Spec) -> Any:
    """Return the kernel of the own-phase fraction."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

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
        i = wp.tid() + first
        if wp.static(spec.row_list):
            if i >= counters[BAND_COUNT]:
                return
            i = band[i]
        elif (int(flags[i]) & BAND) == 0:
            return
        if (int(flags[i]) & NEAR) == 0:
            fraction[i] = real(1.0)
            if wp.static(spec.contact_angle):
                contact_cosine[i] = real(0.0)
            return
        xi = position[i]
        own = phase[i]
        same = shape(real(0.0)) * state[i][1]
        every = same
        cosine = real(0.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], True, params)
            w = shape(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]
            every += w
            if phase[j] == own:
                same += w
            elif wp.static(spec.contact_angle):
                cosine += w * contact_angles[int(own) * phases.shape[0] + int(phase[j])]
        fraction[i] = same / every
        if wp.static(spec.contact_angle):
            contact_cosine[i] = cosine / wp.max(every - same, real(1.0e-30))

    return own_fraction


@functools.cache
def make_normal(spec: Spec) -> Any:
    """Return the kernel of the fraction's gradient n [1/m] and its weight (|n| h)^2, zero where |n| < 0.01/h."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

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
        i = wp.tid() + first
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
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], True, params)
            share = fraction[j]
            if phase[j] != own:
                share = real(1.0) - share
            n += ((share - f_i) * slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]) * d
        n = n * params.g_norm
        strength = wp.length(n) * params.h
        weight = strength * strength
        if strength < real(FAINTEST):
            weight = real(0.0)
        normal[i] = n
        interface_weight[i] = weight

    return colour_normal


@functools.cache
def make_curvature(spec: Spec) -> Any:
    """Return the kernel of the interface curvature [1/m], clamped to what the kernel can resolve."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
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
        i = wp.tid() + first
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
            k = list_begin(i, list_width)
            step = list_step(particle_count)
            end = k + int(fluid_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                if interface_weight[j] > real(0.0):
                    d = separation(xi, position[j], True, params)
                    f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1] * params.g_norm
                    unit_j = wp.normalize(normal[j])
                    if phase[j] != own:
                        unit_j = -unit_j
                    moment -= f * wp.outer(d, d)
                    # normals point into the own phase; kappa is the divergence of the opposite direction
                    spread += f * wp.outer(d, unit_i - unit_j)
            if wp.determinant(moment) > real(SMALLEST_MOMENT):
                kappa = wp.trace(wp.inverse(moment) * spread)
            else:
                kappa = real(d_real) * wp.trace(spread) / wp.max(wp.trace(moment), real(1.0e-6))
            limit = real(SHARPEST) * params.inv_h
            kappa = wp.clamp(kappa, -limit, limit)
        curvature[i] = kappa

    return interface_curvature


# Width of the means across an interface: weights exp(-NARROW t^2/h^2) of the way t along it, the narrowest that still finds
# some particles in reach. Half and double of it: docs/records/tension.md.
NARROW = 2.0


@functools.cache
def make_evened(spec: Spec, sharp: bool) -> Any:
    """Return the kernel of the mean of the curvature across the interface; `sharp`: that of the curvature, not smoothed.

        mean_i  = sum_j w_j^2 a_ij exp(-NARROW t_ij^2/h^2) V_j kappa_j / sum_j (the same without kappa_j),   i included
        kappa_i = mean_i + (mean_i - the same mean of mean_i)

    t_ij is the way along the interface at i, whatever the distance across, so that both sides see the same particles;
    a_ij = max(n_i.n_j/(|n_i| |n_j|), 0) leaves out other interfaces in reach. Signs of other phases are turned.
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    reach2 = KERNELS[spec.kernel].support ** 2

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
        i = wp.tid() + first
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
            mean = total * own_value
            k = list_begin(i, list_width)
            step = list_step(particle_count)
            end = k + int(fluid_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
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
            mean = mean / total
        if wp.static(sharp):
            limit = real(SHARPEST) * params.inv_h
            curvature[i] = wp.clamp(real(2.0) * own_value - mean, -limit, limit)
        else:
            mean_curvature[i] = mean

    return evened_curvature
