"""Drift of the total momentum along periodic axes, taken out (no source equation).

The corrected gradient and the pressure jump conserve momentum on the whole, not pair by pair; where no wall takes it nothing
else fixes the mean velocity, and what is left would add up:
    dv = (P - sum m v) / sum m,   P = P_0 + M (g + b) t
is added to every particle along the axes of `Spec.momentum_axes`; where g or b depends on time (g + b) t is their integral.
A shift of all velocities changes no difference between two of them.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.block_sums import make_block_sums
from warpsph.kernels.core.clock import DRIFT_VELOCITY, MOMENTUM, STEP, TIME
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.spec import Spec, types_of

from .volume import make_volume_parts


@functools.cache
def make_drift(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels (sum_momentum over blocks, close_momentum on what totals them): see `block_sums`.

    The fourth entry of a sum is the mass. Where the volume of the box is held too, they add up that in the same pass
    (`volume`): a box of some ten thousand particles would spend more time on launching two kernels more than on the sums.
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    dimension = spec.dimension
    kept = wp.vec3d(*(1.0 if axis in spec.momentum_axes else 0.0 for axis in range(3)))
    with_volume = spec.volume_constraint
    volume_of, close_volume = make_volume_parts(spec)
    store_volume, total_volume = make_block_sums(wp.vec2d, spec.row_list)
    store_momentum, total_momentum = make_block_sums(wp.vec4d, spec.row_list)

    @wp.kernel(module="unique", enable_backward=False)
    def sum_momentum(
        first: int,
        block_count: int,
        fluid_count: int,
        phases: wp.array(dtype=Phase),
        phase: wp.array(dtype=wp.int8),
        rest_volume: wp.array(dtype=real),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        momentum_sums: wp.array(dtype=wp.vec4d),
        volume_sums: wp.array(dtype=wp.vec2d),
    ):
        t = wp.tid() + first
        begin = t
        end = wp.min(t + 1, fluid_count)
        if wp.static(spec.row_list):
            chunk = (fluid_count + block_count - 1) / block_count
            begin = t * chunk
            end = wp.min(begin + chunk, fluid_count)
        total = wp.vec4d()
        volume = wp.vec2d()
        for k in range(begin, end):
            own = int(0)
            if wp.static(spec.multiphase):
                own = int(phase[k])
            m = wp.float64(phases[own].density) * wp.float64(rest_volume[k])
            v = velocity[k]
            for axis in range(wp.static(dimension)):
                total[axis] += m * wp.float64(v[axis])
            total[3] += m
            if wp.static(with_volume):
                volume += volume_of(k, phases, phase, state)
        store_momentum(t, total, momentum_sums)
        if wp.static(with_volume):
            store_volume(t, volume, volume_sums)

    @wp.kernel(module="unique", enable_backward=False)
    def close_momentum(
        block_count: int,
        params: Params,
        clock: wp.array(dtype=wp.float64),
        impulse: wp.array(dtype=wp.float64),
        momentum_sums: wp.array(dtype=wp.vec4d),
        volume_sums: wp.array(dtype=wp.vec2d),
    ):
        t = wp.tid()
        total = total_momentum(t, block_count, momentum_sums)
        volume = wp.vec2d()
        if wp.static(with_volume):
            volume = total_volume(t, block_count, volume_sums)
        if t > 0:
            return
        # the velocities are those of the middle of the step
        time = clock[TIME] + wp.float64(0.5) * clock[STEP]
        held = wp.static(kept)
        for axis in range(wp.static(dimension)):
            if wp.static(spec.varying_force):
                drift = clock[MOMENTUM + axis] + impulse[axis] - total[axis] / total[3]
            else:
                drive = wp.float64(params.gravity[axis]) + wp.float64(params.body_force[axis])
                drift = clock[MOMENTUM + axis] + drive * time - total[axis] / total[3]
            clock[DRIFT_VELOCITY + axis] = held[axis] * drift
        if wp.static(with_volume):
            close_volume(clock, volume)

    return sum_momentum, close_momentum
