"""Relaxation of the pressure, which lets sound die (theory: riemann#relaxation; Mandelshtam and Leontovich 1937).

    dP/dt = (p(s) - P)/tau,   p = p(s) + m (p(s) - P)

A compression in less than tau meets a fluid that is stiffer by 1 + m, a slow one the equation of state alone: what fades of
the pressure in between is the energy that sound loses.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import RELAXATION, STEP
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.spec import Spec, types, types_of


@functools.cache
def make_late(precision: str) -> Any:
    """Return the `wp.func` late(pressure, settled, dt, tau): the settled pressure one step later [Pa].

    pressure: of the density [Pa]; dt: step, tau: time of relaxation [s]. Backward Euler, stable for any step.
    """
    real = types(2, precision).real

    @wp.func
    def late(pressure: real, settled: real, dt: real, tau: real):
        return settled + (pressure - settled) * (dt / (tau + dt))

    return late


@functools.cache
def make_relaxation(spec: Spec) -> Any:
    """Return the kernel that adds to the pressure of each fluid particle what has not yet faded of it.

    It runs right behind the sweep that sets the pressure of the density; `beginning` 1 takes that as settled.
    """
    real, _, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    late = make_late(spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def relaxation(
        first: int,
        beginning: int,
        params: Params,
        clock: wp.array(dtype=wp.float64),
        state: wp.array(dtype=pair),
        settled: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        both = state[i]
        p = both[0]
        if beginning == 1:
            settled[i] = p
            return
        slow = late(p, settled[i], real(clock[STEP]), params.relaxation_time)
        settled[i] = slow
        state[i] = pair(p + real(clock[RELAXATION]) * (p - slow), both[1])

    return relaxation
