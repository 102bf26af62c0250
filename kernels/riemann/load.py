"""Force of the fluid on each wall particle, when a gauge asks for it.

The pair force of the conservative gradient, F = V_f V_w (p_f + p_w) grad_f W, and friction, both with the opposite
sign of what the fluid particle feels: before planes without 2 p_f along them (theory: riemann#smooth). With bodies friction
is kept apart too, walls that turn have a twist beside pairs of the Morris form, and pairs act halfway between their
particles, as in `kernels/delta/delta_load.py`; with the corrected gradient, which has no pair forces, their load is the
integral over the surface (`kernels/core/surface_load.py`).
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.planes import make_along_plane
from warpsph.kernels.core.poses import make_pose, make_velocity_at
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NOW, make_forcing
from warpsph.kernels.core.torques import make_couple
from warpsph.kernels.core.viscosity import make_friction_slope, make_viscosity


@functools.cache
def make_load(spec: Spec) -> Any:
    """Return the kernel over wall particles that writes the force on each of them [N, per metre of depth in 2-D]."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    Pose = make_pose()
    velocity_at = make_velocity_at(spec)
    couple_of = make_couple(spec.dimension, spec.precision)
    separation = separation_of(spec)
    along_plane = make_along_plane(spec.dimension, spec.precision, not spec.bodies)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    gravity_of, _ = make_forcing(spec)
    form = spec.viscosity if spec.viscosity != "none" else "morris"
    turns = spec.moving and spec.wall_no_slip and form == "morris"
    viscous_term = make_viscosity(form, spec.dimension, spec.precision)
    friction_slope = make_friction_slope(form, spec.kernel, spec.dimension, spec.precision)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def wall_load(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        mirror_velocity: wp.array(dtype=vec),
        body_motion: wp.array(dtype=int),
        poses: wp.array(dtype=Pose),
        wall_body: wp.array(dtype=int),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_impact: wp.array(dtype=real),
        wall_plane: wp.array(dtype=vec),
        load: wp.array(dtype=vec),
        friction: wp.array(dtype=vec),
        twist: wp.array(dtype=vec),
        couple: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        i = w + fluid_count
        xi = position[i]
        p_w = state[i][0]
        force = vec()
        rubbed = vec()
        twisted = vec()
        turned = vec()
        own_arm = vec()
        if wp.static(spec.bodies):
            own_arm = wall_normal[w] * wall_depth[w]
        wall_volume = params.wall_volume
        if wp.static(spec.bodies):
            wall_volume = state[i][1]
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(position[j], xi, True, params)  # from the wall particle to the fluid particle
            r2 = wp.dot(d, d)
            state_j = state[j]
            own = int(0)
            if wp.static(spec.multiphase):
                own = int(phase[j])
            if wp.static(spec.multiphase and not spec.bodies):
                # as in the momentum sweep: each fluid meets the wall with its own one-sided state
                p_w = state_j[0]
                if wp.static(spec.gravity):
                    g = gravity_of(params, forcing, GRAVITY_NOW)
                    p_w -= phases[own].density * rest_volume[j] / state_j[1] * wp.dot(g, d)
            q = wp.sqrt(r2) * params.inv_h
            f = slope(q) * state_j[1] * wall_volume * params.g_norm
            rub = phases[own].viscosity * (friction_slope(q) * state_j[1] * wall_volume * params.g_norm)
            push = ((state_j[0] + p_w + wall_impact[j]) * f) * d
            if wp.static(not spec.corrected):
                if state_j[0] + p_w > real(0.0):
                    push -= along_plane(wall_plane[j], (real(2.0) * state_j[0] * f) * d)
            spun = vec()
            if wp.static(spec.wall_no_slip):
                if slip[w] == wp.uint8(0):
                    drag = rub * viscous_term(velocity[j] - mirror_velocity[w], d, r2 + params.tiny, params.inv_h)
                    push -= drag
                    if wp.static(spec.bodies):
                        rubbed -= drag
                    if wp.static(turns):
                        spin = velocity_at(vec(), d, wall_body[w], body_motion, poses)
                        spun = rub * viscous_term(spin, d, r2 + params.tiny, params.inv_h)
                        twisted += spun
            force += push
            if wp.static(spec.bodies):
                turned += couple_of(real(0.5) * d - own_arm, push + spun)
        load[w] = force
        if wp.static(spec.bodies):
            friction[w] = rubbed
            couple[w] = turned
        if wp.static(turns):
            twist[w] = twisted

    return wall_load
