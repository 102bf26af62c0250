"""Pressure differences that dissipation spares (theory: riemann#inertia).

    grad p / rho = g + b,   b = f - a:   db/dt = (f - a - b) FOLLOW c / dx

with a the acceleration and f the forces of the scene but gravity. b is followed slowly, as the slope of the pressure at a
wall is: what is steady is left out of the dissipation, and sound is damped as before.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import LAST_STEP, STEP
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.core.time_signals import make_forcing
from warpsph.kernels.core.wall_fit import FOLLOW


@functools.cache
def make_inertia(spec: Spec) -> Any:
    """Return the `wp.func` later_inertia(before, acceleration, position, ...): b [m/s^2] a step later, f - a at first."""
    real, vec, _, _ = types_of(spec)
    Params, Phase = make_params(spec.dimension, spec.precision), make_phase(spec.precision)
    _, body_force_of = make_forcing(spec)

    @wp.func
    def later_inertia(
        before: vec,
        acceleration: vec,
        position: vec,
        params: Params,
        own: Phase,
        forcing: wp.array(dtype=vec),
        clock: wp.array(dtype=wp.float64),
    ):
        now = -acceleration
        if wp.static(spec.body_force):
            now += body_force_of(params, forcing)
        if wp.static(spec.central_force):
            now -= params.pull * (position - params.center)
        kept = real(0.0)
        if clock[LAST_STEP] > wp.float64(0.0):
            kept = wp.exp(-real(FOLLOW) * own.sound_speed / params.spacing * real(clock[STEP]))
        return now + kept * (before - now)

    return later_inertia


@functools.cache
def make_loud(spec: Spec) -> Any:
    """Return the `wp.func` loud(left, spared): what sound has of p_i - p_j [Pa] of one fluid, less what is borne (`left`).

    b may take no more than what gravity leaves, nor turn its sign: on crumbs of spray the acceleration is that of pressures
    which have no gradient, and would feed them.
    """
    real = types_of(spec).real

    @wp.func
    def loud(left: real, spared: real):
        if wp.static(not spec.inertia):
            return left
        # as `wp.clamp`, whose care for what is no number takes half as long as all of the pair
        low, high = wp.where(left < real(0.0), left, real(0.0)), wp.where(left > real(0.0), left, real(0.0))
        bounded = wp.where(spared > low, spared, low)
        return left - wp.where(bounded < high, bounded, high)

    return loud
