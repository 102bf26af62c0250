"""Continuity sweep of the delta-plus scheme, with density diffusion and what a shift carries (theory: delta#d1, delta#d4).

    ds_i/dt = (1+s_i) sum_j (v_i - v_j).grad_i W V_j + delta h c D_i,   s = rho/rho0 - 1
    D_i = (2 / rho0 c^2) sum_j [(p_j - p_i) - (G_i + G_j).(x_j - x_i)/2] (x_j - x_i).grad_i W V_j / r^2

D compares pressures and not densities: the same where pressure is proportional to s, and zero for a linear pressure with any
equation of state. G is the corrected pressure gradient of the last momentum sweep. Positions are those in the middle of
the step. Walls take part in the first sum alone: what their pressure misses would be a source of volume beside them. Walls
have their own velocity: the rate is that of a sum over places, which returns the work that it takes, and is divided by the
share that it has of a compression along the normal; in a full domain bodies that the fluid sticks to, but not its sides, go
on with the flow (theory: delta#d6).

In a domain that is full the divergence is exact for linear velocities, tr(sum_j (v_j - v_i) (x) grad_i W V_j M_i^-1), but
beside walls along which the velocity jumps: what a strained arrangement makes of a divergence has one sign, and would raise
the pressure of the whole domain. In any other, and between inlets and outlets, the density follows the room of the
particles, away from free surfaces, as fast as the fluid is strained (theory: delta#d8).
What the velocities make of the rate is kept for the pressure that damps sound (theory: riemann#damping).
Where no whole particle is in reach the fluid is thinner than the kernel: it has no pressure (theory: delta#thin).
"""

import functools
import math
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import STEP
from warpsph.kernels.core.dry_walls import ROW, WET, make_seen
from warpsph.kernels.core.eigenvalue import WHOLE
from warpsph.kernels.core.fields import FLUID
from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import WRAPPED, list_access, make_at, separation_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.wall_share import LEAST_SHARE, make_cell_rate, make_slides

from .fluid_pairs import make_rate_sums

SMALLEST_MOMENT = 0.1  # determinant below which a neighbourhood is too thin to correct
SPARSE = 0.4  # of the dimension, which -sum F V r^2 is inside a fluid: fewer neighbours than a particle on a surface has


def continues_flow(spec: Spec) -> bool:
    """In the continuity sweep bodies that the fluid sticks to have the velocity of the flow that is continued into them."""
    return spec.wall_no_slip and not spec.flat_walls and (spec.exact_divergence or not spec.free_surface)


