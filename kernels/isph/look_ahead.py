"""Velocity that bodies see in projection ISPH: that of the end of the step (theory: isph#bodies)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.core.weights import make_weights


@functools.cache
def make_look_ahead(spec: Spec) -> Any:
    """Return the kernel that extrapolates the velocity to the end of the step; `behind` 1: that of walls, as it is."""
    _, vec, _, _ = types_of(spec)
    real = types_of(spec).real
    time_weights = make_weights(spec.second_order)

    @wp.kernel(module="unique", enable_backward=False)
    def look_ahead(
        first: int,
        behind: int,
        fluid_count: int,
        clock: wp.array(dtype=wp.float64),
        velocity: wp.array(dtype=vec),
        velocity_old: wp.array(dtype=vec),
        velocity_ahead: wp.array(dtype=vec),
    ):
        i = wp.tid() + first + behind * fluid_count
        v = velocity[i]
        if behind == 0:
            v = v + (v - velocity_old[i]) * real(time_weights(clock)[3])
        velocity_ahead[i] = v

    return look_ahead
