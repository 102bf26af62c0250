"""Volume constraint of a closed or periodic domain (prototype of the corrected gradient; no source equation).

The corrected gradient sees pressure differences alone, so the mean pressure is free; it follows from the volume:
    dP = (sum V - V_box) / sum (V / (rho c^2)),   s_i += (1 + s_i) dP / (rho c^2)
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.block_sums import make_block_sums
from warpsph.kernels.core.clock import BOX_VOLUME, EXCESS_PRESSURE
from warpsph.kernels.core.params import make_phase
from warpsph.kernels.core.spec import Spec, types_of


@functools.cache
def make_volume_parts(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s of a particle and of the end of the sum.

    volume_of(k, phases, phase, state): (V, V/(rho c^2)) [m^d, m^d/Pa]; close(clock, total): sets the pressure to be added.
    """
    _, _, _, pair = types_of(spec)
    Phase = make_phase(spec.precision)

    @wp.func
    def volume_of(k: int, phases: wp.array(dtype=Phase), phase: wp.array(dtype=wp.int8), state: wp.array(dtype=pair)):
        own = int(0)
        if wp.static(spec.multiphase):
            own = int(phase[k])
        v = wp.float64(state[k][1])
        return wp.vec2d(v, v * wp.float64(phases[own].compressibility))

    @wp.func
    def close(clock: wp.array(dtype=wp.float64), total: wp.vec2d):
        clock[EXCESS_PRESSURE] = (total[0] - clock[BOX_VOLUME]) / total[1]

    return volume_of, close


@functools.cache
def make_volume(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels (sum_volume over blocks, close_volume on what totals them): see `block_sums`."""
    _, _, _, pair = types_of(spec)
    Phase = make_phase(spec.precision)
    volume_of, close = make_volume_parts(spec)
    store_block, total_of_blocks = make_block_sums(wp.vec2d, spec.row_list)

    @wp.kernel(module="unique", enable_backward=False)
    def sum_volume(
        first: int,
        block_count: int,
        fluid_count: int,
        phases: wp.array(dtype=Phase),
        phase: wp.array(dtype=wp.int8),
        state: wp.array(dtype=pair),
        volume_sums: wp.array(dtype=wp.vec2d),
    ):
        t = wp.tid() + first
        begin = t
        end = wp.min(t + 1, fluid_count)
        if wp.static(spec.row_list):
            chunk = (fluid_count + block_count - 1) / block_count
            begin = t * chunk
            end = wp.min(begin + chunk, fluid_count)
        total = wp.vec2d()
        for k in range(begin, end):
            total += volume_of(k, phases, phase, state)
        store_block(t, total, volume_sums)

    @wp.kernel(module="unique", enable_backward=False)
    def close_volume(
        block_count: int,
        clock: wp.array(dtype=wp.float64),
        volume_sums: wp.array(dtype=wp.vec2d),
    ):
        t = wp.tid()
        total = total_of_blocks(t, block_count, volume_sums)
        if t == 0:
            close(clock, total)

    return sum_volume, close_volume
