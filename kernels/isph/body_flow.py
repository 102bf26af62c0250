"""Velocity of bodies in projection ISPH: the flow continued through their surfaces along linear fits (theory: isph#bodies).

At the foot x_s of each particle of the first layer, with weights w_f = W(x_f - x_s) V_f over the fluid and r = x_f - x_s:

    no-slip: v_w + S r, S = [sum w (v_f - v_w) (x) r] [sum w r (x) r]^-1
    free slip: v_s + G r, the plain least-squares fit; its part along the normal is that of the fit through v_w

A wall particle x behind the surface (its foot: x_o) has with that of the first layer nearest to its foot

    mirrored velocity, for friction: v_w + S (x - x_o)
    continued velocity, for the divergence: the same at a no-slip wall; v_s + G (x - x_s) along a free-slip one

Both are exact where the velocity is linear, whatever the arrangement. Where the fluid is too thin for a fit, S changes along
the normal alone, and G = 0.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.wall_fit import THIN
from warpsph.kernels.core.weights import make_weights


@functools.cache
def make_body_fit(spec: Spec) -> Any:
    """Return the kernel over wall particles that fits the velocity of the fluid before the first layer.

    `ahead` 1 takes the velocity extrapolated to the end of the step, where friction sees it, 0 the present one.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    time_weights = make_weights(spec.second_order)
    thin = THIN**spec.dimension

    @wp.func
    def thinnest(params: Params):
        limit = real(thin)
        for _axis in range(wp.static(spec.dimension)):
            limit = limit * params.spacing * params.spacing
        return limit

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def body_fit(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        ahead: real,
        params: Params,
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_area: wp.array(dtype=real),
        surface_shear: wp.array(dtype=mat),
        slide: wp.array(dtype=vec),
        slide_gradient: wp.array(dtype=mat),
    ):
        w = wp.tid() + first
        if wall_area[w] == real(0.0):
            return
        i = w + fluid_count
        normal = wall_normal[w]
        foot = position[i] + normal * wall_depth[w]
        own = velocity[i]
        omega = ahead * real(time_weights(clock)[3])
        weight = real(0.0)
        mean = vec()  # of r
        difference = vec()  # of v - v_w
        square = mat()  # sum w r (x) r
        product = mat()  # sum w (v - v_w) (x) r
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            r = -separation(foot, position[j], True, params)
            w_j = shape(wp.length(r) * params.inv_h) * rest_volume[j]
            v = velocity[j]
            v = v + (v - velocity_old[j]) * omega - own
            weight += w_j
            mean += w_j * r
            difference += w_j * v
            square += wp.outer(r, w_j * r)
            product += wp.outer(v, w_j * r)
        shear = mat()
        gradient = mat()
        if weight > real(1.0e-20):
            inv_weight = real(1.0) / weight
            mean = mean * inv_weight
            difference = difference * inv_weight
            square = square * inv_weight
            product = product * inv_weight
            limit = thinnest(params)
            spread = square - wp.outer(mean, mean)
            if wp.determinant(spread) > limit:
                gradient = (product - wp.outer(difference, mean)) * wp.inverse(spread)
            if wp.determinant(square) > limit:
                shear = product * wp.inverse(square)
            else:
                out = wp.max(wp.dot(normal, square * normal), real(1.0e-6) * params.spacing * params.spacing)
                shear = wp.outer(product * normal / out, normal)
        surface_shear[w] = shear
        slide[w] = own + difference - gradient * mean
        slide_gradient[w] = gradient

    return body_fit


@functools.cache
def make_body_velocity(spec: Spec) -> Any:
    """Return the kernel that gives every wall particle its mirrored and its continued velocity from the fit of its leader."""
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def body_velocity(
        first: int,
        fluid_count: int,
        params: Params,
        row_of_wall: wp.array(dtype=int),
        leader: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        surface_shear: wp.array(dtype=mat),
        slide: wp.array(dtype=vec),
        slide_gradient: wp.array(dtype=mat),
        continued_velocity: wp.array(dtype=vec),
        mirror_velocity: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        i = w + fluid_count
        lead = row_of_wall[leader[w]]
        normal = wall_normal[w]
        mirrored = velocity[i] - surface_shear[lead] * (normal * wall_depth[w])
        slides = bool(True)
        if wp.static(spec.wall_no_slip):
            mirror_velocity[w] = mirrored
            slides = slip[w] == wp.uint8(1)
        if slides:
            foot = position[lead + fluid_count] + wall_normal[lead] * wall_depth[lead]
            v = slide[lead] + slide_gradient[lead] * separation(position[i], foot, True, params)
            mirrored = v + normal * wp.dot(normal, mirrored - v)
        continued_velocity[w] = mirrored

    return body_velocity
