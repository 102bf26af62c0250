"""Pair formulas as Yang et al. 2019 print them, eqs (11), (16) to (18) (theory: printed#yang; seed 000).

Left is i, right is j, e points from i to j, u = v.e. A wall particle is the right state of a one-sided problem.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.spec import types


class PrintedStates(NamedTuple):
    """`wp.func`s of a pair: velocity [m/s] and pressure [Pa] between two particles."""

    velocity: Any
    pressure: Any


@functools.cache
def make_printed_states(dimension: int, precision: str) -> PrintedStates:
    """Return the star states of eqs (11) and (16).

    printed_velocity(u_i, u_j, dp, rho_i, rho_j, c_i, c_j), along e: (u_i + u_j)/2 + dp/(2 rho_mean c_mean), with the
        densities that the particles have, dp = P_i - P_j [Pa] whole, hydrostatic part included.
    printed_pressure(p_i, p_j, mu_i, mu_j, closing, inv_h): (p_i + p_j)/2 + K/h mu_i mu_j/(mu_i + mu_j) (u_i - u_j),
        K = 2.5 (d + 2), closing = u_i - u_j, whether the pair approaches or not.
    """
    real = types(2, precision).real
    k_friction = 2.5 * (dimension + 2)

    @wp.func
    def printed_velocity(u_i: real, u_j: real, dp: real, rho_i: real, rho_j: real, c_i: real, c_j: real):
        mean_density = real(0.5) * (rho_i + rho_j)
        mean_sound = real(0.5) * (c_i + c_j)
        return real(0.5) * (u_i + u_j) + real(0.5) * dp / (mean_density * mean_sound)

    @wp.func
    def printed_pressure(p_i: real, p_j: real, mu_i: real, mu_j: real, closing: real, inv_h: real):
        # two phases without viscosity have no friction; the quotient would be 0/0
        mu = mu_i * mu_j / wp.max(mu_i + mu_j, real(1.0e-30))
        return real(0.5) * (p_i + p_j) + real(k_friction) * inv_h * mu * closing

    return PrintedStates(printed_velocity, printed_pressure)


class PrintedWall(NamedTuple):
    """`wp.func`s of the right state at a wall: density excess [-] and velocity [m/s]."""

    excess: Any
    velocity: Any


@functools.cache
def make_printed_wall(dimension: int, precision: str) -> PrintedWall:
    """Return the one-sided state of eqs (17), (18).

    wall_excess(p, stiffness, gamma): rho/rho0 - 1 at the pressure p above the background, eq (5) solved for the density.
    reflected_velocity(v, v_wall, normal, slips): 2 v_wall - v, or with free slip v - 2 ((v - v_wall).n) n. Both have the
        normal part -u_L + 2 u_w; that of no slip has the tangential part too, of which there would be no friction else.
    """
    real, vec, _, _ = types(dimension, precision)
    thinnest = 1.0e-3  # of (rho/rho0)^gamma: a pressure below that of vacuum has no density

    @wp.func
    def wall_excess(p: real, stiffness: real, gamma: real):
        return wp.pow(wp.max(real(1.0) + p / stiffness, real(thinnest)), real(1.0) / gamma) - real(1.0)

    @wp.func
    def reflected_velocity(v: vec, v_wall: vec, normal: vec, slips: bool):
        result = real(2.0) * v_wall - v
        if slips:
            result = v - (real(2.0) * wp.dot(v - v_wall, normal)) * normal
        return result

    return PrintedWall(wall_excess, reflected_velocity)
