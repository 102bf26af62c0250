"""Force of the fluid on the surface of bodies and sides, when a gauge asks for it (theory: riemann#bodies).

    F = sum over the facets of the first layer of -(p_s a + M grad p) + A mu t,   t the part of dv/dn along the surface

A facet is what a particle stands for of one face (`warpsph/scene/facets.py`): a particle in a corner has two or three, with
a normal each. a is its vector area and M its first moment about its foot, so that a uniform pressure has no force on a
closed body and a linear one the exact force, whatever the faces. A is its area.

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
from .poses import make_pose, make_velocity_at
from .quadratic import make_quadratic
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types, types_of
from .torques import make_couple


@functools.cache
def make_surface_load(spec: Spec) -> Any:
    """Return the kernel over wall particles that writes force and friction on each [N, per metre of depth in 2-D].

    Of several facets it writes the sums; `couple` is what these have beyond the torque of the sum at the foot of the
    particle [N m]. Pressure [Pa] and friction [Pa] of each facet are written too.

    facet_first: (walls + 1,), first facet of each wall particle by its number, and their count.
    facet_arm, facet_normal, facet_vector, facet_moment: at time 0; the arm is that from the particle to the foot.
    body_turn: (bodies,), how each wall body is turned since.
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Pose = make_pose()
    velocity_at = make_velocity_at(spec)
    couple_of = make_couple(spec.dimension, spec.precision)
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
        first_wall_id: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        particle_id: wp.array(dtype=int),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        body_motion: wp.array(dtype=int),
        poses: wp.array(dtype=Pose),
        wall_body: wp.array(dtype=int),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        surface_pressure: wp.array(dtype=real),
        surface_gradient: wp.array(dtype=vec),
        surface_velocity: wp.array(dtype=vec),
        surface_shear: wp.array(dtype=mat),
        facet_first: wp.array(dtype=int),
        facet_arm: wp.array(dtype=vec),
        facet_normal: wp.array(dtype=vec),
        facet_area: wp.array(dtype=real),
        facet_vector: wp.array(dtype=vec),
        facet_moment: wp.array(dtype=mat),
        body_turn: wp.array(dtype=mat),
        facet_pressure: wp.array(dtype=real),
        facet_friction: wp.array(dtype=vec),
        load: wp.array(dtype=vec),
        friction: wp.array(dtype=vec),
        couple: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        i = w + fluid_count
        number = particle_id[i] - first_wall_id
        own_arm = wall_normal[w] * wall_depth[w]
        pushed = vec()
        rubbed = vec()
        turned = vec()
        for f in range(facet_first[number], facet_first[number + 1]):
            arm = facet_arm[f]
            normal = facet_normal[f]
            area = facet_vector[f]
            moment = facet_moment[f]
            if wp.static(spec.moving):
                turn = body_turn[wall_body[w] - 1]
                arm = turn * arm
                normal = turn * normal
                area = turn * area
                moment = turn * moment * wp.transpose(turn)
            foot = position[i] + arm
            gradient = surface_gradient[w]
            pressure = surface_pressure[w] + wp.dot(gradient, arm - own_arm)
            own_velocity = surface_velocity[w]
            if wp.static(spec.moving):
                own_velocity = velocity_at(own_velocity, arm - own_arm, wall_body[w], body_motion, poses)
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
            stress = vec()
            if weight > real(0.0):
                bent, value = value_of(normal_matrix, first_moment, wp.float64(weight), right_pressure, pressed)
                if wp.static(bends) and bent:
                    pressure += real(wp.clamp(value, -wp.float64(widest), wp.float64(widest)))
                if wp.static(spec.wall_no_slip):
                    if slip[w] == wp.uint8(0):
                        shear = surface_shear[w]
                        found, slopes = solve(normal_matrix, right)
                        if found:
                            for a in range(wp.static(spec.dimension)):
                                for b in range(wp.static(spec.dimension)):
                                    shear[a, b] = real(slopes[b, a]) * params.inv_h
                        viscosity = viscosity / wp.max(weight, real(1.0e-30))
                        across = shear * normal
                        if wp.static(spec.moving):  # what turns with the wall is not sheared
                            across -= velocity_at(vec(), normal, wall_body[w], body_motion, poses)
                        stress = viscosity * (across - normal * wp.dot(across, normal))
            else:
                gradient = vec()
            if wp.static(spec.free_surface):
                if pressure <= real(0.0):  # of a foot that is dry too
                    pressure = real(0.0)
                    gradient = vec()
            push = -(pressure * area + moment * gradient)
            drag = facet_area[f] * stress
            pushed += push
            rubbed += drag
            turned += couple_of(arm - own_arm, push + drag)
            if wp.static(spec.dimension == 3):
                for a in range(3):
                    b = (a + 1) % 3
                    c = (a + 2) % 3
                    turned[a] = turned[a] - pressure * (moment[c, b] - moment[b, c])
            else:
                turned[0] = turned[0] - pressure * (moment[1, 0] - moment[0, 1])
            facet_pressure[f] = pressure
            facet_friction[f] = stress
        load[w] = pushed + rubbed
        friction[w] = rubbed
        couple[w] = turned

    return surface_load
