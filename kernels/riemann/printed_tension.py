"""Geometry of the interface as Yang et al. 2019 print it, eqs (20) to (23) (theory: printed#yang; seed 000).

    C = 0 in the first phase, 1 in the second;  c_i = sum_j C_j W V_j, not divided by sum W V, its own place included
    n_i = sum_j (c_j - c_i) grad_i W V_j
    kappa_i = -sum_j min(N_i, N_j) (n_j/|n_j| - n_i/|n_i|).grad_i W V_j / sum_j min(N_i, N_j) W V_j,   N = (|n| > 0.01/h)

On all particles: noise of sum W V away from the interface is a normal too. Walls take no part. `normal` and `curvature` are
kept as the default form keeps them, towards the own phase and positive where that is convex: their product is the same.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of

SMALLEST = 0.01  # of |n| h: what is less is no interface


@functools.cache
def make_printed_colour(spec: Spec) -> Any:
    """Return the kernel of the smoothed colour, below eq (21)."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_colour(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        fraction: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        xi = position[i]
        colour = real(0.0)
        if int(phase[i]) == 1:
            colour = shape(real(0.0)) * state[i][1]
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            if int(phase[j]) == 1:
                d = separation(xi, position[j], True, params)
                colour += shape(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]
        fraction[i] = colour * params.g_norm * params.h * params.h  # alpha/h^d

    return printed_colour


@functools.cache
def make_printed_normal(spec: Spec) -> Any:
    """Return the kernel of the normal of eq (21) and of its weight (|n| h)^2, zero where eq (22) has no direction."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_normal(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        fraction: wp.array(dtype=real),
        normal: wp.array(dtype=vec),
        interface_weight: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        xi = position[i]
        n = vec()
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], True, params)
            n += ((fraction[j] - fraction[i]) * slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]) * d
        n = n * params.g_norm
        if int(phase[i]) == 0:
            n = -n
        strength = wp.length(n) * params.h
        weight = strength * strength
        if not (strength > real(SMALLEST)):
            weight = real(0.0)
        normal[i] = n
        interface_weight[i] = weight

    return printed_normal


@functools.cache
def make_printed_curvature(spec: Spec) -> Any:
    """Return the kernel of the curvature of eq (23) [1/m], with the sign that (24) needs and without a limit."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_curvature(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        normal: wp.array(dtype=vec),
        interface_weight: wp.array(dtype=real),
        curvature: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        kappa = real(0.0)
        if interface_weight[i] > real(0.0):
            xi = position[i]
            unit_i = wp.normalize(normal[i])
            spread = real(0.0)
            weight = shape(real(0.0)) * state[i][1]
            k = list_begin(i, list_width)
            step = list_step(particle_count)
            end = k + int(fluid_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                if interface_weight[j] > real(0.0):
                    d = separation(xi, position[j], True, params)
                    q = wp.sqrt(wp.dot(d, d)) * params.inv_h
                    unit_j = wp.normalize(normal[j])
                    if phase[j] != phase[i]:
                        unit_j = -unit_j
                    spread += slope(q) * state[j][1] * wp.dot(unit_j - unit_i, d)
                    weight += shape(q) * state[j][1]
            # grad W has alpha/h^(d+2), W has alpha/h^d
            kappa = -spread / weight * params.inv_h * params.inv_h
        curvature[i] = kappa

    return printed_curvature
