"""Vorticity and Q of the fluid, when an output asks for them (theory: common#gradient).

At each particle the least-squares fit of a quadratic through its own velocity, with the weights W over the fluid around it,
gives the slopes S[a, b] = d v_a / d x_b: exact for a velocity of second order at any arrangement, and so in front of
walls too, without a word from them. Where the fluid is too thin for it they are those of a straight line, which is exact
for a velocity of first order, and 0 where there is not even that.
"""

import functools
from typing import Any

import warp as wp

from .clock import LAST_STEP
from .mirror import code_shift
from .pair import list_access, separation_of
from .params import make_params
from .quadratic import LEAST_PIVOT, make_quadratic
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types, types_of


@functools.cache
def make_swirl(dimension: int) -> Any:
    """Return the `wp.func` swirl(slopes) -> (vorticity, Q) of a velocity gradient, in float64.

    The vorticity has three components, in 2-D (0, 0, dv/dx - du/dy). Q = (|O|^2 - |D|^2)/2 = -S_ab S_ba/2, with the
    parts of the gradient that turn, O, and that strain, D (Hunt, Wray and Moin 1988).
    """
    mat = types(dimension, "float64").mat

    @wp.func
    def swirl(slopes: mat):
        curl = wp.vec3d()
        curl[2] = slopes[1, 0] - slopes[0, 1]
        if wp.static(dimension == 3):
            curl[0] = slopes[2, 1] - slopes[1, 2]
            curl[1] = slopes[0, 2] - slopes[2, 0]
        return curl, wp.float64(-0.5) * wp.trace(slopes * slopes)

    return swirl


@functools.cache
def make_flow_gradient(spec: Spec, staggered: bool) -> Any:
    """Return the kernel over fluid particles that writes vorticity [1/s] and Q [1/s^2].

    staggered: velocities are half a step behind positions, and are brought up to them.
    vorticity: three entries a particle, in 2-D one.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    fit = make_quadratic(spec.dimension)
    _, vec64, mat64, _ = types(spec.dimension, "float64")
    square, sides, basis, solve = fit.square, fit.sides, fit.basis, fit.solve
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    swirl = make_swirl(spec.dimension)
    image_bit = code_shift(spec.dimension)
    width = 3 if spec.dimension == 3 else 1

    @wp.func
    def straight(normal: square, right: sides):
        """The slopes of a straight line, from the sums of the quadratic; 0 where the points lie on a line or a plane."""
        moment = mat64()
        sums = mat64()
        for a in range(wp.static(spec.dimension)):
            for b in range(wp.static(spec.dimension)):
                moment[a, b] = normal[a, b]
                sums[a, b] = right[b, a]
        mean = wp.trace(moment) / wp.float64(wp.static(spec.dimension))
        least = wp.float64(LEAST_PIVOT)
        for _axis in range(wp.static(spec.dimension)):
            least = least * mean
        slopes = mat64()
        if mean > wp.float64(0.0) and wp.determinant(moment) > least:
            slopes = sums * wp.inverse(moment)
        return slopes

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def flow_gradient(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        vorticity: wp.array(dtype=real),
        q_criterion: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        normal = square()
        right = sides()
        half = real(0.0)
        if wp.static(staggered):
            half = real(0.5) * real(clock[LAST_STEP])
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            if wp.static(spec.mirror):
                if j >> image_bit != 0:
                    continue  # an image of the fluid is no fluid
            r = separation(position[j], position[i], True, params) * params.inv_h
            slide = velocity[j] - velocity[i]
            if wp.static(staggered):
                slide += half * (acceleration[j] - acceleration[i])
            w_j = wp.float64(shape(wp.length(r)))
            terms = basis(vec64(r))
            normal += wp.outer(terms, w_j * terms)
            right += wp.outer(terms, w_j * vec64(slide))
        slopes = straight(normal, right)
        found, quadratic = solve(normal, right)
        if found:
            for a in range(wp.static(spec.dimension)):
                for b in range(wp.static(spec.dimension)):
                    slopes[a, b] = quadratic[b, a]
        curl, q = swirl(slopes * wp.float64(params.inv_h))
        if wp.static(spec.dimension == 3):
            vorticity[wp.static(width) * i] = real(curl[0])
            vorticity[wp.static(width) * i + 1] = real(curl[1])
            vorticity[wp.static(width) * i + 2] = real(curl[2])
        else:
            vorticity[i] = real(curl[2])
        q_criterion[i] = real(q)

    return flow_gradient
