"""Weights of the two-level time derivative of a step of variable length (BDF2), shared by projection and walls."""

import functools
from typing import Any

import warp as wp

from .clock import LAST_STEP, STEP

LONGEST = 2.0  # ratio of two steps: BDF2 is stable below 2.4


@functools.cache
def make_weights(second_order: bool) -> Any:
    """Return the `wp.func` time_weights(clock) -> (c_0, c_1, beta, omega) of a step, float64."""

    @wp.func
    def time_weights(clock: wp.array(dtype=wp.float64)):
        omega = wp.float64(0.0)
        if wp.static(second_order):
            if clock[LAST_STEP] > wp.float64(0.0):
                omega = clock[STEP] / clock[LAST_STEP]
                if omega > wp.float64(LONGEST):
                    omega = wp.float64(0.0)  # after a short step to the time of an output: as at the start
        one = wp.float64(1.0)
        both = one + wp.float64(2.0) * omega
        return wp.vec4d((one + omega) * (one + omega) / both, omega * omega / both, (one + omega) / both, omega)

    return time_weights
