"""Force of the fluid on each wall particle in the printed form: pair forces of its momentum sweep (theory: printed#yang)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NOW, make_forcing

from .printed_pair import make_printed_states, make_printed_wall
from .printed_sweeps import make_slip_normal


@functools.cache
def make_printed_load(spec: Spec) -> Any:
    """Return the kernel over wall particles that writes the force on each of them [N, per metre of depth in 2-D]."""
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    _, printed_pressure = make_printed_states(spec.dimension, spec.precision)
    wall_excess, reflected_velocity = make_printed_wall(spec.dimension, spec.precision)
    slip_normal = make_slip_normal(spec)
    gravity_of, _ = make_forcing(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def printed_load(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        rest_volume: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        load: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        i = w + fluid_count
        slips = bool(True)
        if wp.static(spec.wall_no_slip):
            slips = slip[w] != wp.uint8(0)
        force = vec()
        step = list_step(particle_count)
        k = list_begin(i, list_width)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(position[j], position[i], True, params)  # from the wall particle to the fluid particle
            r = wp.sqrt(wp.dot(d, d) + params.tiny)
            own = phases[0]
            if wp.static(spec.multiphase):
                own = phases[int(phase[j])]
            p_wall = state[j][0]
            if wp.static(spec.gravity):
                rho = own.density * rest_volume[j] / state[j][1]
                p_wall -= rho * wp.dot(gravity_of(params, forcing, GRAVITY_NOW), d)
            towards = vec()
            if slips:
                begin = list_begin(j, list_width) + int(fluid_neighbours[j]) * step
                last = begin + int(wall_neighbours[j]) * step
                towards = slip_normal(
                    j, begin, last, step, fluid_count, position[j], True, params, neighbours, position, slip
                )
            closing = -wp.dot(velocity[j] - reflected_velocity(velocity[j], velocity[i], towards, slips), d) / r
            p_star = printed_pressure(state[j][0], p_wall, own.viscosity, own.viscosity, closing, params.inv_h)
            volume = params.wall_volume / (real(1.0) + wall_excess(p_wall - own.background, own.stiffness, own.gamma))
            force += (real(2.0) * p_star * slope(r * params.inv_h) * state[j][1] * volume * params.g_norm) * d
        load[w] = force

    return printed_load