@functools.cache
def make_delta_continuity(spec: Spec, flow_part: bool = True, slow_part: bool = True) -> Any:
    """Return the sweep that writes the rate of the density excess, and the change of velocity that belongs to the shift.

    flow_part: with the divergence of the velocity; without `slow_part`, what `slow_rate` holds is added.
    slow_part: with the diffusion, and with what the shift carries.
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    (_, rate_sums), at_vec = make_rate_sums(spec, flow_part, slow_part), make_at(vec)
    periodic = any(spec.periodic)
    carries = spec.shift_form == "consistent" and slow_part
    diffuses = spec.density_diffusion and slow_part
    exact, roomy = spec.exact_divergence and flow_part, spec.room and flow_part
    seen = make_seen(spec)
    continued, slides_at = continues_flow(spec), make_slides(spec.own_sides)
    particle_of, lane_of, part_of = lanes_of(spec)
    with_cells, sparse = make_cell_rate(spec), SPARSE * spec.dimension

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def delta_continuity(
        first: int,
        particle_count: int,
        fluid_count: int,
        list_width: int,
        density_diffusion: real,
        params: Params,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        midway: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        boundary_volume: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_sides: wp.array(dtype=wp.uint8),
        wall_normal: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        pressure_gradient: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        slow_rate: wp.array(dtype=real),
        wholeness: wp.array(dtype=real),
        density_excess: wp.array(dtype=real),
        density_rate: wp.array(dtype=real),
        room_part: wp.array(dtype=real),
        flow_rate: wp.array(dtype=real),
        carried: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        xi = midway[i]
        vi = velocity[i]
        p_i = state[i][0]
        s_i = density_excess[i]
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        rate = real(0.0)
        correctable = bool(True)
        full, thin = bool(True), bool(False)  # no particle of a free surface within the support, nor any other than those
        if wp.static(roomy and spec.free_surface):
            full = wholeness[i] >= real(WHOLE)
            thin = not full
        room = state[i][1]  # sum of (1 - r^2/R^2)^2 V, its own place included
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        pairs = rate_sums(
            i, k, end, step, wrapped, xi, vi, p_i, s_i, params, neighbours, midway, velocity, state, pressure_gradient,
            shift, wholeness, density_excess)  # fmt: skip
        if lane > 0:
            return
        k, step = end, stride
        flow, moment, carry = mat() + pairs.flow, mat() + pairs.moment, vec() + pairs.carry
        full, thin = full and pairs.ragged == real(0.0), thin and pairs.company == real(0.0)
        rate += pairs.rate
        room += pairs.room
        beside, touches = bool(False), bool(False)  # a wall is within the support, and so near that it is touched
        share = real(1.0)  # of a compression along the normal, what the sum has of it beside walls that do not take part
        if wp.static(spec.walls and flow_part):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, at_vec(position, j), wrapped, params)
                f = slope(wp.length(d) * params.inv_h)
                beside = beside or f < real(0.0)
                touches = touches or wp.dot(d, d) < real(wp.static((WET + ROW) ** 2)) * params.spacing * params.spacing
                if wp.static(roomy):
                    inside = wp.max(real(1.0) - wp.dot(d, d) * params.inv_window, real(0.0))
                    volume = params.wall_volume
                    if wp.static(spec.bodies):
                        volume = boundary_volume[j - fluid_count]
                    room += inside * inside * volume
                if wp.static(spec.bodies):
                    w = j - fluid_count
                    volume = seen(d, state[j][1], boundary_volume[w], wall_normal[w], wall_depth[w], params.spacing)
                    fd = (f * volume) * d
                    dv = vi - at_vec(velocity, j)
                    slides = bool(True)
                    if wp.static(continued):
                        slides = slides_at(w, slip, wall_sides)
                        if not slides:
                            dv = vi - mirror_velocity[w]
                    correctable = correctable and (not slides or f == real(0.0))
                    if slides:
                        share += wall_depth[w] * wp.dot(wall_normal[w], fd) * params.g_norm
                    rate += wp.dot(dv, fd)
                    if wp.static(exact):
                        flow -= wp.outer(dv, fd)
                        moment -= wp.outer(d, fd)
                else:
                    correctable = False  # the velocity of a wall is not that of a linear field
        elif wp.static(spec.walls and carries):
            end += int(wall_neighbours[i]) * step
            while k < end:
                d = separation(xi, position[neighbour(neighbours, i, k)], wrapped, params)
                beside = beside or slope(wp.length(d) * params.inv_h) < real(0.0)
                k += step
        if wp.static(spec.bodies and flow_part):
            rate /= wp.max(share, real(LEAST_SHARE))
        elif wp.static(spec.walls and flow_part):
            at_walls = end - int(wall_neighbours[i]) * step
            rate = with_cells(rate, i, at_walls, end, step, wrapped, xi, vi, params, neighbours, position, velocity)
        if wp.static(exact):
            m = moment * params.g_norm
            if correctable and wp.determinant(m) > real(SMALLEST_MOMENT):
                rate -= wp.trace(flow * wp.inverse(m)) - wp.trace(flow)
        total = (real(1.0) + s_i) * rate
        if wp.static(spec.acoustic_damping and flow_part):
            flow_rate[i] = total * params.g_norm
        if wp.static(diffuses):
            own = phases[0]
            total -= real(2.0) * density_diffusion * params.h * own.sound_speed * own.compressibility * pairs.evening
        total = total * params.g_norm
        if wp.static(carries):
            if beside:
                carry = vec()  # it would cost bodies their drag (theory: delta#d4)
            carried[i] = carry * (real(0.5) * params.g_norm)
            total += real(0.5) * params.g_norm * pairs.moved / real(clock[STEP])
        if wp.static(roomy):
            follow = real(0.0)
            if full:
                strain = flow
                if wp.static(spec.free_surface):
                    # a body of fluid that turns is not strained
                    strain = (flow + wp.transpose(flow)) * real(wp.static(math.sqrt(0.5)))
                pace = wp.sqrt(wp.ddot(strain, strain)) * params.g_norm
                follow = (real(1.0) + s_i) * params.room * pace * (room * params.window_norm - real(1.0))
            total += follow
            room_part[i] = follow
        if wp.static(flow_part and not slow_part):
            total += slow_rate[i]
        if wp.static(spec.free_surface and flow_part):
            # with hardly a fluid neighbour a density below rest is memory, not tension, and would draw spray into walls
            if pairs.crowd * params.g_norm < real(sparse):
                total = wp.max(total, -s_i / real(clock[STEP]))
            if wp.static(roomy):
                alone = pairs.crowd * params.g_norm < real(sparse) and not touches
                if thin and (alone or not beside):
                    # what spray was pressed to is memory too: it would stay apart as a gas does, and above walls
                    total = wp.min(total, -s_i / real(clock[STEP]))
        density_rate[i] = total

    return shared(delta_continuity, spec)
