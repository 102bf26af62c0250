"""The flow on each side of an interface, for the Riemann problem between two phases (no source equation).

Next to an interface the neighbours of the own phase fill a part of the support alone. From them:
    grad v_i = [sum_own (v_j - v_i) (x) grad_i W V_j] [sum_own (x_j - x_i) (x) grad_i W V_j]^-1
    facing_i = sum_other grad_i W V_j / |.|, from the own phase to the others
The first carries the velocity of the denser particle of a pair to its middle, v_i + grad v_i.(x_j - x_i)/2. With constant
states the particles of a heavy phase would see no divergence towards a light one, and its rows would compress and expand in
turn. Of that only what the weights of u* leave out counts, (rho_i - rho_j)/(rho_i + rho_j): carried velocities have no
counterpart in p*, so the work of the pressures is not what the flow gains, and more of it than needed feeds short waves
(docs/records/tension.md).
The second tells a particle at an interface from one that is alone among the other phase: it is zero where no one side
faces the others.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import NEAR, list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of

# Root 1/d of the determinant of the own phase's moment, 1 inside a fluid, 0.5 at a flat surface. Below the first the
# gradient fades, below the second it is zero: a drop of a few particles moves as one.
FULL, NONE = 0.3, 0.15
# |sum_other grad W V| over sum_other |grad W V|, 0.6 to 1 at a flat interface: below, no one side faces the other phases.
CLEAR = 0.3
# h times the gradient of the share of other phases, of order 1 beside an interface, below which it points nowhere.
FAINT = 1.0e-6


@functools.cache
def make_interface_flow(spec: Spec) -> Any:
    """Return the kernel over fluid particles; those without another phase in their list are left alone."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    full, none = FULL**spec.dimension, NONE**spec.dimension

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def interface_flow(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        mirror_velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        velocity_gradient: wp.array(dtype=mat),
        facing: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        if (int(flags[i]) & NEAR) == 0:
            return
        xi = position[i]
        vi = velocity[i]
        own = phase[i]
        flow = mat()
        moment = mat()
        others = vec()
        all_others = real(0.0)
        fluid_count = particle_count - slip.shape[0]
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(xi, position[j], True, params)
            fd = (slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * state[j][1]) * d
            if phase[j] == own:
                moment -= wp.outer(d, fd)
                flow += wp.outer(velocity[j] - vi, fd)
            else:
                others += fd
                all_others += wp.length(fd)
        if wp.static(spec.wall_no_slip):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                if slip[j - fluid_count] == wp.uint8(0):
                    d = separation(xi, position[j], True, params)
                    fd = (slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * params.wall_volume) * d
                    moment -= wp.outer(d, fd)
                    flow += wp.outer(mirror_velocity[j - fluid_count] - vi, fd)
        gradient = mat()
        m = moment * params.g_norm
        determinant = wp.determinant(m)
        if determinant > real(none):
            gradient = (flow * params.g_norm) * wp.inverse(m)
            if determinant < real(full):
                gradient = gradient * ((determinant - real(none)) / real(full - none))
        velocity_gradient[i] = gradient
        strength = wp.length(others)
        # what the edge of the support sees of another phase is no direction, and its reciprocal may be infinite
        if strength > real(CLEAR) * all_others and strength * (params.g_norm * params.h) > real(FAINT):
            facing[i] = others / strength
        else:
            facing[i] = vec()

    return interface_flow
