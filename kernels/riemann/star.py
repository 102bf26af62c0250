"""Star states of a particle pair: the linearised Riemann problem between two media (theory: riemann#a3).

Left is i, right is j, e points from i to j, u = v.e, Z = rho c. The weights of velocity and pressure belong
together: only p* = b p_i + a p_j with u* = a u_i + b u_j does no net work on the pair.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.spec import types

EDGE = 1.0e-4  # dimensionless length of `into_wall` up to which a wall is hardly in reach and has no normal yet


class StarStates(NamedTuple):
    """`wp.func`s of one formulation: velocity [m/s] and pressure [Pa] between two particles."""

    velocity: Any
    pressure: Any


@functools.cache
def make_star(precision: str, arithmetic: bool) -> StarStates:
    """Return star_velocity(u_i, u_j, rho_i, rho_j, Z_i, Z_j, dp) and star_pressure(p_i, p_j, rho_i, rho_j, jump).

    `dp` is theta (P_i - P_j - J): the pressure difference that is in no equilibrium, with the hydrostatic part and
    the Laplace jump J = p_i - p_j at rest taken out. `arithmetic` gives the printed form, seed 000 eqs (11), (16).
    """
    real = types(2, precision).real

    if arithmetic:

        @wp.func
        def star_velocity(u_i: real, u_j: real, rho_i: real, rho_j: real, z_i: real, z_j: real, dp: real):
            # (11): rho_bar c_bar from mean density and mean sound speed
            z_bar = real(0.25) * (rho_i + rho_j) * (z_i / rho_i + z_j / rho_j)
            return real(0.5) * (u_i + u_j) + real(0.5) * dp / z_bar

        @wp.func
        def star_pressure(p_i: real, p_j: real, rho_i: real, rho_j: real, jump: real):
            return real(0.5) * (p_i + p_j + jump)

    else:

        @wp.func
        def star_velocity(u_i: real, u_j: real, rho_i: real, rho_j: real, z_i: real, z_j: real, dp: real):
            return (rho_i * u_i + rho_j * u_j) / (rho_i + rho_j) + dp / (z_i + z_j)

        @wp.func
        def star_pressure(p_i: real, p_j: real, rho_i: real, rho_j: real, jump: real):
            # the pressure on the side of i: from j it is the same less the jump, the difference is the tension
            return (rho_j * p_i + rho_i * (p_j + jump)) / (rho_i + rho_j)

    return StarStates(star_velocity, star_pressure)


@functools.cache
def make_jump(precision: str) -> Any:
    """Return the `wp.func` laplace_jump(sigma, kappa_i, kappa_j, w_i, w_j) = J_ij = sigma k_ij [Pa].

    kappa is the divergence of the normal that leaves the particle's *own* phase, so it changes sign across the
    interface; k_ij is its mean weighted by the strength w of the colour gradient. J_ji = -J_ij.
    """
    real = types(2, precision).real

    @wp.func
    def laplace_jump(sigma: real, kappa_i: real, kappa_j: real, w_i: real, w_j: real):
        weight = w_i + w_j
        jump = real(0.0)
        if weight > real(1.0e-9):
            jump = sigma * (w_i * kappa_i - w_j * kappa_j) / weight
        return jump

    return laplace_jump


@functools.cache
def make_carried(dimension: int, precision: str) -> Any:
    """Return the `wp.func` carried(rho_i, rho_j, G, d) = (rho_i - rho_j)/(rho_i + rho_j) d.G d/2 [m^2/s].

    G is the velocity gradient on the side of the denser particle, d = x_i - x_j. Over the distance it is what u* lacks: its
    weights leave a dense particle 2 rho_j/(rho_i + rho_j) of what the velocity changes towards a light one.
    """
    real, vec, mat, _ = types(dimension, precision)

    @wp.func
    def carried(rho_i: real, rho_j: real, gradient: mat, d: vec):
        return real(0.5) * (rho_i - rho_j) / (rho_i + rho_j) * wp.dot(gradient * d, d)

    return carried


class OneSided(NamedTuple):
    """`wp.func`s of the one-sided problem at a wall, see `momentum`."""

    alone: Any
    reaction: Any


@functools.cache
def make_one_sided(dimension: int, precision: str) -> OneSided:
    """Return alone_at_wall(into_wall, own_even, norm) in 0..1, wall_reaction(a, into_wall, share) = -share max(a.n, 0) n.

    Arguments of the functions:
        into_wall: sum over the wall of F V x_ij, x_ij from the wall particle to the fluid particle: n times its length
        own_even: the same over the fluid of the own phase
        norm: makes `into_wall` dimensionless
        a: an acceleration [m/s^2], or a displacement [m]
    alone is 0 where the own phase stands against the wall as a whole, 1 where half of it is missing:
    own_even.into_wall > -|into_wall|^2/2.
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def alone_at_wall(into_wall: vec, own_even: vec, norm: real):
        result = real(0.0)
        size2 = wp.dot(into_wall, into_wall)
        if size2 * norm * norm > real(EDGE * EDGE):
            missing = real(2.0) + real(2.0) * wp.dot(own_even, into_wall) / size2
            result = wp.clamp(missing, real(0.0), real(1.0))
        return result

    @wp.func
    def wall_reaction(a: vec, into_wall: vec, share: real):
        result = vec()
        push = wp.dot(a, into_wall)
        if push > real(0.0) and share > real(0.0):
            result = into_wall * (-share * push / wp.dot(into_wall, into_wall))
        return result

    return OneSided(alone_at_wall, wall_reaction)
