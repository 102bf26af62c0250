"""Volume constraint of a closed or periodic domain (prototype of the corrected gradient; no source equation).

The corrected gradient sees pressure differences alone, so the mean pressure is free; it follows from the volume:
    dP = (sum V - V_box) / sum (V / (rho c^2)),   s_i += (1 + s_i) dP / (rho c^2)
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import BOX_VOLUME, EXCESS_PRESSURE, FOLDS
from warpsph.kernels.core.params import make_phase
from warpsph.kernels.core.spec import Spec, types_of


@functools.cache
def make_volume(spec: Spec) -> tuple[Any, Any, Any]:
    """Return the kernels (sum_volume over blocks, fold_volume over FOLDS, close_volume on one thread).

    Float64 sums in a fixed order: the result does not depend on how many threads work on it.
    """
    _, _, _, pair = types_of(spec)
    Phase = make_phase(spec.precision)

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
        block = wp.tid() + first
        n = fluid_count
        k = block
        step = block_count
        end = n
        if wp.static(spec.row_list):
            chunk = (n + block_count - 1) / block_count
            k = block * chunk
            end = wp.min(k + chunk, n)
            step = 1
        volume = wp.float64(0.0)
        softness = wp.float64(0.0)
        while k < end:
            own = int(0)
            if wp.static(spec.multiphase):
                own = int(phase[k])
            v = wp.float64(state[k][1])
            volume += v
            softness += v * wp.float64(phases[own].compressibility)
            k += step
        volume_sums[block] = wp.vec2d(volume, softness)

    @wp.kernel(module="unique", enable_backward=False)
    def fold_volume(
        first: int,
        block_count: int,
        volume_sums: wp.array(dtype=wp.vec2d),
        volume_folds: wp.array(dtype=wp.vec2d),
    ):
        fold = wp.tid() + first
        total = wp.vec2d()
        k = fold
        while k < block_count:
            total += volume_sums[k]
            k += FOLDS
        volume_folds[fold] = total

    @wp.kernel(module="unique", enable_backward=False)
    def close_volume(
        clock: wp.array(dtype=wp.float64),
        volume_folds: wp.array(dtype=wp.vec2d),
    ):
        total = wp.vec2d()
        for fold in range(FOLDS):
            total += volume_folds[fold]
        clock[EXCESS_PRESSURE] = (total[0] - clock[BOX_VOLUME]) / total[1]

    return sum_volume, fold_volume, close_volume
