"""What changes the density of each particle in a step, part by part, as elastic energy (theory: delta#budget).

The sums are those of the continuity sweep, kept apart; a change ds of the density excess is the work p V ds/(1+s) with the
pressure and the volume in the middle of the change. What the shift carries changes the kinetic energy too.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import EXCESS_PRESSURE, STEP
from warpsph.kernels.core.dry_walls import make_seen
from warpsph.kernels.core.eos import make_eos
from warpsph.kernels.core.pair import WRAPPED, list_access, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.wall_share import LEAST_SHARE, make_cell_rate, make_slides

from .delta_continuity import SMALLEST_MOMENT, continues_flow
from .delta_momentum import make_driving_force


@functools.cache
def make_budget_density(spec: Spec) -> Any:
    """Return the sweep that writes the energy [J] that each particle gains in this step by each part of its density's rate.

    It runs behind the continuity sweep, on the same positions, before the density and the velocity are advanced.
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation, seen = separation_of(spec), make_seen(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    eos = make_eos(spec.precision)
    driving_force = make_driving_force(spec)
    carries, continued = spec.shift_form == "consistent", continues_flow(spec)
    slides_at, with_cells = make_slides(spec.own_sides), make_cell_rate(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def budget_density(
        first: int,
        particle_count: int,
        fluid_count: int,
        list_width: int,
        density_diffusion: real,
        params: Params,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        midway: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_sides: wp.array(dtype=wp.uint8),
        wall_normal: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        boundary_volume: wp.array(dtype=real),
        pressure_gradient: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        density_excess: wp.array(dtype=real),
        density_rate: wp.array(dtype=real),
        room_part: wp.array(dtype=real),
        carried: wp.array(dtype=vec),
        budget_flow: wp.array(dtype=real),
        budget_wall_flow: wp.array(dtype=real),
        budget_exact: wp.array(dtype=real),
        budget_diffusion: wp.array(dtype=real),
        budget_shift: wp.array(dtype=real),
        budget_volume: wp.array(dtype=real),
        budget_room: wp.array(dtype=real),
        budget_spray: wp.array(dtype=real),
        budget_lift: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        xi = midway[i]
        vi = velocity[i]
        p_i = state[i][0]
        s_i = density_excess[i]
        own = phases[0]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        rate = real(0.0)
        at_walls = real(0.0)
        evening = real(0.0)
        moved = real(0.0)
        flow = mat()
        moment = mat()
        correctable, share = bool(True), real(1.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, midway[j], wrapped, params)
            state_j = state[j]
            f = slope(wp.length(d) * params.inv_h) * state_j[1]
            dv = vi - velocity[j]
            rate += f * wp.dot(dv, d)
            if wp.static(spec.exact_divergence):
                flow -= wp.outer(dv, f * d)
                moment -= wp.outer(d, f * d)
            if wp.static(spec.density_diffusion):
                dp = state_j[0] - p_i
                evening += f * (dp + real(0.5) * wp.dot(pressure_gradient[i] + pressure_gradient[j], d))
            if wp.static(carries):
                moved += f * wp.dot(shift[i] + shift[j], d) * (density_excess[j] - s_i)
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, position[j], wrapped, params)
                f = slope(wp.length(d) * params.inv_h)
                if wp.static(spec.bodies):
                    w = j - fluid_count
                    volume = seen(d, state[j][1], boundary_volume[w], wall_normal[w], wall_depth[w], params.spacing)
                    fd = (f * volume) * d
                    dv = vi - velocity[j]
                    slides = bool(True)
                    if wp.static(continued):
                        slides = slides_at(w, slip, wall_sides)
                        if not slides:
                            dv = vi - mirror_velocity[w]
                    correctable = correctable and (not slides or f == real(0.0))
                    if slides:
                        share += wall_depth[w] * wp.dot(wall_normal[w], fd) * params.g_norm
                    at_walls += wp.dot(dv, fd)
                    if wp.static(spec.exact_divergence):
                        flow -= wp.outer(dv, fd)
                        moment -= wp.outer(d, fd)
                else:
                    correctable = False
        if wp.static(spec.bodies):
            at_walls += (rate + at_walls) * (real(1.0) / wp.max(share, real(LEAST_SHARE)) - real(1.0))
        elif wp.static(spec.walls):
            k = end - int(wall_neighbours[i]) * step
            at_walls = with_cells(rate, i, k, end, step, wrapped, xi, vi, params, neighbours, position, velocity) - rate
        correction = real(0.0)
        if wp.static(spec.exact_divergence):
            m = moment * params.g_norm
            if correctable and wp.determinant(m) > real(SMALLEST_MOMENT):
                correction = wp.trace(flow) - wp.trace(flow * wp.inverse(m))
        dt = real(clock[STEP])
        stretch = (real(1.0) + s_i) * params.g_norm
        even = real(-2.0) * density_diffusion * params.h * own.sound_speed * own.compressibility * params.g_norm * evening
        drawn = real(0.5) * params.g_norm * moved / dt
        total = density_rate[i]
        # pressure times volume over 1 + s in the middle of the change
        half = s_i + real(0.5) * dt * total
        pressed = eos(half, own.stiffness, own.gamma) + own.background
        work = dt * pressed * rest_volume[i] / ((real(1.0) + half) * (real(1.0) + half))
        mass = own.density * rest_volume[i]
        budget_flow[i] = work * stretch * rate
        budget_wall_flow[i] = work * stretch * at_walls
        budget_exact[i] = work * stretch * correction
        budget_diffusion[i] = work * even
        part = real(0.0)
        if wp.static(spec.room):
            part = room_part[i]
        budget_room[i] = work * part
        budget_spray[i] = work * (total - stretch * (rate + at_walls + correction) - even - drawn - part)
        kinetic = real(0.0)
        if wp.static(carries):
            kinetic = mass * wp.dot(carried[i], vi + real(0.5) * carried[i])
        budget_shift[i] = work * drawn + kinetic
        lift = real(0.0)
        if wp.static(spec.shifting and (spec.gravity or spec.body_force or spec.central_force)):
            lift = -mass * wp.dot(driving_force(xi, params, forcing), shift[i])
        budget_lift[i] = lift
        held = real(0.0)
        if wp.static(spec.volume_constraint):
            # the drift has done this already; its pressure is that of the middle of that change
            share = real(clock[EXCESS_PRESSURE]) * own.compressibility
            before = (s_i - share) / (real(1.0) + share)
            mean = real(0.5) * (s_i + before)
            squeezed = eos(mean, own.stiffness, own.gamma) + own.background
            held = (s_i - before) * squeezed * rest_volume[i] / ((real(1.0) + mean) * (real(1.0) + mean))
        budget_volume[i] = held

    return budget_density
