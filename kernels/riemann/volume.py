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
def make_fold(dtype: Any) -> Any:
    """Return the `wp.func` fold_sums(sums, block_count, fold): the sum over every FOLDS-th block from `fold` on."""

    @wp.func
    def fold_sums(sums: wp.array(dtype=dtype), block_count: int, fold: int):
        total = dtype()
        k = int(fold)
        while k < block_count:
            total += sums[k]
            k += FOLDS
        return total

    return fold_sums


@functools.cache
def make_volume_parts(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s of a particle and of the end of the sum.

    volume_of(k, phases, phase, state): (V, V/(rho c^2)) [m^d, m^d/Pa]; close(clock, folds): sets the pressure to be added.
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
    def close(clock: wp.array(dtype=wp.float64), folds: wp.array(dtype=wp.vec2d)):
        total = wp.vec2d()
        for fold in range(FOLDS):
            total += folds[fold]
        clock[EXCESS_PRESSURE] = (total[0] - clock[BOX_VOLUME]) / total[1]

    return volume_of, close


@functools.cache
def make_volume(spec: Spec) -> tuple[Any, Any, Any]:
    """Return the kernels (sum_volume over blocks, fold_volume over FOLDS, close_volume on one thread).

    Float64 sums in a fixed order: the result does not depend on how many threads work on it.
    """
    _, _, _, pair = types_of(spec)
    Phase = make_phase(spec.precision)
    volume_of, close = make_volume_parts(spec)
    fold_sums = make_fold(wp.vec2d)

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
        total = wp.vec2d()
        while k < end:
            total += volume_of(k, phases, phase, state)
            k += step
        volume_sums[block] = total

    @wp.kernel(module="unique", enable_backward=False)
    def fold_volume(
        first: int,
        block_count: int,
        volume_sums: wp.array(dtype=wp.vec2d),
        volume_folds: wp.array(dtype=wp.vec2d),
    ):
        fold = wp.tid() + first
        volume_folds[fold] = fold_sums(volume_sums, block_count, fold)

    @wp.kernel(module="unique", enable_backward=False)
    def close_volume(
        clock: wp.array(dtype=wp.float64),
        volume_folds: wp.array(dtype=wp.vec2d),
    ):
        close(clock, volume_folds)

    return sum_volume, fold_volume, close_volume
