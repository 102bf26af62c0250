"""Force of the fluid on each wall particle, when a gauge asks for it (theory: delta#d6).

That of its pairs in the momentum sweep, with the opposite sign; friction is kept apart too. Pairs of the Morris form have
the stress mu grad v n; what mu (grad v)^T n adds has no net force on a closed body, but a torque on one that turns. Beside
a wall that turns it is -mu omega x n, for pairs -omega x x_fw beside v_fw: none are left where both turn as one. It is the
`twist`, which counts in torques alone: the force stays what the fluid loses. Pairs act halfway between their particles: with
these arms twists have the torque -2 mu omega V on any body of the volume V, and any shape of its surface (theory: delta#d6).
Along a wall without friction it is the same of the slope (S n)_t of `friction_slide`, with omega = n x (S n)_t.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.dry_walls import make_seen
from warpsph.kernels.core.fields import FLUID, slipping
from warpsph.kernels.core.friction_slide import make_curving, make_friction_slide
from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.poses import make_pose, make_velocity_at
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.torques import make_couple
from warpsph.kernels.core.viscosity import make_friction_slope, make_viscosity


@functools.cache
def make_delta_load(spec: Spec) -> Any:
    """Return the kernel over wall particles that writes force and friction on each [N, per metre of depth in 2-D]."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    Pose = make_pose()
    velocity_at = make_velocity_at(spec)
    couple_of = make_couple(spec.dimension, spec.precision)
    separation, seen = separation_of(spec), make_seen(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    viscous = spec.viscosity != "none"
    turns = spec.moving and spec.wall_no_slip and spec.viscosity == "morris"
    slides = slipping(spec) and spec.viscosity == "morris"
    viscous_term = make_viscosity(spec.viscosity if viscous else "radial", spec.dimension, spec.precision)
    friction_slide, curving = make_friction_slide(spec), make_curving(spec)
    friction_slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def delta_load(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        mirror_velocity: wp.array(dtype=vec),
        slip_slope: wp.array(dtype=vec),
        body_motion: wp.array(dtype=int),
        poses: wp.array(dtype=Pose),
        wall_body: wp.array(dtype=int),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        pressure_sign: wp.array(dtype=wp.int8),
        slip: wp.array(dtype=wp.uint8),
        load: wp.array(dtype=vec),
        friction: wp.array(dtype=vec),
        twist: wp.array(dtype=vec),
        couple: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
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
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            if wp.static(spec.open_axis >= 0):
                if int(zone[j]) != FLUID:
                    continue  # nothing pushes a buffer
            d = separation(position[j], xi, True, params)  # from the wall particle to the fluid particle
            r2 = wp.dot(d, d)
            p_j = state[j][0]
            q = wp.sqrt(r2) * params.inv_h
            volume = state[i][1]
            if wp.static(spec.dry_walls):
                volume = seen(d, volume, boundary_volume[w], wall_normal[w], wall_depth[w], params.spacing)
            f = slope(q) * state[j][1] * volume * params.g_norm
            rub = phases[0].viscosity * (friction_slope(q) * state[j][1] * volume * params.g_norm)
            if wp.static(spec.tension_control != ""):
                p_j = p_j * real(pressure_sign[j])
            push = ((p_w + p_j) * f) * d
            spun = vec()
            if wp.static(viscous and (spec.bodies or spec.wall_no_slip)):
                rubs = bool(True)
                if wp.static(not spec.bodies):
                    rubs = slip[w] == wp.uint8(0)
                if rubs:
                    slide = friction_slide(w, velocity[j], mirror_velocity[w], d, slip, wall_normal, slip_slope)
                    drag = rub * viscous_term(slide, d, r2 + params.tiny, params.inv_h)
                    push -= drag
                    rubbed -= drag
                    if wp.static(turns):
                        if slip[w] == wp.uint8(0):
                            spin = velocity_at(vec(), d, wall_body[w], body_motion, poses)
                            spun = rub * viscous_term(spin, d, r2 + params.tiny, params.inv_h)
                    if wp.static(slides):
                        along = curving(w, slip, slip_slope)
                        spin = wp.dot(wall_normal[w], d) * along - wp.dot(along, d) * wall_normal[w]
                        spun += rub * viscous_term(spin, d, r2 + params.tiny, params.inv_h)
                    twisted += spun
            force += push
            if wp.static(spec.bodies):
                turned += couple_of(real(0.5) * d - own_arm, push + spun)
        load[w] = force
        if wp.static(spec.bodies):
            friction[w] = rubbed
            couple[w] = turned
        if wp.static(turns or slides):
            twist[w] = twisted

    return delta_load
