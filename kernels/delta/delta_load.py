"""Force of the fluid on each wall particle, when a gauge asks for it (theory: delta#d6).

That of its pairs in the momentum sweep, with the opposite sign; friction is kept apart too.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.fields import FLUID
from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.viscosity import make_viscosity


@functools.cache
def make_delta_load(spec: Spec) -> Any:
    """Return the kernel over wall particles that writes force and friction on each [N, per metre of depth in 2-D]."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    viscous = spec.viscosity != "none"
    viscous_term = make_viscosity(spec.viscosity if viscous else "radial", spec.dimension, spec.precision)

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
        pressure_sign: wp.array(dtype=wp.int8),
        slip: wp.array(dtype=wp.uint8),
        load: wp.array(dtype=vec),
        friction: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
    ):
        w = wp.tid() + first
        i = w + fluid_count
        xi = position[i]
        p_w = state[i][0]
        pressed = vec()
        rubbed = vec()
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
            f = slope(wp.sqrt(r2) * params.inv_h) * state[j][1] * state[i][1] * params.g_norm
            if wp.static(spec.tension_control):
                p_j = p_j * real(pressure_sign[j])
            pressed += ((p_w + p_j) * f) * d
            if wp.static(viscous and (spec.bodies or spec.wall_no_slip)):
                rubs = bool(True)
                if wp.static(not spec.bodies):
                    rubs = slip[w] == wp.uint8(0)
                if rubs:
                    slide = velocity[j] - mirror_velocity[w]
                    rubbed -= (phases[0].viscosity * f) * viscous_term(slide, d, r2 + params.tiny, params.inv_h)
        load[w] = pressed + rubbed
        if wp.static(spec.bodies):
            friction[w] = rubbed

    return delta_load
