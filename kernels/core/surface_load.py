"""Force of the fluid on the surface of bodies and sides, when a gauge asks for it (theory: riemann#a5).

    F = sum over the first layer of A (-p_s n + mu (S + S^T) n),  p_s, S of the fit at the foot (`wall_fit`)

The two terms are kept apart: what is left of the force without the friction is that of the pressure.
"""

import functools
from typing import Any

import warp as wp

from .pair import list_access, separation_of
from .params import make_params, make_phase
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types, types_of


@functools.cache
def make_surface_load(spec: Spec) -> Any:
    """Return the kernel over wall particles that writes force and friction on each [N, per metre of depth in 2-D]."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
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
        state: wp.array(dtype=pair),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_area: wp.array(dtype=real),
        slip: wp.array(dtype=wp.uint8),
        surface_pressure: wp.array(dtype=real),
        surface_shear: wp.array(dtype=mat),
        load: wp.array(dtype=vec),
        friction: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        normal = wall_normal[w]
        rubbed = vec()
        if wp.static(spec.wall_no_slip):
            if wall_area[w] > real(0.0) and slip[w] == wp.uint8(0):
                viscosity = phases[0].viscosity
                if wp.static(spec.multiphase):
                    # of the fluids before the foot, by their weights in the fit
                    i = w + fluid_count
                    foot = position[i] + normal * wall_depth[w]
                    weight = real(0.0)
                    viscosity = real(0.0)
                    k = list_begin(i, list_width)
                    step = list_step(particle_count)
                    end = k + int(fluid_neighbours[i]) * step
                    while k < end:
                        j = neighbour(neighbours, i, k)
                        k += step
                        r = wp.length(separation(foot, position[j], True, params))
                        w_j = shape(r * params.inv_h) * state[j][1]
                        weight += w_j
                        viscosity += w_j * phases[int(phase[j])].viscosity
                    viscosity = viscosity / wp.max(weight, real(1.0e-30))
                stretch = surface_shear[w] + wp.transpose(surface_shear[w])
                rubbed = (viscosity * wall_area[w]) * (stretch * normal)
        load[w] = rubbed - (surface_pressure[w] * wall_area[w]) * normal
        friction[w] = rubbed

    return surface_load


@functools.cache
def make_load_torque(dimension: int, precision: str) -> Any:
    """Return the kernel over wall particles that writes the torque of the force on each about the pivot of its body [N m].

    In 2-D, per metre of depth, it is the first component, the other is 0.
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.kernel(module="unique", enable_backward=False)
    def load_torque(
        first: int,
        fluid_count: int,
        position: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_body: wp.array(dtype=int),
        pivots: wp.array(dtype=vec),
        load: wp.array(dtype=vec),
        torque: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        arm = position[w + fluid_count] + wall_normal[w] * wall_depth[w] - pivots[wall_body[w] - 1]
        force = load[w]
        turned = vec()
        if wp.static(dimension == 3):
            turned = wp.cross(arm, force)
        else:
            turned[0] = arm[0] * force[1] - arm[1] * force[0]
        torque[w] = turned

    return load_torque
