"""Implicit viscosity of projection ISPH: the explicit viscous term, stabilised (theory: isph#b1; Ascher et al. 1995).

With u_e = (1 + omega) u^n - omega u^{n-1} the extrapolated velocity and u*_x that of `projection.predict`, whose viscous
term is taken at u_e, each component c is replaced by

    u* = u*_x - r + w,    (1 + s' beta dt nu A_c) w = r,    r = u*_x - u_e - (beta dt/rho) grad p^n

A_c w = -sum_j V_j F_ij t_c (w_i - w_j), t_c what the viscous pair term makes in direction c of a velocity in direction c
alone: 2 for the Morris form, whose A is the Laplacian itself, 2 (d + 2) x_c^2/r^2 for the radial one. A_c is symmetric, one
scalar equation a component. What it leaves out, the coupling of the components and the corrections for disorder, stands in
u*_x.

r is what the step adds to the extrapolation, O(dt^2), so that w - r = O(dt^2 beta dt nu/h^2): second order, and nothing
where the viscous number is small. For that the last pressure gradient has to be part of it: it balances the weight of a
fluid at rest. Beside bodies it is that of the fluid alone: the whole gradient there answers what the last step added across
the wall, and friction that waits for this answer drives rows at the wall to and fro (docs/records/bodies_isph.md#late).

Stability: with z = s' beta dt nu lambda(A) and zeta that of the full term, the roots of
(1 + z) q^2 - (2 (z - zeta) + 4/3) q + z - zeta + 1/3 stay in the unit circle as long as z >= 3/4 zeta - 2/3. lambda of the
full radial term is up to d times that of its diagonal part: sum_c x_c^2 w_c^2 >= (x.w)^2/d. Explicit viscosity, z = 0, is
stable up to zeta = 8/9, at a step dt_e; so s' = s (1 - dt_e/dt) will do: as little as stability needs, for friction between
components conserves no angular momentum, and nothing up to dt_e.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import STEP, VISCOUS_STEP
from warpsph.kernels.core.fields import FLUID, implicit_at_bodies
from warpsph.kernels.core.mirror import NO_SLIP, code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access, make_entry, natural
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.viscosity import make_friction_slope, make_viscosity
from warpsph.kernels.core.weights import make_weights

# s by dimension. Largest lambda of the full term over that of A, times 3/4, measured on blocks with a free surface and up to
# 0.25 spacings of disorder: morris 0.88; radial 1.42 in 2-D, 1.6 in 3-D.
STABILISER = {
    "morris": (1.0, 1.0, 1.0),
    "radial": (1.0, 1.5, 1.75),
    "isotropic": (1.0, 1.5, 1.75),
    "paper": (1.0, 1.5, 1.75),
}
# Diagonal entry of a wall over its weight w: 2 for a mirrored velocity -w_i. The quadratic of a body answers the velocity
# beside it more strongly: with 2 the tangential velocity grows by 1.4 to 1.6 a step of many h^2/nu, with 3 it decays.
COUPLING = 4.0


@functools.cache
def make_diffusion(spec: Spec) -> tuple[Any, Any, Any]:
    """Return the kernels (fill the matrix, right-hand side r, u* from the solution w) of one component.

    Rows are multiplied by V_i over the volume of a wall particle, so that the matrix is symmetric. The image of a neighbour
    carries w_j, reversed where friction reverses its velocity; wall particles of no-slip bodies carry -w_i, or
    (1 - COUPLING) w_i if they have a surface of their own.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)
    apart = make_images(spec).apart
    viscous_term = make_viscosity(spec.viscosity, spec.dimension, spec.precision)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    row_begin, row_stride, _, Columns, put_column = make_entry(spec.row_list, spec.wide_list)
    _, _, _, Values, put_value = make_entry(spec.row_list, spec.wide_list, real)
    time_weights = make_weights(spec.second_order)
    periodic = any(spec.periodic)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1
    dimension = spec.dimension
    stabiliser = STABILISER[spec.viscosity][spec.dimension - 1]

    @wp.func
    def image_sign(code: int, component: int, sides: Sides):
        sign = real(1.0)
        for axis in range(wp.static(dimension)):
            digit = (code >> (2 * axis)) & 3
            if digit != 0:
                if axis == component or sides.kind[2 * axis + digit - 1] == NO_SLIP:
                    sign = real(-1.0)
        return sign

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def diffusion_matrix(
        first: int,
        component: int,
        particle_count: int,
        fluid_count: int,
        list_width: int,
        matrix_width: int,
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
        matrix_columns: Columns,
        matrix_values: Values,
        matrix_counts: wp.array(dtype=wp.int16),
        matrix_diagonal: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        xi = position[i]
        wrapped = bool(False)
        if wp.static(periodic):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        share = rest_volume[i] / params.wall_volume
        reach = real(time_weights(clock)[2] * clock[STEP]) * phases[0].viscosity / phases[0].density  # beta dt nu [m^2]
        needed = wp.max(wp.float64(0.0), wp.float64(1.0) - clock[VISCOUS_STEP] / clock[STEP])
        weight = real(wp.static(-stabiliser)) * real(needed) * share * reach * params.g_norm
        along = vec()
        along[component] = real(1.0)
        diagonal = share
        count = int(0)
        entry = row_begin(i, matrix_width)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        row_step = row_stride(fluid_count)
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
            term = viscous_term(along, d, r2 + params.tiny, params.inv_h)
            w = weight * f * term[component]
            other = w
            if wp.static(spec.mirror):
                if code != 0:
                    other = w * image_sign(code, component, sides)
            diagonal += w
            inside = bool(True)
            if wp.static(spec.open_axis >= 0):
                inside = int(zone[j]) == FLUID  # a buffer has its velocity from elsewhere: w = 0
            if j == i:
                diagonal -= other  # an own image
            elif inside and w > real(0.0):
                put_column(matrix_columns, i, entry, j)
                put_value(matrix_values, i, entry, -other)
                entry += row_step
                count += 1
        if wp.static(spec.walls and spec.wall_no_slip):
            wall_first = particle_count - slip.shape[0]
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = natural(neighbour(neighbours, i, k))
                k += step
                if slip[j - wall_first] == wp.uint8(0):
                    d = apart(xi, position[j], 0, wrapped, params, sides)
                    r2 = wp.dot(d, d)
                    wall_volume = params.wall_volume
                    if wp.static(spec.bodies):
                        wall_volume = boundary_volume[j - wall_first]
                    f = slope(wp.sqrt(r2) * params.inv_h) * wall_volume
                    term = viscous_term(along, d, r2 + params.tiny, params.inv_h)
                    diagonal += real(wp.static(COUPLING if spec.bodies else 2.0)) * weight * f * term[component]
        matrix_counts[i] = wp.int16(count)
        matrix_diagonal[i] = diagonal

    @wp.kernel(module="unique", enable_backward=False)
    def diffusion_source(
        first: int,
        component: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        rest_volume: wp.array(dtype=real),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        velocity_star: wp.array(dtype=vec),
        lasting_gradient: wp.array(dtype=vec),
        fluid_gradient: wp.array(dtype=vec),
        unknown: wp.array(dtype=real),
        source: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        weights = time_weights(clock)
        now = velocity[i][component]
        extrapolated = now + (now - velocity_old[i][component]) * real(weights[3])
        gradient = lasting_gradient[i]
        if wp.static(implicit_at_bodies(spec)):
            gradient = fluid_gradient[i]
        push = real(weights[2] * clock[STEP]) / phases[0].density * gradient[component]
        added = velocity_star[i][component] - extrapolated - push
        source[i] = rest_volume[i] / params.wall_volume * added
        unknown[i] = real(0.0)

    @wp.kernel(module="unique", enable_backward=False)
    def diffusion_take(
        first: int,
        component: int,
        params: Params,
        rest_volume: wp.array(dtype=real),
        unknown: wp.array(dtype=real),
        source: wp.array(dtype=real),
        velocity_star: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                return
        v = velocity_star[i]
        v[component] = v[component] + (unknown[i] - source[i] * (params.wall_volume / rest_volume[i]))
        velocity_star[i] = v

    return diffusion_matrix, diffusion_source, diffusion_take
