"""Open ends of a gas: particles that hold their state, and what lets them go (theory: compressible#c1-ends)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_inner_slope
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of

from .gas_fields import GOING, HELD
from .riemann_states import make_acoustic_states

# Share of its speed of sound that a wave gives a held particle on the way of a smoothing length, from which it is let go: a
# shock whose pressure is about twice that of the particle.
MET = 1.0


@functools.cache
def make_gas_release(spec: Spec) -> Any:
    """Return the kernel that lets a held particle go, which then moves as every other.

    It holds the state of a gas that no wave has met. One that would give it MET of its speed of sound on the way of a
    smoothing length has: held on, the particle would stand in the gas as a wall, or fly through it whatever it weighs. With
    the star pressures of its pairs, `|sum m_j max(p* - p_i, 0) (g_i + g_j) e_ij| h_i > MET c_i^2`: an even stream has
    p* = p_i and holds for ever, and so does what expands. Neighbours that are held count too: where the start gives
    two of them different states, they would fly through each other.

    Runs at the end of a step. In the next one the particle is GOING: it has density, gradients and rates, which limit the
    step after that, but they do not move it yet: a step that knows nothing of it would be too long. `gas_watch` ends that.
    This launch takes HELD to GOING alone and asks no neighbour whether it is held, in whatever order it runs.
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    inner_slope = make_inner_slope(spec.kernel, spec.dimension, spec.precision)
    images = make_images(spec)
    apart, image_velocity = images.apart, images.image_velocity
    list_begin, list_step, neighbour, Listed = list_access(spec)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1
    acoustic = make_acoustic_states(spec.precision)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def gas_release(
        first: int,
        particle_count: int,
        list_width: int,
        w_norm: real,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        held: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        mass: wp.array(dtype=real),
        smoothing: wp.array(dtype=real),
        density: wp.array(dtype=real),
        stiffening: wp.array(dtype=real),
        state: wp.array(dtype=pair),
    ):
        i = wp.tid() + first
        if held[i] != wp.uint8(HELD):
            return
        gamma = phases[0].gamma
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        p = state[i][0]
        sound = wp.sqrt(gamma * p / density[i])
        force = vec()
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            way = -apart(position[i], position[j], code, wrapped, params, sides)
            r = wp.length(way)
            slope_i = inner_slope(w_norm, r, smoothing[i])
            slope_j = inner_slope(w_norm, r, smoothing[j])
            if slope_i + slope_j <= real(0.0):
                continue
            toward = way / r
            vj = velocity[j]
            if wp.static(spec.mirror):
                vj = image_velocity(vj, code, sides)
            p_j = state[j][0]
            c_j = wp.sqrt(gamma * p_j / density[j])
            u = wp.dot(vj - velocity[i], toward)
            star_p, star_u = acoustic(density[i], real(0.0), p, sound, density[j], u, p_j, c_j, gamma)
            force += (mass[j] * wp.max(star_p - p, real(0.0)) * (slope_i * stiffening[i] + slope_j * stiffening[j])) * toward
        if wp.length(force) * smoothing[i] > real(MET) * sound * sound:
            held[i] = wp.uint8(GOING)

    return gas_release
