"""What makes up the acceleration of each particle, part by part, for the budget gauge (theory: delta#budget).

The sums are those of the momentum sweep, kept apart. What the parts leave of the acceleration is the contact of walls.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.dry_walls import make_seen
from warpsph.kernels.core.friction_slide import make_friction_slide
from warpsph.kernels.core.pair import WRAPPED, list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.time_signals import make_forcing
from warpsph.kernels.core.viscosity import make_friction_slope, make_viscosity

from .delta_momentum import make_driving_force


@functools.cache
def make_budget_forces(spec: Spec) -> Any:
    """Return the sweep that writes the parts of the acceleration [m/s^2] that the last momentum sweep found."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation, seen = separation_of(spec), make_seen(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    driving_force = make_driving_force(spec)
    _, body_force_of = make_forcing(spec)
    viscous = spec.viscosity != "none"
    viscous_term = make_viscosity(spec.viscosity if viscous else "radial", spec.dimension, spec.precision)
    friction_slide = make_friction_slide(spec)
    artificial_term = make_viscosity("radial", spec.dimension, spec.precision)
    friction_slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def budget_forces(
        first: int,
        particle_count: int,
        fluid_count: int,
        list_width: int,
        artificial_viscosity: real,
        params: Params,
        phases: wp.array(dtype=Phase),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        slip_slope: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        pressure_sign: wp.array(dtype=wp.int8),
        acceleration: wp.array(dtype=vec),
        budget_pressure: wp.array(dtype=vec),
        budget_tension: wp.array(dtype=vec),
        budget_viscous: wp.array(dtype=vec),
        budget_artificial: wp.array(dtype=vec),
        budget_wall: wp.array(dtype=vec),
        budget_friction: wp.array(dtype=vec),
        budget_contact: wp.array(dtype=vec),
        budget_gravity: wp.array(dtype=vec),
        budget_body: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        xi = position[i]
        vi = velocity[i]
        p_i = state[i][0]
        own = phases[0]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        pressures = vec()  # sum p_j F V x_ij over the fluid
        even = vec()  # sum F V x_ij over the fluid
        at_walls = vec()  # both over walls
        into_wall = vec()
        viscosity = vec()
        artificial = vec()
        friction = vec()
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], wrapped, params)
            r2 = wp.dot(d, d)
            state_j = state[j]
            q = wp.sqrt(r2) * params.inv_h
            f, rub = slope(q) * state_j[1], own.viscosity * (friction_slope(q) * state_j[1])
            pressures += (state_j[0] * f) * d
            even += f * d
            dv = vi - velocity[j]
            if wp.static(viscous):
                viscosity += rub * viscous_term(dv, d, r2 + params.tiny, params.inv_h)
            if wp.static(spec.artificial_viscosity):
                artificial += (artificial_viscosity * f) * artificial_term(dv, d, r2 + params.tiny, params.inv_h)
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, position[j], wrapped, params)
                r2 = wp.dot(d, d)
                state_j = state[j]
                if wp.static(spec.dry_walls):
                    w = j - fluid_count
                    state_j[1] = seen(d, state_j[1], boundary_volume[w], wall_normal[w], wall_depth[w], params.spacing)
                q = wp.sqrt(r2) * params.inv_h
                f, rub = slope(q) * state_j[1], own.viscosity * (friction_slope(q) * state_j[1])
                at_walls += (state_j[0] * f) * d
                into_wall += f * d
                if wp.static(viscous and (spec.bodies or spec.wall_no_slip)):
                    rubs = bool(True)
                    if wp.static(not spec.bodies):
                        rubs = slip[j - fluid_count] == wp.uint8(0)
                    if rubs:
                        mirror = mirror_velocity[j - fluid_count]
                        slide = friction_slide(j - fluid_count, vi, mirror, d, slip, wall_normal, slip_slope)
                        friction += rub * viscous_term(slide, d, r2 + params.tiny, params.inv_h)
        sign = real(1.0)
        if wp.static(spec.tension_control != ""):
            sign = real(pressure_sign[i])
        scale = params.g_norm * state[i][1] / (own.density * rest_volume[i])
        driving = driving_force(xi, params, forcing)
        body = vec()
        if wp.static(spec.body_force):
            body = body_force_of(params, forcing)
        budget_pressure[i] = -scale * (pressures + p_i * even)
        budget_tension[i] = (scale * (real(1.0) - sign) * p_i) * even
        budget_viscous[i] = scale * viscosity
        budget_artificial[i] = scale * artificial
        budget_wall[i] = -scale * (at_walls + (sign * p_i) * into_wall)
        budget_friction[i] = scale * friction
        budget_gravity[i] = driving - body
        budget_body[i] = body
        rest = vec()
        if wp.static(spec.walls):
            pairs = viscosity + artificial + friction - pressures - at_walls - (sign * p_i) * (even + into_wall)
            rest = acceleration[i] - scale * pairs - driving
        budget_contact[i] = rest

    return budget_forces
