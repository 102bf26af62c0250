"""Friction next to a free surface: the stress across it is balanced by the pressure there (theory: isph#surface-stress)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import STEP
from warpsph.kernels.core.fields import FLUID
from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access, natural
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types, types_of
from warpsph.kernels.core.viscosity import make_friction_slope, make_viscosity
from warpsph.kernels.core.weights import make_weights

# Answer of the stress to a pressure over that of the row's own slope: some of it comes again by the depth, through the
# gradient of the pressure. Without an answer what creeps gains energy; larger ones delay the pressure, by a period at Re 25
# with 192 spacings and 6 (docs/records/isph.md#strain).
ANSWER = 1.0


@functools.cache
def make_stress_pressure(dimension: int, precision: str) -> Any:
    """Return the `wp.func` that gives the pressure [Pa] which balances friction across a free surface.

    The stress there is 2 mu n.Gn; without divergence that is -2 mu times the strain along the surface, tr G - n.Gn, of which
    a row, whose neighbours lie to its sides, has more than of the strain across it.

    A pressure p of a row slows it down across the surface at p slope/rho, slope = |L sum grad W V|, and its gradient G
    answers with the same slope: in the time `reach` by ANSWER slope^2 reach p/rho. From one step to the next the pressure
    goes as much of the way as this answer leaves it stable, all of it with short steps; `before` is that of the last step,
    0 for a particle that is new near the surface.
    """
    real, vec, mat, _ = types(dimension, precision)
    Phase = make_phase(precision)

    @wp.func
    def stress_pressure(n: vec, gradient: mat, slope: vec, before: real, phase: Phase, reach: real):
        stress = real(2.0) * phase.viscosity * (wp.dot(n, gradient * n) - wp.trace(gradient))
        answer = real(2.0 * ANSWER) * phase.viscosity / phase.density * reach * wp.dot(slope, slope)
        if before != real(0.0):
            stress = before + (stress - before) / (real(1.0) + answer)
        return stress

    return stress_pressure


@functools.cache
def make_surface_friction(spec: Spec) -> Any:
    """Return the sweep that finds the pressure which balances friction across a free surface, and takes that out of u*.

    Friction between the pairs of a truncated support ends at the surface: of a linear velocity field it leaves the force
    that makes the stress mu (G + G^T) n vanish there. Along the surface that is the condition of a free surface. Across it
    the pressure of the surface, p_s = 2 mu (n.Gn - tr G), balances the stress; a row would have it twice, and as a force in
    one row where the gradient of the pressure is looked for. What pairs make of E p_s/(2 mu) across the surface goes,

        u* <- u* - beta dt/(2 rho) p_s n (n.sum_j V_j F_ij term(E x_ij, x_ij)),    E = n (x) n - (1 - n (x) n)/(d - 1)

    Where a support is full, `predict` has taken out all that pairs make of a linear field.
    """
    real, vec, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)
    apart = make_images(spec).apart
    list_begin, list_step, neighbour, Listed = list_access(spec)
    viscous_term = make_viscosity(spec.viscosity, spec.dimension, spec.precision)
    stress_pressure = make_stress_pressure(spec.dimension, spec.precision)
    time_weights = make_weights(spec.second_order)
    periodic = any(spec.periodic)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1
    sideways = 1.0 / (spec.dimension - 1)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def surface_friction(
        first: int,
        particle_count: int,
        list_width: int,
        full_spread: real,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        slip: wp.array(dtype=wp.uint8),
        boundary_volume: wp.array(dtype=real),
        spread: wp.array(dtype=real),
        correction: wp.array(dtype=mat),
        crowding: wp.array(dtype=vec),
        surface_normal: wp.array(dtype=vec),
        velocity_gradient: wp.array(dtype=mat),
        surface_stress: wp.array(dtype=real),
        velocity_star: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        before = surface_stress[i]
        surface_stress[i] = real(0.0)
        if spread[i] > full_spread:
            return
        xi = position[i]
        n = surface_normal[i]
        reach = real(time_weights(clock)[2] * clock[STEP])
        stress = stress_pressure(n, velocity_gradient[i], correction[i] * crowding[i], before, phases[0], reach)
        surface_stress[i] = stress
        aside = real(sideways)
        across = real(1.0) + aside
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        total = vec()
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = natural(neighbour(neighbours, i, k))
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            d = apart(xi, position[j], code, wrapped, params, sides)
            r2 = wp.dot(d, d)
            f = slope(wp.sqrt(r2) * params.inv_h) * rest_volume[j]
            total += f * viscous_term(across * wp.dot(n, d) * n - aside * d, d, r2 + params.tiny, params.inv_h)
        if wp.static(spec.walls and spec.wall_no_slip):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = natural(neighbour(neighbours, i, k))
                k += step
                b = j - (particle_count - slip.shape[0])
                if slip[b] == wp.uint8(0):
                    d = apart(xi, position[j], 0, wrapped, params, sides)
                    r2 = wp.dot(d, d)
                    wall_volume = params.wall_volume
                    if wp.static(spec.bodies):
                        wall_volume = boundary_volume[b]
                    f = slope(wp.sqrt(r2) * params.inv_h) * wall_volume
                    total += f * viscous_term(across * wp.dot(n, d) * n - aside * d, d, r2 + params.tiny, params.inv_h)
        share = real(0.5) * reach * stress / phases[0].density
        velocity_star[i] = velocity_star[i] - n * (share * params.g_norm * wp.dot(n, total))

    return surface_friction
