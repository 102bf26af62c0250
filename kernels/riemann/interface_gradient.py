"""The velocity gradient at an interface, from the more viscous side, for the friction across it (theory: riemann#a4).

The gradient G of the own phase (`interface_flow`) is that of a place inside it. What varies along the interface it has from
the depth <y> = sum_own F V t^2 y / sum_own F V t^2 below the particle, with n towards the other phase, y = n.x_ij and t the
part of x_ij along the interface. What the neighbours have beyond v_i + G.x_ji tells how that changes with the depth:
    D_i = (d-1) sum_own F V (v_j - v_i - G.x_ji) (x) t y / sum_own F V t^2 (y - <y>)^2
A linear flow has no D, on any arrangement. At the interface, a_i away from the particle,
    S = G - (a_i + <y>) D + (a_i + y') tr(D) n (x) n,   y' = sum_own F V y^3 / (2 sum_own F V y^2),
since a fluid that keeps its volume does across the interface what it does along it, with the other sign; of that G has
what is at the depth y' (of a velocity that is quadratic in y).
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import NEAR, list_access, look_ahead, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.riemann.interface_flow import FULL


@functools.cache
def make_interface_gradient(spec: Spec) -> Any:
    """Return the kernel over fluid particles; those that have no thinner fluid in their list are left alone."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, _, Listed = list_access(spec)
    look, taken, onward = look_ahead(spec)
    axes_along = spec.dimension - 1
    particle_of, lane_of, part_of, added, added_mat = lanes_of(spec, real, mat)
    full = FULL**spec.dimension

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def interface_gradient(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        velocity_gradient: wp.array(dtype=mat),
        facing: wp.array(dtype=vec),
        interface_depth: wp.array(dtype=real),
        gradient_at_interface: wp.array(dtype=mat),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if (int(flags[i]) & NEAR) == 0:
            return
        own = phase[i]
        thinnest = bool(True)
        for other in range(phases.shape[0]):
            thinnest = thinnest and phases[other].viscosity >= phases[int(own)].viscosity
        if thinnest:
            return
        xi, vi = position[i], velocity[i]
        n, gradient = facing[i], velocity_gradient[i]
        even, first_moment, second_moment = real(0.0), real(0.0), real(0.0)  # sums of F V t^2, and times y, y^2
        straight, skew = real(0.0), real(0.0)  # sums of F V y^2 and F V y^3
        moment = mat()
        rise = mat()
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        ahead = look(neighbours, i, k, end)
        beside_thinner = bool(False)
        while k < end:
            j = taken(ahead, neighbours, i, k)
            k, ahead = onward(neighbours, i, k, step, end)
            if phase[j] == own:
                d = separation(xi, position[j], True, params)
                f = -slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]
                y = wp.dot(n, d)
                along = y * n - d
                weight = f * wp.dot(along, along)
                even += weight
                first_moment += weight * y
                second_moment += weight * (y * y)
                straight += f * (y * y)
                skew += f * (y * y * y)
                moment += wp.outer(d, f * d)
                rise += wp.outer(velocity[j] - vi + gradient * d, (f * y) * along)
            elif phases[int(phase[j])].viscosity < phases[int(own)].viscosity:
                beside_thinner = True
        if wp.static(spec.lanes > 1):
            beside_thinner = added(wp.where(beside_thinner, real(1.0), real(0.0))) > real(0.0)
            even, first_moment, second_moment = added(even), added(first_moment), added(second_moment)
            straight, skew, moment, rise = added(straight), added(skew), added_mat(moment), added_mat(rise)
            if lane > 0:
                return
        if not beside_thinner:
            return
        surface = mat() + gradient
        # a direction, and neighbours enough that the gradient has not faded
        if wp.length(n) > real(0.0) and wp.determinant(moment * params.g_norm) >= real(full) and even > real(0.0):
            depth = first_moment / even
            spread = second_moment - first_moment * depth
            if spread > real(0.0):
                turn = rise * (real(axes_along) / spread)
                below = interface_depth[i] * params.h
                across = (below + real(0.5) * skew / straight) * wp.trace(turn)
                surface = gradient - (below + depth) * turn + across * wp.outer(n, n)
        gradient_at_interface[i] = surface

    return shared(interface_gradient, spec)
