"""Friction of disorder: evens what velocities of neighbours differ by beyond their gradients (theory: riemann#disorder).

    a_i = (rho0/rho_i) sum_j b_ij [(v_ij - (G_i + G_j)/2 x_ij).e_ij] x_ij F_ij V_j,   b_ij = (b_i + b_j)/2
    b_i = max(A |G_i| h - 6 nu/h, 0), at most c/5; beside no-slip walls 60 nu/h

over the own phase, e the unit vector of the pair, G the velocity gradient, A `numerics.disorder_friction`. A linear flow
feels nothing of it on any arrangement, a smooth one at fourth order in h, disordered particles all of it. Pairs exchange
momentum along their line. Every fourth step finds it, and each of the four has it.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import STEPS
from warpsph.kernels.core.pair import make_at
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.spec import Spec, types_of

# What it takes from velocities that know nothing of each other is b <r>/(2 d nu) of what the viscosity takes,
# <r> = sum |F| r V / sum |F| V = 2h/3 in 2-D and 6h/7 in 3-D (Wendland C2): as much at b = 6 and 7 nu/h.
AS_VISCOUS = 6.0
# How much more is taken off within reach of a no-slip wall. A gradient of one side is off by half of what the flow bends
# over h, which is no disorder: where the layer at the wall is resolved, |G| h^2 < 15 nu, it is left alone.
RESOLVED = 10.0
# Of the sound speed: a step of h/(2c) then takes up to a quarter of what velocities differ by from one particle to the next.
FASTEST = 0.2
UNKNOWN = -1.0  # b of particles whose neighbours leave the gradient open; they take no part


# Steps that it is held for: the most that it may take of a difference in one, a quarter, so often is all of it.
HELD = 4


@functools.cache
def make_disorder_due(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s (due(counters), near(counters)): a step finds the friction anew, or the one after it does.

    Without it in a `Spec` none does. The first step does, and has gradients of the start.
    """

    @wp.func
    def due(counters: wp.array(dtype=int)):
        if wp.static(spec.disorder):
            return counters[STEPS] % HELD == 0
        return False

    @wp.func
    def near(counters: wp.array(dtype=int)):
        if wp.static(spec.disorder):
            return counters[STEPS] == 0 or (counters[STEPS] + 1) % HELD == 0
        return False

    return due, near


@functools.cache
def make_disorder_speed(spec: Spec) -> Any:
    """Return the `wp.func` disorder_speed(G, clings, params, phase) -> b [m/s], beside a no-slip wall or not."""
    real, _, mat, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)

    @wp.func
    def disorder_speed(gradient: mat, clings: bool, params: Params, own: Phase):
        turning = params.disorder * wp.sqrt(wp.ddot(gradient, gradient)) * params.h
        viscous = real(AS_VISCOUS) * own.viscosity / (own.density * params.h)
        if clings:
            viscous *= real(RESOLVED)
        return wp.clamp(turning - viscous, real(0.0), real(FASTEST) * own.sound_speed)

    return disorder_speed


@functools.cache
def make_disorder_friction(spec: Spec) -> Any:
    """Return the `wp.func` of what a pair adds to the acceleration, to be summed with F V_j; 0 where it is not due.

    disorder_friction(due, i, j, v_ij, x_ij, r, b, G), the last two those of all particles.
    """
    real, vec, mat, _ = types_of(spec)
    at_real, at_mat = make_at(real), make_at(mat)

    @wp.func
    def disorder_friction(
        due: bool,
        i: int,
        j: int,
        v: vec,
        d: vec,
        r: real,
        speeds: wp.array(dtype=real),
        gradients: wp.array(dtype=mat),
    ):
        result = vec()
        if due:
            own, other = speeds[i], at_real(speeds, j)
            if wp.min(own, other) >= real(0.0) and own + other > real(0.0) and r > real(0.0):
                beyond = wp.dot(v - real(0.5) * ((gradients[i] + at_mat(gradients, j)) * d), d)
                result = (real(0.5) * (own + other) * beyond / r) * d
        return result

    return disorder_friction
