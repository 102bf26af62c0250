"""Force of the fluid on the surface of bodies and sides, when a gauge asks for it (theory: riemann#bodies).

    F = sum over the first layer of A (-p_s n + mu t),   t the part of (S + S^T) n along the surface

p_s is the value of a quadratic through the pressure at the foot, S the slope of one through the velocity of the wall there:
straight lines (`wall_fit`) have the value and the slope of some way off the wall. Where the fluid is too thin for it, they
are those of the line; so is p_s before a free surface and between fluids, whose pressures have a kink there. No p_s is
farther from that of the line than a pressure before the foot. Beside a rigid surface that it sticks to a fluid without
divergence has no stress along the normal but its pressure. The two terms are kept apart: what is left of the force without
the friction is that of the pressure.
"""

import functools
from typing import Any

import warp as wp

from .pair import list_access, separation_of
from .params import make_params, make_phase
from .quadratic import make_quadratic
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types, types_of


@functools.cache
def make_surface_load(spec: Spec) -> Any:
    """Return the kernel over wall particles that writes force and friction on each [N, per metre of depth in 2-D]."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    fit = make_quadratic(spec.dimension)
    vec64 = types(spec.dimension, "float64").vec
    square, sides, vector, basis = fit.square, fit.sides, fit.vector, fit.basis
    solve, value_of = fit.solve, fit.value
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    bends = not spec.free_surface and not spec.multiphase
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def surface_load(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_area: wp.array(dtype=real),
        slip: wp.array(dtype=wp.uint8),
        surface_pressure: wp.array(dtype=real),
        surface_velocity: wp.array(dtype=vec),
        surface_shear: wp.array(dtype=mat),
        load: wp.array(dtype=vec),
        friction: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        normal = wall_normal[w]
        rubbed = vec()
        pressure = surface_pressure[w]
        area = wp.max(wall_area[w], real(0.0))  # negative beyond inlets and outlets, where a surface bears no load
        if area > real(0.0):
            i = w + fluid_count
            foot = position[i] + normal * wall_depth[w]
            own_velocity = surface_velocity[w]
            weight = real(0.0)
            viscosity = real(0.0)  # of the fluids before the foot, by their weights
            pressed = wp.float64(0.0)
            widest = real(0.0)  # difference of a pressure before the foot from that of the line
            normal_matrix = square()
            first_moment = vector()
            right = sides()
            right_pressure = vector()
            k = list_begin(i, list_width)
            step = list_step(particle_count)
            end = k + int(fluid_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                r = separation(position[j], foot, True, params) * params.inv_h
                state_j = state[j]
                w_j = shape(wp.length(r)) * state_j[1]
                own = int(0)
                if wp.static(spec.multiphase):
                    own = int(phase[j])
                weight += w_j
                viscosity += w_j * phases[own].viscosity
                terms = wp.float64(w_j) * basis(vec64(r))
                excess = wp.float64(state_j[0] - pressure)
                normal_matrix += wp.outer(basis(vec64(r)), terms)
                first_moment += terms
                right += wp.outer(terms, vec64(velocity[j] - own_velocity))
                right_pressure += excess * terms
                pressed += wp.float64(w_j) * excess
                widest = wp.max(widest, wp.abs(state_j[0] - pressure))
            if weight > real(0.0):
                bent, value = value_of(normal_matrix, first_moment, wp.float64(weight), right_pressure, pressed)
                if wp.static(bends) and bent:
                    pressure += real(wp.clamp(value, -wp.float64(widest), wp.float64(widest)))
                if wp.static(spec.free_surface):
                    pressure = wp.max(pressure, real(0.0))  # of a foot that is dry too
            if wp.static(spec.wall_no_slip):
                if slip[w] == wp.uint8(0):
                    shear = surface_shear[w]
                    found, slopes = solve(normal_matrix, right)
                    if found:
                        for a in range(wp.static(spec.dimension)):
                            for b in range(wp.static(spec.dimension)):
                                shear[a, b] = real(slopes[b, a]) * params.inv_h
                    viscosity = viscosity / wp.max(weight, real(1.0e-30))
                    rubbed = (viscosity * area) * ((shear + wp.transpose(shear)) * normal)
                    rubbed -= normal * wp.dot(rubbed, normal)
        load[w] = rubbed - (pressure * area) * normal
        friction[w] = rubbed

    return surface_load
